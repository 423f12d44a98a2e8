"""Where the motor is to be, sample by sample: soft start, soft stop, and a change without a jump.

A reference is a source (a function of time) plus a correction that leads from where the motor was told to
be, at the speed at which it was told to go, to the source within a given time: the polynomial of fifth order
whose value and first two derivatives vanish at its end.
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

        self._set(full, trajectory.duration, max(trajectory.ramp, SHORTEST_BLEND_S), endless)

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
        values = np.asarray(self._source(time))
        if time[0] < self._blend:
            s = np.minimum(time / self._blend, 1.0)
            gap = 1.0 + s**3 * (-10.0 + s * (15.0 - 6.0 * s))
            rate = s + s**3 * (-6.0 + s * (8.0 - 3.0 * s))
            values = values + self._gap * gap + self._gap_rate * self._blend * rate
        self._ahead, self._next = values.tolist(), 0
