"""Delays between two signals of one period (thesis section 4.2).

Sign: **positive means that the joint angles (LHS) come later than the cable tension.** A signal
delayed by d is ``x(t - d)``: tension is shifted by the delay before it is compared with the LHS.

The tension must come in with the sign of its cable (s T), so that both signals rise together.
"""

from __future__ import annotations

import numpy as np

from fingerlab.sessions.model import Array
from fingerlab.signals.regions import Mask, longest_stretch


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
