"""The wanted motion, how it ends, and the current that makes an angle or a torque."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.acquisition.control.trajectories import Trajectory
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.core.errors import UserError
from fingerlab.rig.limits import Limits
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Gains:
    """Gains of the position loop, at the gearbox output. The thesis gives none; all are assumed."""

    proportional: float = 14.0
    """A/rad; 12 Hz bandwidth with the RE40's rotor."""
    integral: float = 25.0
    """A/(rad s)."""
    derivative: float = 0.25
    """A s/rad; damping ratio 0.7."""
    derivative_cutoff_hz: float = 60.0
    """Hz; an encoder count then moves the current by 60 mA."""
    current_limit: float = 6.0
    """A; nominal current of the RE40 (thesis table 2.3)."""


GAIN_RANGES = {
    "proportional": (3.5, 18.0, "A/rad"),
    "integral": (0.0, 50.0, "A/(rad s)"),
    "derivative": (0.2, 0.34, "A s/rad"),
}
"""What they may be. Wherever they stand in it, the loop multiplies no disturbance by more than 2.5, at 1 kHz
and in blocks of 5 and 10, on benches of 2.6e-4 to 4e-4 kg m^2 and 0 to 0.15 N m/rad at the output: a phase
margin of 23 degrees and a gain margin of 1.67 at least. The usual gains stay below 2.1: 28 degrees, 1.9. Both
are computed in ``tests/acquisition/test_position.py``."""


def check_gains(gains: Gains) -> None:
    """Refuse gains with which the loop would be no longer sure to be steady.

    Raises:
        UserError: one is out of its range.
    """
    for name, (low, high, unit) in GAIN_RANGES.items():
        value = getattr(gains, name)
        if not low <= value <= high:
            raise UserError(f"The {name} gain is {value:g}; it should be {low:g} to {high:g} {unit}.")


LARGEST_INTEGRAL_SHARE = 4.0
"""Integral over proportional gain of a slowed loop, 1/s: a tenth of its bandwidth of some 6 Hz."""


def slowed(gains: Gains, cycles: int) -> Gains:
    """Gains for a loop that sets its command only every ``cycles`` samples, from the newest of them.

    The bandwidth falls with the square root, and the margins stay what they are at 1 kHz (``GAIN_RANGES``).
    The integral keeps its time, or the finger's springs would hold the motor back for seconds.
    """
    share = cycles**-0.5
    proportional = gains.proportional * share**2
    return replace(
        gains,
        proportional=proportional,
        integral=min(gains.integral * share**2, LARGEST_INTEGRAL_SHARE * proportional),
        derivative=gains.derivative * share,
    )


LEARNING_S = 2.0
"""Time over which the feed-forward averages (assumed: a stroke or two)."""

LEAST_MOTION = math.radians(0.2)
"""rad: of a motion no larger, half of what it seems to say is believed (assumed: five encoder counts)."""


LARGEST_SLOPE = 3.0
"""A/rad (assumed): twice that of the stiffest simulated finger on air."""


class FeedForward:
    """The current that a motion will need: for the inertia, and for springs as far as they have been felt.

    A loop that is slowed is little stiffer than the finger: of a sine of 1 Hz two thirds were left. No
    rig file knows how stiff a finger is at the pulley, for that takes the cable's moment arms. So it is
    learned: the slope of the commanded current over the motor's angle, as their running means have it.
    Nothing is fed back: the wanted motion times bounded numbers cannot make a steady loop unsteady.

    Args:
        period: of a command, s. inertia: A for each rad/s^2.

    Attributes:
        slope: what was learned, A/rad, 0 to 3.
    """

    def __init__(self, period: float, inertia: float) -> None:
        self._share = 1.0 - math.exp(-period / LEARNING_S)
        self._inertia = inertia
        self.reset()

    def reset(self) -> None:
        """Nothing is known."""
        self.slope = self._angle = self._current = self._spread = self._together = self._pushed = 0.0
        self._wanted = math.nan

    def more(self, position: float, current: float, wanted: float, acceleration: float) -> float:
        """Current (A) by which the next command is to go beyond the last one, as far as is known beforehand.

        Args:
            position: of the motor, rad, under the last command's ``current``, A.
            wanted: angle while the next command acts, rad. acceleration: that is wanted, rad/s^2.
        """
        if self._wanted != self._wanted:  # the first of a motion
            self._wanted, self._angle, self._current = wanted, position, current
        self._learn(position, current - self._pushed)
        pushed = self._inertia * acceleration
        more = self.slope * (wanted - self._wanted) + pushed - self._pushed
        self._wanted, self._pushed = wanted, pushed
        return more

    def _learn(self, angle: float, current: float) -> None:
        share, off, more = self._share, angle - self._angle, current - self._current
        self._angle += share * off
        self._current += share * more
        self._spread += share * ((1.0 - share) * off * off - self._spread)
        self._together += share * ((1.0 - share) * off * more - self._together)
        slope = self._together / (self._spread + LEAST_MOTION**2)
        self.slope = min(max(slope, 0.0), LARGEST_SLOPE)


class PositionLoop:
    """Current command (A) from the position error (rad), once a command.

    Args:
        period: of a command, s.
    """

    def __init__(self, gains: Gains, period: float) -> None:
        self.gains, self.period = gains, period
        self._share = 1.0 - math.exp(-2.0 * math.pi * gains.derivative_cutoff_hz * period)
        self.reset()

    def change(self, gains: Gains, error: float) -> None:
        """Go on with other gains; the current (A) at this ``error`` (rad) stays what it is."""
        before = self.gains.proportional * error + self.gains.derivative * self._rate
        self._integral += before - gains.proportional * error - gains.derivative * self._rate
        self.gains = gains

    def reset(self) -> None:
        """Forget the past: no integral, no rate."""
        self._integral = self._rate = 0.0
        self._last: float | None = None

    def take_over(self, current: float) -> None:
        """Go on from a current (A) that something else has set."""
        self.reset()
        self._integral = current

    def command(self, error: float, beforehand: float = 0.0) -> float:
        """Current command, within the limit; the integral stands still while it is reached.

        Args:
            beforehand: A, by how much more is known to be needed than at the last command.
        """
        gains = self.gains
        if self._last is None:
            self._last = error
        self._rate += self._share * ((error - self._last) / self.period - self._rate)
        self._last = error
        limit = gains.current_limit
        self._integral = min(max(self._integral + beforehand, -limit), limit)
        wanted = gains.proportional * error + gains.derivative * self._rate + self._integral
        if wanted > limit:
            return limit
        if wanted < -limit:
            return -limit
        self._integral += gains.integral * error * self.period
        return wanted


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
