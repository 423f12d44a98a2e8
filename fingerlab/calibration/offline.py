"""A calibration from recordings made before: text files, or sessions with the volts as read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fingerlab.calibration.plan import FIRST, LOADING, SECOND, Move, Plan, standard_plan
from fingerlab.calibration.recording import Progress, read_recording
from fingerlab.calibration.result import Outcome, outcome_of
from fingerlab.calibration.sensors import Sensor
from fingerlab.calibration.steps import Step, StepTiming, count_steps, find_steps
from fingerlab.core.errors import UserError


def outcome_from_files(
    paths: Sequence[Path],
    sensor: Sensor,
    timing: StepTiming | None = None,
    column: str | None = None,
    progress: Progress = lambda *_: None,
) -> tuple[Outcome, list[str]]:
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
    steps: list[Step] = []
    moves: list[Move] = []
    notes: list[str] = []

    def told_of(number: int) -> Progress:
        return lambda share, what: progress((number + share) / len(paths), what)

    for number, (path, sweep) in enumerate(zip(paths, (FIRST, SECOND), strict=False)):
        recording = read_recording(path, sensor, column, progress=told_of(number))
        available = count_steps(recording.time, timing)
        planned = _moves(sensor, available, sweep, len(paths) == 1)
        steps += find_steps(recording.time, recording.volts, len(planned), timing)
        moves += planned
        notes.append(f"{recording.source}: {len(planned)} steps of {timing.seconds:g} s.")
        if available > len(planned):
            notes.append(f"{available - len(planned)} steps more at its end have no known value.")
    if sensor.mark_unit == "deg":
        notes.append("The marks are assumed evenly from 0° to 90°.")
    return outcome_of(Plan(sensor, tuple(moves)), steps), notes


def _moves(sensor: Sensor, available: int, sweep: str, alone: bool) -> tuple[Move, ...]:
    whole = standard_plan(sensor).moves
    if sensor.mark_unit == "kg" and alone:
        return whole if available >= len(whole) else tuple(m for m in whole if m.sweep == LOADING)
    return tuple(Move(sweep, mark, "") for mark in sensor.default_marks(max(available, 3)))
