"""``calibrate``: volts to units from a stepped recording."""

from __future__ import annotations

import math
from pathlib import Path

import click

from fingerlab.calibration import SENSORS, Calibration, SteadyStep, StepTiming, calibrate_steps, find_steps
from fingerlab.calibration.line import count_steps
from fingerlab.calibration.offline import read_recording
from fingerlab.cli.common import PATH, json_option, result_table, table_console, write_json
from fingerlab.core.errors import UserError


@click.command()
@click.argument("data", metavar="DATA [DATA2 ...]", nargs=-1, required=True, type=PATH)
@click.option("--sensor", "word", required=True, type=click.Choice(tuple(SENSORS)), help="Which sensor.")
@click.option(
    "--marks",
    metavar="M1,M2,...",
    help="Known value of each step: kg for the load cell, degrees for an angle sensor.",
)
@click.option("--column", help="Column of the volts: a number, a header, or a raw channel of a session.")
@click.option("--run", "run_name", metavar="NAME", help="Run of a session.  [default: the first with volts]")
@click.option("--step", "step_seconds", type=float, default=15.0, show_default=True, help="Seconds a step.")
@click.option(
    "--centre",
    "centre_seconds",
    type=float,
    default=5.0,
    show_default=True,
    help="Seconds in the middle of each step that count.",
)
@json_option
def calibrate(
    data: tuple[Path, ...],
    word: str,
    marks: str | None,
    column: str | None,
    run_name: str | None,
    step_seconds: float,
    centre_seconds: float,
    json_target: str | None,
) -> None:
    """Fit a sensor's straight line from a stepped recording, and compare it with the data sheet.

    DATA is a text file with time (s) in its first column and volts in another, at 20 Hz as the bench
    records them, or a session that holds the volts as read in /runs/NNN/raw. Each step lasts 15 s, of
    which the central 5 s count. A repeated recording may be given as a second file; all steps then share
    one line.

    The load cell is loaded with 0 to 1 kg in steps of 100 g (F = m g, g = 9.81 m/s2); an angle sensor
    is held at --marks, without them evenly from 0 to 90 degrees.
    """
    sensor, timing = SENSORS[word], StepTiming(step_seconds, centre_seconds)
    steps: list[SteadyStep] = []
    values: list[float] = []
    notes: list[str] = []
    for path in data:
        recording = read_recording(path, sensor, column, run_name)
        available = count_steps(recording.time, timing)
        known = _marks(marks) or sensor.default_marks(available)
        steps += find_steps(recording.time, recording.volts, len(known), timing)
        values += known
        notes.append(f"{recording.source}: {len(known)} steps")
        if available > len(known):
            notes.append(
                f"{available - len(known)} steps more at its end have no known value and are left out"
            )
    result = calibrate_steps(sensor, steps, values)
    if marks is None and sensor.mark_unit == "deg":
        notes.append("marks assumed evenly from 0° to 90° (--marks)")
    if json_target != "-":
        _print(result, values, notes)
    if json_target is not None:
        write_json(
            {**result.to_json(), "recordings": [str(path) for path in data], "notes": notes}, json_target
        )


def _marks(text: str | None) -> tuple[float, ...]:
    if text is None:
        return ()
    try:
        marks = tuple(float(part) for part in text.split(","))
    except ValueError:
        marks = (math.nan,)
    if not all(math.isfinite(mark) for mark in marks):
        raise UserError(f"--marks {text!r} is no list of numbers; write it like 0,15,30,45,60,75,90.")
    return marks


def _print(result: Calibration, marks: list[float], notes: list[str]) -> None:
    sensor = result.sensor
    scale, unit = sensor.screen.factor, sensor.screen.symbol
    console = table_console(width=110)
    console.print(sensor.title, style="bold")
    for note in notes:
        console.print(note)
    table = result_table(
        *(f">known ({sensor.mark_unit})", f">known ({unit})", ">reading (V)", ">spread (V)"),
        f">off ({unit})",
    )
    for mark, known, step, off in zip(marks, result.known, result.steps, result.residuals, strict=True):
        cells = (f"{mark:g}", f"{known * scale:.3f}", f"{step.volts:.4f}", f"{step.spread:.4f}")
        table.add_row(*cells, f"{off * scale:+.3f}")
    console.print(table)
    for name, value, per in (("gain", result.gain, "/V"), ("offset", result.offset, "")):
        low, high = value.low * scale, value.high * scale
        console.print(
            f"{name:7} {value.value * scale:.4f} {unit}{per}  (90 % interval {low:.4f} to {high:.4f})"
        )
    console.print(
        f"R²      {result.r2:.5f}; rms {result.rms * scale:.3g} {unit}; zero at {result.zero_volts:.4f} V"
    )
    limit = sensor.gain
    console.print(f"sheet   {limit.low * scale:.1f} to {limit.high * scale:.1f} {unit}/V ({limit.source})")
    if sensor.published:
        gain, offset = sensor.published
        console.print(f"thesis  {gain:g} {unit}/V, {offset:g} {unit}")
    for sentence in result.suspect or ("Nothing speaks against it.",):
        console.print(f"suspect: {sentence}" if result.suspect else sentence)
