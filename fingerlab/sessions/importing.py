"""Text files of the bench to one session: planned first, so that it can be shown, then written."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.rig.constants import Rig
from fingerlab.sessions.format import LEAST_RATE, MOST_RATE, RATE_TOLERANCE, REQUIRED_CHANNELS
from fingerlab.sessions.hdf5 import sample_fault
from fingerlab.sessions.mapping import Column, map_columns
from fingerlab.sessions.model import Array
from fingerlab.sessions.text_table import SEPARATOR_WORDS, TextTable, inspect_table, read_blocks
from fingerlab.sessions.trajectory import recognised, trajectory_words
from fingerlab.sessions.writing import SessionWriter

WHOLE_RATE = 1e-4
"""A sampling rate this close (relative) to a whole number is that number; time is rounded in text."""

RATE_AGREEMENT = 0.01
"""Relative difference allowed between a given rate and the time column. Assumed."""

_DERIVED = {
    "motor_current": ("motor_torque", "motor_torque / (torque_constant * gear_ratio)"),
    "motor_torque": ("motor_current", "torque_constant * gear_ratio * motor_current"),
}
"""Channels that follow from another by the rig's constants: by which, and how (session format)."""


@dataclass(frozen=True)
class TextRun:
    """A text file and what it cannot say of itself; without a ``trajectory`` its command is asked."""

    path: Path
    phase: str
    cable: str
    trajectory: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class ImportPlan:
    """How one text file becomes a run.

    Attributes:
        source: the file, phase, cable and trajectory.
        table: its layout.
        columns: which column is which channel.
        derived: channels that are calculated, by name, with the formula in words.
        sample_rate_hz: Hz.
        counted_time: whether time is counted from the rate because no column holds it.
        trajectory: what the motor was told, as in the session format.
        read_from_command: whether that was read from the command, for nobody had said it.
    """

    source: TextRun
    table: TextTable
    columns: tuple[Column, ...]
    derived: Mapping[str, str]
    sample_rate_hz: float
    counted_time: bool
    trajectory: Mapping[str, Any]
    read_from_command: bool


def plan_import(
    sources: Iterable[TextRun], mapping: str | None = None, rate: float | None = None
) -> tuple[ImportPlan, ...]:
    """Find out how text files become runs, reading no more than the first block of each.

    Args:
        sources: the files in the order taken.
        mapping: as in :func:`fingerlab.sessions.mapping.map_columns`.
        rate: sampling rate, Hz; found from the time column where absent.

    Raises:
        UserError: a file cannot be read, the mapping does not fit, or a channel is missing.
    """
    return tuple(_plan(source, mapping, rate) for source in sources)


