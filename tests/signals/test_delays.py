"""Delays against shifts that were put in."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.signals.periods import (
    cross_correlation_delay,
    finddelay,
    findsignal_delay,
    normalise,
)

PHASES = 1000
PHASE = np.arange(PHASES) / PHASES


def _shape(phase: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * phase) + 0.3 * np.sin(4 * np.pi * phase + 0.8)


@pytest.mark.parametrize("shift", [-499, -162, -1, 0, 1, 28, 162, 400, 500])
def test_cross_correlation_finds_a_constructed_shift(shift: int) -> None:
    tension = 2.0 + 3.0 * _shape(PHASE)
    lhs = -0.02 + 0.01 * np.roll(_shape(PHASE), shift)  # positive shift: LHS comes later
    assert cross_correlation_delay(lhs, tension) == shift


@pytest.mark.parametrize("shift", [-60, 0, 45, 162])
def test_findsignal_finds_a_constructed_shift_in_either_region(shift: int) -> None:
    tension, lhs = 5 * _shape(PHASE), 0.2 * np.roll(_shape(PHASE), shift)
    slope = np.gradient(lhs)
    for region in (slope > 0.2 * slope.max(), slope < 0.2 * slope.min()):
        assert findsignal_delay(lhs, tension, region) == shift


def test_findsignal_finds_each_regions_own_delay() -> None:
    """A trapezium whose rise is 120 ms late and whose fall is 30 ms late."""

    def trapezium(rise: float, fall: float) -> np.ndarray:
        return np.clip((PHASE - rise) / 0.25, 0, 1) - np.clip((PHASE - fall) / 0.25, 0, 1)

    tension, lhs = trapezium(0.05, 0.55), trapezium(0.17, 0.58)
    slope = np.gradient(lhs)
    assert findsignal_delay(lhs, tension, slope > 1e-6) == 120
    assert findsignal_delay(lhs, tension, slope < -1e-6) == 30
    assert 30 < cross_correlation_delay(lhs, tension) < 120


def test_findsignal_is_the_least_squared_distance() -> None:
    """Against the distances written out one by one."""
    random = np.random.default_rng(5)
    lhs, tension = random.normal(size=60).cumsum(), random.normal(size=60).cumsum()
    region = np.zeros(60, dtype=bool)
    region[50:] = region[:8] = True  # round the seam
    k = np.flatnonzero(region)
    y, x = normalise(lhs), normalise(tension)
    distance = {d: float(np.sum((y[k] - x[(k - d) % 60]) ** 2)) for d in range(-29, 31)}
    assert findsignal_delay(lhs, tension, region) == min(distance, key=distance.__getitem__)


def test_finddelay_is_the_plain_cross_correlation() -> None:
    """Against numpy's, as Matlab documents its function; and biased towards zero, as said."""
    tension, lhs = _shape(PHASE), np.roll(_shape(PHASE), 162)
    a, b = (lhs - lhs.mean()) / lhs.std(), (tension - tension.mean()) / tension.std()
    expected = int(np.argmax(np.correlate(a, b, "full"))) - (PHASES - 1)
    assert finddelay(lhs, tension) == expected
    assert 120 <= finddelay(lhs, tension) < 162


def test_finddelay_of_a_pulse_is_exact() -> None:
    pulse = np.exp(-(((np.arange(400) - 150) / 12.0) ** 2))
    assert finddelay(np.roll(pulse, 37), pulse) == 37
    assert finddelay(np.roll(pulse, -37), pulse) == -37
    assert abs(finddelay(np.roll(pulse, 37), pulse, longest=20)) <= 20


def test_normalise() -> None:
    np.testing.assert_allclose(normalise(np.array([3.0, 1.0, 2.0])), [1.0, 0.0, 0.5])
    np.testing.assert_array_equal(normalise(np.full(4, 2.0)), 0.0)
