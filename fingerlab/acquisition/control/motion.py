"""The wanted motion, how it ends, and the current of a wanted torque; that of an angle is in ``position``."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fingerlab.acquisition.control.position import Gains
from fingerlab.acquisition.control.trajectories import Trajectory
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.core.errors import UserError
from fingerlab.rig.limits import Limits
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
        self.value = self._before = self._earlier = 0.0

    @property
    def over(self) -> bool:
        """Whether the trajectory has lasted its time."""
        return self._done >= self._samples

    def begin(self, position: float) -> None:
        """Stand at ``position`` (rad)."""
        self.value = self._before = self._earlier = position

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
        self._earlier, self._before, self.value = self._before, self.value, self._ahead[self._next]
        self._next += 1
        self._done += 1
        return self.value

    def ahead(self, samples: float) -> float:
        """The command so many samples from now, at the speed of this moment, rad."""
        return self.value + samples * (self.value - self._before)

    @property
    def acceleration(self) -> float:
        """Of the command, over the last three samples, rad/s^2."""
        return (self.value - 2.0 * self._before + self._earlier) / self.period**2

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


REST_BAND = math.radians(0.3)
"""A motor that stays this near to its command is at rest (assumed: seven encoder counts)."""

REST_S = 0.1
"""For so long."""

LONGEST_SETTLING_S = 2.0
"""After so long the current goes off in any case (assumed: four times the loop's integral time)."""


class Settling:
    """Tells when a soft stop is over: a motor without current and without friction keeps its last speed."""

    def __init__(self, period: float) -> None:
        self._wanted, self._most = round(REST_S / period), round(LONGEST_SETTLING_S / period)
        self.begin()

    def begin(self) -> None:
        """A soft stop begins."""
        self._near = self._waited = 0

    def over(self, error: float) -> bool:
        """Whether the motor rests, ``error`` (rad) from its command. Called once a cycle after the stop."""
        self._waited += 1
        self._near = self._near + 1 if abs(error) <= REST_BAND else 0
        return self._near >= self._wanted or self._waited >= self._most


FREE_SPEED = 2.0
"""rad/s at the pulley (assumed): a pressing finger turns the motor slower, an unloaded one soon faster."""

LIMIT_MARGIN = 0.95
"""The set value stays below the limits, so that only a fault can reach them (assumed, as in the loop)."""

STEP_S = 2e-3
"""Times at which a trajectory is checked, s."""


def braked(current: float, speed: float, gain: float) -> float:
    """Current command (A) less the brake: ``gain`` (A s/rad) times what the speed (rad/s) has too much."""
    if speed > FREE_SPEED:
        return current - gain * (speed - FREE_SPEED)
    if speed < -FREE_SPEED:
        return current - gain * (speed + FREE_SPEED)
    return current


def most_torque(limits: Limits, torque_per_amp: float) -> float:
    """Largest torque at the gearbox output that the loop sends, N m."""
    return LIMIT_MARGIN * min(limits.torque, limits.current * torque_per_amp)


class TorqueDrive:
    """The wanted torque, one value a sample, and the current that makes it.

    Attributes:
        reference: N m at the gearbox output, with the soft start and change of a position.
    """

    def __init__(self, period: float, gains: Gains, units: BenchUnits, limits: Limits) -> None:
        self.reference = Reference(period)
        self._gain = gains.derivative
        self._per_amp = units.torque_per_amp
        most = most_torque(limits, units.torque_per_amp) / units.torque_per_amp
        self._most = min(most, gains.current_limit)

    def current(self, speed: float) -> float:
        """Current command, A, at a motor speed in rad/s at the pulley."""
        wanted = braked(self.reference.value / self._per_amp, speed, self._gain)
        return min(max(wanted, -self._most), self._most)


def check_torque(trajectory: Trajectory, limits: Limits, units: BenchUnits, cable: bool = True) -> None:
    """Refuse a torque that reaches the limits, or pulls the cable (where there is one) tight too fast.

    Raises:
        UserError: it does.
    """
    time = np.arange(0.0, min(trajectory.duration, 600.0), STEP_S)
    torque = trajectory.command(time)
    low, high = float(torque.min()), float(torque.max())
    most = most_torque(limits, units.torque_per_amp)
    if low < -most or high > most:
        raise UserError(
            f"The trajectory asks for {1e3 * low:.4g} to {1e3 * high:.4g} mN m; the rig's limits of torque "
            f"and current allow {1e3 * most:.4g} mN m in either direction."
        )
    if not cable:
        return
    rise = float(np.abs(np.diff(torque)).max(initial=0.0)) / STEP_S / units.pulley_radius
    if rise > limits.tension_rise:
        raise UserError(
            f"The trajectory pulls the cable tight by up to {rise:.4g} N/s; the limit is "
            f"{limits.tension_rise:.4g} N/s."
        )
