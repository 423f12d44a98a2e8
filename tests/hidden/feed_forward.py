"""``python -m tests.hidden.feed_forward``: does the force come closer to what was wanted?

A bench has one effect, drawn as in the blind trials. A session of it is diagnosed, what the diagnosis says is
saved as a model, and ``record --feed-forward --ab`` sends a wanted force by the nominal and by the found
model. Results go to a JSON-lines file as they come, so that a run that was stopped can go on; the table is
made of all of them.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import click
import numpy as np
from click.testing import CliRunner
from threadpoolctl import threadpool_limits

from fingerlab.acquisition.bench import process_bench
from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.cli.main import cli
from fingerlab.core.errors import UserError
from fingerlab.diagnosis import diagnose
from fingerlab.effects import CATALOGUE
from fingerlab.models.file import load_model, write_model
from fingerlab.prediction import fit_extended, model_of_extended
from fingerlab.prediction.trial import analyse_trial, trial_json
from fingerlab.sessions import open_session
from tests.hidden.sweep.running import asked
from tests.hidden.sweep.running import record as record_session
from tests.hidden.sweep.trials import Trial

PAGE = Path("docs/feed-forward.md")
FAMILIES = (
    "Joint friction",
    "Springs of the joints",
    "Mass and gravity",
    "Cable",
    "Motor and gearbox",
    "Others",
)
"""Those of drive, cable and joints; sensors and contact are not."""
BEYOND = ("transport_delay", "routing_change")
"""Beside them: a motor that runs ahead of its sensors, and a cable that runs another way."""
WANTED = {"kind": "sine", "mean_n": 0.9, "amplitude_n": 0.5, "frequency_hz": 0.5, "duration_s": 8.0}
"""N: about where the contact runs of a session press, and beyond them to either side."""
MEDIAN, NEVER = 0.3, 1.0
"""Wanted: at most so much of the nominal model's force error is left in the median, and never more."""


def tried() -> tuple[str, ...]:
    """Effects of drive, cable and joints."""
    return tuple(name for name, one in CATALOGUE.items() if one.family in FAMILIES or name in BEYOND)


def try_bench(source: str, effect: str, seed: int, pairs: int, models: Path | None = None) -> dict[str, Any]:
    """What a trial shows on a bench with the effect, or why there was none.

    Args:
        source: ``twin`` or ``engine``.
        models: folder in which what the diagnosis found is kept, and taken from where it is there.
    """
    about: dict[str, Any] = {"source": source, "effect": effect, "seed": seed, "pairs": pairs}
    trial = Trial(source, "rich", (effect,), seed)
    with tempfile.TemporaryDirectory() as folder:
        model = (Path(folder) if models is None else models) / f"{source}-{effect}-{seed}.json"
        taken = Path(folder) / "trial.h5"
        try:
            about["effects"] = found(trial, model)
            if about["effects"]:
                (record if source == "twin" else record_engine)(trial, model, taken, pairs)
                about |= trial_json(analyse_trial(open_session(taken)))
        except Exception as error:  # counted as not shown
            about["failed"] = str(error) if isinstance(error, UserError) else repr(error)
        return about


def found(trial: Trial, model: Path) -> list[str]:
    """The effects that a diagnosis of the bench finds; its model is written, unless it is there already."""
    if not model.exists():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "session.h5"
            record_session(trial, path)
            sessions = [open_session(path)]
            said = diagnose(sessions, with_curves=False)
            write_model(model_of_extended(fit_extended(sessions, said.final_model)), model)
    return list(load_model(model).effects)


def record(trial: Trial, model: Path, taken: Path, pairs: int) -> None:
    """``fingerlab record --feed-forward`` on the simulated rig, as a user would call it."""
    _feed_forward(model, taken, pairs, "simulated", *asked(trial), "--seed", str(trial.seed))


def record_engine(trial: Trial, model: Path, taken: Path, pairs: int) -> None:
    """The same on the second engine as a device of one's own.

    Nobody waits for the clock, and the bench counts as checked: one that is not has a tenth of its current.
    """
    from tests.hidden.engine import own_device

    def inline(choice: Any, settings: LoopSettings, rescue: Path, _rate_hz: float) -> InlineBench:
        return InlineBench(choice.build(), replace(settings, current_share=1.0), rescue)

    rig = taken.with_name("rig.toml")
    rig.write_text(own_device.rig_text(), encoding="utf-8")
    told = json.dumps({"effects": dict.fromkeys(trial.effects), "seed": trial.seed})
    with (
        patch.dict(os.environ, {own_device.VARIABLE: told}),
        patch.object(process_bench, "ProcessBench", inline),
    ):
        _feed_forward(model, taken, pairs, f"own:{own_device.__file__}", "--rig", str(rig), typed="\n")


def _feed_forward(
    model: Path, taken: Path, pairs: int, device: str, *bench: str, typed: str | None = None
) -> None:
    done = CliRunner().invoke(
        cli,
        [
            "record", "--device", device, "--feed-forward", str(model), "--wanted", json.dumps(WANTED),
            "--ab", str(pairs), *bench, "--out", str(taken),
        ],
        input=typed,
    )  # fmt: skip
    if done.exit_code != 0:
        raise UserError(str(done.exception or done.output.strip().splitlines()[-1]))


Entry = Mapping[str, Any]


def ratio(entry: Entry) -> float:
    """Force error of the found model over the nominal one's; NaN where there was no trial."""
    return float(entry["ratio"]["value"]) if "ratio" in entry else math.nan


