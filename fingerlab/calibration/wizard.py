"""The guided calibration as a state machine: readings in, what to do and how far it is out.

The operator does what :attr:`Wizard.move` says. Once the reading has left the previous step and stands
still, a hold of 15 s begins, of which the central 5 s are captured (thesis section 2.2). A reading that
stirs meanwhile begins it anew. Before the first step it has to leave where it stood, too, unless the sensor
is at rest there. There is no clock and no window in here.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

import numpy as np

from fingerlab.calibration.line import SteadyStep, StepTiming
from fingerlab.calibration.outcome import (
    CalibrationOutcome,
    Misplaced,
    early_objection,
    find_misplaced,
    outcome_of,
)
from fingerlab.calibration.sensors import CalibrationPlan, Move
from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Array

WINDOW_S = 2.0
"""A reading is judged by its last two seconds (assumed: a placed weight swings for about one)."""
BLOCK_S = 0.25
SHARE = 0.05
"""Means over a quarter of a second may differ by this share of the distance between marks (assumed): far
less than what tells neighbouring marks apart, far more than the sensors' noise."""
RATE_HZ = 20.0
"""Rate at which calibrations are recorded, as in the thesis; faster readings are averaged down to it."""

Light = Literal["none", "moving", "stable"]


class Averager:
    """Averages readings of any rate down to :data:`RATE_HZ`; slower ones go through as they are."""

    def __init__(self) -> None:
        self._slot: int | None = None
        self._volts: list[Array] = []

    def feed(self, time: Array, volts: Array) -> tuple[Array, Array]:
        """The means that have become complete: time of the slot's start (s) and volts, shapes (m,).

        Args:
            time: s, shape (n,), increasing, also from one call to the next. volts: V, shape (n,).
        """
        slots = np.floor(time * RATE_HZ + 1e-6).astype(np.int64)
        times: list[float] = []
        means: list[float] = []
        if not len(slots):
            return np.empty(0), np.empty(0)
        starts = np.flatnonzero(np.diff(slots, prepend=slots[0] - 1))
        for start, piece in zip(starts, np.split(volts, starts[1:]), strict=True):
            slot = int(slots[start])
            if self._slot is not None and slot != self._slot:
                times.append(self._slot / RATE_HZ)
                means.append(float(np.concatenate(self._volts).mean()))
                self._volts = []
            self._slot = slot
            self._volts.append(piece)
        return np.array(times), np.array(means)


@dataclass(frozen=True)
class Stillness:
    """How still a reading stands: the light, and by how much block means differ in the window, V."""

    light: Light
    spread: float


def judge(time: Array, volts: Array, tolerance: float) -> Stillness:
    """Judge the last two seconds.

    Args:
        time: s, shape (n,), increasing. volts: V, shape (n,); NaN where nothing is read.
        tolerance: how far block means may differ, V.
    """
    if not len(time) or not np.isfinite(volts[-1]):
        return Stillness("none", float("nan"))
    recent = time > time[-1] - WINDOW_S + 1e-9
    inside, when = volts[recent], time[recent]
    if when[-1] - when[0] < WINDOW_S - 3 * BLOCK_S / 2 or not np.isfinite(inside).all():
        return Stillness("moving", float("nan"))
    blocks = np.floor((when - when[0]) / BLOCK_S + 1e-6).astype(np.int64)
    counts = np.bincount(blocks)
    means = np.bincount(blocks, inside)[counts > 0] / counts[counts > 0]
    spread = float(np.ptp(means))
    return Stillness("stable" if spread <= tolerance else "moving", spread)


KEPT_S = 60.0
"""How much of the reading is kept to be drawn, s."""
GAP_S = 1.0
"""A longer gap in the readings begins the hold anew, s."""
LEFT = 0.3
"""A reading that is this share of the distance between marks away has left the last step (assumed)."""


class Phase(Enum):
    """Where the wizard is in a step."""

    CHANGE = "waiting for the change"
    SETTLE = "waiting for stillness"
    HOLD = "holding"
    DONE = "all steps captured"


@dataclass(frozen=True)
class Capture:
    """A captured step: its reading, and the stretch of time that counted, s."""

    step: SteadyStep
    start: float
    end: float


