"""Tables to one session: planned first, so that it can be shown, then written.

Text files of the bench, or logs of one axis of any machine, as text or as MAT files.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import factor
from fingerlab.rig.file import GIVES_TORQUE, LINEAR_AXIS, UNTOLD, Motor, Rig
from fingerlab.sessions.disk_files import repeated_files
from fingerlab.sessions.hdf5 import sample_fault
from fingerlab.sessions.left_out import RowsLeftOut, kept_rows
from fingerlab.sessions.mapping import (
    AUTOMATIC,
    AXIS_RADIUS_M,
    Axis,
    Column,
    Table,
    axis_lacks,
    is_linear,
    map_columns,
    unknown_names,
    words_of,
)
from fingerlab.sessions.mat_table import MatTable, mat_tables
from fingerlab.sessions.model import LEAST_RATE, LEFT_OUT, MOST_RATE, RATE_TOLERANCE, REQUIRED_CHANNELS, Array
from fingerlab.sessions.reading import open_session
from fingerlab.sessions.text_table import BLOCK_LINES, SEPARATOR_WORDS, TableRows, inspect_table, read_rows
from fingerlab.sessions.trajectory import recognised, trajectory_words
from fingerlab.sessions.writing import SessionWriter

WHOLE_RATE = 1e-4
"""A sampling rate this close (relative) to a whole number is that number; time is rounded in text."""

RATE_AGREEMENT = 0.01
"""Relative difference allowed between a given rate and the time column. Assumed."""

NOT_OF_THE_BENCH = "; a log of one axis of any machine is imported with --axis."

_DERIVED = {
    "motor_current": ("motor_torque", "motor_torque / (torque_constant * gear_ratio)"),
    "motor_torque": ("motor_current", "torque_constant * gear_ratio * motor_current"),
}
"""Channels that follow from another by the rig's constants: by which, and how (session format)."""


@dataclass(frozen=True)
class TextRun:
    """A table and what it cannot say of itself; without a ``trajectory`` its command is asked.

    ``axis``: it is the log of one axis of any machine, with units named.
    """

    path: Path
    phase: str
    cable: str
    trajectory: Mapping[str, Any] | None = None
    axis: Axis | None = None


@dataclass(frozen=True)
class ImportPlan:
    """How one table becomes a run; a text file is one, a MAT file one or more.

    Attributes:
        source: the file, phase, cable and trajectory.
        table: its layout.
        columns: which column is which channel.
        derived: channels that are calculated, by name, with the formula in words.
        sample_rate_hz: Hz.
        counted_time: whether time is counted from the rate because no column holds it.
        trajectory: what the motor was told, as in the session format.
        read_from_command: whether that was read from the command, for nobody had said it.
        start: time of the first sample of an axis, s, from which its time is counted.
        left_out: rows of its first block that the run is made without.
    """

    source: TextRun
    table: Table
    columns: tuple[Column, ...]
    derived: Mapping[str, str]
    sample_rate_hz: float
    counted_time: bool
    trajectory: Mapping[str, Any]
    read_from_command: bool
    start: float
    left_out: RowsLeftOut


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
    return tuple(_plan(source, table, mapping, rate) for source in sources for table in _tables(source.path))


def first_rows(path: Path) -> tuple[Table, Array]:
    """The first table of a file and its first rows, (rows, columns), as they stand in it: to be looked at.

    Columns of words are NaN; rows in which anything else could not be read are not among them.

    Raises:
        UserError: the file cannot be read, or a number is written with the other decimal sign.
    """
    table = _tables(path)[0]
    values = next(_blocks(table)).values[:BLOCK_LINES]
    filled = np.isfinite(values)
    whole = filled[:, filled.any(axis=0)].all(axis=1)
    return table, values[whole] if 2 * np.count_nonzero(whole) > len(values) else values


