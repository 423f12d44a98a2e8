"""Zero-phase low-pass filter and derivatives of evenly sampled signals."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Array

BUTTERWORTH_ORDER = 4
"""Thesis section 4.1: 4th-order Butterworth low-pass."""


def low_pass(values: Array, sample_rate_hz: float, cutoff_hz: float) -> Array:
    """Butterworth low-pass run forwards and backwards, so that nothing is delayed.

    Args:
        values: shape (..., n), any unit; filtered along the last axis.
        sample_rate_hz: sampling rate, Hz.
        cutoff_hz: -3 dB frequency of the single pass, Hz (the double pass is at -6 dB there).

    Returns:
        Filtered values, same shape and unit.

    Raises:
        UserError: the cut-off is not below half the sampling rate, or the signal is too short.
    """
    if not 0 < cutoff_hz < sample_rate_hz / 2:
        raise UserError(
            f"A low-pass at {cutoff_hz:g} Hz is impossible at {sample_rate_hz:g} samples a second; "
            f"choose a cut-off between 0 and {sample_rate_hz / 2:g} Hz."
        )
    from scipy.signal import sosfiltfilt  # slow to import, and the constants of signals are wanted early

    sos = _sections(sample_rate_hz, cutoff_hz)
    pad = min(int(3 * sample_rate_hz / cutoff_hz), values.shape[-1] - 1)
    if pad < 1:
        raise UserError("A run of fewer than two samples cannot be filtered; record at least a second.")
    return np.asarray(sosfiltfilt(sos, values, axis=-1, padlen=pad))


@lru_cache(maxsize=64)
def _sections(sample_rate_hz: float, cutoff_hz: float) -> Array:
    """The filter's second-order sections; every run of a session asks for the same ones."""
    from scipy.signal import butter

    return np.asarray(butter(BUTTERWORTH_ORDER, cutoff_hz, fs=sample_rate_hz, output="sos"))


def low_pass_stretches(values: Array, sample_rate_hz: float, cutoff_hz: float) -> Array | None:
    """Low-pass each unbroken stretch of a channel that was not read throughout.

    Args:
        values: shape (n,), any unit, NaN where nothing was read; else as :func:`low_pass`.

    Returns:
        Filtered values, same shape and unit. NaN in the gaps, and in stretches shorter than one period
        of the cut-off, which a filter cannot tell from noise. None where no stretch is long enough.
    """
    finite = np.isfinite(values)
    if finite.all():
        return low_pass(values, sample_rate_hz, cutoff_hz)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], finite, [False])).astype(np.int8)))
    result = np.full(values.shape, np.nan)
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if stop - start >= sample_rate_hz / cutoff_hz:
            result[start:stop] = low_pass(values[start:stop], sample_rate_hz, cutoff_hz)
    return result if np.isfinite(result).any() else None


def derivative(values: Array, sample_rate_hz: float) -> Array:
    """Central difference along the last axis; unit of ``values`` per second, same shape."""
    return np.asarray(np.gradient(values, 1.0 / sample_rate_hz, axis=-1))
