"""The current that makes an angle: gains, feed-forward, and the position loop."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fingerlab.core.errors import UserError


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
