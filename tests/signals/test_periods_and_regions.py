"""Periods and regions against closed forms of sines."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.signals.periods import (
    REGIONS,
    PeriodGrid,
    consecutive_mask,
    longest_stretch,
    period_grid,
    recognise,
    region_mask,
    repeats,
    speed_threshold,
)

PHASE = np.arange(20000) / 20000


@pytest.mark.parametrize("percent", [10, 20, 30])
def test_shares_of_the_regions_of_a_sine(percent: int) -> None:
    """|sin| below 2 p of its amplitude lasts (2/pi) asin(2 p) of the period (p of the range, 2 A)."""
    speed = 3.0 * np.sin(2 * np.pi * PHASE + 0.4)
    labels = recognise(speed, speed_threshold(speed, percent))
    share = {name: np.mean(labels == i) for i, name in enumerate(REGIONS)}
    still = 2 / np.pi * np.arcsin(2 * percent / 100)
    for name, expected in zip(REGIONS, ((1 - still) / 2, still / 2) * 2, strict=True):
        assert share[name] == pytest.approx(expected, abs=2e-4)


def test_statics_follow_their_motion() -> None:
    speed = np.sin(2 * np.pi * PHASE + 2.0)  # the seam of the period lies inside a motion
    labels = recognise(speed, 0.2)
    order = labels[np.flatnonzero(np.diff(labels) != 0)]
    start = int(np.flatnonzero(order == 0)[0])
    assert np.roll(order, -start).tolist() == [0, 1, 2, 3]


def test_static_at_the_seam_belongs_to_the_motion_before_it() -> None:
    speed = np.array([0.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0])
    assert recognise(speed, 0.5).tolist() == [3, 3, 0, 0, 1, 2, 2, 3]


def test_slow_flexion_is_not_found() -> None:
    """Slow flexion, snap extension: flexion stays under 20 % of the range, the thesis' missing bar."""
    speed = np.where(PHASE < 0.9, 1.0, -9.0)
    labels = recognise(speed, speed_threshold(speed, 20))
    assert region_mask(labels, "flexion") is None
    assert consecutive_mask(labels, "flexion") is None
    assert region_mask(labels, "extension") is not None
    assert region_mask(labels, "static_1") is None
    found = region_mask(recognise(speed, speed_threshold(speed, 5)), "flexion")
    assert found is not None
    assert found.mean() == pytest.approx(0.9, abs=1e-3)


def test_contact_within_thresholds_is_static_throughout() -> None:
    labels = recognise(0.01 * np.sin(2 * np.pi * PHASE), 0.4)
    assert set(labels.tolist()) == {REGIONS.index("static_1")}


def test_longest_stretch_goes_round_the_seam() -> None:
    assert longest_stretch(np.array([1, 1, 0, 1, 0, 0, 1, 1], dtype=bool)) == (6, 4)
    assert longest_stretch(np.ones(5, dtype=bool)) == (0, 5)
    assert longest_stretch(np.zeros(5, dtype=bool)) == (0, 0)


def test_flexion_extension_takes_the_longest_stretch_only() -> None:
    speed = np.zeros(1000)
    speed[100:400], speed[450:500], speed[600:900] = 1.0, 1.0, -1.0
    mask = consecutive_mask(recognise(speed, 0.2), "flexion")
    assert mask is not None
    assert np.flatnonzero(mask).tolist() == list(range(100, 400))


@pytest.mark.parametrize(("frequency", "periods"), [(1.0, 27), (0.5, 13), (2.0, 55), (0.3, 7)])
def test_whole_periods_inside_the_usable_part(frequency: float, periods: int) -> None:
    """30 s at 1 kHz, 2 s and 0.5 s left out, in step with the run's start."""
    grid = period_grid(30000, 1000.0, frequency)
    assert grid is not None
    assert grid.count == periods
    assert grid.start % grid.period == pytest.approx(0.0, abs=1e-6)
    assert grid.start >= 2000
    assert grid.start + grid.count * grid.period <= 29500 + 1e-6


@pytest.mark.parametrize("frequency", [1.0, 0.7, 3.3])
def test_folding_a_fractional_period(frequency: float) -> None:
    t = np.arange(30000) / 1000.0
    grid = period_grid(len(t), 1000.0, frequency)
    assert grid is not None
    sine = np.sin(2 * np.pi * frequency * t + 0.3)
    expected = np.sin(2 * np.pi * np.arange(grid.phases) / grid.phases + 0.3)
    # linear interpolation between samples 1 ms apart: error at most (w h)^2 / 8
    bound = (2 * np.pi * frequency / 1000) ** 2 / 8 + 1e-9
    np.testing.assert_allclose(grid.mean(sine), expected, atol=bound)
    assert repeats(sine, grid)


def test_shift_delays_the_signal() -> None:
    values = np.arange(100.0)
    grid = PeriodGrid(20.0, 10.0, 5)
    np.testing.assert_array_equal(grid.fold(values, 3.0)[0], np.arange(17.0, 27.0))
    assert np.isnan(grid.fold(values, 25.0)[0]).all()
    assert np.isfinite(grid.fold(values, 25.0)[1:]).all()
    assert np.isnan(grid.fold(values, -35.0)[-1]).all()


def test_no_grid_for_what_is_too_short_or_has_no_frequency() -> None:
    assert period_grid(4000, 1000.0, 1.0) is None  # one whole period is left
    assert period_grid(30000, 1000.0, 0.0) is None
    assert period_grid(30000, 1000.0, 400.0) is None
    assert period_grid(10, 1000.0, 1.0) is None


def test_a_chirp_does_not_repeat() -> None:
    t = np.arange(20000) / 1000.0
    grid = period_grid(len(t), 1000.0, 1.0)
    assert grid is not None
    assert not repeats(np.sin(2 * np.pi * (0.2 * t + 0.1 * t**2)), grid)
    assert not repeats(np.full(len(t), 0.4), grid)
    assert repeats(np.sin(2 * np.pi * t), grid)
