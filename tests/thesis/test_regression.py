"""Sums, lines and intervals against numpy, scipy and repeated draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal, stats

from fingerlab.thesis.traces import (
    RegressionSums,
    coefficient_of_determination,
    fit_line,
    repeating_misfit,
)


def test_line_is_polyfit_and_r2_is_scipys() -> None:
    random = np.random.default_rng(1)
    x = random.normal(50.0, 2.0, (7, 300))
    y = 0.3 * x - 4 + random.normal(size=x.shape)
    line = fit_line(RegressionSums.of_rows(x, y))
    assert line is not None
    slope, intercept = np.polyfit(x.ravel(), y.ravel(), 1)
    assert line.slope == pytest.approx(slope, rel=1e-10)
    assert line.intercept == pytest.approx(intercept, rel=1e-10)
    assert line.r2 == pytest.approx(stats.linregress(x.ravel(), y.ravel()).rvalue ** 2, rel=1e-10)
    assert line.samples == x.size


def test_sums_added_up_are_the_sums_of_everything() -> None:
    random = np.random.default_rng(2)
    x, y = random.normal(1e6, 1.0, (5, 40)), random.normal(-1e6, 1.0, (5, 40))
    parts = RegressionSums.joined(
        [RegressionSums.of_rows(x[:2], y[:2]), RegressionSums.of_rows(x[2:], y[2:])]
    )
    assert len(parts) == 5
    whole = parts.merged()
    assert whole.xx[0] == pytest.approx(np.sum((x - x.mean()) ** 2), rel=1e-9)
    assert whole.xy[0] == pytest.approx(np.sum((x - x.mean()) * (y - y.mean())), rel=1e-9)


def test_rows_with_gaps_are_left_out() -> None:
    x = np.arange(12.0).reshape(3, 4)
    y = 2 * x + 1
    y[1, 2] = np.nan
    sums = RegressionSums.of_rows(x, y)
    assert len(sums) == 2
    line = fit_line(sums)
    assert line is not None
    assert line.slope == pytest.approx(2.0)


def test_no_line_where_tension_does_not_vary() -> None:
    assert fit_line(RegressionSums.of_rows(np.full((2, 10), 3.0), np.ones((2, 10)))) is None
    assert fit_line(RegressionSums.of_rows(np.empty((0, 10)), np.empty((0, 10)))) is None


def test_ninety_per_cent_interval_with_correlated_noise() -> None:
    """AR(1) noise with a memory of 50 samples: nine intervals in ten hold the truth, not one in three."""
    random = np.random.default_rng(4)
    t = np.arange(12 * 200)
    x = 3 + np.sin(2 * np.pi * t / 200)
    inside = {"slope": 0, "intercept": 0, "naive": 0}
    draws = 400
    for _ in range(draws):
        noise = signal.lfilter([1.0], [1.0, -0.98], random.normal(0, 0.02, len(t) + 500))[500:]
        y = 0.7 * x - 0.2 + noise
        line = fit_line(RegressionSums.of_rows(x.reshape(12, 200), y.reshape(12, 200)))
        assert line is not None
        slope, intercept = line.slope_estimate("m"), line.intercept_estimate("N m")
        inside["slope"] += slope.low <= 0.7 <= slope.high
        inside["intercept"] += intercept.low <= -0.2 <= intercept.high
        plain = stats.linregress(x, y)
        inside["naive"] += abs(plain.slope - 0.7) < 1.645 * plain.stderr
    assert 0.85 < inside["slope"] / draws < 0.95
    assert 0.82 < inside["intercept"] / draws < 0.95
    assert inside["naive"] / draws < 0.5  # what treating samples as independent would have claimed


def test_misfit_that_repeats_widens_the_interval() -> None:
    """Ten identical periods of a curved truth: no scatter between them, yet the slope is not known."""
    x = np.tile(np.linspace(1, 5, 400), (10, 1))
    y = 0.01 * x + 0.002 * np.sin(3 * x)
    sums = RegressionSums.of_rows(x, y)
    bare = fit_line(sums)
    assert bare is not None
    assert bare.slope_error < 1e-9
    misfit = repeating_misfit(x[0], y[0], bare, seconds=0.4)
    assert misfit.variance == pytest.approx(
        np.mean((y[0] - np.polyval(np.polyfit(x[0], y[0], 1), x[0])) ** 2)
    )
    assert misfit.independent == pytest.approx(4.0)
    wide = fit_line(sums, misfit)
    assert wide is not None
    assert wide.slope == bare.slope
    # residual variance over (k - 2) effective values and the variance of x
    assert wide.slope_error == pytest.approx(np.sqrt(misfit.variance / 2 / np.var(x[0])), rel=1e-6)
    estimate = wide.slope_estimate("m", -1.0)
    assert estimate.value == -wide.slope
    assert estimate.low < -0.01 < estimate.high


def test_r2_of_the_thesis() -> None:
    y = np.array([1.0, 2.0, 3.0, np.nan])
    assert coefficient_of_determination(y, y) == 1.0
    assert coefficient_of_determination(y, np.full(4, 2.0)) == 0.0
    assert coefficient_of_determination(y, np.array([3.0, 2.0, 1.0, 0.0])) == pytest.approx(-3.0)
    assert np.isnan(coefficient_of_determination(np.ones(3), np.ones(3)))
