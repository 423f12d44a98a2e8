"""A comparison in units of the screen, and what is said of it. No Qt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fingerlab.core.text import ScreenUnit, decimals_for, fixed, screen_unit
from fingerlab.diagnosis.answer.results import Comparison
from fingerlab.sessions.model import Array

from .equations import equation_text

MARGIN = 0.06
"""Share of the value range left free above and below the curves."""


@dataclass(frozen=True)
class Shown:
    """Curves of shape (n,): time in s, the others in ``unit``, the residual in ``residual_unit``."""

    comparison: Comparison
    unit: ScreenUnit
    residual_unit: ScreenUnit
    time: Array
    measured: Array
    modelled: Array
    residual: Array


def scale(comparison: Comparison, units_of: Shown | None) -> Shown:
    """Values in units of the screen; in those of ``units_of`` so that a refit is seen on the same scale."""
    residual = comparison.measured - comparison.modelled
    if units_of is not None:
        unit, residual_unit = units_of.unit, units_of.residual_unit
    else:
        unit = screen_unit(comparison.unit, largest(comparison.measured))
        residual_unit = screen_unit(comparison.unit, max(largest(residual), comparison.floor))
    return Shown(
        comparison,
        unit,
        residual_unit,
        comparison.time,
        comparison.measured * unit.factor,
        comparison.modelled * unit.factor,
        residual * residual_unit.factor,
    )


def largest(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if len(finite) else 0.0


def limits(values: Array) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    margin = MARGIN * (high - low) or abs(high) or 1.0
    return low - margin, high + margin


def values_at(shown: Shown, index: int) -> str:
    time = f"{fixed(float(shown.time[index]), 2)} s"
    if not np.isfinite(shown.residual[index]):
        return f"{time}: this equation says nothing here"
    floor = 0.3 * shown.comparison.floor
    decimals = decimals_for(floor * shown.unit.factor)
    measured, modelled = (fixed(float(s[index]), decimals) for s in (shown.measured, shown.modelled))
    residual = fixed(float(shown.residual[index]), decimals_for(floor * shown.residual_unit.factor))
    return (
        f"{time}: measured {measured}, modelled {modelled} {shown.unit.symbol}, "
        f"residual {residual} {shown.residual_unit.symbol}"
    )


def describe(shown: Shown, floor: float) -> str:
    finite = shown.residual[np.isfinite(shown.residual)]
    rms = float(np.sqrt(np.mean(finite**2))) if len(finite) else 0.0
    decimals = decimals_for(floor * 0.3)
    return (
        f"{equation_text(shown.comparison.equation).quantity}, run {shown.comparison.run}: residual "
        f"{fixed(rms, decimals)} {shown.residual_unit.symbol} root mean square, "
        f"floor {fixed(floor, decimals)}."
    )
