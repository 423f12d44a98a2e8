"""Straight lines through clouds that need not be kept: sums per block, added up later.

Interval of a coefficient (90 %). Neighbouring samples of a low-passed signal are not independent, so
the variance has two parts. *What differs between blocks* (periods within a run, runs when several are
pooled) enters by the cluster-robust sandwich estimator, which allows any correlation inside a block
(Liang and Zeger 1986); the quantile is Student's t with blocks - 1 degrees of freedom. *What repeats in
every period* is misfit of the model that no further period averages away: it counts once, as the
low-pass leaves two independent values per cycle of its cut-off (2 x 5 Hz) and not as many as samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.core.text import ParameterEstimate
from fingerlab.sessions.model import Array
from fingerlab.signals.prepare import THESIS_CUTOFF_HZ

CONFIDENCE = 0.90


@dataclass(frozen=True)
class RegressionSums:
    """Counts, means and centred sums of x and y over blocks; every array of shape (blocks,)."""

    count: Array
    mean_x: Array
    mean_y: Array
    xx: Array
    xy: Array
    yy: Array

    @classmethod
    def of_rows(cls, x: Array, y: Array) -> RegressionSums:
        """One block a row, from x and y of shape (rows, samples); rows that hold NaN are left out."""
        whole = np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)
        if not whole.all():
            x, y = x[whole], y[whole]
        mean_x, mean_y = x.mean(axis=1), y.mean(axis=1)
        dx, dy = x - mean_x[:, None], y - mean_y[:, None]
        count = np.full(len(x), float(x.shape[1]))
        return cls(count, mean_x, mean_y, _dot(dx, dx), _dot(dx, dy), _dot(dy, dy))

    @classmethod
    def joined(cls, parts: Sequence[RegressionSums]) -> RegressionSums:
        """All blocks of all parts, one after another."""
        names = ("count", "mean_x", "mean_y", "xx", "xy", "yy")
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))

    def __len__(self) -> int:
        return len(self.count)

    def merged(self) -> RegressionSums:
        """The same samples as one block (parallel-axis theorem, no loss of digits to large means)."""
        n = self.count.sum()
        mx, my = float(self.count @ self.mean_x / n), float(self.count @ self.mean_y / n)
        dx, dy = self.mean_x - mx, self.mean_y - my
        sums = (
            n,
            mx,
            my,
            self.xx.sum() + self.count @ dx**2,
            self.xy.sum() + self.count @ (dx * dy),
            self.yy.sum() + self.count @ dy**2,
        )
        return RegressionSums(*(np.array([float(v)]) for v in sums))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", a, b))


@dataclass(frozen=True)
class Misfit:
    """The part of a fit's residual that repeats in every period.

    Attributes:
        variance: its mean square, (unit of y)^2. independent: independent values in one period's region.
    """

    variance: float
    independent: float


@dataclass(frozen=True)
class RegressionLine:
    """``y = slope x + intercept`` by least squares, with standard errors and R2 (4.1).

    ``covariance`` is that of slope and intercept, from which follows how sure the line is at each x.
    """

    slope: float
    intercept: float
    r2: float
    slope_error: float
    intercept_error: float
    freedom: int
    samples: int
    blocks: int
    covariance: float

    def half_width(self, x: Array) -> Array:
        """Half the 90 % interval of the line at each x, same shape, unit of y; NaN for a single block."""
        if self.freedom < 1:
            return np.full_like(x, np.nan)
        variance = self.intercept_error**2 + 2.0 * x * self.covariance + x**2 * self.slope_error**2
        return quantile(self.freedom) * np.sqrt(np.maximum(variance, 0.0))

    def slope_estimate(self, unit: str, sign: float = 1.0) -> ParameterEstimate:
        """``sign`` times the slope with its 90 % interval."""
        return self._estimate(sign * self.slope, self.slope_error, unit)

    def intercept_estimate(self, unit: str) -> ParameterEstimate:
        """The intercept with its 90 % interval."""
        return self._estimate(self.intercept, self.intercept_error, unit)

    def _estimate(self, value: float, error: float, unit: str) -> ParameterEstimate:
        half = error * quantile(self.freedom) if self.freedom > 0 else np.nan
        return ParameterEstimate(value, unit, value - half, value + half)


def quantile(freedom: int) -> float:
    """Student's t that leaves 5 % on either side."""
    from scipy.stats import t as student  # slow to import

    return float(student.ppf(0.5 + CONFIDENCE / 2, freedom))


def fit_line(blocks: RegressionSums, misfit: Misfit | None = None) -> RegressionLine | None:
    """Least-squares line through the samples behind ``blocks``; None where x does not vary."""
    if len(blocks) == 0:
        return None
    total = blocks.merged()
    n, mx, my = total.count[0], total.mean_x[0], total.mean_y[0]
    sxx, sxy, syy = total.xx[0], total.xy[0], total.yy[0]
    if n < 3 or not sxx > 1e-18 * n * max(mx**2, 1e-300):
        return None
    slope = sxy / sxx
    residual = max(syy - slope * sxy, 0.0)
    # Scores of each block about the overall mean of x, where slope and level are uncorrelated.
    offset = blocks.mean_x - mx
    error = blocks.mean_y - my - slope * offset
    level_score = blocks.count * error
    slope_score = blocks.xy - slope * blocks.xx + offset * level_score
    g = len(blocks)
    scale = g / (g - 1.0) if g > 1 else np.nan
    slope_variance = scale * float(slope_score @ slope_score) / sxx**2
    level_variance = scale * float(level_score @ level_score) / n**2
    cross = scale * float(slope_score @ level_score) / (sxx * n)
    if misfit is not None:
        spread = misfit.variance / max(misfit.independent - 2.0, 1.0)
        slope_variance += spread / (sxx / n)
        level_variance += spread
    intercept_variance = level_variance + mx**2 * slope_variance - 2.0 * mx * cross
    return RegressionLine(
        slope=float(slope),
        intercept=float(my - slope * mx),
        r2=float(1.0 - residual / syy) if syy > 0 else float("nan"),
        slope_error=float(np.sqrt(slope_variance)),
        intercept_error=float(np.sqrt(max(intercept_variance, 0.0))),
        freedom=g - 1,
        samples=int(n),
        blocks=g,
        covariance=float(cross - mx * slope_variance),
    )


def repeating_misfit(
    x: Array, y: Array, line: RegressionLine, seconds: float, cutoff_hz: float = THESIS_CUTOFF_HZ
) -> Misfit:
    """Misfit that the average period still shows, from its samples in one region.

    Args:
        x, y: the average period inside the region, shape (k,). seconds: how long the region lasts.
        cutoff_hz: of the filter, Hz, to which the samples are as good as two a period.
    """
    error = y - line.slope * x - line.intercept
    return Misfit(float(np.mean(error**2)), 2.0 * cutoff_hz * seconds)


def coefficient_of_determination(measured: Array, modelled: Array) -> float:
    """R2 of (4.1) over the samples where both are numbers; NaN where nothing varies."""
    both = np.isfinite(measured) & np.isfinite(modelled)
    if both.sum() < 2:
        return float("nan")
    y, f = measured[both], modelled[both]
    total = float(np.sum((y - y.mean()) ** 2))
    return 1.0 - float(np.sum((y - f) ** 2)) / total if total > 0 else float("nan")
