"""``fit``: moment arms and friction losses, or the motor bench's J, gain and offset."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import click

from fingerlab.cli.common import (
    NEW_FILE,
    figures_option,
    json_option,
    progress_bar,
    refuse_same_place,
    result_table,
    session_argument,
    table_console,
    write_results,
)
from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import json_ready
from fingerlab.core.text import amount, in_words, mean_and_deviation, number, run_names
from fingerlab.models.file import estimate_to_json
from fingerlab.sessions import Session, open_session
from fingerlab.signals.periods import REGION_TITLES, THRESHOLDS_PERCENT
from fingerlab.thesis.fitting import (
    MotorBenchFit,
    SessionFit,
    delay_estimate,
    fit_motor_bench,
    fit_session,
    model_of_fit,
    model_of_motor_bench,
    motor_bench_runs,
)
from fingerlab.thesis.onair import RegionResult
from fingerlab.thesis.traces import JOINT_TITLES, FitSpec, Method

CLI_DELAYS = ("none", "xcorr", "findsignal")


@click.command()
@session_argument
@click.option(
    "--method",
    type=click.Choice(get_args(Method)),
    default="regions",
    show_default=True,
    help="Four regions, flexion and extension only, or the whole of every run.",
)
@click.option(
    "--delay",
    type=click.Choice(CLI_DELAYS),
    default="none",
    show_default=True,
    help="Shift the tension first: one delay a run by cross-correlation, or one a region by least squares.",
)
@click.option(
    "--threshold",
    type=click.Choice([str(t) for t in THRESHOLDS_PERCENT]),
    default=str(THRESHOLDS_PERCENT[0]),
    show_default=True,
    help="Per cent of the joint's speed range that parts motion from standstill.",
)
@click.option(
    "--model", "model_file", metavar="M.json", type=NEW_FILE, help="Keep the result as a model file."
)
@figures_option("Draw the thesis' figures into a folder.")
@json_option
def fit(
    session_file: Path,
    method: Method,
    delay: Any,
    threshold: str,
    model_file: Path | None,
    figures: Path | None,
    json_target: str | None,
) -> None:
    """Fit moment arms and friction losses to the on-air runs of a session.

    Per joint and region: LHS = s a T + L, a straight line of joint torque on cable tension. Intervals are
    90 %. Runs that do not repeat a trajectory serve '--method whole' only. A session that holds
    motor-bench runs and no finger is fitted with J, gain and offset of the motor-bench equation.
    """
    refuse_same_place({"--model": model_file, "--json": json_target})
    session = open_session(session_file)
    if motor_bench_runs(session) and not any(run.phase == "on_air" for run in session.runs):
        _fit_motor_bench(session, model_file, figures, json_target)
        return
    bar, report = progress_bar("Fitting")
    with bar:
        result = fit_session(session, FitSpec(method, delay, float(threshold)), report)
    drawn = _figures(session, figures)
    if json_target != "-":
        _print_fit(session, result)
    saved = None if model_file is None else (model_of_fit(session, result), model_file)
    write_results(_fit_json(result), json_target, saved, drawn)


def _figures(session: Session, folder: Path | None) -> Any:
    if folder is None:
        return None
    from fingerlab.report.force_figures import thesis_figures
    from fingerlab.report.recording_words import figure_source
    from fingerlab.thesis.analysis import thesis_analysis

    bar, report = progress_bar("Drawing")
    with bar:
        analysis = thesis_analysis(session, report)
    fitted = f"fitted to its runs on air, {analysis.cable} cable"
    runs = [run.name for run in analysis.on_air] + [run.name for run in analysis.contact]
    return thesis_figures(analysis, figure_source(session, fitted, runs)), folder


def _print_fit(session: Session, result: SessionFit) -> None:
    console = table_console()
    console.print(f"{session.path.name}: {result.spec.title}", soft_wrap=True)
    for cable, results in result.cables.items():
        table = result_table(
            *("joint", "region", ">moment arm (mm)", ">friction loss (mN m)", ">R2 pooled", ">R2 by run"),
            ">delay (ms)",
            title=f"{cable} cable, {run_names(result.used[cable])}",
        )
        for (joint, region), one in results.items():
            table.add_row(JOINT_TITLES[joint], REGION_TITLES[region], *_cells(one, result.spec.delay))
        console.print(table)
    console.print("± is half the 90 % interval; ± beside R2 is the deviation over runs.", soft_wrap=True)
    if result.skipped:
        names = ", ".join(name for name, _ in result.skipped)
        reasons = " or ".join(dict.fromkeys(reason for _, reason in result.skipped))
        console.print(f"Not used: {names} ({reasons}).", soft_wrap=True)


def _cells(result: RegionResult, delay: str) -> tuple[str, ...]:
    if result.pooled is None:
        return ("not found", "–", "–", "–", "–")
    shift = "–"
    if delay != "none":
        shift = in_words(delay_estimate(result.pooled.delay_s, result.delays_s), with_unit=False)
    return (
        in_words(result.pooled.moment_arm, with_unit=False),
        in_words(result.pooled.loss, with_unit=False),
        number(result.pooled.r2),
        mean_and_deviation(result.r2.mean, result.r2.deviation),
        shift,
    )


def _fit_json(result: SessionFit) -> Any:
    """The JSON of ``fit``: SI units, null where there is no number."""
    cables: dict[str, Any] = {}
    for cable, results in result.cables.items():
        joints: dict[str, Any] = {}
        for (joint, region), one in results.items():
            joints.setdefault(joint, {})[region] = _region_json(one)
        cables[cable] = {"runs": list(result.used[cable]), "joints": joints}
    return json_ready(
        {
            "schema": 1,
            "session": str(result.session),
            "kind": "finger",
            "method": result.spec.method,
            "delay": result.spec.delay,
            "threshold_percent": result.spec.threshold,
            "cables": cables,
            "skipped": [{"run": name, "because": reason} for name, reason in result.skipped],
        }
    )


def _region_json(result: RegionResult) -> dict[str, Any] | None:
    if result.pooled is None:
        return None
    return {
        "moment_arm": estimate_to_json(result.pooled.moment_arm),
        "friction_loss": estimate_to_json(result.pooled.loss),
        "delay": estimate_to_json(delay_estimate(result.pooled.delay_s, result.delays_s)),
        "r2": result.pooled.r2,
        "samples": result.pooled.samples,
        "by_run": [
            {"run": run, "moment_arm": a, "friction_loss": loss, "r2": r2, "delay": d}
            for run, a, loss, r2, d in zip(
                result.runs,
                result.moment_arms.values,
                result.losses.values,
                result.r2.values,
                result.delays_s.values,
                strict=True,
            )
        ],
    }


def _fit_motor_bench(
    session: Session, model_file: Path | None, figures: Path | None, json_target: str | None
) -> None:
    if figures is not None:
        raise UserError(
            f"{session.path} holds motor-bench runs only and the thesis drew no figure of those; "
            "leave out '--figures'."
        )
    bar, report = progress_bar("Fitting")
    with bar:
        result = fit_motor_bench(session, report)
    if json_target != "-":
        _print_motor_bench(session, result)
    saved = None if model_file is None else (model_of_motor_bench(session, result), model_file)
    write_results(_motor_bench_json(result), json_target, saved)


def _print_motor_bench(session: Session, result: MotorBenchFit) -> None:
    from fingerlab.report.line_units import line_units

    console, line = table_console(), line_units([session])
    law = "force = m" if line.radius else "motor_torque = J"
    load = "load" if line.radius else "load_torque"
    console.print(
        f"{session.path.name}: motor-bench runs only, so no moment arms; fitted "
        f"{law} * acceleration + gain * {load} + offset.",
        soft_wrap=True,
    )
    mass = "mass" if line.radius else "J"
    table = result_table("parameter", ">value", "source", title=run_names(tuple(result.run_r2)))
    for name, estimate in result.parameters.items():
        source = "fixed by the rig" if name in result.fixed else "fitted"
        table.add_row(mass if name == "inertia" else name, in_words(line.estimate(estimate)), source)
    console.print(table)
    for name in result.absent:
        varied = "load" if name == "gain" else "acceleration"
        console.print(f"No run varies the {varied}, so {line.called(name)} was not fitted.", soft_wrap=True)
    error = amount(result.rmse / line.radius, "N") if line.radius else f"{1e3 * result.rmse:.1f} mN m"
    console.print(
        f"R2 {number(result.r2)}, error {error}. ± is half the 90 % interval.",
        soft_wrap=True,
    )


def _motor_bench_json(result: MotorBenchFit) -> Any:
    """The JSON of ``fit`` on motor-bench runs: SI units, null where there is no number."""
    return json_ready(
        {
            "schema": 1,
            "session": str(result.session),
            "kind": "motor_bench",
            "parameters": {name: estimate_to_json(p) for name, p in result.parameters.items()},
            "fixed_by_rig": list(result.fixed),
            "not_shown_by_data": list(result.absent),
            "r2": result.r2,
            "rmse": result.rmse,
            "by_run": [{"run": run, "r2": r2} for run, r2 in result.run_r2.items()],
        }
    )
