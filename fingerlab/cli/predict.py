"""``predict``: endpoint force of contact runs from a model file, against the load cell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.table import Table

from fingerlab.cli.common import json_option, progress_bar
from fingerlab.cli.output import refuse_taken_early, table_console, write_results
from fingerlab.core.plain_data import json_ready
from fingerlab.core.text import mean_and_deviation, number, r2_text
from fingerlab.models.file import DIAGNOSIS_METHOD, Model, load_model
from fingerlab.sessions import Session, content_hash, open_session
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.contact import ContactRun, SessionPrediction, parameter_sets, predict_session
from fingerlab.thesis.onair import Spread
from fingerlab.thesis.prediction import FORCE_PHASES, ParameterSet
from fingerlab.thesis.traces import JOINT_TITLES

PATH = click.Path(path_type=Path)
NUMBERS = ("r2", "normalised_r2", "peak_measured", "peak_modelled", "share", "rmse")


@click.command()
@click.argument("session_file", metavar="S.h5", type=PATH)
@click.option(
    "--model",
    "model_file",
    metavar="M.json",
    type=PATH,
    required=True,
    help="Model file written by 'fingerlab fit' or 'fingerlab diagnose --save'.",
)
@click.option("--figures", metavar="DIR", type=PATH, help="Draw measured and modelled force into a folder.")
@json_option
def predict(session_file: Path, model_file: Path, figures: Path | None, json_target: str | None) -> None:
    """Predict the endpoint force of a session's contact runs, and compare it with the load cell.

    Each set of parameters in the model predicts on its own: by PIP and by MCP equation, with each region's
    parameters throughout and, for a model of four regions, switching with the region. A model that
    'diagnose --save' wrote predicts with its effects and without, each with a 90 % interval; a run that it
    was fitted to is predicted by a fit without that run.
    """
    session = open_session(session_file)
    refuse_taken_early(None, figures)
    model = load_model(model_file)
    if model.method == DIAGNOSIS_METHOD:
        from fingerlab.cli.predict_extended import predict_with_effects

        predict_with_effects(session, model, str(model_file), figures, json_target)
        return
    sets = parameter_sets(model, str(model_file))
    bar, report = progress_bar("Predicting")
    with bar:
        result = predict_session(session, sets, report)
    if json_target != "-":
        _print(session, model, result)
    drawn = None
    if figures is not None:
        from fingerlab.report.force_figures import prediction_figures

        drawn = (prediction_figures(result), figures)
    write_results(prediction_json(session, model, result), json_target, None, drawn)


def set_title(given: ParameterSet) -> str:
    """A parameter set in words, without its joint."""
    region = REGION_TITLES.get(given.name, given.name)
    return f"{region} parameters of the {given.cable} cable"


def over_runs(runs: Sequence[ContactRun[str]], name: str, number_name: str) -> Spread:
    """One number of one parameter set over the runs."""
    return Spread(tuple(float(getattr(run.predictions[name], number_name)) for run in runs))


def phase_error(runs: Sequence[ContactRun[str]], name: str, phase: str) -> Spread:
    """Mean error of one phase of the force cycle over the runs, N."""
    return Spread(tuple(run.predictions[name].error_by_phase[phase] for run in runs))


def _print(session: Session, model: Model, result: SessionPrediction) -> None:
    console = table_console()
    same = any(s.sha256 == content_hash(session) for s in model.sessions)
    origin = "this session" if same else ", ".join(s.name for s in model.sessions)
    console.print(
        f"{session.path.name}: {len(result.runs)} contact run{'s' if len(result.runs) > 1 else ''}, "
        f"model '{model.method}' fitted on {origin}.",
        soft_wrap=True,
    )
    if not np.isfinite(over_runs(result.runs, next(iter(result.sets)), "peak_measured").mean):
        console.print("No load cell was read in these runs: modelled forces only.", soft_wrap=True)
    console.print(_force_table(result))
    console.print(_phase_table(result))
    if result.sweep and result.sweep_set is not None:
        steps = "; ".join(
            f"{step.angle_deg:g}°: {number(step.peak, 2)} N, R2 {r2_text(step.r2)}" for step in result.sweep
        )
        console.print(
            "Contact force leaning towards the base, PIP equation, "
            f"{set_title(result.sets[result.sweep_set])}: {steps}.",
            soft_wrap=True,
        )


def _force_table(result: SessionPrediction) -> Table:
    table = _table("Endpoint force, mean ± deviation over runs")
    for title in ("R2", "R2 normalised", "error (N)", "cell peak (N)", "model peak (N)", "share (%)"):
        table.add_column(title, justify="right")
    columns = (
        ("r2", 3, 1.0),
        ("normalised_r2", 3, 1.0),
        ("rmse", 2, 1.0),
        ("peak_measured", 2, 1.0),
        ("peak_modelled", 2, 1.0),
        ("share", 1, 100.0),
    )
    for name, given in result.sets.items():
        cells = []
        for key, digits, factor in columns:
            spread = over_runs(result.runs, name, key)
            cells.append(mean_and_deviation(factor * spread.mean, factor * spread.deviation, digits))
        table.add_row(*_row_head(given), *cells)
    return table


def _phase_table(result: SessionPrediction) -> Table:
    table = _table("Modelled less measured force by phase of the cycle (N)")
    for phase in FORCE_PHASES:
        table.add_column(phase, justify="right")
    for name, given in result.sets.items():
        spreads = [phase_error(result.runs, name, phase) for phase in FORCE_PHASES]
        table.add_row(*_row_head(given), *(mean_and_deviation(s.mean, s.deviation) for s in spreads))
    return table


def _table(title: str) -> Table:
    table = Table(title=title, title_justify="left", padding=(0, 1, 0, 0))
    for column in ("equation", "cable", "parameters"):
        table.add_column(column, no_wrap=True)
    return table


def _row_head(given: ParameterSet) -> tuple[str, str, str]:
    return JOINT_TITLES[given.joint], given.cable, REGION_TITLES.get(given.name, given.name)


def prediction_json(session: Session, model: Model, result: SessionPrediction) -> dict[str, Any]:
    """The JSON of ``predict``: SI units, null where there is no number."""
    data: dict[str, Any] = json_ready(
        {
            "schema": 1,
            "session": str(session.path),
            "model": {
                "method": model.method,
                "sessions": [vars(s) for s in model.sessions],
                "sign_convention": model.sign_convention,
            },
            "predictions": [
                {
                    "parameters": name,
                    "equation": f"endpoint_force_{given.joint}",
                    "cable": given.cable,
                    **{key: over_runs(result.runs, name, key).mean for key in NUMBERS},
                    "error_by_phase": {p: phase_error(result.runs, name, p).mean for p in FORCE_PHASES},
                    "by_run": [
                        {"run": run.name}
                        | {key: getattr(run.predictions[name], key) for key in NUMBERS}
                        | {"error_by_phase": dict(run.predictions[name].error_by_phase)}
                        for run in result.runs
                    ],
                }
                for name, given in result.sets.items()
            ],
            "contact_angle_sweep": {
                "parameters": result.sweep_set,
                "steps": [{"angle_deg": s.angle_deg, "peak": s.peak, "r2": s.r2} for s in result.sweep],
            },
        }
    )
    return data
