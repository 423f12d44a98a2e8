"""Numbers with as many digits as their uncertainty allows."""

from __future__ import annotations

import math

from fingerlab.identify.results import ParameterEstimate

from .units import screen_unit

MINUS = "−"
ASYMMETRY = 1.5
"""An interval whose sides differ by more than this factor is written out instead of as ±."""


def decimals_for(uncertainty: float) -> int:
    """Decimals that an uncertainty allows: its first digit, or two digits where the first is 1."""
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 3
    exponent = math.floor(math.log10(uncertainty))
    first = uncertainty / 10.0**exponent
    return max(0, -exponent + (1 if first < 1.95 else 0))


def fixed(value: float, decimals: int) -> str:
    """A number with that many decimals and a real minus sign; never "−0"."""
    text = f"{value:.{decimals}f}"
    if not text.strip("-0."):
        text = text.lstrip("-")
    return text.replace("-", MINUS)


def estimate_text(estimate: ParameterEstimate) -> str:
    """``4.8 ± 0.2 mN m``; a lopsided interval as ``4.8 (4.1 to 7.2) mN m``."""
    largest = max(abs(v) for v in (estimate.value, estimate.low, estimate.high) if math.isfinite(v))
    unit = screen_unit(estimate.unit, largest)
    value, low, high = (v * unit.factor for v in (estimate.value, estimate.low, estimate.high))
    gap = "" if unit.symbol.startswith("°") else " "
    tail = f"{gap}{unit.symbol}" if unit.symbol else ""
    if not (math.isfinite(low) and math.isfinite(high)) or high <= low:
        return f"{significant(value, 3)}{tail}"
    below, above = value - low, high - value
    decimals = decimals_for((high - low) / 2.0)
    if min(below, above) <= 0 or max(below, above) > ASYMMETRY * min(below, above):
        decimals = decimals_for(max(min(below, above), (high - low) / 10.0))
        return f"{fixed(value, decimals)} ({fixed(low, decimals)} to {fixed(high, decimals)}){tail}"
    return f"{fixed(value, decimals)} ± {fixed((high - low) / 2.0, decimals)}{tail}"


def significant(value: float, digits: int) -> str:
    """A number rounded to ``digits`` significant digits, without exponent where it reads well."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "not a number"
    exponent = math.floor(math.log10(abs(value)))
    if not -4 <= exponent <= 6:
        return f"{value:.{digits - 1}e}".replace("-", MINUS)
    return fixed(value, max(0, digits - 1 - exponent))


def score_text(score: float) -> str:
    """An error in multiples of the floor."""
    if not math.isfinite(score):
        return "not a number"
    return fixed(score, 0 if score >= 100 else 1 if score >= 10 else 2)


def percent(share: float) -> str:
    """A probability in per cent, never a false 0 or 100."""
    if share > 0.995:
        return "> 99 %"
    if share < 0.005:
        return "< 1 %"
    return f"{round(100 * share)} %"
