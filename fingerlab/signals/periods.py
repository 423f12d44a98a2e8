"""A run in its periods: folded, averaged, parted into regions, and delays between averages.

Regions are those of thesis section 4.1: flexion, extension, and the standstills after each. Delays are those
of section 4.2. Sign: **positive means that the joint angles (LHS) come later than the cable tension.** A
signal delayed by d is ``x(t - d)``: tension is shifted by the delay before it is compared with the LHS. The
tension must come in with the sign of its cable (s T), so that both signals rise together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

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


Region = Literal["flexion", "static_1", "extension", "static_2"]
Labels = np.ndarray[Any, np.dtype[np.int8]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

REGIONS: tuple[Region, ...] = ("flexion", "static_1", "extension", "static_2")
"""A label is an index into this: static 1 follows flexion, static 2 follows extension."""

REGION_TITLES = {
    "flexion": "flexion",
    "static_1": "static 1",
    "extension": "extension",
    "static_2": "static 2",
    "whole": "whole run",
}

THRESHOLDS_PERCENT = (10, 20, 30)
"""Thresholds that the thesis tried, per cent of the joint's speed range (sections 4.1 and 4.2)."""

MINIMUM_SHARE = 0.02
"""Smallest share of a period that makes a region (assumed; the thesis says "a sufficient number")."""

_FLEXION, _STATIC_1, _EXTENSION, _STATIC_2 = range(4)


def speed_threshold(mean_speed: Array, percent: float) -> float:
    """Threshold in rad/s: ``percent`` of the range (maximum less minimum) of the average joint speed.

    Args:
        mean_speed: joint speed averaged over the periods, rad/s, shape (phases,).
    """
    return float(percent / 100.0 * np.ptp(mean_speed))


def recognise(mean_speed: Array, threshold: float) -> Labels:
    """Label each phase of the average period by its speed.

    Above ``+threshold`` is flexion, below ``-threshold`` extension; what lies between is static 1 where
    the last motion was flexion and static 2 where it was extension, round the period's end. A period
    that never leaves the thresholds (the contact runs under the on-air thresholds, thesis figure 4.7)
    follows no motion and is static 1 throughout.

    Args:
        mean_speed: rad/s, flexion positive, shape (phases,). threshold: rad/s, at least 0.

    Returns:
        Index into ``REGIONS``, shape (phases,).
    """
    labels = np.full(mean_speed.shape, _STATIC_1, dtype=np.int8)
    flexing, extending = mean_speed > threshold, mean_speed < -threshold
    labels[flexing], labels[extending] = _FLEXION, _EXTENSION
    moving = np.flatnonzero(flexing | extending)
    still = np.flatnonzero(~(flexing | extending))
    if len(moving) and len(still):
        # searchsorted gives the motion before each still phase; -1 wraps to the period's last motion.
        last = moving[np.searchsorted(moving, still) - 1]
        labels[still] = np.where(labels[last] == _FLEXION, _STATIC_1, _STATIC_2)
    return labels


def region_mask(labels: Labels, region: Region) -> Mask | None:
    """Phases of a region, shape (phases,); None where they are too few to make one (a missing bar)."""
    mask = labels == REGIONS.index(region)
    return mask if mask.sum() >= max(MINIMUM_SHARE * len(labels), 3) else None


def consecutive_mask(labels: Labels, region: Region) -> Mask | None:
    """The longest unbroken stretch of a region, round the period's end; None where it is too short.

    Section 4.2 needs consecutive samples, because a stretch of signal is searched for as a whole.
    """
    start, length = longest_stretch(labels == REGIONS.index(region))
    if length < max(MINIMUM_SHARE * len(labels), 3):
        return None
    mask = np.zeros(len(labels), dtype=bool)
    mask[np.arange(start, start + length) % len(labels)] = True
    return mask


def longest_stretch(mask: Mask) -> tuple[int, int]:
    """Start and length of the longest run of True on a circle; (0, 0) where there is none."""
    n = len(mask)
    if not mask.any():
        return 0, 0
    if mask.all():
        return 0, n
    origin = int(np.flatnonzero(~mask)[0])  # a False to start from, so that no stretch crosses the seam
    edges = np.diff(np.concatenate(([0], np.roll(mask, -origin).astype(np.int8), [0])))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    best = int(np.argmax(ends - begins))
    return (int(begins[best]) + origin) % n, int(ends[best] - begins[best])


def normalise(values: Array) -> Array:
    """Scaled to run from 0 to 1, same shape, no unit; all zero where the signal does not move."""
    span = np.nanmax(values) - np.nanmin(values)
    return np.asarray((values - np.nanmin(values)) / span if span > 0 else np.zeros_like(values))


def cross_correlation_delay(lhs: Array, signed_tension: Array) -> int:
    """Delay of one average period against another at the peak of their cross-correlation, samples.

    The period is a circle here. Matlab's ``finddelay``, which the thesis used, does not wrap round:
    the overlap shrinks as the shift grows, and the answer depends on where the period was cut;
    :func:`finddelay` is that reading.

    Args:
        lhs, signed_tension: one average period each, shape (phases,), any units.

    Returns:
        Samples in (-phases/2, phases/2], positive where ``lhs`` is later.
    """
    spectrum = np.fft.rfft(lhs - lhs.mean()) * np.conj(np.fft.rfft(signed_tension - signed_tension.mean()))
    return _signed(int(np.argmax(np.fft.irfft(spectrum, len(lhs)))), len(lhs))


def finddelay(lhs: Array, signed_tension: Array, longest: int | None = None) -> int:
    """Delay at the peak of the cross-correlation without wrapping, samples, after Matlab's function.

    Both are brought to zero mean and unit deviation first. Biased towards zero by up to a fifth for a
    single period; the bias vanishes for a stretch that is long against the delay.

    Args:
        lhs, signed_tension: shape (n,), any units. longest: largest delay looked for, samples; n - 1 if None.
    """
    a = (lhs - lhs.mean()) / (lhs.std() or 1.0)
    b = (signed_tension - signed_tension.mean()) / (signed_tension.std() or 1.0)
    n = len(a)
    from scipy.fft import next_fast_len  # slow to import

    size = next_fast_len(2 * n)
    correlation = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)
    reach = n - 1 if longest is None else min(longest, n - 1)
    lags = np.arange(-reach, reach + 1)
    return int(lags[np.argmax(correlation[lags])])


def findsignal_delay(lhs: Array, signed_tension: Array, region: Mask) -> int:
    """Delay at which one region of the LHS lies closest to the tension, samples.

    Minimises the squared distance between the stretch of the normalised average LHS and the
    normalised average tension, as Matlab's ``findsignal`` does, with the period as a circle.

    Args:
        lhs, signed_tension: one average period each, shape (phases,), any units.
        region: phases that belong to the region, shape (phases,); its longest stretch counts.

    Returns:
        Samples in (-phases/2, phases/2], positive where ``lhs`` is later.
    """
    n = len(lhs)
    start, length = longest_stretch(region)
    weight = np.zeros(n)
    weight[np.arange(start, start + length) % n] = 1.0
    y, x = normalise(lhs), normalise(signed_tension)
    # sum of w(k) (y(k) - x(k-d))^2 over k, for every d at once; the term in y alone does not move.
    cross = np.fft.irfft(np.fft.rfft(weight * y) * np.conj(np.fft.rfft(x)), n)
    power = np.fft.irfft(np.fft.rfft(weight) * np.conj(np.fft.rfft(x**2)), n)
    return _signed(int(np.argmin(power - 2.0 * cross)), n)


def _signed(lag: int, n: int) -> int:
    return lag - n if lag > n // 2 else lag
