"""``compare``: several saved models on the same runs, none of which their values have seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from rich.table import Table
from rich.text import Text

from fingerlab.cli.common import (
    PATH,
    figures_option,
    json_option,
    progress_bar,
    result_table,
    session_argument,
    table_console,
    tell_own_effects,
    write_json,
    write_results,
)
from fingerlab.cli.predict import NUMBERS_WITH_DELAY, interval_json
from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import json_ready
from fingerlab.core.progress import Watch
from fingerlab.models.file import load_model
from fingerlab.prediction import ExtendedModel, extended_model
from fingerlab.prediction.comparing import ComparedModel, ModelComparison, compare_models
from fingerlab.prediction.predict import spread_over
from fingerlab.report.comparison_words import (
    cell,
    channel_title,
    channels_of,
    line_of,
    pair_title,
    pairs_json,
    pairs_sentence,
)
from fingerlab.report.line_units import LineUnits, line_units
from fingerlab.report.page_tables import (
    compared_rows,
    errors_beside_each_other,
    force_got_worse,
    judged_as_they_stand,
)
from fingerlab.sessions import Session, open_session, refuse_twice
from fingerlab.signals.run_pairs import compare_sessions


@click.command()
@session_argument
@click.option(
    "--model",
    "model_files",
    metavar="M.json",
    type=PATH,
    multiple=True,
    help="Model file written by 'fingerlab diagnose --save'; repeatable.",
)
@click.option(
    "--beside",
    metavar="S2.h5",
    type=PATH,
    help="Compare the runs with those of another session instead, motion by motion, in phase.",
)
@figures_option("Draw the errors into a folder.")
@json_option
def compare(
    session_file: Path,
    model_files: tuple[Path, ...],
    beside: Path | None,
    figures: Path | None,
    json_target: str | None,
) -> None:
    """Compare saved models on the runs of a session, beside the nominal model; or two sessions run by run.

    Every run is judged by values that have not seen it: left out of the fit where the model was fitted to
    this session, as they stand in the file where it was fitted to others. Errors are in multiples of the
    floor of the best model; the endpoint force is that of the contact runs.
    """
    if (beside is None) == (not model_files) or (beside is not None and figures is not None):
        raise UserError("Give --model, once or more, and --figures if wanted; or --beside alone.")
    session = open_session(session_file)
    if beside is not None:
        other = open_session(beside)
        refuse_twice([session, other])
        _compare_runs(session, other, json_target)
        return
    tell_own_effects()
    models = _load(model_files)
    bar, report = progress_bar("Comparing")
    with bar:
        result = compare_models(session, models, report)
    if json_target != "-":
        _print(result, line_units([session]))
    drawn = None
    if figures is not None:
        from fingerlab.report.force_figures import comparison_figures
        from fingerlab.report.recording_words import figure_source

        source = figure_source(session, ", ".join(models), [run.name for run in session.runs])
        drawn = (comparison_figures(result, source), figures)
    write_results(_comparison_json(result), json_target, None, drawn)


def _compare_runs(first: Session, second: Session, json_target: str | None) -> None:
    """Two benches or two days, run by run."""
    bar, report = progress_bar("Comparing")
    with bar:
        found = compare_sessions(first, second, Watch(report))
    if json_target is not None:
        write_json(json_ready(pairs_json(found)), json_target)
    if json_target == "-":
        return
    units, line = channels_of(found), line_of(found)
    columns = (f">{unit.label(channel_title(name, line))}" for name, unit in units.items())
    table = result_table("runs", "motion", *columns, padding=(0, 1, 0, 0))
    for pair in found.pairs:
        texts = (cell(pair, name, unit, line).text for name, unit in units.items())
        table.add_row(*pair_title(pair, line), *texts)
    console = table_console()
    console.print(table)
    console.print(Text(pairs_sentence(found)))
    for sentence in found.refused:
        console.print(Text(sentence))


def _load(paths: tuple[Path, ...]) -> dict[str, ExtendedModel]:
    """Models by the name of their file, or by the whole path where names are the same."""
    models: dict[str, ExtendedModel] = {}
    alike = len({p.name for p in paths}) < len(paths)
    for path in paths:
        name = str(path) if alike else path.name
        if name in models:
            raise UserError(f"{path} is named twice; name each model once.")
        models[name] = extended_model(load_model(path), str(path))
    return models


def _print(result: ModelComparison, line: LineUnits) -> None:
    """The models side by side; of a linear axis in the units of its line."""
    console = table_console()
    of_all = ("model", "effects", ">error / floor")
    of_force = (">force error (mN)", ">R2", ">R2 normalised", ">amplitude (%)", ">in interval (%)")
    forces = any(one.forces for one in result.models)  # a motor alone presses on nothing
    table = result_table(
        *of_all,
        *(of_force if forces else ()),
        title=f"{result.session.name}, runs that the values have not seen",
        padding=(0, 1, 0, 0),
    )
    for name, *rest in compared_rows(result):
        table.add_row(Text(name), *(rest if forces else rest[: len(of_all) - 1]))
    console.print(table)
    if any(m.errors for m in result.models):
        console.print(_equations(result, line))
    if force_got_worse(result):
        console.print(force_got_worse(result), soft_wrap=True)
    if judged_as_they_stand(result):
        console.print(judged_as_they_stand(result), soft_wrap=True)


def _equations(result: ModelComparison, line: LineUnits) -> Table:
    errors = {m.name: line.errors(m.errors) for m in result.models if m.errors}
    headings, rows = errors_beside_each_other(errors)
    columns = [f">{heading}" for heading in headings]
    table = result_table("model", *columns, title="Error by equations (rms)", padding=(0, 1, 0, 0))
    for name, cells in rows.items():
        table.add_row(Text(name), *cells)
    return table


def _comparison_json(result: ModelComparison) -> Any:
    """The JSON of ``compare``: SI units, null where there is no number."""
    return json_ready(
        {
            "schema": 1,
            "session": str(result.session),
            "models": [
                {
                    "model": model.name,
                    "effects": list(model.effects),
                    "left_out": model.left_out,
                    "score": model.score,
                    "errors": {name: error.to_json() for name, error in model.errors.items()},
                    "endpoint_force": _force_json(model),
                }
                for model in result.models
            ],
        }
    )


def _force_json(model: ComparedModel) -> dict[str, Any] | None:
    if not model.forces:
        return None
    return {
        **{key: spread_over(model.forces, "both", key).mean for key in NUMBERS_WITH_DELAY},
        "interval": interval_json(model.forces),
        "by_run": [
            {"run": r.run, "held_out": r.held_out}
            | {key: r.numbers["both"].value(key) for key in NUMBERS_WITH_DELAY}
            | {"coverage": r.coverage, "half_width": r.half_width}
            for r in model.forces
        ],
    }