def of_one_axis(
    sources: Sequence[TextRun], rig: Rig | None, torque_constant: float | None, radius: float | None
) -> tuple[list[TextRun], Rig]:
    """The files as motor-bench runs of any machine, and a rig that knows no finger.

    Args:
        rig: with the machine's constants; None: nothing but ``torque_constant`` is known, if that.
        torque_constant: what an ampere gives at the axis with the gear, N m/A; of a linear axis N/A.
        radius: of the arc as which a linear axis is told, or the lever of a force on one that turns, m; None:
            :data:`AXIS_RADIUS_M`, which is no lever of anything.
    """
    lever = Axis(radius or AXIS_RADIUS_M, radius is not None, torque_constant)
    runs = [replace(source, phase="motor_bench", cable="none", axis=lever) for source in sources]
    if rig is None:
        rig = Rig(None, Motor(gear_ratio=1.0), extra={UNTOLD: list(GIVES_TORQUE)})
    if torque_constant:
        motor = replace(rig.motor, torque_constant=torque_constant, gear_ratio=1.0)
        rig = replace(rig, motor=motor, extra={k: v for k, v in rig.extra.items() if k != UNTOLD})
    return runs, replace(rig, finger=None)


def moves_along_a_line(plan: ImportPlan) -> bool:
    """Whether a table is the log of an axis whose position is a length."""
    return plan.source.axis is not None and any(is_linear(c.unit, "rad") for c in _angles(plan))


def _line_radius(plan: ImportPlan) -> float:
    """Of the arc as which the axis will be told, m; 0: it turns."""
    axis = plan.source.axis
    return axis.radius if axis is not None and moves_along_a_line(plan) else 0.0


def _angles(plan: ImportPlan) -> list[Column]:
    return [column for column in plan.columns if column.target_unit == "rad"]


def refuse_unknown_constant(plan: ImportPlan, rig: Rig, rig_named: str = "", option: str = "") -> None:
    """Refuse the log of an axis with a current alone of which nobody says what torque or force it gives.

    Args:
        rig_named: the rig file, if one is given. option: where an ampere's torque is told otherwise.

    Raises:
        UserError: nobody says it, or a rig file says it for an axis that turns and this one is linear.
    """
    if "motor_torque" not in plan.derived:
        return
    axis, linear = plan.source.axis, moves_along_a_line(plan)
    untold = [name for name in GIVES_TORQUE if name in rig.untold]
    if rig_named and len(untold) == 1:
        raise UserError(
            f"{plan.table.path} gives a current and no torque, and {rig_named} holds no {untold[0]}; give "
            f"{' and '.join(GIVES_TORQUE)} there, the ratio 1 where there is no gear."
        )
    if untold:
        raise UserError(
            f"{plan.table.path} gives a current and no torque; say {option} what an ampere gives at the "
            f"axis, {'N/A' if linear else 'N m/A'} with the gear included."
        )
    if linear and axis is not None and axis.constant is None and not axis.lever:
        raise UserError(
            f"{plan.table.path} tells the position in a length, and {rig_named or 'the rig'} what an ampere "
            f"gives in N m; say {option} in place of that what it gives in N/A, or --radius should give the "
            "lever between the two in m."
        )


def _tables(path: Path) -> Sequence[Table]:
    return mat_tables(path) if path.suffix.lower() == ".mat" else [inspect_table(path)]


def _blocks(table: Table) -> Iterator[TableRows]:
    if isinstance(table, MatTable):
        return iter([TableRows(table.values, np.arange(1, len(table.values) + 1), (), True)])
    return read_rows(table)


def _left_out(table: Table) -> RowsLeftOut:
    return RowsLeftOut(table.path, "row" if isinstance(table, MatTable) else "line")


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
    rig = _told_as_an_arc(rig, plans)
    with SessionWriter(target, rig, title, attributes=attributes) as writer:
        for number, plan in enumerate(plans):
            if progress:
                progress(number / len(plans), plan.table.path.name)
            _write_run(writer, plan, rig)
    return Path(target)


def _told_as_an_arc(rig: Rig, plans: Sequence[ImportPlan]) -> Rig:
    """The rig with the radius of a linear axis, at which an ampere's force is a torque; else as it is."""
    axis = next((plan.source.axis for plan in plans if moves_along_a_line(plan)), None)
    if axis is None:
        return rig
    motor = rig.motor
    if axis.constant is not None:
        motor = replace(motor, torque_constant=axis.constant * axis.radius)
    return replace(rig, motor=motor, extra={**rig.extra, LINEAR_AXIS: {"radius_m": axis.radius}})


