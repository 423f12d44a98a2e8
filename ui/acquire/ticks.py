"""Round numbers along an axis. No Qt."""

from __future__ import annotations

import math

STEPS = (1.0, 2.0, 5.0, 10.0)


def round_ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """At most ``most`` round values (at least two wherever that is possible) and how they are written.

    Steps are 1, 2 or 5 times a power of ten.
    """
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return []
    rough = span / max(most, 2)
    ticks = _multiples(low, high, rough)
    while len(ticks) < 2:
        rough /= 2
        ticks = _multiples(low, high, rough)
    return ticks


def _multiples(low: float, high: float, rough: float) -> list[tuple[float, str]]:
    """Multiples of the smallest round step that is not below ``rough``."""
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in STEPS if power * factor >= rough * (1 - 1e-9))
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [
        (number * step, f"{number * step:.{digits}f}".replace("-", "−")) for number in range(first, last + 1)
    ]
