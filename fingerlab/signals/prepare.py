"""From a run to filtered signals with their derivatives: zero-phase low-pass, central differences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Array, Run, whole_pieces

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


THESIS_CUTOFF_HZ = 5.0
"""Thesis section 4.1: physiological finger motion does not exceed 3 to 5 Hz."""
MOST_OF_THE_RATE = 0.3
"""Cut-off over sampling rate, at most, of the thesis' filter in slow recordings, as in the diagnosis: run
twice, it leaves 1/600 at two fifths of the rate."""

NEEDED = ("motor_position", "motor_torque")
FILTERED = (*NEEDED, "mcp_angle", "pip_angle", "endpoint_force", "load_torque")
"""Channels that are low-passed; the first two every run must have."""


@dataclass(frozen=True)
class Signals:
    """Filtered signals of one run; every array has shape (n,) and SI units, None where not recorded.

    Attributes:
        time: s. motor_position, motor_acceleration: rad, rad/s^2 at the pulley.
        motor_torque: N m at the gearbox output, as measured (no inertia subtracted).
        mcp, pip: joint angles, rad, flexion positive, with ``_velocity`` and ``_acceleration``.
        force: N, compression positive, NaN where the load cell was not read; None where never.
        load_torque: N m (motor bench only), with gaps in the same way.
        cable_sign: +1 flexion, -1 extension, 0 none.
    """

    run_name: str
    phase: str
    cable_sign: int
    sample_rate_hz: float
    time: Array
    motor_position: Array
    motor_acceleration: Array
    motor_torque: Array
    mcp: Array | None
    mcp_velocity: Array | None
    mcp_acceleration: Array | None
    pip: Array | None
    pip_velocity: Array | None
    pip_acceleration: Array | None
    force: Array | None
    load_torque: Array | None

    def __len__(self) -> int:
        return len(self.time)


def thesis_cutoff_hz(sample_rate_hz: float) -> float:
    """The thesis' 5 Hz; below 17 samples a second what such a recording can hold."""
    return min(THESIS_CUTOFF_HZ, MOST_OF_THE_RATE * sample_rate_hz)


def prepare(run: Run, cutoff_hz: float | None = None) -> Signals:
    """Read a run's channels, low-pass them at ``cutoff_hz`` (Hz; None: the thesis') and differentiate.

    Where samples were lost, of the longest piece without a gap.

    Raises:
        UserError: a channel is missing or unreadable, or the cut-off does not fit the sampling rate.
    """
    rate = run.sample_rate_hz
    channels = run.load(["time", *(name for name in FILTERED if name in NEEDED or run.has(name))])
    cutoff_hz = thesis_cutoff_hz(rate) if cutoff_hz is None else cutoff_hz
    piece = max(whole_pieces(channels["time"], rate), key=lambda one: one.stop - one.start)
    channels = {name: values[piece] for name, values in channels.items()}
    filtered = _low_passed(run, channels, cutoff_hz)

    def twice(values: Array | None) -> tuple[Array | None, Array | None]:
        if values is None:
            return None, None
        velocity = derivative(values, rate)
        return velocity, derivative(velocity, rate)

    position = filtered["motor_position"]
    mcp, pip = filtered.get("mcp_angle"), filtered.get("pip_angle")
    mcp_velocity, mcp_acceleration = twice(mcp)
    pip_velocity, pip_acceleration = twice(pip)
    return Signals(
        run_name=run.name,
        phase=run.phase,
        cable_sign=run.cable_sign,
        sample_rate_hz=rate,
        time=channels["time"],
        motor_position=position,
        motor_acceleration=derivative(derivative(position, rate), rate),
        motor_torque=filtered["motor_torque"],
        mcp=mcp,
        mcp_velocity=mcp_velocity,
        mcp_acceleration=mcp_acceleration,
        pip=pip,
        pip_velocity=pip_velocity,
        pip_acceleration=pip_acceleration,
        force=filtered.get("endpoint_force"),
        load_torque=filtered.get("load_torque"),
    )


def _low_passed(run: Run, channels: Mapping[str, Array], cutoff_hz: float) -> dict[str, Array]:
    """Channels of ``FILTERED`` that there are, low-passed; gaps stay gaps, one that is all gaps is left out.

    Raises:
        UserError: the motor's channels have gaps, or the cut-off does not fit the sampling rate.
    """
    rate = run.sample_rate_hz
    there = [name for name in FILTERED if name in channels]
    whole = [name for name in there if np.isfinite(channels[name]).all()]
    for name in NEEDED:
        if name not in whole:
            raise UserError(
                f"Run {run.name} holds values in '{name}' that are not numbers; the motor's channels should "
                "have no gaps."
            )
    # One call for all channels: designing the filter takes as long as filtering one of them.
    filtered = low_pass(np.stack([channels[n] for n in whole]), rate, cutoff_hz)
    result = dict(zip(whole, filtered, strict=True))
    for name in there:
        if name not in whole:
            pieces = low_pass_stretches(channels[name], rate, cutoff_hz)
            result |= {} if pieces is None else {name: pieces}
    return result


SEGMENT_S = 10.0
"""Of a spectrum (Welch, "The use of fast Fourier transform", 1967): a tenth of a hertz is told apart."""
LEAST_FOR_SPECTRUM = 50
"""Fewer tell no spectrum; assumed."""


def amplitude_density(
    values: Array, rate_hz: float, segment_s: float = SEGMENT_S
) -> tuple[Array, Array] | None:
    """Welch's amplitude density of the longest stretch without a gap; None where that is too short.

    Args:
        values: shape (n,), any unit, NaN where there is nothing. segment_s: what is averaged over, s.

    Returns:
        Frequencies above 0, Hz, and the density in the unit of the values per root of a hertz, (m,) each.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return None
    parts = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    longest = values[max(parts, key=len)]
    if len(longest) < LEAST_FOR_SPECTRUM:
        return None
    # As scipy.signal.welch, whose import alone would stop a window, and with it the motor, for a second.
    length = min(int(segment_s * rate_hz), len(longest))
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    pieces = np.lib.stride_tricks.sliding_window_view(longest, length)[:: length - length // 2]
    lines = np.fft.rfft(window * (pieces - pieces.mean(axis=1, keepdims=True)))
    density = np.mean(np.abs(lines) ** 2, axis=0) * 2.0 / (rate_hz * np.sum(window**2))
    if length % 2 == 0:
        density[-1] *= 0.5  # half the rate has no second side
    return np.asarray(np.fft.rfftfreq(length, 1.0 / rate_hz)[1:]), np.asarray(np.sqrt(density[1:]))
