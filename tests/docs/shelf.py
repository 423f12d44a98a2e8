"""What the commands of a page find in their folder besides what earlier ones wrote: made once, and small."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import fingerlab.report.content
import fingerlab.report.page
from fingerlab.cli.main import cli
from fingerlab.identify.results import Diagnosis
from fingerlab.report.page import Extras
from fingerlab.sessions import content_hash
from fingerlab.sessions.model import Session
from fingerlab.twin.protocols import RunPlan

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 8.0
"""Length of a run in the sessions of most pages; the page with checked numbers has the real ones."""
OUTPUTS = ("--out", "--save", "--json", "--pdf", "--figures", "--equation", "--model")


def shortened(plans: Callable[[float], list[RunPlan]]) -> Callable[[float], list[RunPlan]]:
    """The same protocol with short runs, of sines and chirps alone, and each run alike at most twice."""

    def short(amplitude: float) -> list[RunPlan]:
        kept: list[RunPlan] = []
        for plan in plans(amplitude):
            if plan.trajectory["kind"] not in ("sine", "chirp"):
                continue
            if sum(k.trajectory == {**plan.trajectory, "duration_s": SECONDS} for k in kept) < 2:
                kept.append(RunPlan(plan.phase, plan.cable, {**plan.trajectory, "duration_s": SECONDS},
                                    plan.load_torque, plan.attributes))  # fmt: skip
        return kept

    return short


class Remembered:
    """A diagnosis that was made already is not made again: pages differ in words more than in data."""

    def __init__(self, diagnose: Callable[..., Diagnosis]) -> None:
        self._diagnose = diagnose
        self._made: dict[tuple[object, ...], Diagnosis] = {}

    def __call__(
        self, sessions: list[Session], added: tuple[str, ...] = (), *_: object, **__: object
    ) -> Diagnosis:
        key = (*(content_hash(s) for s in sessions), *added)
        if key not in self._made:
            self._made[key] = self._diagnose(sessions, added)
        return self._made[key]


def thin_reports(patch: pytest.MonkeyPatch) -> None:
    """Reports with a few of their figures and without the thesis' analysis: their own tests draw the rest.

    The model is fitted once more, for prediction and equations, only where the equations are asked for.
    """
    whole = fingerlab.report.page.write_report

    def thin(*given: Any, extras: Extras | None = None, **named: Any) -> Path:
        sessions, out, added, diagnosis, *_ = given
        few = replace(diagnosis, comparisons=diagnosis.comparisons[:1], candidates=diagnosis.candidates[:2])
        if extras is None or extras.equation is None:
            few = replace(few, final_parameters={})
        return whole(sessions, out, added, few, extras=extras, **named)

    patch.setattr(fingerlab.report.page, "write_report", thin)
    patch.setattr(fingerlab.report.content, "analyse", lambda sessions, progress: None)


def run(line: list[str]) -> str:
    """What a command says on both streams; it has to succeed."""
    done = CliRunner().invoke(cli, line, catch_exceptions=False, input="yes\n")
    assert done.exit_code == 0, f"fingerlab {' '.join(line)}: {done.output}"
    return done.output


def fill(shelf: Path) -> None:
    """Sessions, models, text files, a rig file and calibration recordings, as a user would have them."""
    run(["simulate", "--protocol", "rich", "--effect", "coulomb_friction", "--seed", "7",
         "--out", str(shelf / "session.h5")])  # fmt: skip
    run(["diagnose", str(shelf / "session.h5"), "--save", str(shelf / "a.json")])
    shutil.copy(shelf / "a.json", shelf / "b.json")
    run(["export", str(shelf / "session.h5"), "--to", "txt", "--out", str(shelf / "txt")])
    for number, path in enumerate(sorted((shelf / "txt").glob("*.txt"))[:2], start=1):
        shutil.copy(path, shelf / f"run{number}.txt")
    shutil.copy(ROOT / "resources" / "rigs" / "default.toml", shelf / "my-rig.toml")
    shutil.copy(ROOT / "docs" / "own_effect_example.py", shelf / "own_effect_example.py")
    (shelf / "my-effects").mkdir()
    shutil.copy(ROOT / "docs" / "own_effect_example.py", shelf / "my-effects")
    (shelf / "recordings").mkdir()
    shutil.copy(shelf / "session.h5", shelf / "recordings")
    _steps(shelf / "steps.txt", [(9.81 * 0.1 * k + 5.317) / 11.194 for k in range(11)])
    _steps(shelf / "angles.txt", [2.5 + angle / 40.0 for angle in (0.0, 30.0, 60.0, 90.0)])


def _steps(path: Path, volts: list[float]) -> None:
    """A stepped recording at 20 Hz, 15 s a step, with half a millivolt of noise."""
    held = np.repeat(volts, 300) + np.random.default_rng(1).normal(0.0, 5e-4, 300 * len(volts))
    rows = (f"{k / 20:.2f}\t{v:.5f}" for k, v in enumerate(held))
    path.write_text("time (s)\tvolts\n" + "\n".join(rows) + "\n", encoding="utf-8")


def supply(words: list[str], shelf: Path, folder: Path) -> None:
    """Put what a command reads and nobody has made yet into its folder."""
    for before, word in zip(["", *words], words, strict=False):
        name = word.rstrip("/")
        reads = before not in OUTPUTS or (before == "--model" and words[0] != "fit")
        if reads and name and (shelf / name).exists() and not (folder / name).exists():
            if (shelf / name).is_dir():
                shutil.copytree(shelf / name, folder / name)
            else:
                shutil.copy(shelf / name, folder / name)
