"""Samples put right, and filtered: lost ones and spikes, then the two bandwidths of the diagnosis.

A low-pass spreads one wrong sample over a tenth of a second, and a derivative makes much of it. A spike is
told by its size against its neighbours (Hampel's identifier, Pearson, "Outliers in process modeling and
identification", 2002), on the scale of the channel's own noise; a gap of a few milliseconds is crossed on a
straight line. A channel that is logged more often than it is read stands on a staircase, which is half a step
late and whose derivative is a comb; it is taken at its readings alone. All are counted, by channel, and told
as findings about the bench.

Nonlinear terms are formed at high bandwidth, then measured signals and terms pass the same zero-phase
low-pass and are decimated. Friction formed from a speed at 8 Hz makes Coulomb friction look like Stribeck
friction; formed at 40 Hz it does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from fingerlab.diagnosis.settings import (
    END_JUMP,
    JUMP_STEPS,
    LANDED_SCATTERS,
    LANDING_S,
    LEAST_JITTER,
    LEAST_JUMPS,
    LEAST_SPIKE,
    LEAST_SPIKE_LOCALLY,
    LONGEST_BRIDGE_S,
    MOST_SPIKES_SHARE,
    NARROW_CUTOFF_HZ,
    NARROW_RATE_HZ,
    NARROW_TAPS,
    PRESSING_SHARE,
    PULSE_SAMPLES,
    REPORTED_JITTER,
    SAME_SIZE,
    SPIKE_NEIGHBOURS,
    STANDING_SHARE,
    STRAIGHTER,
    WIDE_CUTOFF_HZ,
    WIDE_RATE_HZ,
)
from fingerlab.diagnosis.signals.encoder import smallest_step
from fingerlab.sessions.model import Array, BoolArray, IntArray

Repair = tuple[str, str]
"""What was put right, and the channel: samples are counted by both."""
SPIKE, REPEATED, TURNED = "spike", "held", "turned"
"""Of a channel: single samples that are no measurements, those that only repeat the last reading, and those
whose sign is turned."""
BRIDGED, CUT_OUT, UNEVEN = ("bridged", "time"), ("cut out", "time"), ("uneven", "time")
"""Of the time: samples that were lost and bridged, those of gaps too long for that, between which a run is
analysed piece by piece, and those that came early or late, where all are taken at their times."""


def bridge_samples(rate: float) -> int:
    """So many lost samples in a row, at ``rate`` a second, are bridged; one at any rate."""
    return max(int(LONGEST_BRIDGE_S * rate), 1)


def at_even_times(
    samples: Mapping[str, Array], rate: float, lead: int
) -> tuple[dict[str, Array], dict[Repair, int]]:
    """The samples on an even grid of times, where they were not taken evenly; and how many that concerns.

    Times that a log holds may be those at which a sample was taken, or at which a packet of them came. They
    are believed where the motion runs straighter between its neighbours by them than by their numbers. Gaps
    too long to be bridged stay.

    Args:
        samples: channels, ``motor_position`` among them, and their ``time`` (s), (n,) each.
        rate: samples a second. lead: so many at the start are not counted.
    """
    time = samples["time"]
    steps = np.diff(time) * rate
    if not len(steps) or np.abs(steps - np.rint(steps)).mean() < LEAST_JITTER or (steps <= 0.0).any():
        return dict(samples), {}
    place = (time - time[0]) * rate
    if not _straighter(samples["motor_position"], place):
        return dict(samples), {}
    every = np.arange(int(place[-1]) + 1)
    gaps = np.rint(steps) > bridge_samples(rate) + 1
    cut = gaps[np.minimum(np.searchsorted(place, every, side="right") - 1, len(gaps) - 1)]
    cut_out, every = int(np.count_nonzero(cut & (every >= lead))), every[~cut]
    found = {name: np.interp(every, place, values) for name, values in samples.items()}
    behind = place[place >= lead]
    off = np.abs(behind - np.rint(behind)) > REPORTED_JITTER
    bridged_ones = int(np.count_nonzero(every >= lead)) - len(behind)
    counts = {BRIDGED: max(bridged_ones, 0), UNEVEN: int(off.sum()), CUT_OUT: cut_out}
    return found | {"time": time[0] + every / rate}, {what: count for what, count in counts.items() if count}


def _straighter(position: Array, place: Array) -> bool:
    """Whether a position lies straighter between its neighbours at its ``place`` than by its number, (n,)."""
    bends = []
    for x in (place, np.concatenate(([0.0], np.cumsum(np.maximum(np.rint(np.diff(place)), 1.0))))):
        share = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
        line = position[:-2] + share * (position[2:] - position[:-2])
        bends.append(float(np.abs(position[1:-1] - line).mean()))
    return bends[0] < STRAIGHTER * bends[1]


def bridged(samples: Mapping[str, Array], rate: float) -> tuple[dict[str, Array], int]:
    """The samples with short gaps filled on a straight line, and how many were filled.

    Args:
        samples: channels and their ``time`` (s), (n,) each. rate: samples a second.
    """
    time = samples["time"]
    steps = np.diff(time) * rate
    lost = np.rint(steps).astype(int) - 1
    lost[(lost < 0) | (lost > bridge_samples(rate))] = 0
    if not lost.any():
        return dict(samples), 0
    place = np.concatenate(([0], np.cumsum(lost + 1)))
    every = np.arange(place[-1] + 1)
    return {name: np.interp(every, place, values) for name, values in samples.items()}, int(lost.sum())


def lost(time: Array, rate: float) -> dict[Repair, int]:
    """Samples that a stretch of time, s, (n,), lacks: those that are bridged, and those of longer gaps."""
    missing = np.rint(np.diff(time) * rate).astype(int) - 1
    short = missing <= bridge_samples(rate)
    counts = {BRIDGED: missing[short & (missing > 0)].sum(), CUT_OUT: missing[~short].sum()}
    return {what: int(count) for what, count in counts.items() if count}


def landing_samples(rate: float) -> int:
    """Over how many samples before and behind it a knock is asked whether a tip lands, at ``rate``, Hz."""
    return math.ceil(LANDING_S * rate)


def without_spikes(values: Array, around: int = 0) -> tuple[Array, IntArray]:
    """A channel with its spikes on the line between their neighbours, and where they were, (spikes,).

    Args:
        around: of a force on a tip, so many samples (:func:`landing_samples`) are looked at around
            what may be the knock of a tip that lands: it pushed the finger, and is no spike. 0: another one.
    """
    spikes, ends = _jutting(values)
    if around and len(spikes):
        spikes = spikes[~_lands(values, spikes, around)]
    spikes = np.union1d(spikes, ends)
    if not len(spikes) or len(spikes) > max(MOST_SPIKES_SHARE * len(values), 1.0):
        return values, NONE
    return _on_a_line(values, spikes), spikes


def knocks_of(force: Array, around: int) -> Array:
    """What the knocks of a tip that lands add to a force, (n,); zero elsewhere.

    They last a sample or two, and how hard they were is known no better than that.

    Args:
        around: as of :func:`without_spikes`, which has taken off what is none.
    """
    knocks, _ = _jutting(force)
    knocks = knocks[_lands(force, knocks, around)] if len(knocks) else knocks
    return force - _on_a_line(force, knocks) if len(knocks) else np.zeros_like(force)


def _jutting(values: Array) -> tuple[IntArray, IntArray]:
    """Samples of a channel that stand far out of the line of their neighbours; those at its ends apart."""
    if len(values) < 2 * SPIKE_NEIGHBOURS + 1 or not np.isfinite(values).all():
        return NONE, NONE
    bend = np.abs(values[1:-1] - 0.5 * (values[2:] + values[:-2]))
    middle = len(bend) // 2
    scale = max(1.4826 * float(np.partition(bend, middle)[middle]), smallest_step(values))
    suspects = np.flatnonzero(bend > 0.5 * LEAST_SPIKE * scale) + 1
    if not len(suspects) or not scale > 0:
        return NONE, NONE
    ends = np.concatenate((_jump(values[::-1], scale), len(values) - 1 - _jump(values, scale)))
    # A spike bends the line at its neighbours, too; which of them it is, those further off say.
    around = np.concatenate((np.arange(-SPIKE_NEIGHBOURS, 0), np.arange(1, SPIKE_NEIGHBOURS + 1)))
    near = values[np.clip(suspects[:, None] + around, 0, len(values) - 1)]
    usual = np.median(near, axis=1)
    local = np.median(np.abs(near - usual[:, None]), axis=1)
    off = np.abs(values[suspects] - usual)
    spikes = suspects[(off > LEAST_SPIKE * scale) & (off > LEAST_SPIKE_LOCALLY * local)]
    # So many in a row are a pulse that was measured: a rotor catching up with a cable that hung loose.
    rows = np.split(spikes, np.flatnonzero(np.diff(spikes) > 1) + 1)
    return np.concatenate([row for row in rows if len(row) < PULSE_SAMPLES] or [NONE]), ends


def _on_a_line(values: Array, places: IntArray) -> Array:
    """The values with those at some places on the line between their neighbours, (n,)."""
    good = np.ones(len(values), dtype=bool)
    good[places] = False
    kept = np.flatnonzero(good)
    repaired = values.copy()
    repaired[places] = np.interp(places, kept, values[kept])
    return repaired


def _lands(values: Array, spikes: IntArray, samples: int) -> BoolArray:
    """Which of them are the knock of a tip that was clear of the load cell and presses it then, (spikes,)."""
    low, high = np.quantile(values, (0.02, 0.98))
    pressing = low + PRESSING_SHARE * (high - low)
    around = np.arange(1, samples + 1)
    last = values[np.maximum(spikes[:, None] - around - 1, 0)]
    before = np.median(last, axis=1)
    scatter = 1.4826 * np.median(np.abs(last - before[:, None]), axis=1)
    after = np.median(values[np.minimum(spikes[:, None] + around + 1, len(values) - 1)], axis=1)
    # However lightly it presses at first: the spike of a cable leaves the load cell as it was.
    least = LANDED_SCATTERS * np.maximum(scatter, smallest_step(values))
    touching = (after > pressing) | (after - before > least)
    return np.asarray((before < pressing) & touching)


def _jump(values: Array, scale: float) -> IntArray:
    """How far from the end a channel has jumped away in its last samples: 0 is the last, (samples,).

    A log that ends in a stop, or begins with a switch, shows a pulse of which nobody sees the other side.
    ``scale``: what the channel bends by from sample to sample, or its step.
    """
    usual = values[-3 * SPIKE_NEIGHBOURS : -SPIKE_NEIGHBOURS]
    if len(usual) < 2 * SPIKE_NEIGHBOURS:
        return NONE
    off = np.abs(values[: -SPIKE_NEIGHBOURS - 1 : -1] - np.median(usual)) > END_JUMP * max(
        np.ptp(usual), scale
    )
    return np.flatnonzero(off)


def usual_wait(values: Array, most: float) -> int:
    """After how many samples a channel is read anew, if what is logged between only repeats the last reading.

    A channel that moves by several of its steps from one sample to the next moves on with the sample after
    that, unless nobody has read it. One that is told to stand, or whose encoder is coarse, moves otherwise.

    Args:
        values: (n,). most: samples between two readings of what is still a measurement of the motion.

    Returns:
        1 where each sample is a reading, or too little moves to tell.
    """
    changes = np.abs(np.diff(values))
    new = np.flatnonzero(changes) + 1
    if not LEAST_JUMPS < len(new) < STANDING_SHARE * len(values):
        return 1
    sizes = np.unique(changes[new - 1])
    apart = np.diff(sizes)
    # At an even speed all changes are alike, and what they differ by is the step.
    step = min(sizes[0], np.min(apart, where=apart > SAME_SIZE * sizes[0], initial=np.inf))
    waits = np.diff(new)[changes[new[:-1] - 1] > JUMP_STEPS * step]
    if len(waits) < LEAST_JUMPS or np.mean(waits > 1) < STANDING_SHARE or np.median(waits) > most:
        return 1
    return int(np.median(waits))


def readings_of(values: Array, usual: int) -> IntArray:
    """Where a channel was read, (readings,), of which most are ``usual`` samples apart: where it moves on.

    What stands still was read all the while, also before it first moves and after it last does.
    """
    new = np.flatnonzero(np.diff(values)) + 1
    ends = np.append(new, len(values) + usual // 2)
    stands = np.flatnonzero(np.diff(ends) > 2 * usual)
    still = [np.arange(ends[k], ends[k + 1] - usual // 2, usual) for k in stands]
    return np.unique(np.concatenate((np.arange(new[0] - usual, -1, -usual), new, *still)))


def between_readings(values: Array, readings: IntArray, count: int) -> Array:
    """A cubic spline (not-a-knot) through a channel's ``values`` at its ``readings``, (count,).

    Before the first reading and after the last it goes on straight.
    """
    from scipy.interpolate import CubicSpline  # slow to import, and few recordings want it

    spline = CubicSpline(readings, values)
    place = np.arange(count)
    found = spline(np.clip(place, readings[0], readings[-1]))
    before, after = place < readings[0], place > readings[-1]
    found[before] += spline(readings[0], 1) * (place[before] - readings[0])
    found[after] += spline(readings[-1], 1) * (place[after] - readings[-1])
    return np.asarray(found)


NONE = np.zeros(0, dtype=int)


NARROW_STEP = round(WIDE_RATE_HZ / NARROW_RATE_HZ)
NARROW_HALF = NARROW_TAPS // 2


def low_pass_kernel(
    taps: int, cutoff_hz: float, sample_rate_hz: float, window: Callable[[int], Array] = np.hamming
) -> Array:
    """Windowed-sinc low-pass (Hamming), unit gain at zero frequency, shape (taps,); ``taps`` is odd.

    The same kernel as ``scipy.signal.firwin``, without the two seconds that importing it takes.
    """
    place = np.arange(taps) - taps // 2
    kernel = np.sinc(2.0 * cutoff_hz / sample_rate_hz * place) * window(taps)
    return np.asarray(kernel / kernel.sum())


DIFFERENCE = np.array((-1.0, 8.0, 0.0, -8.0, 1.0)) / 12.0
"""Central difference of fourth order: exact to 1e-7 at 5 Hz and 1 kHz, and quiet towards the Nyquist
frequency, where a second difference would let noise fold back into the band."""
EDGE = 4
"""Zeros on either side of the wide kernel, for two differences that reach beyond it."""


def derivative_kernels(sample_rate_hz: float) -> tuple[Array, int]:
    """Low-pass kernel at 40 Hz with its first and second derivative, shape (taps, 3), and the decimation.

    Units 1, 1/s, 1/s^2. At a sampling rate below 250 Hz nothing is decimated.
    """
    step = max(1, round(sample_rate_hz / WIDE_RATE_HZ))
    cutoff = min(WIDE_CUTOFF_HZ, 0.3 * sample_rate_hz)
    taps = 2 * round(1.2 * sample_rate_hz / cutoff) + 1
    # A Hann window ends at zero, where a Hamming window's step would ring in the second derivative. The zeros
    # keep differences at its edges: a torque and the acceleration that causes it must pass with one gain.
    smooth = np.pad(low_pass_kernel(taps, cutoff, sample_rate_hz, np.hanning), EDGE)
    taps += 2 * EDGE
    slope = -np.convolve(smooth, DIFFERENCE, mode="same") * sample_rate_hz
    # A finite kernel must differentiate a ramp to exactly one and a parabola to exactly two.
    lag = (np.arange(taps) - taps // 2) / sample_rate_hz
    slope /= float(slope @ lag)
    bend = -np.convolve(slope, DIFFERENCE, mode="same") * sample_rate_hz
    bend -= bend.mean()
    bend /= 0.5 * float(bend @ lag**2)
    return np.stack((smooth, slope, bend), axis=1), step


def differentiate(values: Array, kernels: Array, step: int) -> Array:
    """Values with first and second derivative at the wide rate, shape (3, m); only whole windows."""
    count = max(0, (len(values) - len(kernels)) // step + 1)
    block = np.hstack([_block_kernel(k, step) for k in kernels.T])
    blocks = -(-count // BLOCK)
    padded = np.zeros((blocks - 1) * BLOCK * step + len(block) if blocks else len(block))
    padded[: len(values)] = values[: len(padded)]
    windows = np.ascontiguousarray(sliding_window_view(padded, len(block))[:: BLOCK * step])
    wide = (windows @ block).reshape(len(windows), kernels.shape[1], BLOCK)
    return np.ascontiguousarray(wide.transpose(1, 0, 2).reshape(kernels.shape[1], -1)[:, :count])


def is_wide_rate(rate: float) -> bool:
    """Whether signals of this rate, Hz, are at the wide rate as they are."""
    return abs(rate / WIDE_RATE_HZ - 1.0) < SAME_RATE


def at_wide_rate(signals: Array, rate: float) -> Array:
    """Smooth signals (..., n) of a rate (Hz) at the wide rate exactly, from their first sample on.

    Delays and both filters count in samples of that rate. Between the samples a polynomial through the eight
    nearest is taken (Lagrange).
    """
    length = signals.shape[-1]
    if is_wide_rate(rate) or length < POINTS:
        return signals
    place = np.arange(int((length - 1) * WIDE_RATE_HZ / rate) + 1) * (rate / WIDE_RATE_HZ)
    first = np.clip(np.floor(place).astype(int) - POINTS // 2 + 1, 0, length - POINTS)
    at = place - first
    nodes = np.arange(POINTS)
    weights = np.ones((POINTS, len(place)))
    for k in nodes:
        for other in nodes[nodes != k]:
            weights[k] *= (at - other) / (k - other)
    result = np.zeros((*signals.shape[:-1], len(place)))
    for k in nodes:
        result += weights[k] * signals[..., first + k]
    return result


POINTS = 8
"""Samples that a value between two of them follows from: right to a thousandth up to a fifth of the rate."""
SAME_RATE = 1e-6
"""Rates that differ by no larger share are the same: a minute of samples then drifts by a sixtieth of one."""


_NARROW = low_pass_kernel(NARROW_TAPS, NARROW_CUTOFF_HZ, WIDE_RATE_HZ)
EFFECTIVE_SHARE = min(1.0, float(1.0 / (NARROW_RATE_HZ / WIDE_RATE_HZ * np.sum(_NARROW**2) ** -1)))
"""Independent samples per decimated sample of white noise: noise bandwidth over Nyquist frequency."""


@lru_cache(maxsize=32)
def noise_of_derivatives(rate: float) -> tuple[float, ...]:
    """Variance that white noise of 1 unit^2 at ``rate`` (Hz) leaves, low-passed, of a signal and its slopes.

    Of the signal, its first and its second derivative: 1, 1/s^2 and 1/s^4.
    """
    frequency = np.linspace(0.0, 0.5 * min(rate, WIDE_RATE_HZ), 1024)

    def passed(kernels: Array, at: float) -> Array:
        turns = np.outer(frequency, np.arange(len(kernels)) / at)
        return np.asarray(np.abs(np.exp(-2j * np.pi * turns) @ kernels) ** 2)

    both = passed(derivative_kernels(rate)[0], rate) * passed(_NARROW[:, None], WIDE_RATE_HZ)
    return tuple(float(np.trapezoid(one, frequency)) / (0.5 * rate) for one in both.T)


def decimated_count(length: int) -> int:
    """Number of decimated samples that a wide signal of ``length`` samples gives."""
    return max(0, (length - NARROW_TAPS) // NARROW_STEP + 1)


BLOCK = 16
"""Decimated samples that one product of matrices gives."""
BLOCK_LENGTH = BLOCK * NARROW_STEP
"""Wide samples from one block to the next."""


def _block_kernel(kernel: Array, step: int) -> Array:
    """The kernel at ``BLOCK`` successive outputs, shape (window, BLOCK)."""
    result = np.zeros(((BLOCK - 1) * step + len(kernel), BLOCK))
    for k in range(BLOCK):
        result[k * step : k * step + len(kernel), k] = kernel
    return result


_BLOCK_KERNEL = _block_kernel(_NARROW, NARROW_STEP)


def padded_length(length: int) -> int:
    """Samples of a wide signal of ``length`` samples, with zeros that make it whole blocks and one more."""
    return (-(-decimated_count(length) // BLOCK) + 1) * BLOCK_LENGTH


def decimate(columns: NDArray[np.floating[Any]], length: int | None = None) -> Array:
    """Low-pass at 8 Hz and decimate to 25 Hz; shape (..., n) -> (..., decimated_count(n)).

    Each column has a product of matrices of its own, of one shape for all: in a product of all columns at
    once, the last bits of a column depend on how many stand before it on many processors.

    Args:
        length: n, where the columns are padded with zeros to ``padded_length(n)`` already; else None.
    """
    n = columns.shape[-1] if length is None else length
    count = decimated_count(n)
    if count == 0:
        return np.zeros((*columns.shape[:-1], 0))
    flat = columns.reshape(-1, columns.shape[-1])
    if length is None:
        flat = np.zeros((len(flat), padded_length(n)), columns.dtype)
        flat[:, :n] = columns.reshape(-1, n)
    blocks = flat.reshape(len(flat), -1, BLOCK_LENGTH)
    kernel = _BLOCK_KERNEL.astype(columns.dtype)
    behind = len(kernel) - BLOCK_LENGTH  # a window reaches so far into the next block
    low = blocks[:, :-1] @ kernel[:BLOCK_LENGTH]
    low += blocks[:, 1:, :behind] @ kernel[BLOCK_LENGTH:]
    low = low.reshape(len(flat), -1)[:, :count]
    return np.asarray(low.reshape(*columns.shape[:-1], count), dtype=np.float64)
