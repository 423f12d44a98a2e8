"""The two bandwidths against scipy's own filters, sines, ramps and parabolas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import firwin, freqz, upfirdn

from fingerlab.diagnosis.signals import filters as bw

KERNEL = firwin(81, 8.0, fs=250.0)
RATES = [1000.0, 2000.0, 500.0, 250.0, 100.0]


def centres(length: int, taps: int, step: int) -> np.ndarray:
    """Index of the middle sample of each whole window."""
    return np.arange((length - taps) // step + 1) * step + taps // 2


@pytest.mark.parametrize("length", [81, 90, 91, 500, 1234, 5000])
def test_narrow_is_a_whole_window_convolution_decimated(length: int) -> None:
    values = np.random.default_rng(length).standard_normal((3, length))
    count = bw.decimated_count(length)
    for row, low in zip(values, bw.decimate(values), strict=True):
        assert low == pytest.approx(np.convolve(row, KERNEL, mode="valid")[::10], abs=1e-12)
        assert low == pytest.approx(upfirdn(KERNEL, row, 1, 10)[8 : 8 + count], abs=1e-12)


def test_a_signal_shorter_than_the_filter_gives_nothing() -> None:
    assert bw.decimate(np.ones((2, 80))).shape == (2, 0)
    assert bw.decimate(np.ones((2, 81))).shape == (2, 1)


@pytest.mark.parametrize(
    ("frequency", "gain", "within"), [(0.5, 1, 2e-3), (3, 1, 0.03), (8, 0.5, 0.01), (20, 0, 2.5e-3)]
)
# Beyond the cut-off: the side lobes of a Hamming window, -53 dB.
def test_narrow_passes_sines_with_known_gain_and_no_phase(
    frequency: float, gain: float, within: float
) -> None:
    time = np.arange(5000) / 250.0
    low = bw.decimate(np.stack((np.sin(2 * np.pi * frequency * time), time)))
    # The mean of the filtered time axis is the middle of the window, so the sine is taken at that time.
    turn = 2 * np.pi * frequency * low[1]
    part, quadrature = np.linalg.lstsq(np.stack((np.sin(turn), np.cos(turn)), axis=1), low[0], rcond=None)[0]
    if frequency < 12.5:  # above, the decimated sine has another name
        assert quadrature == pytest.approx(0.0, abs=1e-6)
    assert np.hypot(part, quadrature) == pytest.approx(gain, abs=within)


def test_effective_share_is_the_noise_bandwidth_over_nyquist() -> None:
    frequency, response = freqz(KERNEL, worN=65536, fs=250.0)
    noise_bandwidth = np.trapezoid(np.abs(response) ** 2, frequency)
    assert noise_bandwidth / 12.5 == pytest.approx(bw.EFFECTIVE_SHARE, rel=1e-3)


@pytest.mark.parametrize("rate", RATES)
def test_derivatives_are_exact_on_ramp_and_parabola(rate: float) -> None:
    kernels, step = bw.derivative_kernels(rate)
    assert rate / step == pytest.approx(min(rate, 250.0))
    time = np.arange(round(2 * rate)) / rate
    middle = time[centres(len(time), len(kernels), step)]
    ramp = bw.differentiate(0.3 - 1.7 * time, kernels, step)
    assert ramp[0] == pytest.approx(0.3 - 1.7 * middle, abs=1e-9)
    assert ramp[1] == pytest.approx(np.full_like(middle, -1.7), abs=1e-9)
    assert ramp[2] == pytest.approx(np.zeros_like(middle), abs=1e-6)
    parabola = bw.differentiate(2.5 * time**2, kernels, step)
    assert parabola[1] == pytest.approx(5.0 * middle, abs=1e-8)
    assert parabola[2] == pytest.approx(np.full_like(middle, 5.0), abs=1e-6)


@pytest.mark.parametrize(("frequency", "within"), [(1.0, 0.002), (3.0, 0.015), (8.0, 0.1)])
def test_derivatives_of_sines(frequency: float, within: float) -> None:
    kernels, step = bw.derivative_kernels(1000.0)
    time = np.arange(6000) / 1000.0
    omega = 2 * np.pi * frequency
    middle = time[centres(len(time), len(kernels), step)]
    value, velocity, acceleration = bw.differentiate(np.sin(omega * time), kernels, step)
    assert value == pytest.approx(np.sin(omega * middle), abs=within)
    assert velocity / omega == pytest.approx(np.cos(omega * middle), abs=within)
    assert acceleration / omega**2 == pytest.approx(-np.sin(omega * middle), abs=within)


def test_wide_signals_hold_forty_hertz_back() -> None:
    """What lies above the wide rate's Nyquist frequency must not fold back into the band."""
    kernels, step = bw.derivative_kernels(1000.0)
    time = np.arange(6000) / 1000.0
    assert np.abs(bw.differentiate(np.sin(2 * np.pi * 240.0 * time), kernels, step)[0]).max() < 0.01
    assert np.abs(bw.differentiate(np.sin(2 * np.pi * 40.0 * time), kernels, step)[0]).max() == pytest.approx(
        0.5, abs=0.03
    )


@pytest.mark.parametrize("frequency", [1.0, 3.0, 5.0])
def test_derivatives_pass_with_the_gain_of_the_values(frequency: float) -> None:
    """Else a torque and the acceleration that causes it no longer agree after filtering."""
    kernels, _ = bw.derivative_kernels(1000.0)
    omega = 2 * np.pi * frequency
    lag = (np.arange(len(kernels)) - len(kernels) // 2) / 1000.0
    value = kernels[:, 0] @ np.cos(omega * lag)
    assert kernels[:, 1] @ np.sin(omega * lag) / omega == pytest.approx(value, rel=2e-4)
    assert -kernels[:, 2] @ np.cos(omega * lag) / omega**2 == pytest.approx(value, rel=2e-4)


@pytest.mark.parametrize("rate", [1000.0, 500.0])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_what_an_encoders_step_makes_of_speed_and_acceleration_is_foretold(rate: float, order: int) -> None:
    """Rounding of a motion of many steps is white: a twelfth of the step's square, up to half the rate."""
    step = 1e-4
    time = np.arange(int(60 * rate)) / rate
    angle = 0.7 * np.sin(2 * np.pi * 0.31 * time) + 0.2 * np.sin(2 * np.pi * 0.83 * time)
    wrong = np.rint(angle / step) * step - angle
    found = bw.decimate(bw.differentiate(wrong, *bw.derivative_kernels(rate)))[order]
    told = step**2 / 12.0 * bw.noise_of_derivatives(rate)[order]
    assert float(np.mean(found**2)) == pytest.approx(told, rel=0.15)
