"""Numbers with their uncertainty, in words: as many digits as the interval allows."""

from __future__ import annotations

import math

from fingerlab.models.file import ParameterEstimate

SCREEN_UNITS = {"m": ("mm", 1e3), "N m": ("mN m", 1e3), "s": ("ms", 1e3)}
"""Units shown in place of SI ones, with the factor."""


def in_words(estimate: ParameterEstimate, with_unit: bool = True) -> str:
    """``value ± half interval unit`` in the unit of the screen, such as ``10.8 ± 0.4 mm``."""
    unit, factor = SCREEN_UNITS.get(estimate.unit, (estimate.unit, 1.0))
    text = plus_minus(factor * estimate.value, factor * (estimate.high - estimate.low) / 2.0)
    return f"{text} {unit}" if with_unit and unit not in ("1", "") else text


def plus_minus(value: float, half: float) -> str:
    """``value ± half`` rounded to the first digit of ``half`` (two where it begins with 1).

    Without a finite ``half`` the value alone, to four digits; a dash where there is no value.
    """
    if not math.isfinite(value):
        return "–"
    if not math.isfinite(half) or half <= 0:
        return f"{value:.4g}"
    exponent = math.floor(math.log10(half))
    digits = -exponent + (1 if half / 10.0**exponent < 1.95 else 0)
    if (digits > 6 and abs(value) < 1e-3) or exponent > 5:
        power = max(math.floor(math.log10(max(abs(value), half))), exponent)
        mantissa = plus_minus(value / 10.0**power, half / 10.0**power)
        return f"({mantissa})·10^{power}"
    value = value if round(value, digits) else 0.0  # no "-0"
    return f"{round(value, digits):.{max(digits, 0)}f} ± {round(half, digits):.{max(digits, 0)}f}"


def number(value: float, digits: int = 3) -> str:
    """A number with fixed decimals, a dash where there is none."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


def mean_and_deviation(mean: float, deviation: float, digits: int = 3) -> str:
    """``mean ± deviation`` of single results with fixed decimals: a spread is no uncertainty of the mean."""
    if not math.isfinite(mean):
        return "–"
    return (
        f"{number(mean, digits)} ± {number(deviation, digits)}"
        if math.isfinite(deviation)
        else number(mean, digits)
    )
