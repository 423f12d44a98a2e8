"""Where the motor is to be, sample by sample: soft start, soft stop, and a change without a jump.

A reference is a source (a function of time) plus a correction that leads from where the motor was told to
be, at the speed at which it was told to go, to the source within a given time: the polynomial of fifth order
whose value and first two derivatives vanish at its end.

From one motion to another it is a mixture of both instead, whose shares change by such a polynomial: what
lies between two motions within the limits is within the limits, while a correction would carry on a high
speed for as long as it lasts, far beyond either motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fingerlab.acquisition.trajectories import Trajectory
from fingerlab.sessions.model import Array

BLOCK = 256
"""Samples calculated ahead at a time; one by one, numpy would cost more than the rest of the loop."""

SHORTEST_BLEND_S = 0.5
"""A change of trajectory takes at least this long (assumed)."""

SLOPE_S = 1e-7
"""Step of the difference that gives a source's speed at its start, s."""

STOP_S = 1.0
"""Duration of a soft stop (assumed)."""


class Reference:
    """The command in rad, one value a sample."""

    def __init__(self, period: float) -> None:
        self.period = period
        self._source: Callable[[Array], Array] = np.zeros_like
        self._done = self._lead = 0
        self._samples: float = 0
        self._gap = self._gap_rate = 0.0
        self._blend = SHORTEST_BLEND_S
        self._ahead: list[float] = []
        self._next = 0
        self.value = self._before = 0.0

    @property
    def over(self) -> bool:
        """Whether the trajectory has lasted its time."""
        return self._done >= self._samples

    def begin(self, position: float) -> None:
        """Stand at ``position`` (rad)."""
        self.value = self._before = position

    def start(self, trajectory: Trajectory, position: float, endless: bool = False) -> None:
        """Begin from rest at ``position`` (rad); the trajectory's own envelope leads into the motion."""
        self.begin(position)
        self._set(trajectory.command, trajectory.duration, max(trajectory.ramp, SHORTEST_BLEND_S), endless)
        self._lead = 0  # from rest, the first sample is the trajectory's own first

    def change(self, trajectory: Trajectory, endless: bool = False) -> None:
        """Go over to another trajectory from the motion of this moment."""

        def full(time: Array) -> Array:
            return np.asarray(trajectory.offset + trajectory.amplitude * trajectory.wave(time))

        blend = max(trajectory.ramp, SHORTEST_BLEND_S)
        self._set(_mixed(self._as_it_is(), full, blend), trajectory.duration, blend, endless)
        self._gap = self._gap_rate = 0.0  # a mixture begins where the motion is; what is left is rounding

    def rest(self, seconds: float = STOP_S) -> None:
        """Soft stop: lead to zero within ``seconds``, then be over."""
        self._set(np.zeros_like, seconds, seconds, False)

    def wind(self, speed: float, limit: float) -> None:
        """Move slowly at ``speed`` (rad/s) until ``limit`` (rad), then be over."""
        begin = self.value
        self._set(lambda time: begin + speed * time, abs((limit - begin) / speed), SHORTEST_BLEND_S, False)

    def hold(self, position: float, blend: float = SHORTEST_BLEND_S) -> None:
        """Stay at ``position`` (rad) without an end."""
        self._set(lambda time: np.full_like(time, position), math.inf, blend, True)

    def next(self) -> float:
        """The next sample's command, rad."""
        if self._next >= len(self._ahead):
            self._calculate()
        self._before, self.value = self.value, self._ahead[self._next]
        self._next += 1
        self._done += 1
        return self.value

    def _as_it_is(self) -> Callable[[Array], Array]:
        """The present motion as a function of the time since the last sample."""
        source, gap, rate, blend = self._source, self._gap, self._gap_rate, self._blend
        last = (self._done - 1 + self._lead) * self.period
        if self._done == 0:
            value = self.value
            return lambda time: np.full_like(time, value)
        return lambda time: np.asarray(source(last + time) + _correction(last + time, gap, rate, blend))

    def _set(self, source: Callable[[Array], Array], seconds: float, blend: float, endless: bool) -> None:
        start = np.asarray(source(np.array([0.0, SLOPE_S])))
        rate = (self.value - self._before) / self.period
        self._gap = self.value - float(start[0])
        self._gap_rate = rate - float(start[1] - start[0]) / SLOPE_S
        self._source, self._blend = source, blend
        self._samples = math.inf if endless else round(seconds / self.period)
        self._done, self._next, self._ahead = 0, 0, []
        self._lead = 1  # the sample before was the source's start

    def _calculate(self) -> None:
        time = (self._done + self._lead + np.arange(BLOCK, dtype=np.float64)) * self.period
        values = np.asarray(self._source(time)) + _correction(time, self._gap, self._gap_rate, self._blend)
        self._ahead, self._next = values.tolist(), 0


def _correction(time: Array, gap: float, rate: float, blend: float) -> Array:
    """What leads from ``gap`` (rad) and ``rate`` (rad/s) beside a source to nothing in ``blend`` seconds."""
    if time[0] >= blend:
        return np.zeros_like(time)
    s = np.minimum(time / blend, 1.0)
    of_gap = 1.0 + s**3 * (-10.0 + s * (15.0 - 6.0 * s))
    of_rate = s + s**3 * (-6.0 + s * (8.0 - 3.0 * s))
    return np.asarray(gap * of_gap + rate * blend * of_rate)


def _mixed(
    old: Callable[[Array], Array], new: Callable[[Array], Array], blend: float
) -> Callable[[Array], Array]:
    """From one motion to the other within ``blend`` seconds, with smooth shares of both."""

    def motion(time: Array) -> Array:
        if time[0] >= blend:
            return np.asarray(new(time))
        s = np.minimum(time / blend, 1.0)
        share = s**3 * (10.0 + s * (-15.0 + 6.0 * s))
        return np.asarray(old(time) + share * (new(time) - old(time)))

    return motion
