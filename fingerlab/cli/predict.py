"""``predict``, ``inverse``, ``trial``: the force of a torque, the torque of a force, and how it did.

A model of ``fit`` predicts with the parameters of each region; one of ``diagnose --save`` with its effects
and without, with an interval.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from fingerlab.cli.common import (
    NEW_FILE,
    PATH,
    counted,
    figures_option,
    json_option,
    progress_bar,
    refuse_same_place,
    result_table,
    session_argument,
    table_console,
    write_json,
    write_results,
    write_text_safely,
)
from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import json_ready
from fingerlab.core.text import (
    LEVEL,
    amount,
    largest_of,
    mean_and_deviation,
    number,
    r2_text,
    screen_unit,
    significant,
)
from fingerlab.diagnosis.signals.scales import find_scales
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel, load_model
from fingerlab.prediction import EQUATIONS, extended_model, predict_extended
from fingerlab.prediction.extended import EQUATION_WORDS, Equation, ExtendedModel
from fingerlab.prediction.inverse import TorquePlan, needed_torque, plan_json, predictors
from fingerlab.prediction.predict import ExtendedPrediction, RunPrediction, interval_over, spread_over
from fingerlab.prediction.target import ContactPose, pose_by_hand, pose_of_run, wanted_force, words_of
from fingerlab.prediction.trial import CAUSES, Trial, analyse_trial, trial_json
from fingerlab.report.comparison_words import result_sentences, trial_row
from fingerlab.report.diagnosis_words import effect_title, in_sentence, model_words
from fingerlab.report.page_tables import worse_force_sentence
from fingerlab.report.recording_words import figure_source
from fingerlab.sessions import Session, content_hash, open_session
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.contact import ContactRun, SessionPrediction, parameter_sets, predict_session
from fingerlab.thesis.onair import Spread
from fingerlab.thesis.prediction import FORCE_PHASES
from fingerlab.thesis.traces import JOINT_TITLES

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

NUMBERS = ("r2", "normalised_r2", "peak_measured", "peak_modelled", "share", "rmse")
"""Numbers of each run and their means over the runs, in the JSON."""
NUMBERS_WITH_DELAY = (*NUMBERS, "delay")
HOLDS_FROM, HOLDS_TO = 0.85, 0.95
"""Share of held-out force between which a 90 % interval is said to hold."""
REGION_COLUMNS = (
    ("R2", "r2", 3, 1.0),
    ("R2 normalised", "normalised_r2", 3, 1.0),
    ("error (N)", "rmse", 2, 1.0),
    ("cell peak (N)", "peak_measured", 2, 1.0),
    ("model peak (N)", "peak_modelled", 2, 1.0),
    ("amplitude (%)", "share", 1, 100.0),
)
EFFECT_COLUMNS = (
    ("R2", "r2", 4, 1.0),
    ("R2 normalised", "normalised_r2", 4, 1.0),
    ("error (mN)", "rmse", 1, 1e3),
    ("cell peak (N)", "peak_measured", 2, 1.0),
    ("model peak (N)", "peak_modelled", 2, 1.0),
    ("amplitude (%)", "share", 1, 100.0),
    ("delay (ms)", "delay", 0, 1e3),
)
"""Title, number, digits, and factor to the unit in the title; of a model of ``fit``, and of a diagnosis."""


@click.command()
@session_argument
@click.option(
    "--model",
    "model_file",
    metavar="M.json",
    type=PATH,
    required=True,
    help="Model file written by 'fingerlab fit' or 'fingerlab diagnose --save'.",
)
@figures_option("Draw measured and modelled force into a folder.")
@json_option
def predict(session_file: Path, model_file: Path, figures: Path | None, json_target: str | None) -> None:
    """Predict the endpoint force of a session's contact runs, and compare it with the load cell.

    Each set of parameters in the model predicts on its own: by PIP and by MCP equation, with each region's
    parameters throughout and, for a model of four regions, switching with the region. A model that
    'diagnose --save' wrote predicts with its effects and without, each with a 90 % interval; a run that it
    was fitted to is predicted by a fit without that run.
    """
    session = open_session(session_file)
    model = load_model(model_file)
    if model.method == DIAGNOSIS_METHOD:
        _predict_with_effects(session, model, str(model_file), figures, json_target)
    else:
        _predict_by_region(session, model, str(model_file), figures, json_target)


def _predict_by_region(
    session: Session, model: SavedModel, where: str, figures: Path | None, json_target: str | None
) -> None:
    sets = parameter_sets(model, where)
    bar, report = progress_bar("Predicting")
    with bar:
        result = predict_session(session, sets, report)
    if json_target != "-":
        _print_by_region(session, model, result)
    drawn = None
    if figures is not None:
        from fingerlab.report.force_figures import prediction_figures

        source = figure_source(session, Path(where).name, [run.name for run in result.runs])
        drawn = (prediction_figures(result, source), figures)
    sweep = [{"angle_deg": s.angle_deg, "peak": s.peak, "r2": s.r2} for s in result.sweep]
    told = _json(session, model, _regions_json(result), result.sweep_set, sweep)
    write_results(told, json_target, None, drawn)


def _origin(session: Session, model: SavedModel | ExtendedModel) -> tuple[bool, str]:
    """Whether the model was fitted on this session, and on which it was, in words."""
    own = any(s.sha256 == content_hash(session) for s in model.sessions)
    return own, "this session" if own else ", ".join(s.name for s in model.sessions)


def _cells(columns: Sequence[tuple[str, str, int, float]], over: Callable[[str], Spread]) -> list[str]:
    """A row of numbers, mean ± deviation over the runs."""
    spreads = [(over(key), digits, factor) for _, key, digits, factor in columns]
    return [
        mean_and_deviation(factor * s.mean, factor * s.deviation, digits) for s, digits, factor in spreads
    ]


def _over_runs(runs: Sequence[ContactRun[str]], name: str, number_name: str) -> Spread:
    """One number of one parameter set over the runs."""
    return Spread(tuple(float(getattr(run.predictions[name], number_name)) for run in runs))


def _phase_error(runs: Sequence[ContactRun[str]], name: str, phase: str) -> Spread:
    """Mean error of one phase of the force cycle over the runs, N."""
    return Spread(tuple(run.predictions[name].error_by_phase[phase] for run in runs))


def _print_by_region(session: Session, model: SavedModel, result: SessionPrediction) -> None:
    console = table_console()
    console.print(
        f"{session.path.name}: {counted(len(result.runs), 'contact run')}, "
        f"model '{model.method}' fitted on {_origin(session, model)[1]}.",
        soft_wrap=True,
    )
    if not np.isfinite(_over_runs(result.runs, next(iter(result.sets)), "peak_measured").mean):
        console.print("No load cell was read in these runs: modelled forces only.", soft_wrap=True)
    forces = _region_table(
        "Endpoint force, mean ± deviation over runs", [title for title, *_ in REGION_COLUMNS]
    )
    phases = _region_table("Modelled less measured force by phase of the cycle (N)", FORCE_PHASES)
    for name, given in result.sets.items():
        head = JOINT_TITLES[given.joint], given.cable, REGION_TITLES.get(given.name, given.name)
        forces.add_row(*head, *_cells(REGION_COLUMNS, partial(_over_runs, result.runs, name)))
        spreads = [_phase_error(result.runs, name, phase) for phase in FORCE_PHASES]
        phases.add_row(*head, *(mean_and_deviation(s.mean, s.deviation) for s in spreads))
    console.print(forces)
    console.print(phases)
    if result.sweep and result.sweep_set is not None:
        swept = result.sets[result.sweep_set]
        steps = "; ".join(
            f"{step.angle_deg:g}°: {number(step.peak, 2)} N, R2 {r2_text(step.r2)}" for step in result.sweep
        )
        console.print(
            "Contact force leaning towards the base, PIP equation, "
            f"{REGION_TITLES.get(swept.name, swept.name)} parameters of the {swept.cable} cable: {steps}.",
            soft_wrap=True,
        )


def _region_table(title: str, numbers: Sequence[str]) -> Table:
    columns = ("equation", "cable", "parameters", *(f">{one}" for one in numbers))
    return result_table(*columns, no_wrap=True, title=title, padding=(0, 1, 0, 0))


def _regions_json(result: SessionPrediction) -> list[dict[str, Any]]:
    return [
        {
            "parameters": name,
            "equation": f"endpoint_force_{given.joint}",
            "cable": given.cable,
            **{key: _over_runs(result.runs, name, key).mean for key in NUMBERS},
            "error_by_phase": {p: _phase_error(result.runs, name, p).mean for p in FORCE_PHASES},
            "by_run": [
                {"run": run.name}
                | {key: getattr(run.predictions[name], key) for key in NUMBERS}
                | {"error_by_phase": dict(run.predictions[name].error_by_phase)}
                for run in result.runs
            ],
        }
        for name, given in result.sets.items()
    ]


def _predict_with_effects(
    session: Session, model: SavedModel, where: str, figures: Path | None, json_target: str | None
) -> None:
    extended = extended_model(model, where)
    bar, report = progress_bar("Predicting")
    with bar:
        result = predict_extended(session, extended, where, report)
    if json_target != "-":
        _print_with_effects(session, extended, result)
    drawn = None
    if figures is not None:
        from fingerlab.report.force_figures import extended_figures

        words = f"{Path(where).name}: {model_words(extended.effect_ids)}"
        predicted = [run.run for run in next(iter(result.runs.values()))]
        drawn = (extended_figures(result, figure_source(session, words, predicted)), figures)
    told = [_prediction_json(name, one, runs) for name, runs in result.runs.items() for one in EQUATIONS]
    write_results(_json(session, model, told), json_target, None, drawn)


def _print_with_effects(session: Session, model: ExtendedModel, result: ExtendedPrediction) -> None:
    console = table_console()
    runs = next(iter(result.runs.values()))
    titles = [in_sentence(effect_title(name)) for name in model.effect_ids]
    what = f"nominal model with {', '.join(titles)}" if titles else "nominal model"
    own, origin = _origin(session, model)
    console.print(
        f"{session.path.name}: {counted(len(runs), 'contact run')}, {what}, fitted on {origin}.",
        soft_wrap=True,
    )
    if all(run.held_out for run in runs):
        console.print("Each run is predicted by a fit that has not seen it.", soft_wrap=True)
    elif own:
        names = ", ".join(run.run for run in runs if not run.held_out)
        console.print(f"The fit has seen run {names}: there was no other of its kind.", soft_wrap=True)
    if not np.isfinite(spread_over(runs, "both", "peak_measured").mean):
        console.print("No load cell was read in these runs: modelled forces only.", soft_wrap=True)
    columns = ("model", "equation", *(f">{one}" for one, *_ in EFFECT_COLUMNS))
    title = "Endpoint force, mean ± deviation over runs"
    table = result_table(*columns, no_wrap=True, title=title, padding=(0, 1, 0, 0))
    for name, tried in result.runs.items():
        for equation in EQUATIONS:
            cells = _cells(EFFECT_COLUMNS, partial(spread_over, tried, equation))
            table.add_row(name, EQUATION_WORDS[equation], *cells)
    console.print(table)
    others = {f"the {name} model": runs for name, runs in result.runs.items() if name != "nominal"}
    worse = worse_force_sentence(result.runs["nominal"], others)
    if worse:
        console.print(worse, soft_wrap=True)
    _print_intervals(console, result)
    if not all(run.held_out for run in runs) and np.isfinite(runs[0].half_width):
        holds = HOLDS_FROM <= interval_over(runs)[1] <= HOLDS_TO
        end = "." if holds or not np.isfinite(runs[0].coverage) else ": here it does not."
        console.print(
            f"The interval comes from held-out runs of {origin}; it holds for runs like those{end}",
            soft_wrap=True,
        )


def _print_intervals(console: Console, result: ExtendedPrediction) -> None:
    for name, runs in result.runs.items():
        width, share = interval_over(runs)
        if not np.isfinite(width):
            sentence = "no interval; it takes at least two contact runs in the fit"
        else:
            sentence = f"± {number(1e3 * width, 1)} mN on average"
            if np.isfinite(share):
                sentence += f"; {number(100 * share, 1)} % of the load cell's samples lie inside"
        console.print(f"{100 * LEVEL:.0f} % interval, {name} model: {sentence}.", soft_wrap=True)


def _prediction_json(name: str, equation: Equation, runs: Sequence[RunPrediction]) -> dict[str, Any]:
    phases = {
        p: Spread(tuple(run.numbers[equation].error_by_phase[p] for run in runs)).mean for p in FORCE_PHASES
    }
    data: dict[str, Any] = {
        "parameters": f"{name}/{equation}",
        "equation": "endpoint_force" if equation == "both" else f"endpoint_force_{equation}",
        "cable": ", ".join(dict.fromkeys(run.cable for run in runs)),
        **{key: spread_over(runs, equation, key).mean for key in NUMBERS_WITH_DELAY},
        "error_by_phase": phases,
    }
    if equation == "both":
        data["interval"] = interval_json(runs)
    data["by_run"] = [_run_json(run, equation) for run in runs]
    return data


def _run_json(run: RunPrediction, equation: Equation) -> dict[str, Any]:
    data: dict[str, Any] = {"run": run.run, "held_out": run.held_out}
    data |= {key: run.numbers[equation].value(key) for key in NUMBERS_WITH_DELAY}
    data["error_by_phase"] = dict(run.numbers[equation].error_by_phase)
    if equation == "both":
        data |= {"coverage": run.coverage, "half_width": run.half_width}
    return data


def _json(
    session: Session,
    model: SavedModel,
    predictions: Sequence[Mapping[str, Any]],
    swept: str | None = None,
    steps: Sequence[Mapping[str, Any]] = (),
) -> Any:
    """The JSON of ``predict``: SI units, null where there is no number."""
    about: dict[str, Any] = {"method": model.method}
    if model.method == DIAGNOSIS_METHOD:
        about["effects"] = list(model.effects)
    about |= {"sessions": [vars(s) for s in model.sessions], "sign_convention": model.sign_convention}
    sweep = {"parameters": swept, "steps": steps}
    whole = {"schema": 1, "session": str(session.path), "model": about, "predictions": predictions}
    return json_ready({**whole, "contact_angle_sweep": sweep})


def interval_json(runs: Sequence[RunPrediction]) -> dict[str, Any]:
    """The interval over the runs, for JSON."""
    half_width, coverage = interval_over(runs)
    return {"level": LEVEL, "coverage": coverage, "half_width": half_width}


@click.command()
@session_argument
@click.option("--model", "model_file", metavar="M.json", type=PATH, required=True, help="As for 'predict'.")
@click.option(
    "--wanted",
    metavar="JSON|FILE",
    required=True,
    help='Wanted force: JSON such as {"kind": "sine", "mean_n": 1, "amplitude_n": 0.5, "frequency_hz": 0.5}, '
    "a file of it, or a text table of time (s) and force (N). Kinds: sine, ramp_hold, steps, file.",
)
@click.option("--run", "run_name", help="Contact run that says how the finger stands; the first by default.")
@click.option("--pose", nargs=2, type=float, metavar="MCP PIP", help="Joint angles in degrees instead.")
@click.option("--parameters", help="Which predictor of the model; the first by default ('--json' names all).")
@click.option("--out", type=NEW_FILE, help="Trajectory to write, for 'record' and 'simulate'.")
@json_option
def inverse(
    session_file: Path,
    model_file: Path,
    wanted: str,
    run_name: str | None,
    pose: tuple[float, float] | None,
    parameters: str | None,
    out: Path | None,
    json_target: str | None,
) -> None:
    """Give the motor torque that a wanted endpoint force needs, with its interval, and check the limits.

    The finger presses as it does in a contact run of the session. What is written with --out runs with
    'fingerlab record --trajectory FILE', in the simulated rig, and in the Acquire tab.
    """
    refuse_same_place({"--out": out, "--json": json_target})
    session = open_session(session_file)
    stands = _pose(session, run_name, pose)
    known = predictors(load_model(model_file), str(model_file), stands.cable)
    name = parameters or next(iter(known))
    if name not in known:
        raise UserError(f"{model_file} has no predictor '{name}'; it has: {'; '.join(known)}.")
    plan = needed_torque(wanted_force(wanted, "--wanted"), known[name], stands, session.rig, str(model_file))
    if out is not None:
        write_text_safely(out, json.dumps(plan.experiment(), indent=1) + "\n")
    if json_target != "-":
        _print(plan, name, out)
    if json_target is not None:
        result = {
            **plan_json(plan),
            "session": str(session.path),
            "predictor": name,
            "predictors": list(known),
        }
        write_json(result, json_target)


def _pose(session: Session, run_name: str | None, angles: tuple[float, float] | None) -> ContactPose:
    if angles is not None:
        if run_name is not None:
            raise UserError("Give either --run or --pose, not both.")
        limits = session.rig.limits
        bounds = (("MCP", limits.mcp_low, limits.mcp_high), ("PIP", limits.pip_low, limits.pip_high))
        for (joint, low, high), angle in zip(bounds, angles, strict=True):
            if not low <= math.radians(angle) <= high:
                raise UserError(
                    f"--pose has the {joint} at {angle:g} degrees; the rig's limits are "
                    f"{math.degrees(low):.4g} to {math.degrees(high):.4g} degrees."
                )
        return pose_by_hand(math.radians(angles[0]), math.radians(angles[1]))
    runs = {run.name: run for run in session.contact_runs()}
    if not runs:
        raise UserError(
            f"{session.path} has no contact run with a cable; give --pose with the "
            "two joint angles in degrees."
        )
    if run_name is not None and run_name not in runs:
        raise UserError(f"{session.path} has no contact run '{run_name}'; it has {', '.join(runs)}.")
    return pose_of_run(runs[run_name or next(iter(runs))], find_scales([session]))


def _print(plan: TorquePlan, name: str, out: Path | None) -> None:
    angles = words_of(plan.pose)
    click.echo(f"Predictor: {name}.")
    click.echo(
        f"Finger as in {plan.pose.source}: MCP {angles['mcp_deg']:.1f}°, PIP {angles['pip_deg']:.1f}°, "
        f"{plan.pose.cable} cable."
    )
    half = plan.half_width
    unit = screen_unit("N m", largest_of(plan.torque))
    low, high = (significant(unit.factor * float(end), 4) for end in (plan.torque.min(), plan.torque.max()))
    known = (
        f" ± {significant(unit.factor * half.mean(), 2)}" if half.size and half.min() == half.min() else ""
    )
    click.echo(
        f"{significant(plan.force.min())} to {significant(plan.force.max())} N need {low} to "
        f"{unit.after(f'{high}{known}')} ({significant(plan.current.min())} to "
        f"{significant(plan.current.max())} A); the rig allows {amount(plan.torque_limit, 'N m', 4)}."
    )
    for sentence in (*plan.beyond, *plan.warnings):
        click.echo(sentence)
    if out is not None:
        click.echo(f"Written to {out}; take it with 'fingerlab record --trajectory {out}'.", err=True)


@click.command()
@session_argument
@figures_option("Draw wanted and measured force into a folder.")
@json_option
def trial(session_file: Path, figures: Path | None, json_target: str | None) -> None:
    """Tell by how much the force error fell in a feed-forward trial, with a 90 % interval.

    Beside it stands what the found model had foretold, and what is left by cause: what differs from run to
    run, what is constant, in proportion, late, or against the direction of the force.
    """
    session = open_session(session_file)
    found = analyse_trial(session)
    if json_target != "-":
        _print_trial(found, session_file.name)
    drawn = None
    if figures is not None:
        from fingerlab.report.force_figures import trial_figures

        source = figure_source(session, found.model_file, [run.name for run in session.runs])
        drawn = (trial_figures(found, source), figures)
    write_results(json_ready(trial_json(found)), json_target, None, drawn)


def _print_trial(found: Trial, name: str) -> None:
    console = table_console()
    rows = [trial_row(one) for one in (found.nominal, found.found) if one is not None]
    columns = ("model", ">runs", ">error, rms (mN)", ">foretold (mN)", ">largest (mN)", ">run to run (mN)")
    table = result_table(*columns, title=f"{name}: force wanted and measured", padding=(0, 1, 0, 0))
    causes = result_table("model", *(f">{cause}" for cause in CAUSES), title="The squared error by cause (%)")
    for row in rows:
        table.add_row(*row[: len(columns)])
        causes.add_row(row[0], *row[len(columns) :])
    console.print(table)
    console.print(causes)
    for sentence in result_sentences(found):
        console.print(sentence, soft_wrap=True)
