"""The two bandwidths of the diagnosis, and the filters between them.

Nonlinear terms are formed at high bandwidth, then measured signals and terms pass the same zero-phase
low-pass and are decimated. Friction formed from a speed at 8 Hz makes Coulomb friction look like Stribeck
friction; formed at 40 Hz it does not.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fingerlab.sessions.model import Array

WIDE_RATE_HZ = 250.0
WIDE_CUTOFF_HZ = 40.0
NARROW_RATE_HZ = 25.0
NARROW_CUTOFF_HZ = 8.0
NARROW_TAPS = 81  # odd, so that the delay is a whole number of samples and can be removed
NARROW_STEP = round(WIDE_RATE_HZ / NARROW_RATE_HZ)
NARROW_HALF = NARROW_TAPS // 2


def low_pass_kernel(taps: int, cutoff_hz: float, sample_rate_hz: float) -> Array:
    """Windowed-sinc low-pass (Hamming), unit gain at zero frequency, shape (taps,); ``taps`` is odd.

    The same kernel as ``scipy.signal.firwin``, without the two seconds that importing it takes.
    """
    place = np.arange(taps) - taps // 2
    kernel = np.sinc(2.0 * cutoff_hz / sample_rate_hz * place) * np.hamming(taps)
    return np.asarray(kernel / kernel.sum())


def wide_kernels(sample_rate_hz: float) -> tuple[Array, int]:
    """Low-pass kernel at 40 Hz with its first and second derivative, shape (taps, 3), and the decimation.

    Units 1, 1/s, 1/s^2. At a sampling rate below 250 Hz nothing is decimated.
    """
    step = max(1, round(sample_rate_hz / WIDE_RATE_HZ))
    cutoff = min(WIDE_CUTOFF_HZ, 0.3 * sample_rate_hz)
    taps = 2 * round(1.2 * sample_rate_hz / cutoff) + 1
    smooth = low_pass_kernel(taps, cutoff, sample_rate_hz)
    slope = -np.gradient(smooth, 1.0 / sample_rate_hz)
    # A finite kernel must differentiate a ramp to exactly one and a parabola to exactly two.
    lag = (np.arange(taps) - taps // 2) / sample_rate_hz
    slope /= float(slope @ lag)
    bend = np.gradient(np.gradient(smooth, 1.0 / sample_rate_hz), 1.0 / sample_rate_hz)
    bend -= bend.mean()
    bend /= 0.5 * float(bend @ lag**2)
    return np.stack((smooth, slope, bend), axis=1), step


def widen(values: Array, kernels: Array, step: int) -> Array:
    """Values with first and second derivative at the wide rate, shape (3, m); only whole windows."""
    windows = sliding_window_view(values, len(kernels))[::step]
    return np.ascontiguousarray((windows @ kernels).T)


_NARROW = low_pass_kernel(NARROW_TAPS, NARROW_CUTOFF_HZ, WIDE_RATE_HZ)
EFFECTIVE_SHARE = float(1.0 / (NARROW_RATE_HZ / WIDE_RATE_HZ * np.sum(_NARROW**2) ** -1))
"""Independent samples per decimated sample of white noise: noise bandwidth over Nyquist frequency."""
EFFECTIVE_SHARE = min(1.0, EFFECTIVE_SHARE)


def narrow_count(length: int) -> int:
    """Number of decimated samples that a wide signal of ``length`` samples gives."""
    return max(0, (length - NARROW_TAPS) // NARROW_STEP + 1)


def narrow(columns: Array) -> Array:
    """Low-pass at 8 Hz and decimate to 25 Hz; shape (..., n) -> (..., narrow_count(n))."""
    length = columns.shape[-1]
    count = narrow_count(length)
    if count == 0:
        return np.zeros((*columns.shape[:-1], 0))
    # Several outputs share one window, so that the sums become products of matrices.
    blocks = -(-count // BLOCK)
    needed = (blocks - 1) * BLOCK * NARROW_STEP + len(_BLOCK_KERNEL)
    if needed > length:
        columns = np.concatenate(
            (columns, np.zeros((*columns.shape[:-1], needed - length), columns.dtype)), axis=-1
        )
    windows = sliding_window_view(columns, len(_BLOCK_KERNEL), axis=-1)[..., :: BLOCK * NARROW_STEP, :][
        ..., :blocks, :
    ]
    low = np.ascontiguousarray(windows) @ _BLOCK_KERNEL.astype(columns.dtype)
    return np.asarray(low.reshape(*columns.shape[:-1], blocks * BLOCK)[..., :count], dtype=np.float64)


BLOCK = 8


def _block_kernel() -> Array:
    kernel = np.zeros(((BLOCK - 1) * NARROW_STEP + NARROW_TAPS, BLOCK))
    for k in range(BLOCK):
        kernel[k * NARROW_STEP : k * NARROW_STEP + NARROW_TAPS, k] = _NARROW
    return kernel


_BLOCK_KERNEL = _block_kernel()
"""The narrow kernel at BLOCK successive outputs, shape (window, BLOCK)."""
