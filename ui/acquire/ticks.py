"""Round numbers along an axis. No Qt."""

from __future__ import annotations

import math
from functools import lru_cache

STEPS = (1.0, 2.0, 5.0, 10.0)


def tick_step(low: float, high: float, most: int) -> float:
    """The round step with at most ``most`` multiples on the way (two wherever that is possible); or 0."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return 0.0
    rough = span / max(most, 2)
    step = _round_up(rough)
    while math.floor(high / step + 1e-9) - math.ceil(low / step - 1e-9) < 1:
        rough /= 2
        step = _round_up(rough)
    return step


def _round_up(rough: float) -> float:
    """The smallest round step that is not below ``rough``."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(power * factor for factor in STEPS if power * factor >= rough * (1 - 1e-9))


@lru_cache(maxsize=64)
def round_ticks(low: float, high: float, most: int) -> tuple[tuple[float, str], ...]:
    """At most ``most`` round values (at least two wherever that is possible) and how they are written.

    Steps are 1, 2 or 5 times a power of ten.
    """
    step = tick_step(low, high, most)
    if not step:
        return ()
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple(
        (number * step, f"{number * step:.{digits}f}".replace("-", "−")) for number in range(first, last + 1)
    )
