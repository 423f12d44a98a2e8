"""Where the volts of a calibration come from: a text file, or the raw group of a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from fingerlab.calibration.sensors import Sensor
from fingerlab.core.errors import UserError
from fingerlab.sessions.mapping import split_header
from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.reading import open_session
from fingerlab.sessions.samples import sample_fault
from fingerlab.sessions.text_table import TextTable, inspect_table, read_blocks

PIECE = 1 << 20
"""Samples of a session read at a time: a quarter of an hour at 1 kHz."""

Progress = Callable[[float, str], None]
"""Told the share done (0 to 1) and what is being done; stops the work by raising ``Cancelled``."""

_TIME_FACTORS = {"s": 1.0, "sec": 1.0, "ms": 1e-3}
_VOLT_FACTORS = {"V": 1.0, "v": 1.0, "volt": 1.0, "volts": 1.0, "mV": 1e-3}


@dataclass(frozen=True)
class Recording:
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
) -> Recording:
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
) -> Recording:
    session = open_session(path)
    runs = [run for run in session.runs if name is None or run.name == name]
    if not runs:
        raise UserError(f"{path} has no run {name}; it has {', '.join(run.name for run in session.runs)}.")
    for run in runs:
        channel = _raw_channel(run, sensor, column)
        if channel is not None:
            unit = run.units[channel]
            factor = _VOLT_FACTORS.get(unit or "V")
            if factor is None:
                raise UserError(
                    f"{path}: run {run.name}, '{channel}' is in '{unit}'; it should be in V or mV."
                )
            time, volts = _loaded(run, channel, progress)
            return Recording(time, volts * factor, f"{path}, run {run.name}, {channel}")
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


def _from_text(path: Path, sensor: Sensor, column: str | None, progress: Progress) -> Recording:
    table = inspect_table(path)
    index = _text_column(table, sensor, column)
    time_factor = _factor(table, 0, _TIME_FACTORS, "s or ms")
    volt_factor = _factor(table, index, _VOLT_FACTORS, "V or mV")
    blocks = read_blocks(table, progress=lambda share: progress(share, f"reading {path.name}"))
    values = np.concatenate([block[:, (0, index)] for block in blocks])
    header = f" '{table.header[index]}'" if table.header else ""
    source = f"{path}, column {index + 1}{header}"
    return Recording(values[:, 0] * time_factor, values[:, 1] * volt_factor, source)


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


def _factor(table: TextTable, index: int, factors: dict[str, float], wanted: str) -> float:
    unit = split_header(table.header[index])[1] if table.header else None
    if unit is None:
        return 1.0
    if unit not in factors:
        raise UserError(f"{table.path}, column {index + 1} is in '{unit}'; it should be in {wanted}.")
    return factors[unit]
