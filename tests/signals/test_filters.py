"""Filter and derivative against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.signals.prepare import derivative, low_pass, low_pass_stretches

RATE = 1000.0


def _amplitude_and_phase(values: np.ndarray, frequency: float) -> tuple[float, float]:
    """Of the middle part, over whole periods, against a sine that starts at sample 0."""
    period = round(RATE / frequency)
    start = (len(values) // 3) // period * period
    part = values[start : start + 10 * period]
    k = np.arange(start, start + len(part))
    z = 2 * np.mean(part * np.exp(-2j * np.pi * frequency * k / RATE))
    return abs(z), float(np.angle(1j * z))


@pytest.mark.parametrize("frequency", [1.0, 4.0, 5.0, 8.0])
def test_gain_of_the_double_pass(frequency: float) -> None:
    """|H|^2 of a 4th-order Butterworth, pre-warped by the bilinear transform; no phase."""
    t = np.arange(30000) / RATE
    filtered = low_pass(np.sin(2 * np.pi * frequency * t), RATE, 5.0)
    warped = np.tan(np.pi * frequency / RATE) / np.tan(np.pi * 5.0 / RATE)
    gain, phase = _amplitude_and_phase(filtered, frequency)
    assert gain == pytest.approx(1 / (1 + warped**8), rel=1e-6)
    assert phase == pytest.approx(0.0, abs=1e-6)


def test_half_amplitude_at_the_cut_off() -> None:
    t = np.arange(30000) / RATE
    gain, _ = _amplitude_and_phase(low_pass(np.cos(2 * np.pi * 5.0 * t), RATE, 5.0), 5.0)
    assert gain == pytest.approx(0.5, abs=1e-9)


def test_edges_keep_a_ramp() -> None:
    """The padding is odd, so a straight line runs through both ends unbent."""
    ramp = 2.0 + 3.0 * np.arange(4000) / RATE
    np.testing.assert_allclose(low_pass(ramp, RATE, 5.0), ramp, atol=1e-4)  # of a rise of 12


def test_edge_effect_is_over_after_half_a_second() -> None:
    """What ``EDGE_S`` leaves out is enough: a 1 Hz sine cut anywhere is undisturbed beyond it."""
    for phase in np.linspace(0, 2 * np.pi, 7):
        t = np.arange(10000) / RATE
        sine = np.sin(2 * np.pi * t + phase)
        error = np.abs(low_pass(sine, RATE, 5.0) - sine)[500:-500]
        assert error.max() < 2e-3


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 500.0, 700.0])
def test_impossible_cut_off_is_told(cutoff: float) -> None:
    with pytest.raises(UserError, match="low-pass"):
        low_pass(np.zeros(100), RATE, cutoff)


def test_too_short_is_told() -> None:
    with pytest.raises(UserError, match="fewer than two samples"):
        low_pass(np.zeros(1), RATE, 5.0)


def test_derivative_of_a_parabola_is_exact_inside() -> None:
    t = np.arange(200) / RATE
    np.testing.assert_allclose(derivative(4 * t**2 + t, RATE)[1:-1], (8 * t + 1)[1:-1], rtol=1e-9)


def test_derivative_of_a_sine_has_the_central_difference_gain() -> None:
    """sin(w h) / (w h) of the true slope, and no phase."""
    w, t = 2 * np.pi * 4.0, np.arange(30000) / RATE
    amplitude, phase = _amplitude_and_phase(derivative(-np.cos(w * t), RATE), 4.0)
    assert amplitude == pytest.approx(w * np.sin(w / RATE) / (w / RATE), rel=1e-9)
    assert phase == pytest.approx(0.0, abs=1e-6)


def test_gaps_stay_gaps_and_do_not_spread() -> None:
    t = np.arange(9000) / RATE
    values = np.sin(2 * np.pi * t)
    with_gap = values.copy()
    with_gap[3000:4000] = np.nan
    with_gap[6000:6100] = np.nan
    with_gap[6200:6300] = np.nan  # leaves 100 samples between: half a period of the cut-off
    filtered = low_pass_stretches(with_gap, RATE, 5.0)
    assert filtered is not None
    assert np.isnan(filtered[3000:4000]).all()
    assert np.isnan(filtered[6100:6200]).all()
    assert np.isfinite(filtered[:3000]).all()
    np.testing.assert_array_equal(filtered[4000:6000], low_pass(values[4000:6000], RATE, 5.0))


def test_never_read_is_none() -> None:
    assert low_pass_stretches(np.full(500, np.nan), RATE, 5.0) is None
