"""How late the program is, from the sample counter and a clock that knows nothing of the card's."""

from __future__ import annotations

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