def left_out_words(path: Path) -> list[str]:
    """Which rows the runs of an imported session were made without, one line a run where there are any."""
    return [
        f"run {run.name} ({run.attributes.get('source_file')}): {run.attributes[LEFT_OUT]}"
        for run in open_session(path).runs
        if LEFT_OUT in run.attributes
    ]


def describe_all(plans: Sequence[ImportPlan]) -> list[str]:
    """The plans in lines of text; a file that is laid out as the one before it is told in one.

    A log of one axis that repeats another one is told: two runs that are one pass for a motion that returns.
    """
    lines, before = list[str](), list[str]()
    for plan in plans:
        first, *rest = describe(plan)
        layout = [first.removeprefix(str(plan.table.path)), *rest]
        lines += [f"{plan.table.path}: as the one before it"] if layout == before else [first, *rest]
        before = layout
    logs = dict.fromkeys(plan.table.path for plan in plans if plan.source.phase == "motor_bench")
    for same, path in repeated_files(list(logs)):
        lines.append(
            f"{path} holds the same as {same}, which makes one motion seem to come again: leave it out."
        )
    return lines


def describe(plan: ImportPlan) -> list[str]:
    """The plan in lines of text, to be shown before anything is written."""
    table = plan.table
    lines = [
        f"{table.path}: {_layout(table)}; {plan.sample_rate_hz:g} samples a second; {plan.source.phase}, "
        f"cable {plan.source.cable}"
    ]
    for column in plan.columns:
        change = "" if column.factor == 1.0 else f", times {column.factor:.6g} to {column.target_unit}"
        lines.append(f"  {column.channel} <- column {column.index + 1} [{column.unit or '-'}]{change}"
                     f" ({column.source})")  # fmt: skip
    if plan.read_from_command:
        told = trajectory_words(plan.trajectory, _line_radius(plan))
        lines.append(f"  trajectory <- {told} (read from motor_command)")
    if plan.counted_time:
        lines.append(f"  time <- counted at {plan.sample_rate_hz:g} samples a second")
    lines += [f"  {channel} <- {formula} (derived)" for channel, formula in plan.derived.items()]
    axis = plan.source.axis
    if "motor_torque" in plan.derived and axis is not None and axis.constant is not None:
        arc = f", {axis.constant * axis.radius:g} N m on the arc of {1e3 * axis.radius:g} mm"
        linear = moves_along_a_line(plan)
        unit = "N" if linear else "N m"
        lines.append(f"  an ampere gives {axis.constant:g} {unit} at the axis{arc if linear else ''}")
    if not isinstance(table, MatTable) and table.ahead > (table.header is not None):
        lines.append(f"  of the {table.ahead} lines before the first row, names and units alone are read")
    used = {column.index for column in plan.columns}
    unused = [index for index in range(table.columns) if index not in used]
    if unused:
        words = words_of(table)
        named = (f"{k + 1}{f' (of words, such as {words[k]!r})' if words.get(k) else ''}" for k in unused)
        lines.append(f"  not used: column {', '.join(named)}")
    if plan.left_out.found:
        lines.append(f"  {plan.left_out.words()}")
    return lines


def _layout(table: Table) -> str:
    if isinstance(table, MatTable):
        return f"{table.columns} vectors" + (f" in {table.name}" if table.name else "")
    header = "a header" if table.header else "no header"
    word = "decimal comma" if table.decimal == "," else "decimal point"
    return f"{table.columns} columns, separated by {SEPARATOR_WORDS[table.separator]}, {word}, {header}"


