"""A calibration from recordings made before: text files, or the raw group of sessions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from fingerlab.calibration.line import SteadyStep, StepTiming, count_steps, find_steps
from fingerlab.calibration.outcome import CalibrationOutcome, outcome_of
from fingerlab.calibration.sensors import FIRST, LOADING, SECOND, CalibrationPlan, Move, Sensor, standard_plan
from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import factor
from fingerlab.sessions.hdf5 import sample_fault
from fingerlab.sessions.mapping import split_header
from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.reading import open_session
from fingerlab.sessions.text_table import TextTable, inspect_table, read_blocks

PIECE = 1 << 20
"""Samples of a session read at a time: a quarter of an hour at 1 kHz."""


@dataclass(frozen=True)
class SensorRecording:
    """Readings of one sensor: time (s) and volts (V), shapes (n,), and what they were read from."""

    time: Array
    volts: Array
    source: str


def read_recording(
    path: str | Path,
    sensor: Sensor,
    column: str | None = None,
    run: str | None = None,
    progress: Progress = lambda *_: None,
) -> SensorRecording:
    """Read the volts of one sensor.

    Args:
        path: a text file with time in its first column and volts in another, or a session whose runs
            have the volts as read in their group ``raw``.
        column: number (from 1) or header of the text column, or name of the raw channel. Without it: the
            only column beside time, or the one whose name says the sensor.
        run: run of the session; the first that has the channel where absent.

    Raises:
        UserError: the file cannot be read, the column cannot be told, or time does not increase.
    """
    path = Path(path)
    if path.is_file() and h5py.is_hdf5(path):
        recording = _from_session(path, sensor, column, run, progress)
    else:
        recording = _from_text(path, sensor, column, progress)
    fault = sample_fault("time", recording.time)
    if fault:
        raise UserError(f"{path}: {fault}")
    if not np.isfinite(recording.volts).all():
        index = int(np.argmax(~np.isfinite(recording.volts)))
        raise UserError(f"{path} holds no number of volts at sample {index}; every sample should be one.")
    return recording


def _from_session(
    path: Path, sensor: Sensor, column: str | None, name: str | None, progress: Progress
) -> SensorRecording:
    session = open_session(path)
    runs = [run for run in session.runs if name is None or run.name == name]
    if not runs:
        raise UserError(f"{path} has no run {name}; it has {', '.join(run.name for run in session.runs)}.")
    for run in runs:
        channel = _raw_channel(run, sensor, column)
        if channel is not None:
            unit = run.units[channel]
            times = factor(unit or "V", "V")
            if times is None:
                raise UserError(
                    f"{path}: run {run.name}, '{channel}' is in '{unit}'; it should be in V or mV."
                )
            time, volts = _loaded(run, channel, progress)
            return SensorRecording(time, volts * times, f"{path}, run {run.name}, {channel}")
    wanted = f"'{column}'" if column else f"the raw volts of the {sensor.name} sensor"
    raise UserError(
        f"{path} does not hold {wanted}; a calibration needs volts as read, such as "
        f"/runs/001/raw/{sensor.column_words[0]}, or a text file of time and volts."
    )


def _loaded(run: Run, channel: str, progress: Progress) -> tuple[Array, Array]:
    """Time and one channel of a run, shapes (n,)."""
    pieces = []
    for start in range(0, run.length, PIECE):
        progress(start / run.length, f"reading run {run.name}")
        pieces.append(run.load(["time", channel], start, start + PIECE))
    return np.concatenate([p["time"] for p in pieces]), np.concatenate([p[channel] for p in pieces])


def _raw_channel(run: Run, sensor: Sensor, column: str | None) -> str | None:
    raw = [name for name in run.units if name.startswith("raw/")]
    if column is not None:
        return next((name for name in raw if name in (column, f"raw/{column}")), None)
    named = [name for name in raw if _says(name, sensor)]
    return named[0] if len(named) == 1 else None


def _from_text(path: Path, sensor: Sensor, column: str | None, progress: Progress) -> SensorRecording:
    table = inspect_table(path)
    index = _text_column(table, sensor, column)
    time_factor = _factor(table, 0, "s", "s or ms")
    volt_factor = _factor(table, index, "V", "V or mV")
    blocks = read_blocks(table, progress=lambda share: progress(share, f"reading {path.name}"))
    values = np.concatenate([block[:, (0, index)] for block in blocks])
    header = f" '{table.header[index]}'" if table.header else ""
    source = f"{path}, column {index + 1}{header}"
    return SensorRecording(values[:, 0] * time_factor, values[:, 1] * volt_factor, source)


def _text_column(table: TextTable, sensor: Sensor, column: str | None) -> int:
    """Index of the column of volts."""
    if column is not None and column.isdecimal():
        if not 2 <= int(column) <= table.columns:
            raise UserError(
                f"{table.path} has columns 1 to {table.columns}, the first of which is time; there is no "
                f"column {column} of volts."
            )
        return int(column) - 1
    header = table.header or ()
    if column is not None:
        names = [name for name in header if column in (name, split_header(name)[0])]
        if len(names) != 1:
            raise UserError(
                f"{table.path} has no column '{column}'; its header is {', '.join(header) or 'empty'}."
            )
        return header.index(names[0])
    if table.columns == 2:
        return 1
    named = [index for index, name in enumerate(header) if index and _says(name, sensor)]
    if len(named) != 1:
        raise UserError(
            f"{table.path} has {table.columns} columns; say with --column which holds the volts of the "
            f"{sensor.name} sensor."
        )
    return named[0]


def _says(name: str, sensor: Sensor) -> bool:
    return any(word in name.lower() for word in sensor.column_words)


def _factor(table: TextTable, index: int, si: str, wanted: str) -> float:
    unit = split_header(table.header[index])[1] if table.header else None
    if unit is None:
        return 1.0
    times = factor(unit, si)
    if times is None:
        raise UserError(f"{table.path}, column {index + 1} is in '{unit}'; it should be in {wanted}.")
    return times


def outcome_from_files(
    paths: Sequence[Path],
    sensor: Sensor,
    timing: StepTiming | None = None,
    column: str | None = None,
    progress: Progress = lambda *_: None,
) -> tuple[CalibrationOutcome, list[str]]:
    """The calibration of one or two recordings of the standard procedure.

    A load-cell recording of 21 steps or more is loading and unloading, one of 11 loading alone; a second
    file is a second pass. An angle recording has its marks evenly from 0 to 90 degrees.

    Args:
        progress: called with the share done and what is being read; may raise ``Cancelled``.

    Returns:
        The outcome, and what was assumed or left out, one sentence each.

    Raises:
        UserError: a file cannot be read, or its steps make no line.
    """
    if not 1 <= len(paths) <= 2:
        raise UserError(f"{len(paths)} files were chosen; give one recording, or two of the same sensor.")
    timing = timing or StepTiming()
    steps: list[SteadyStep] = []
    moves: list[Move] = []
    notes: list[str] = []

    def progress_of(number: int) -> Progress:
        return lambda share, what: progress((number + share) / len(paths), what)

    for number, (path, sweep) in enumerate(zip(paths, (FIRST, SECOND), strict=False)):
        recording = read_recording(path, sensor, column, progress=progress_of(number))
        available = count_steps(recording.time, timing)
        planned = _moves(sensor, available, sweep, len(paths) == 1)
        steps += find_steps(recording.time, recording.volts, len(planned), timing)
        moves += planned
        notes.append(f"{recording.source}: {len(planned)} steps of {timing.seconds:g} s.")
        if available > len(planned):
            notes.append(f"{available - len(planned)} steps more at its end have no known value.")
    if sensor.mark_unit == "deg":
        notes.append("The marks are assumed evenly from 0° to 90°.")
    return outcome_of(CalibrationPlan(sensor, tuple(moves)), steps), notes


def _moves(sensor: Sensor, available: int, sweep: str, alone: bool) -> tuple[Move, ...]:
    whole = standard_plan(sensor).moves
    if sensor.mark_unit == "kg" and alone:
        return whole if available >= len(whole) else tuple(m for m in whole if m.sweep == LOADING)
    return tuple(Move(sweep, mark, "") for mark in sensor.default_marks(max(available, 3)))