def is_worse(entry: Entry) -> bool:
    """Whether the found model was worse beyond chance: its whole interval lies above 1."""
    return "ratio" in entry and float(entry["ratio"]["interval"]["low"]) > NEVER


def figures(entries: Sequence[Entry]) -> list[tuple[str, str]]:
    """What was counted."""
    ratios = np.array([ratio(e) for e in entries])
    sent = np.isfinite(ratios)
    foretold = np.array([e["ratio"]["foretold"] for e in entries if "ratio" in e])
    shown = np.array([r for r, e in zip(ratios, entries, strict=True) if "ratio" in e])
    felt = foretold < 0.5
    return [
        ("benches", str(len(entries))),
        ("nothing was found to be sent", str(sum("ratio" not in e and "failed" not in e for e in entries))),
        ("ended on a doubt, or failed", str(sum("failed" in e for e in entries))),
        ("trials", str(int(sent.sum()))),
        (f"found / nominal, median (wanted: at most {MEDIAN:g})", _median(shown)),
        (
            "the same where the model foretells at most a half",
            f"{_median(shown[felt])} ({felt.sum()} trials)",
        ),
        (f"at most {MEDIAN:g}", f"{int((shown <= MEDIAN).sum())} of {len(shown)}"),
        ("above 1 (wanted: none)", f"{int((shown > NEVER).sum())} of {len(shown)}"),
        ("worse beyond chance (interval above 1)", f"{sum(map(is_worse, entries))} of {len(shown)}"),
    ]


def _median(values: np.ndarray[Any, Any]) -> str:
    return f"{np.median(values):.2f}" if len(values) else "-"


def markdown(entries: Sequence[Entry], command: str) -> str:
    """The page."""
    lines = [
        "# Feed-forward on benches with one effect", "", f"Made by `{command}`.",
        "Each simulated bench has one effect of drive, cable or joints, at 0.6 to 1.6 times its default",
        "strength. A session of the protocol `rich` is diagnosed, and what the diagnosis says is saved.",
        "`record --feed-forward` then sends a force of 0.4 to 1.4 N at 0.5 Hz by the nominal model",
        "(fitted to the same session) and by the found one, in pairs of runs in random order. Errors are rms",
        "of the load cell less the wanted force, low-passed at 8 Hz. How it is sent, what ends it and what",
        "it cannot invert stands in [A wanted force](tutorials/wanted-force.md).", "",
        "**Reading it.** An effect that hardly enters the force in contact (slack that is taken up, viscous",
        "friction, a motor's spring) leaves the nominal model right: both miss by what they share, the ratio",
        "is about one, and the found model foretells as much. The interval is that of the runs of one trial,",
        "which repeat within 2 mN, so that a few mN lie beyond it either way. What both share is mostly a",
        "constant: how the tip sticks sideways when it begins to press is not known. Play between gearbox",
        "and pulley chatters under torque, which no feed-forward inverts.", "",
        "| what | figure |", "|---|---|", *(f"| {what} | {value} |" for what, value in figures(entries)), "",
        "| in the bench | seed | found | nominal, mN | found, mN | found / nominal | 90 % | foretold |",
        "|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for e in entries:
        head = f"| {e['effect']} | {e['seed']} | {' + '.join(e.get('effects', [])) or '-'} |"
        if "ratio" not in e:
            lines.append(f"{head} - | - | - | - | {e.get('failed', 'nothing to send')[:80]} |")
            continue
        of = e["ratio"]
        lines.append(
            f"{head} {1e3 * e['nominal']['rms']:.1f} | {1e3 * e['found']['rms']:.1f} | {of['value']:.2f} | "
            f"{of['interval']['low']:.2f} to {of['interval']['high']:.2f} | {of['foretold']:.2f} |"
        )
    return "\n".join(lines) + "\n"


@click.command()
@click.option("--effect", "effects", multiple=True, help="Only these effects; default all of those families.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(501,), show_default=True)
@click.option("--pairs", default=3, show_default=True)
@click.option("--results", type=click.Path(path_type=Path), default=Path("feed-forward.jsonl"))
@click.option("--table", type=click.Path(path_type=Path), help=f"Markdown table, such as {PAGE}.")
def main(
    effects: tuple[str, ...], seeds: tuple[int, ...], pairs: int, results: Path, table: Path | None
) -> None:
    """Hide each effect, find it, send a force by what was found, and say by how much the error fell."""
    known: dict[tuple[str, int, int], dict[str, Any]] = {}
    if results.exists():
        for line in results.read_text(encoding="utf-8").splitlines():
            entry = json.loads(line)
            known[entry["effect"], entry["seed"], entry["pairs"]] = entry
    wanted = [(name, seed, pairs) for seed in seeds for name in effects or tried()]
    with results.open("a", encoding="utf-8") as file, threadpool_limits(limits=1, user_api="blas"):
        for key in wanted:
            if key in known:
                continue
            known[key] = try_bench("twin", *key)
            file.write(json.dumps(known[key]) + "\n")
            file.flush()
            click.echo(f"{key[0]} {key[1]}: {known[key].get('failed') or ratio(known[key])}", err=True)
    entries = [known[key] for key in wanted]
    for what, value in figures(entries):
        click.echo(f"{what:60s} {value}")
    if table is not None:
        said = "".join(f" --seed {seed}" for seed in seeds) + f" --pairs {pairs}"
        command = f"python -m tests.hidden.feed_forward{said} --table {PAGE.as_posix()}"
        table.write_text(markdown(entries, command), encoding="utf-8")


if __name__ == "__main__":
    main()
