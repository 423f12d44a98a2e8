"""``predict`` with the model of a diagnosis: nominal equations and effects, with an interval."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from fingerlab.cli.common import progress_bar
from fingerlab.cli.output import table_console, write_results
from fingerlab.core.plain_data import json_ready
from fingerlab.core.text import mean_and_deviation, number
from fingerlab.models.file import Model
from fingerlab.prediction import EQUATIONS, extended_model, predict_extended
from fingerlab.prediction.extended import EQUATION_WORDS, Equation, ExtendedModel
from fingerlab.prediction.judging import LEVEL
from fingerlab.prediction.predict import ExtendedPrediction, RunPrediction
from fingerlab.report.diagnosis_words import effect_title, in_sentence
from fingerlab.sessions import Session, content_hash
from fingerlab.thesis.onair import Spread
from fingerlab.thesis.prediction import FORCE_PHASES

NUMBERS = ("r2", "normalised_r2", "peak_measured", "peak_modelled", "share", "rmse", "delay")
HOLDS_FROM, HOLDS_TO = 0.85, 0.95
"""Share of held-out force between which a 90 % interval is said to hold."""
COLUMNS = (
    ("R2", "r2", 4, 1.0),
    ("R2 normalised", "normalised_r2", 4, 1.0),
    ("error (mN)", "rmse", 1, 1e3),
    ("cell peak (N)", "peak_measured", 2, 1.0),
    ("model peak (N)", "peak_modelled", 2, 1.0),
    ("share (%)", "share", 1, 100.0),
    ("delay (ms)", "delay", 0, 1e3),
)


def predict_with_effects(
    session: Session, model: Model, where: str, figures: Path | None, json_target: str | None
) -> None:
    """Predict, print, draw and write, as ``predict`` does with a model of ``fit``."""
    extended = extended_model(model, where)
    bar, report = progress_bar("Predicting")
    with bar:
        result = predict_extended(session, extended, where, report)
    if json_target != "-":
        _print(session, extended, result)
    drawn = None
    if figures is not None:
        from fingerlab.report.force_figures import extended_figures

        drawn = (extended_figures(result), figures)
    write_results(extended_json(session, model, result), json_target, None, drawn)


def spread_over(runs: Sequence[RunPrediction], equation: Equation, name: str) -> Spread:
    """One number of one equation over the runs."""
    return Spread(tuple(run.numbers[equation].value(name) for run in runs))


def _print(session: Session, model: ExtendedModel, result: ExtendedPrediction) -> None:
    console = table_console()
    runs = next(iter(result.runs.values()))
    titles = [in_sentence(effect_title(name)) for name in model.effect_ids]
    what = f"nominal model with {', '.join(titles)}" if titles else "nominal model"
    own = any(s.sha256 == content_hash(session) for s in model.sessions)
    origin = "this session" if own else ", ".join(s.name for s in model.sessions)
    console.print(
        f"{session.path.name}: {len(runs)} contact run{'s' if len(runs) > 1 else ''}, {what}, fitted on "
        f"{origin}.",
        soft_wrap=True,
    )
    if all(run.held_out for run in runs):
        console.print("Each run is predicted by a fit that has not seen it.", soft_wrap=True)
    elif own:
        names = ", ".join(run.run for run in runs if not run.held_out)
        console.print(f"The fit has seen run {names}: there was no other of its kind.", soft_wrap=True)
    if not np.isfinite(spread_over(runs, "both", "peak_measured").mean):
        console.print("No load cell was read in these runs: modelled forces only.", soft_wrap=True)
    console.print(_table(result))
    _print_intervals(console, result)
    if not all(run.held_out for run in runs) and np.isfinite(runs[0].half_width):
        holds = HOLDS_FROM <= Spread(tuple(run.coverage for run in runs)).mean <= HOLDS_TO
        end = "." if holds or not np.isfinite(runs[0].coverage) else ": here it does not."
        console.print(
            f"The interval comes from held-out runs of {origin}; it holds for runs like those{end}",
            soft_wrap=True,
        )


def _table(result: ExtendedPrediction) -> Table:
    table = Table(
        title="Endpoint force, mean ± deviation over runs", title_justify="left", padding=(0, 1, 0, 0)
    )
    table.add_column("model", no_wrap=True)
    table.add_column("equation", no_wrap=True)
    for title, *_ in COLUMNS:
        table.add_column(title, justify="right")
    for name, runs in result.runs.items():
        for equation in EQUATIONS:
            cells = []
            for _, key, digits, factor in COLUMNS:
                spread = spread_over(runs, equation, key)
                cells.append(mean_and_deviation(factor * spread.mean, factor * spread.deviation, digits))
            table.add_row(name, EQUATION_WORDS[equation], *cells)
    return table


def _print_intervals(console: Console, result: ExtendedPrediction) -> None:
    for name, runs in result.runs.items():
        width = Spread(tuple(run.half_width for run in runs)).mean
        share = Spread(tuple(run.coverage for run in runs)).mean
        if not np.isfinite(width):
            sentence = "no interval; it takes at least two contact runs in the fit"
        else:
            sentence = f"± {number(1e3 * width, 1)} mN on average"
            if np.isfinite(share):
                sentence += f"; {number(100 * share, 1)} % of the load cell's samples lie inside"
        console.print(f"{100 * LEVEL:.0f} % interval, {name} model: {sentence}.", soft_wrap=True)


def extended_json(session: Session, model: Model, result: ExtendedPrediction) -> dict[str, Any]:
    """The JSON of ``predict``: SI units, null where there is no number."""
    data: dict[str, Any] = json_ready(
        {
            "schema": 1,
            "session": str(session.path),
            "model": {
                "method": model.method,
                "effects": list(model.effects),
                "sessions": [vars(s) for s in model.sessions],
                "sign_convention": model.sign_convention,
            },
            "predictions": [
                _prediction_json(name, equation, runs)
                for name, runs in result.runs.items()
                for equation in EQUATIONS
            ],
            "contact_angle_sweep": {"parameters": None, "steps": []},
        }
    )
    return data


def _prediction_json(name: str, equation: Equation, runs: Sequence[RunPrediction]) -> dict[str, Any]:
    phases = {
        p: Spread(tuple(run.numbers[equation].error_by_phase[p] for run in runs)).mean for p in FORCE_PHASES
    }
    data: dict[str, Any] = {
        "parameters": f"{name}/{equation}",
        "equation": "endpoint_force" if equation == "both" else f"endpoint_force_{equation}",
        "cable": ", ".join(dict.fromkeys(run.cable for run in runs)),
        **{key: spread_over(runs, equation, key).mean for key in NUMBERS},
        "error_by_phase": phases,
    }
    if equation == "both":
        data["interval"] = {
            "level": LEVEL,
            "coverage": Spread(tuple(run.coverage for run in runs)).mean,
            "half_width": Spread(tuple(run.half_width for run in runs)).mean,
        }
    data["by_run"] = [_run_json(run, equation) for run in runs]
    return data


def _run_json(run: RunPrediction, equation: Equation) -> dict[str, Any]:
    data: dict[str, Any] = {"run": run.run, "held_out": run.held_out}
    data |= {key: run.numbers[equation].value(key) for key in NUMBERS}
    data["error_by_phase"] = dict(run.numbers[equation].error_by_phase)
    if equation == "both":
        data |= {"coverage": run.coverage, "half_width": run.half_width}
    return data
