"""Where a device takes its time from, and how late the program is by it."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds from any origin, and a way to wait."""

    def now(self) -> float: ...

    def sleep(self, seconds: float) -> None: ...


class RealClock:
    """The machine's monotonic clock, which nobody can set."""

    def now(self) -> float:
        return time.perf_counter()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class VirtualClock:
    """Time that passes only when somebody waits, or says so."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += max(seconds, 0.0)

    def step(self, seconds: float) -> None:
        """Set the clock forward or back, as a person or a time server does."""
        self._now += seconds


DRIFT = 200e-6
"""How much two quartz clocks may differ: 50 ppm for each data sheet, doubled (assumed)."""

STEP = 1.0
"""s; a jump this large is the clock being set or the machine having slept, not lateness (assumed)."""


class LatenessMeter:
    """Lateness against the most punctual cycle so far.

    Neither clock knows when the card took its first sample, so that the origin is learnt: no cycle can
    be early, hence the earliest one seen sets it. It gives way by ``DRIFT``, so that a slow clock is not
    taken for a late program.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period = 1.0 / rate_hz
        self._origin: float | None = None
        self._index = 0

    def late_by(self, index: int, now: float) -> float:
        """Seconds by which sample ``index`` was read later than the most punctual ones, at ``now``."""
        origin = now - index * self._period
        if self._origin is None:
            self._origin, self._index = origin, index
            return 0.0
        self._origin += DRIFT * self._period * (index - self._index)
        self._index = index
        late = origin - self._origin
        if late < 0.0:
            self._origin = origin
            return 0.0
        if late > STEP:  # from here on lateness counts from the clock as it now is
            self._origin = origin
        return late
