"""Measured and modelled as they are drawn: runs whole, in units of the screen, with their words. No Qt."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.text import ScreenUnit, decimals_for, fixed, screen_unit
from fingerlab.diagnosis.answer.results import Comparison
from fingerlab.sessions.model import Array

from .result_words import equation_text

MARGIN = 0.06
"""Share of the value range left free above and below the curves."""


@dataclass(frozen=True)
class ScaledComparison:
    """Curves of shape (n,): time in s, the others in ``unit``, the residual in ``residual_unit``."""

    comparison: Comparison
    unit: ScreenUnit
    residual_unit: ScreenUnit
    time: Array
    measured: Array
    modelled: Array
    residual: Array


def scaled(comparison: Comparison, units_of: ScaledComparison | None) -> ScaledComparison:
    """Values in units of the screen; in those of ``units_of`` so that a refit is seen on the same scale."""
    residual = comparison.measured - comparison.modelled
    if units_of is not None:
        unit, residual_unit = units_of.unit, units_of.residual_unit
    else:
        unit = screen_unit(comparison.unit, largest(comparison.measured))
        residual_unit = screen_unit(comparison.unit, max(largest(residual), comparison.floor))
    return ScaledComparison(
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


def values_at(shown: ScaledComparison, index: int) -> str:
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


def describe(shown: ScaledComparison, floor: float) -> str:
    finite = shown.residual[np.isfinite(shown.residual)]
    rms = float(np.sqrt(np.mean(finite**2))) if len(finite) else 0.0
    decimals = decimals_for(floor * 0.3)
    return (
        f"{equation_text(shown.comparison.equation).quantity}, run {shown.comparison.run}: residual "
        f"{fixed(rms, decimals)} {shown.residual_unit.symbol} root mean square, "
        f"floor {fixed(floor, decimals)}."
    )


def run_key(comparison: Comparison) -> str:
    """Session and run in one text: Qt hands back a tuple as a list, a text as it is."""
    return f"{comparison.session}\n{comparison.run}"


def joined(comparisons: Iterable[Comparison]) -> dict[tuple[str, str], Comparison]:
    """One comparison for each equation and run, by equation and ``run_key``.

    Stretches of one run follow one another in time, with a gap between them. The floor is the mean over
    the samples.
    """
    parts: dict[tuple[str, str], list[Comparison]] = {}
    for comparison in comparisons:
        parts.setdefault((comparison.equation, run_key(comparison)), []).append(comparison)
    return {key: pieces[0] if len(pieces) == 1 else _join(pieces) for key, pieces in parts.items()}


def _join(pieces: list[Comparison]) -> Comparison:
    pieces = sorted((p for p in pieces if len(p.time)), key=lambda p: float(p.time[0]))
    counts = [len(p.time) for p in pieces]
    times, measured, modelled = [], [], []
    for piece in pieces:
        # The gap is one sample of "nothing" at the end of each stretch; time itself never holds NaN.
        times += [piece.time, piece.time[-1:]]
        measured += [piece.measured, _GAP]
        modelled += [piece.modelled, _GAP]
    return replace(
        pieces[0],
        time=np.concatenate(times),
        measured=np.concatenate(measured),
        modelled=np.concatenate(modelled),
        floor=float(np.average([p.floor for p in pieces], weights=counts)),
        held_out=all(p.held_out for p in pieces),
        coordinates={
            name: np.concatenate([part for p in pieces for part in (p.coordinates[name], _GAP)])
            for name in pieces[0].coordinates
        },
    )


_GAP: Array = np.array([np.nan])