def import_files(
    plans: Sequence[ImportPlan],
    target: str | Path,
    rig: Rig,
    title: str,
    *,
    attributes: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write the planned runs as one session.

    Args:
        rig: constants of the bench; current or torque is calculated with them where one is missing.
        progress: called with the share of the files done (0 to 1) and what is being read.

    Returns:
        The path of the session.

    Raises:
        UserError: a row does not fit, the samples break the format, or the target exists or is full;
            nothing is left behind.
    """
    with SessionWriter(target, rig, title, attributes=attributes) as writer:
        for number, plan in enumerate(plans):
            if progress:
                progress(number / len(plans), plan.table.path.name)
            _write_run(writer, plan, rig)
    return Path(target)


def describe(plan: ImportPlan) -> list[str]:
    """The plan in lines of text, to be shown before anything is written."""
    table = plan.table
    header = "a header" if table.header else "no header"
    word = "decimal comma" if table.decimal == "," else "decimal point"
    lines = [
        f"{table.path}: {table.columns} columns, separated by {SEPARATOR_WORDS[table.separator]}, {word}, "
        f"{header}; {plan.sample_rate_hz:g} samples a second; {plan.source.phase}, "
        f"cable {plan.source.cable}"
    ]
    for column in plan.columns:
        change = "" if column.factor == 1.0 else f", times {column.factor:.6g} to {column.target_unit}"
        lines.append(f"  {column.channel} <- column {column.index + 1} [{column.unit or '-'}]{change}"
                     f" ({column.source})")  # fmt: skip
    if plan.read_from_command:
        lines.append(f"  trajectory <- {trajectory_words(plan.trajectory)} (read from motor_command)")
    if plan.counted_time:
        lines.append(f"  time <- counted at {plan.sample_rate_hz:g} samples a second")
    lines += [f"  {channel} <- {formula} (derived)" for channel, formula in plan.derived.items()]
    used = {column.index for column in plan.columns}
    unused = [str(index + 1) for index in range(table.columns) if index not in used]
    if unused:
        lines.append(f"  not used: column {', '.join(unused)}")
    return lines


def _plan(source: TextRun, mapping: str | None, rate: float | None) -> ImportPlan:
    table = inspect_table(source.path)
    columns = map_columns(table, mapping)
    present = {column.channel for column in columns}
    derived = {
        channel: formula
        for channel, (other, formula) in _DERIVED.items()
        if channel not in present and other in present
    }
    counted = "time" not in present
    if counted and rate is None:
        raise UserError(
            f"{table.path} gives no time; map its column with --map, or give the sampling rate with --rate."
        )
    for channel in REQUIRED_CHANNELS[source.phase]:
        if channel not in present and channel not in derived and channel != "time":
            raise UserError(
                f"{table.path} gives no '{channel}', which a run of phase '{source.phase}' needs; map its "
                "column with --map, or choose another --phase."
            )
    first = next(iter(read_blocks(table)))
    found = float(rate or 0.0) if counted else _rate(table, _values(first, columns, "time"), rate)
    if source.trajectory is not None:
        return ImportPlan(source, table, columns, derived, found, counted, source.trajectory, False)
    read = recognised(_values(first, columns, "motor_command"), found) if "motor_command" in present else None
    told = read or {"kind": "unknown"}
    return ImportPlan(source, table, columns, derived, found, counted, told, read is not None)


def _values(block: Array, columns: Sequence[Column], channel: str) -> Array:
    """A mapped channel of a block of rows, SI, (rows,)."""
    column = next(column for column in columns if column.channel == channel)
    return np.asarray(block[:, column.index] * column.factor)


def _rate(table: TextTable, time: Array, given: float | None) -> float:
    """Sampling rate, Hz, from the ``time`` (s) of the first rows."""
    fault = sample_fault("time", time)
    if fault:
        raise UserError(f"{table.path}: {fault}")
    if len(time) < 2:
        if given is None:
            raise UserError(f"{table.path} holds one row; give its samples a second with --rate.")
        return given
    steps = np.diff(time)
    usual = float(np.median(steps))
    regular = steps[np.abs(steps / usual - 1.0) <= RATE_TOLERANCE]
    rate = 1.0 / float(regular.mean())
    if not LEAST_RATE <= rate <= MOST_RATE:
        raise UserError(f"{table.path} holds {rate:.4g} samples a second by its time column; is it in s?")
    whole = float(round(rate))
    if whole and math.isclose(rate, whole, rel_tol=WHOLE_RATE):
        rate = whole
    if given is None:
        return rate
    if not math.isclose(rate, given, rel_tol=RATE_AGREEMENT):
        raise UserError(
            f"{table.path} holds {rate:.4g} samples a second by its time column, not {given:g}; "
            "correct --rate, or leave the time column out of --map."
        )
    return given


def _write_run(writer: SessionWriter, plan: ImportPlan, rig: Rig) -> None:
    source = plan.source
    attributes = {"source_file": source.path.name, "derived": dict(plan.derived) or None}
    units = {column.channel: column.target_unit for column in plan.columns}
    run = writer.begin_run(
        source.phase,
        source.cable,
        plan.sample_rate_hz,
        plan.trajectory,
        attributes,
        units=units,
        derived=plan.derived,
    )
    start = 0
    for block in read_blocks(plan.table):
        channels = _channels(block, plan, rig)
        for name, values in channels.items():
            fault = sample_fault(name, values, start)
            if fault:
                raise UserError(f"{plan.table.path}: {fault}")
        run.append(channels)
        start += len(block)
    run.finish()


def _channels(block: Array, plan: ImportPlan, rig: Rig) -> dict[str, Array]:
    """A block of rows as channels in SI."""
    channels = {column.channel: block[:, column.index] * column.factor for column in plan.columns}
    constant = rig.motor.torque_constant * rig.motor.gear_ratio
    if "motor_current" in plan.derived:
        channels["motor_current"] = channels["motor_torque"] / constant
    if "motor_torque" in plan.derived:
        channels["motor_torque"] = channels["motor_current"] * constant
    return channels