def _plan(source: TextRun, table: Table, mapping: str | None, rate: float | None) -> ImportPlan:
    columns = map_columns(table, mapping, source.axis)
    misnamed = "" if mapping in AUTOMATIC else unknown_names(columns, source.axis)
    present = {column.channel for column in columns}
    derived = {
        channel: formula
        for channel, (other, formula) in _DERIVED.items()
        if channel not in present and other in present and not (source.axis and other == "motor_torque")
    }
    counted = "time" not in present
    if counted and rate is None:
        raise UserError(
            f"{table.path} gives no time{misnamed}; map its column with --map, or give the sampling rate "
            f"with --rate{'.' if source.axis else NOT_OF_THE_BENCH}"
        )
    for channel in REQUIRED_CHANNELS[source.phase]:
        if channel not in present and channel not in derived and channel != "time":
            if source.axis is not None:
                raise UserError(axis_lacks(table, channel, columns, misnamed))
            raise UserError(
                f"{table.path} gives no '{channel}', which a run of phase '{source.phase}' needs{misnamed}; "
                f"map its column with --map, or choose another --phase{NOT_OF_THE_BENCH}"
            )
    left_out = _left_out(table)
    first = next(kept_rows(_blocks(table), columns, left_out))[0]
    left_out.refuse_many()
    if not len(first):
        raise UserError(f"{table.path} holds no whole row; it should hold one row of numbers a sample.")
    found = float(rate or 0.0) if counted else _rate(table, _values(first, columns, "time"), rate)
    start = 0.0 if counted or source.axis is None else float(_values(first, columns, "time")[0])
    trajectory, read = source.trajectory, False
    if trajectory is None:
        told = "motor_command" in present
        seen = recognised(_values(first, columns, "motor_command"), found) if told else None
        trajectory, read = seen or {"kind": "unknown"}, seen is not None
    return ImportPlan(source, table, columns, derived, found, counted, trajectory, read, start, left_out)


def _values(block: Array, columns: Sequence[Column], channel: str) -> Array:
    """A mapped channel of a block of rows, SI, (rows,)."""
    column = next(column for column in columns if column.channel == channel)
    return np.asarray(block[:, column.index] * column.factor)


def _rate(table: Table, time: Array, given: float | None) -> float:
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
    turns = source.axis is not None and factor(_unit(plan, "motor_position"), "rad") is not None
    start, turned, left_out = 0, None, _left_out(plan.table)
    for block, places in kept_rows(_blocks(plan.table), plan.columns, left_out):
        if not len(block):
            continue
        channels = _channels(block, plan, rig)
        if plan.counted_time:
            channels["time"] = places / plan.sample_rate_hz
        if turns:
            channels["motor_position"] = turned = unwrapped(channels["motor_position"], turned)
        for name, values in channels.items():
            fault = sample_fault(name, values, start)
            if fault:
                raise UserError(f"{plan.table.path}: {fault}")
        run.append(channels)
        start += len(block)
    left_out.refuse_many()
    run.finish({LEFT_OUT: left_out.words() or None})


def _channels(block: Array, plan: ImportPlan, rig: Rig) -> dict[str, Array]:
    """A block of rows as channels in SI."""
    channels = {column.channel: block[:, column.index] * column.factor for column in plan.columns}
    if plan.start:
        channels["time"] = channels["time"] - plan.start
    constant = rig.motor.torque_constant * rig.motor.gear_ratio
    if "motor_current" in plan.derived:
        channels["motor_current"] = channels["motor_torque"] / constant
    if "motor_torque" in plan.derived:
        channels["motor_torque"] = channels["motor_current"] * constant
    return channels


def _unit(plan: ImportPlan, channel: str) -> str:
    """In which unit the table holds a channel."""
    return next(column.unit for column in plan.columns if column.channel == channel)


def unwrapped(position: Array, before: Array | None = None) -> Array:
    """The position of an axis, rad, (n,), without the jumps of an encoder that counts one turn only.

    Between two samples an axis turns by less than half a turn. ``before``: what came before it, unwrapped.
    """
    joined = position if before is None else np.concatenate((before[-1:], position))
    turns = np.cumsum(np.rint(np.diff(joined) / (2.0 * math.pi)))
    return np.asarray(joined - 2.0 * math.pi * np.concatenate(([0.0], turns)))[len(joined) - len(position) :]
