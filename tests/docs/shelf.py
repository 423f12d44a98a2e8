"""What the commands of a page find in their folder besides what earlier ones wrote: made once, and small."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, tzinfo
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

import fingerlab.report.content
import fingerlab.report.page
import fingerlab.sessions.writing
from fingerlab.cli.main import cli
from fingerlab.report.figure_style import NamedFigure
from fingerlab.report.page import Extras
from fingerlab.sessions import content_hash
from fingerlab.sessions.model import Session
from fingerlab.twin.protocols import RunPlan

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 8.0
"""Length of a run in the sessions of most pages; the page with checked numbers has the real ones."""
MOST_FILES = 2
"""Figures of a report that are written as files of their own, each in every format."""
ASKED_FOR = (
    "coulomb_friction", "viscous_friction", "motor_coulomb_friction", "motor_presliding", "spring_hardening",
    "capstan_friction", "cable_stretch", "gravity_tilt", "load_cell_gain",
)  # fmt: skip
"""Effects that are looked for: those of the pages, and one of each other kind. Which is found, no page's run
tells: the whole catalogue is asked for in ``tests/notebook/test_story.py``, on sessions of real length."""
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
    """What was worked out for the same sessions and effects already is not worked out again.

    Args:
        work: ``diagnose``, or a fit, of sessions and effects.
        whole: with curves even where none are wanted, as reports of the same sessions will want them.
        options: of every call.
    """

    def __init__(self, work: Callable[..., Any], whole: bool = False, **options: Any) -> None:
        self._work, self._whole, self._options = work, whole, options
        self._made: dict[tuple[object, ...], Any] = {}

    def __call__(
        self, sessions: list[Session], effects: Sequence[str] = (), *_: object, **named: object
    ) -> Any:
        same = (*(content_hash(s) for s in sessions), *effects)
        plain = named.get("with_curves") is False and not self._whole
        for known in ((*same, plain), (*same, False)):
            if known in self._made:
                return self._made[known]
        options = self._options | ({"with_curves": False} if plain else {})
        return self._made.setdefault((*same, plain), self._work(sessions, effects, **options))


def stop_the_clock(patch: pytest.MonkeyPatch) -> None:
    """Sessions that are simulated in the same way become the same file."""

    class Stopped(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Stopped:
            return cls(2026, 11, 1, 9, tzinfo=UTC)

    patch.setattr(fingerlab.sessions.writing, "datetime", Stopped)


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

    save = fingerlab.report.page.save_figures

    def save_first(figures: Mapping[str, NamedFigure], *where: Any) -> None:
        save(dict(list(figures.items())[:MOST_FILES]), *where)

    patch.setattr(fingerlab.report.page, "write_report", thin)
    patch.setattr(fingerlab.report.page, "save_figures", save_first)
    patch.setattr(fingerlab.report.content, "analyse", lambda sessions, progress: None)


def run(line: list[str]) -> str:
    """What a command says on both streams; it has to succeed."""
    done = CliRunner().invoke(cli, line, catch_exceptions=False, input="yes\n")
    assert done.exit_code == 0, f"fingerlab {' '.join(line)}: {done.output}"
    return done.output


def fill(shelf: Path) -> None:
    """Sessions, text files, a rig file and calibration recordings, as a user would have them."""
    run(["simulate", "--protocol", "rich", "--effect", "coulomb_friction", "--seed", "11",
         "--out", str(shelf / "session.h5")])  # fmt: skip
    run(["export", str(shelf / "session.h5"), "--to", "txt", "--out", str(shelf / "txt")])
    for number, path in enumerate(sorted((shelf / "txt").glob("*.txt"))[:2], start=1):
        shutil.copy(path, shelf / f"run{number}.txt")
    shutil.copy(ROOT / "resources" / "rigs" / "default.toml", shelf / "my-rig.toml")
    shutil.copy(ROOT / "docs" / "own_effect_example.py", shelf / "own_effect_example.py")
    (shelf / "my-effects").mkdir()
    shutil.copy(ROOT / "docs" / "own_effect_example.py", shelf / "my-effects")
    (shelf / "recordings").mkdir()
    shutil.copy(shelf / "session.h5", shelf / "recordings")
    with h5py.File(shelf / "recordings" / "session.h5", "r+") as file:
        file.attrs["notes"] = "of another day"  # the same file twice would be refused
    for bench in ("left", "right"):  # the same runs, so that they are diagnosed once
        (shelf / "benches" / bench).mkdir(parents=True)
        shutil.copy(shelf / "session.h5", shelf / "benches" / bench)
        with h5py.File(shelf / "benches" / bench / "session.h5", "r+") as file:
            file.attrs["title"] = bench
    _axis(shelf / "axis.csv")
    _steps(shelf / "steps.txt", [(9.81 * 0.1 * k + 5.317) / 11.194 for k in range(11)])
    _steps(shelf / "angles.txt", [2.5 + angle / 40.0 for angle in (0.0, 30.0, 60.0, 90.0)])


def _axis(path: Path) -> None:
    """A log of one axis at 250 Hz, 8 s: ms, degrees, N m; a rotor and friction of 40 mN m."""
    time = np.arange(2000) / 250.0
    angle = 0.5 * np.sin(2 * np.pi * time)
    speed = np.pi * np.cos(2 * np.pi * time)
    torque = -2e-4 * (2 * np.pi) ** 2 * angle + 0.04 * np.tanh(speed / 0.02)
    torque = torque + np.random.default_rng(2).normal(0.0, 5e-4, len(time))
    table = np.stack((1000 * time, np.degrees(angle), torque), axis=1)
    np.savetxt(path, table, "%.6f", delimiter=",", header="t,q,tau", comments="")


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
