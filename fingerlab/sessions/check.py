"""Checking a session's samples against the format, a piece at a time, so that ten hours fit in memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.rig.constants import Motor, intervention_of
from fingerlab.sessions.format import CHANNEL_UNITS, RATE_TOLERANCE
from fingerlab.sessions.model import Array, Run, Session

PIECE_SAMPLES = 1 << 17
"""Samples looked at together: nine channels of them are 9 MB in double precision."""

TORQUE_TOLERANCE = 0.02
"""Relative difference between motor_torque and kt * N * motor_current that is worth a word.

The tolerance of a rig constant that the file says nothing about (session format, version 1).
"""

Level = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing that the check found; ``run`` is None where it is about the whole file."""

    level: Level
    run: str | None
    text: str


@dataclass(frozen=True)
class RunCheck:
    """What was counted in one run: gaps in time, samples lost in them, samples of force not read."""

    run: str
    gaps: int
    lost_samples: int
    force_not_read: int


@dataclass(frozen=True)
class CheckReport:
    """Everything that :func:`check_session` found."""

    findings: tuple[Finding, ...]
    runs: tuple[RunCheck, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that break the format."""
        return tuple(finding for finding in self.findings if finding.level == "error")

    def raise_first(self) -> None:
        """Raise the first error as the sentence that the user is to read, or do nothing.

        Raises:
            UserError: the session breaks the format.
        """
        if self.errors:
            raise UserError(self.errors[0].text)


@dataclass
class _Tally:
    """Running sums over the pieces of one run."""

    steps: int = 0
    regular: int = 0
    gaps: int = 0
    lost: int = 0
    step_sum: float = 0.0
    force_nan: int = 0
    current_current: float = 0.0
    torque_current: float = 0.0

    def add(self, piece: dict[str, Array], rate: float, first: int) -> None:
        """Count one piece; its first ``first`` samples (0 or 1) were counted with the one before."""
        steps = np.diff(piece["time"]) * rate
        irregular = np.abs(steps - 1.0) > RATE_TOLERANCE
        late = steps > 1.0 + RATE_TOLERANCE
        self.steps += steps.size
        self.regular += int(steps.size - irregular.sum())
        self.gaps += int(late.sum())
        self.lost += int(np.rint(steps[late] - 1.0).sum())
        self.step_sum += float(steps.sum())
        if "endpoint_force" in piece:
            self.force_nan += int(np.isnan(piece["endpoint_force"][first:]).sum())
        if "motor_current" in piece:
            current, torque = piece["motor_current"][first:], piece["motor_torque"][first:]
            # Not "@": a threaded BLAS waits for busy cores longer than these sums take.
            self.current_current += float(np.einsum("i,i", current, current))
            self.torque_current += float(np.einsum("i,i", current, torque))


def check_session(session: Session, progress: Progress | None = None) -> CheckReport:
    """Read a session's samples once, in pieces, and judge them against the session format.

    Structure has been checked by ``open_session``; this adds time that runs backwards, NaN, a sampling
    rate that the time channel does not keep, gaps, and what the file says of itself.

    Args:
        progress: called with the share done (0 to 1) and what is being read.

    Returns:
        Findings in the order of the runs; errors are those that break the format.

    Raises:
        UserError: the file can no longer be opened at all.
    """
    findings: list[Finding] = []
    runs: list[RunCheck] = []
    for number, run in enumerate(session.runs):
        if progress:
            progress(number / len(session.runs), f"run {run.name}")
        tally = _Tally()
        try:
            for piece, first in _pieces(run):
                tally.add(piece, run.sample_rate_hz, first)
        except UserError as error:
            findings.append(Finding("error", run.name, str(error)))
            runs.append(RunCheck(run.name, tally.gaps, tally.lost, tally.force_nan))
            continue
        findings += _judge(session, run, tally)
        runs.append(RunCheck(run.name, tally.gaps, tally.lost, tally.force_nan))
    return CheckReport(tuple(findings), tuple(runs))


def _pieces(run: Run) -> Iterator[tuple[dict[str, Array], int]]:
    """Pieces of the run's contract channels; each begins with the last sample of the one before."""
    names = [name for name in CHANNEL_UNITS if run.has(name)]
    start = 0
    while start < run.length:
        first = 1 if start else 0
        stop = min(start + PIECE_SAMPLES, run.length)
        yield run.load(names, start - first, stop), first
        start = stop


def _judge(session: Session, run: Run, tally: _Tally) -> list[Finding]:
    where = f"{session.path}: run {run.name}"
    found: list[Finding] = []
    if tally.steps and tally.regular < tally.steps / 2:
        rate = run.sample_rate_hz * tally.steps / tally.step_sum
        text = (
            f"{where} says {run.sample_rate_hz:g} samples a second, but its time channel holds {rate:.4g} "
            "a second; correct sample_rate_hz or time."
        )
        return [Finding("error", run.name, text)]
    if tally.gaps:
        found.append(
            Finding("warning", run.name, f"{tally.gaps} gaps in time, {tally.lost} samples lost in them.")
        )
    if run.length < 2:
        found.append(Finding("warning", run.name, "only one sample; nothing can be fitted to it."))
    if tally.force_nan:
        found.append(Finding("note", run.name, f"endpoint_force was not read in {tally.force_nan} samples."))
    if run.phase == "contact" and (tally.force_nan == run.length or not run.has("endpoint_force")):
        found.append(
            Finding("warning", run.name, "a contact run without endpoint_force; prediction has no measure.")
        )
    found += _judge_torque(session.rig.motor, run, tally)
    found += _judge_attributes(run)
    return found


def _judge_torque(motor: Motor, run: Run, tally: _Tally) -> list[Finding]:
    """motor_torque is kt * N * motor_current by definition; a slope that differs is a wrong constant."""
    if tally.current_current == 0.0:
        return []
    slope = tally.torque_current / tally.current_current
    wanted = motor.torque_constant * motor.gear_ratio
    if abs(slope / wanted - 1.0) <= TORQUE_TOLERANCE:
        return []
    text = (
        f"motor_torque is {slope:.4g} N m/A times motor_current, but the rig's torque constant and gear "
        f"ratio make it {wanted:.4g} N m/A."
    )
    return [Finding("warning", run.name, text)]


def _judge_attributes(run: Run) -> list[Finding]:
    found: list[Finding] = []
    for key, words in (
        ("dropped_samples", "samples were dropped"),
        ("late_cycles", "control cycles came late"),
    ):
        if run.counted(key):
            found.append(Finding("warning", run.name, f"{run.counted(key):g} {words} while recording."))
    try:
        change = intervention_of(run.attributes, run.name)
    except UserError as error:
        found.append(Finding("warning", run.name, str(error)))
    else:
        if change is not None and change.to_json():
            found.append(Finding("note", run.name, f"taken {change.words()}."))
    if not run.complete:
        found.append(Finding("warning", run.name, "recording stopped before the trajectory was complete."))
    return found
