"""Cutting a run into the periods of its trajectory, so that they can be laid on one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fingerlab.sessions.model import Array

SETTLE_S = 2.0
"""Left out at the start of a run, s: 1.5 s of start-up ramp and half a second of filter edge (assumed)."""

EDGE_S = 0.5
"""Left out at the end of a run, s: 2.5 periods of the 5 Hz filter, beyond its edge effect (assumed)."""

MINIMUM_PERIODS = 2
"""Fewer whole periods than this say nothing about repetition."""

MAXIMUM_UNREPEATED = 0.05
"""Largest share of the variance that may differ between periods of a periodic trajectory (assumed)."""


@dataclass(frozen=True)
class PeriodGrid:
    """Whole periods of a run: ``count`` periods of ``period`` samples (may be fractional) from ``start``."""

    start: float
    period: float
    count: int

    @property
    def phases(self) -> int:
        """Number of phases that one folded period has: the period in samples, rounded."""
        return max(round(self.period), 1)

    def fold(self, values: Array, shift: float = 0.0) -> Array:
        """Lay the periods under one another, shape (count, phases), unit of ``values``.

        Args:
            values: shape (n,), the whole run.
            shift: samples by which the signal is delayed first: row p, phase j holds the signal at
                ``start + p period + j - shift``. Rows that would need samples outside the run are NaN.
        """
        first = self.start - shift
        if self.period == self.phases and first == int(first):
            return self._slice(values, int(first))
        index = first + self.period * (
            np.arange(self.count)[:, None] + np.arange(self.phases)[None, :] / self.phases
        )
        folded = np.interp(index, np.arange(len(values)), values)
        outside = (index < 0) | (index > len(values) - 1)
        folded[outside.any(axis=1)] = np.nan
        return np.asarray(folded)

    def _slice(self, values: Array, first: int) -> Array:
        m = self.phases
        if first >= 0 and first + self.count * m <= len(values):
            return values[first : first + self.count * m].reshape(self.count, m)
        folded = np.full((self.count, m), np.nan)
        for row in range(self.count):
            begin = first + row * m
            if begin >= 0 and begin + m <= len(values):
                folded[row] = values[begin : begin + m]
        return folded

    def mean(self, values: Array, shift: float = 0.0) -> Array:
        """The average period, shape (phases,), over the rows of :meth:`fold` that are whole."""
        folded = self.fold(values, shift)
        whole = np.isfinite(folded).all(axis=1)
        return np.asarray(folded[whole].mean(axis=0)) if whole.any() else np.full(self.phases, np.nan)


def usable(length: int, sample_rate_hz: float) -> tuple[int, int]:
    """First and one-past-last sample of a run without start-up and filter edge; empty where too short."""
    start = int(np.ceil(SETTLE_S * sample_rate_hz))
    return start, max(start, length - int(np.ceil(EDGE_S * sample_rate_hz)))


def period_grid(length: int, sample_rate_hz: float, frequency_hz: float) -> PeriodGrid | None:
    """Whole periods of ``frequency_hz`` inside the usable part of a run, in step with its first sample.

    Returns:
        The grid, or None where fewer than ``MINIMUM_PERIODS`` whole periods are left.
    """
    if not 0 < frequency_hz < sample_rate_hz / 4:
        return None
    period = sample_rate_hz / frequency_hz
    if abs(period - round(period)) < 1e-6 * period:
        # A rate worked out from time stamps is a hair off; a millionth of a period is no phase error.
        period = float(round(period))
    start, stop = usable(length, sample_rate_hz)
    first = np.ceil(start / period - 1e-9) * period
    count = int(np.floor((stop - first) / period + 1e-9))
    return PeriodGrid(float(first), period, count) if count >= MINIMUM_PERIODS else None


def settles(values: Array, grid: PeriodGrid) -> bool:
    """Whether a signal comes to repeat with the grid's period: its later half does, about a mean that moves.

    A finger that presses settles for a few seconds, in which :func:`repeats` would not know the period.
    """
    cycles = grid.fold(values)[grid.count // 2 :]
    cycles = cycles - cycles.mean(axis=1, keepdims=True)
    spread = float(np.var(cycles))
    return spread > 0 and float(np.mean(np.var(cycles, axis=0))) <= MAXIMUM_UNREPEATED * spread


def repeats(values: Array, grid: PeriodGrid) -> bool:
    """Whether a signal truly repeats with the grid's period, and moves at all.

    A chirp also names a frequency; only the recording tells whether it is a period.
    """
    folded = grid.fold(values)
    total = float(np.var(folded))
    if not total > 0:
        return False
    return float(np.mean(np.var(folded, axis=0))) <= MAXIMUM_UNREPEATED * total
