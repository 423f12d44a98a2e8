"""The position loop over the current command: PID with a filtered derivative and anti-windup."""

from __future__ import annotations

import math
from dataclasses import dataclass


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


def slowed(gains: Gains, cycles: int) -> Gains:
    """Gains for a loop that sets its command only every ``cycles`` samples, with the delay of as many.

    The bandwidth falls with the square root: 12 Hz become 4 Hz at ten samples, where a delay of 15 ms costs
    21 degrees of phase. The integral keeps its time, or the finger's springs would hold the motor back from
    where it is to be for seconds. Assumed.
    """
    share = cycles**-0.5
    return Gains(
        gains.proportional * share**2,
        gains.integral * share**2,
        gains.derivative * share,
        gains.derivative_cutoff_hz,
        gains.current_limit,
    )


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


class PositionLoop:
    """Current command (A) from the position error (rad), once a sample."""

    def __init__(self, gains: Gains, period: float) -> None:
        self.gains, self.period = gains, period
        self._share = 1.0 - math.exp(-2.0 * math.pi * gains.derivative_cutoff_hz * period)
        self.reset()

    def reset(self) -> None:
        """Forget the past: no integral, no rate."""
        self._integral = self._rate = 0.0
        self._last: float | None = None

    def take_over(self, current: float) -> None:
        """Go on from a current (A) that something else has set."""
        self.reset()
        self._integral = current

    def command(self, error: float) -> float:
        """Current command, within the limit; the integral stands still while it is reached."""
        gains = self.gains
        if self._last is None:
            self._last = error
        self._rate += self._share * ((error - self._last) / self.period - self._rate)
        self._last = error
        wanted = gains.proportional * error + gains.derivative * self._rate + self._integral
        limit = gains.current_limit
        if wanted > limit:
            return limit
        if wanted < -limit:
            return -limit
        self._integral += gains.integral * error * self.period
        return wanted
