"""From SI to what an operator reads: degrees, millinewton metres, millimetres."""

from __future__ import annotations

import math
from dataclasses import dataclass

DEGREES = 180.0 / math.pi


@dataclass(frozen=True)
class ScreenUnit:
    """A unit on the screen: its symbol, and the number that SI values are multiplied by."""

    symbol: str
    factor: float

    def label(self, quantity: str) -> str:
        """An axis label: quantity and unit."""
        return f"{quantity} ({self.symbol})" if self.symbol else quantity


def screen_unit(si: str, largest: float) -> ScreenUnit:
    """The unit in which values up to ``largest`` (in the SI unit ``si``) read well.

    A unit that is not known is shown as it is.
    """
    si = si.strip()
    if si in ("", "1"):
        return ScreenUnit("", 1.0)
    if si == "m" or si.startswith(("m/", "m ")):
        prefix = "µ" if si == "m" and 0 < largest < 2e-5 else "m"
        return ScreenUnit(prefix + _pretty(si), 1e6 if prefix == "µ" else 1e3)
    if si == "rad" or si.startswith("rad/"):
        return ScreenUnit("°" + _pretty(si[3:]), DEGREES)
    if si == "deg":
        return ScreenUnit("°", 1.0)
    if si == "1/rad":
        return ScreenUnit("1/°", 1.0 / DEGREES)
    if si == "kg":
        return ScreenUnit("g", 1e3)
    if si in ("kg m^2", "kg m²"):
        return ScreenUnit("g cm²", 1e7)
    if si == "s":
        return ScreenUnit("ms", 1e3) if largest < 1.0 else ScreenUnit("s", 1.0)
    if si.startswith(("N", "A", "V")) and 0 < largest < 0.5:
        prefix, factor = ("µ", 1e6) if largest < 2e-4 else ("m", 1e3)
        return ScreenUnit(prefix + _pretty(si), factor)
    return ScreenUnit(_pretty(si), 1.0)


def _pretty(si: str) -> str:
    return si.replace("^2", "²").replace("^3", "³").replace("*", " ")