class Wizard:
    """One sensor's calibration.

    Attributes:
        plan, timing: what is done and how long each step is held.
        rises: whether the volts should rise with the known value; None where either is right.
        captures: of the steps so far, in the plan's order.
        phase: where it is. stillness: of the reading now.
        time, volts: the reading of the last minute at 20 Hz, s and V.
    """

    def __init__(
        self, plan: CalibrationPlan, timing: StepTiming | None = None, rises: bool | None = None
    ) -> None:
        self.plan, self.timing, self.rises = plan, timing or StepTiming(), rises
        self.captures: list[Capture] = []
        self.phase = Phase.SETTLE if plan.moves[0].at_rest else Phase.CHANGE
        self.stillness = Stillness("none", float("nan"))
        self.time: Array = np.empty(0)
        self.volts: Array = np.empty(0)
        self._undone: list[Capture] = []
        self._averager = Averager()
        self._hold: float | None = None
        self._left_behind: float | None = None

    # what it says

    @property
    def number(self) -> int:
        """The step to be done now, from 0; the number of steps where all are done."""
        return len(self.captures)

    @property
    def move(self) -> Move | None:
        """What the operator is to do now; None where all is done."""
        return self.plan.moves[self.number] if self.phase is not Phase.DONE else None

    @property
    def light(self) -> Light:
        """The stability light."""
        return self.stillness.light

    @property
    def reading(self) -> float:
        """The newest reading, V; NaN where there is none."""
        return float(self.volts[-1]) if len(self.volts) else float("nan")

    @property
    def held(self) -> float:
        """How much of the hold has passed, 0 to 1."""
        if self._hold is None or not len(self.time):
            return 0.0
        return min(max((float(self.time[-1]) - self._hold) / self.timing.seconds, 0.0), 1.0)

    @property
    def seconds_left(self) -> float:
        """What is left of the hold, s."""
        return (1.0 - self.held) * self.timing.seconds

    @property
    def can_undo(self) -> bool:
        """Whether a step can be taken back."""
        return bool(self.captures)

    @property
    def can_redo(self) -> bool:
        """Whether a step that was taken back can be put back."""
        return bool(self._undone)

    def doubts(self) -> tuple[Misplaced, ...]:
        """Captured steps that do not fit the others, such as a wrong weight."""
        return find_misplaced(self.plan, [one.step for one in self.captures], range(self.number))

    def early(self) -> str:
        """What the data sheet says against the steps so far: zero, sense or span; empty for nothing."""
        return early_objection(self.plan, [one.step for one in self.captures], self.rises)

    # what goes in

    def feed(self, time: Array, volts: Array) -> bool:
        """Take readings: time in s, increasing from call to call, and volts, shapes (n,).

        Returns:
            Whether a step was captured.
        """
        before = self.number
        for moment, value in zip(*self._averager.feed(time, volts), strict=True):
            self._take(float(moment), float(value))
        return self.number > before

    def take_as_it_is(self) -> None:
        """The reading need not leave the last step: the operator says that what is asked for is done."""
        if self.phase is Phase.CHANGE:
            self.phase = Phase.SETTLE

    def undo(self) -> None:
        """Take the last step back; it is then to be done again."""
        if self.captures:
            capture = self.captures.pop()
            self._undone.append(capture)
            self._await(capture.step.volts)

    def redo(self) -> None:
        """Put the step back that was taken back last."""
        if self._undone:
            self._accept(self._undone.pop())

    def interrupt(self) -> None:
        """Nothing is measured now: the hold begins anew when readings come again."""
        self._hold = None
        self.stillness = Stillness("none", float("nan"))
        if self.phase is Phase.HOLD:
            self.phase = Phase.SETTLE

    def outcome(self) -> CalibrationOutcome:
        """The calibration, once all steps are captured.

        Raises:
            UserError: steps are missing, or they make no line.
        """
        if self.phase is not Phase.DONE:
            missing = len(self.plan.moves) - self.number
            raise UserError(f"{missing} steps of {len(self.plan.moves)} are still to be done.")
        return outcome_of(self.plan, [one.step for one in self.captures], self.rises)

    # step by step

    def _take(self, moment: float, value: float) -> None:
        if len(self.time) and not 0 < moment - float(self.time[-1]) <= GAP_S:
            self.time = self.volts = np.empty(0)
            self.interrupt()
        self.time = np.append(self.time, moment)
        self.volts = np.append(self.volts, value)
        if self.time[0] < moment - KEPT_S - self.timing.seconds:
            keep = self.time >= moment - KEPT_S - self.timing.seconds
            self.time, self.volts = self.time[keep], self.volts[keep]
        tolerance = SHARE * self.plan.spacing_volts
        recent = slice(-64, None)  # more than the two seconds that are judged
        self.stillness = judge(self.time[recent], self.volts[recent], tolerance)
        if self._left_behind is None and np.isfinite(value):
            self._left_behind = value  # before the first step: where the sensor stood
        if self.phase is Phase.CHANGE and self._has_left(value):
            self.phase = Phase.SETTLE
        if self.phase is Phase.SETTLE and self.light == "stable":
            self.phase, self._hold = Phase.HOLD, moment
        if self.phase is Phase.HOLD:
            self._hold_on(moment, 2.0 * tolerance)

    def _has_left(self, value: float) -> bool:
        """Whether a reading (V) is no longer that of the last step; nothing is, before there is one."""
        left = self.plan.spacing_volts * LEFT
        return self._left_behind is not None and abs(value - self._left_behind) > left

    def _hold_on(self, moment: float, tolerance: float) -> None:
        assert self._hold is not None
        if self.light != "stable":
            self.interrupt_hold()
            return
        if moment - self._hold < self.timing.seconds:
            return
        start, end = (self._hold + edge for edge in self.timing.window(0))
        inside = self.volts[(self.time >= start - 1e-9) & (self.time < end - 1e-9)]
        half = len(inside) // 2
        if len(inside) < 4 or abs(inside[:half].mean() - inside[half:].mean()) > tolerance:
            self.interrupt_hold()  # it creeps: still within each two seconds, but not over the whole hold
            return
        self._undone.clear()
        step = SteadyStep(float(inside.mean()), float(inside.std(ddof=1)), len(inside))
        self._accept(Capture(step, start, end))

    def interrupt_hold(self) -> None:
        """The reading stirred: wait for it to stand still again."""
        self._hold = None
        self.phase = Phase.SETTLE

    def _accept(self, capture: Capture) -> None:
        self.captures.append(capture)
        if self.number == len(self.plan.moves):
            self.phase, self._hold = Phase.DONE, None
        else:
            self._await(capture.step.volts)

    def _await(self, level: float) -> None:
        """Wait until the reading leaves a level (V)."""
        self.phase, self._hold, self._left_behind = Phase.CHANGE, None, level
