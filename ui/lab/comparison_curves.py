"""Measured and modelled as they are drawn: runs whole, in units of the screen, with their words. No Qt."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.text import ScreenUnit, decimals_for, fixed, screen_unit
from fingerlab.diagnosis.answer.error_parts import Comparison, ExcludedInterval, equation_of
from fingerlab.report.score_words import ASIDE_WORDS, WEIGHED_LESS, aside_text
from fingerlab.sessions.model import Array

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
    """Values in units of the screen, the curves in that of ``units_of``: after a refit they stay in place."""
    residual = comparison.measured - comparison.modelled
    unit = screen_unit(comparison.unit, largest(comparison.measured)) if units_of is None else units_of.unit
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


def values_at(shown: ScaledComparison, index: int) -> tuple[str, ...]:
    """What is read at a sample, in wordings of which each is shorter."""
    at = float(shown.time[index])
    reasons = dict.fromkeys(a.reason for a in shown.comparison.aside if a.start <= at <= a.stop)
    aside = f" ({', '.join(ASIDE_WORDS.get(one, one) for one in reasons)})" if reasons else ""
    time = f"{fixed(at, 2)} s{aside}"
    if not np.isfinite(shown.residual[index]):
        return f"{time}: this equation says nothing here", f"{fixed(at, 2)} s: nothing said"
    floor = 0.3 * shown.comparison.floor
    decimals = decimals_for(floor * shown.unit.factor)
    measured, modelled = (fixed(float(s[index]), decimals) for s in (shown.measured, shown.modelled))
    residual = fixed(float(shown.residual[index]), decimals_for(floor * shown.residual_unit.factor))
    unit, rest = shown.unit.symbol, f"residual {residual} {shown.residual_unit.symbol}"
    bare = fixed(at, 2)
    return (
        f"{time}: measured {measured}, modelled {modelled} {unit}, {rest}",
        f"{bare} s: measured {measured}, modelled {modelled} {unit}, {rest}",
        f"{bare} s: {measured}, modelled {modelled} {unit}, {rest}",
        f"{bare} s: {measured} − {modelled} {unit} = {residual} {shown.residual_unit.symbol}",
        f"{bare} s: {rest}",
    )


def values_between(shown: ScaledComparison, times: tuple[float, float]) -> tuple[str, ...]:
    """What two cursors read: how far apart, and B less A of each curve; each wording shorter."""
    a, b = (int(np.clip(np.searchsorted(shown.time, t), 0, len(shown.time) - 1)) for t in times)
    change = times[1] - times[0]
    floor = 0.3 * shown.comparison.floor
    decimals = decimals_for(floor * shown.unit.factor), decimals_for(floor * shown.residual_unit.factor)

    def less(values: Array, digits: int) -> str:
        difference = float(values[b] - values[a])
        return f"{'+' if difference >= 0 else ''}{fixed(difference, digits)}"

    apart = f"B − A: {fixed(change, 3)} s"
    rate = f" ({1 / abs(change):.3g} Hz)" if change else ""
    measured, modelled = less(shown.measured, decimals[0]), less(shown.modelled, decimals[0])
    residual = f"{less(shown.residual, decimals[1])} {shown.residual_unit.symbol}"
    unit = shown.unit.symbol
    return (
        f"A {fixed(times[0], 3)} s, B {fixed(times[1], 3)} s, {apart}{rate}, measured {measured}, modelled "
        f"{modelled} {unit}, residual {residual}",
        f"{apart}{rate}, measured {measured}, modelled {modelled} {unit}, residual {residual}",
        f"{apart}, measured {measured} {unit}, residual {residual}",
        f"{apart}, residual {residual}",
    )


def ends(comparison: Comparison) -> tuple[float, float]:
    """Where the run begins and ends, s: what is left aside of it included."""
    time, aside = comparison.time, comparison.aside
    start = min([float(time[0]), *(one.start for one in aside)])
    return start, max([float(time[-1]), *(one.stop for one in aside)])


def stretches_of(comparison: Comparison | None, weighed: bool) -> tuple[ExcludedInterval, ...]:
    """What is weighed less in a run, or what is left aside of it."""
    aside = comparison.aside if comparison is not None else ()
    return tuple(one for one in aside if (one.reason in WEIGHED_LESS) is weighed)


def aside_words(comparison: Comparison, weighed: bool = False) -> str:
    """What is left aside of a run, or ``weighed`` less, with its share of it; empty where nothing is."""
    start, stop = ends(comparison)
    shares: dict[str, float] = {}
    for one in stretches_of(comparison, weighed):
        shares[one.reason] = shares.get(one.reason, 0.0) + (one.stop - one.start) / max(stop - start, 1e-9)
    return ", ".join(aside_text(name, share) for name, share in shares.items())


def describe(shown: ScaledComparison, floor: float) -> str:
    finite = shown.residual[np.isfinite(shown.residual)]
    rms = float(np.sqrt(np.mean(finite**2))) if len(finite) else 0.0
    decimals = decimals_for(floor * 0.3)
    return (
        f"{equation_of(shown.comparison.equation).quantity}, run {shown.comparison.run}: residual "
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
        aside=tuple(one for p in pieces for one in p.aside),
        coordinates={
            name: np.concatenate([part for p in pieces for part in (p.coordinates[name], _GAP)])
            for name in pieces[0].coordinates
        },
    )


_GAP: Array = np.array([np.nan])
