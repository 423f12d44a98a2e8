"""From the motion of a segment to its signals as they are judged: low-passed at 8 Hz, decimated to 25 Hz.

Decides which samples of a segment count, which of them are judged apart (those of a taut cable, and those at
which the motor stands), how a delayed channel is read, and what a second reading takes over from the first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial.legendre import legvander

from fingerlab.diagnosis.equations.columns import Column, all_columns
from fingerlab.diagnosis.equations.features import SHIFT_SAMPLES, SLOPE, BoolArray, IntArray
from fingerlab.diagnosis.settings import (
    AT_ONCE,
    AT_REST_DEG,
    INERTIA_SPREADS,
    NARROW_RATE_HZ,
    REST_REACH,
    SLACK_NOISES,
    SLACK_TENSION_N,
    TREND_DEGREE,
)
from fingerlab.diagnosis.signals.filters import (
    NARROW_HALF,
    NARROW_STEP,
    decimate,
    decimated_count,
    padded_length,
)
from fingerlab.effects.base import Effect, Shape
from fingerlab.effects.joints import DRIVE, driven_tension
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.trajectory import found_frequency, told_frequency


def drive_told(effects: Sequence[Effect]) -> Shape:
    """What motor and gearbox keep for themselves, as the shape of any effect tells it; nothing: none does."""
    return next(
        (e.shapes[0] for e in effects if len(e.shapes) == 1 and DRIVE.keys() <= e.shapes[0].keys()), {}
    )


def taut_moments(motion: Motion, inner: slice, drive: Shape) -> BoolArray:
    """Samples into whose low-pass window no slack moment falls.

    Args:
        drive: what motor and gearbox keep for themselves, of ``transmission.DRIVE``.
    """
    if motion.finger is None:
        return np.ones(len(decimate(motion.time[inner])), dtype=bool)
    pull = driven_tension(motion, drive)
    pull = pull - INERTIA_SPREADS * motion.inertia_spread * np.abs(motion.acceleration) / motion.radius
    smooth = np.convolve(pull, np.ones(9) / 9, mode="same")  # 36 ms: the tension's own noise is then small
    noise = float(np.median(np.abs(pull - smooth)[inner])) if len(pull[inner]) else 0.0
    loose = (smooth < max(SLACK_TENSION_N, SLACK_NOISES * noise))[inner]
    # A slack cable hangs through by millimetres, the taut one is known to micrometres: no window that
    # holds a slack moment anywhere but at its very ends may pass for taut.
    reach = np.ones(2 * (NARROW_HALF - NARROW_HALF // 8) + 1)
    near = np.convolve(loose.astype(float), reach, mode="same") > 0.5
    count = decimated_count(len(loose))
    return np.asarray(~near[NARROW_HALF::NARROW_STEP][:count])


def rest_moments(position: Array) -> BoolArray:
    """Decimated samples around which the motor stands, (n,)."""
    angle = np.pad(decimate(position), REST_REACH, mode="edge")
    windows = sliding_window_view(angle, 2 * REST_REACH + 1)
    return np.asarray(np.ptp(windows, axis=1) < np.radians(AT_REST_DEG))


MARGIN = max(abs(samples) for samples in SHIFT_SAMPLES)
"""Samples at the wide rate on either side of those that are judged: room for the delays."""


@dataclass(frozen=True)
class Decimated:
    """Signals of one stretch, decimated: ``columns`` (n, signals), ``taut`` (n,) bool, ``time`` (n,) s.

    ``rest`` (n,) tells where the motor stands; ``live`` are the signals that are not zero throughout.
    """

    columns: Array
    taut: BoolArray
    time: Array
    wide: Motion
    rest: BoolArray
    live: IntArray


def counted(motion: Motion) -> slice:
    """Samples of a stretch, at the wide rate, that are judged: behind its lead, with room for shifts."""
    return slice(motion.lead + MARGIN, len(motion.time) - MARGIN)


def decimated_columns(motion: Motion, effects: Sequence[Effect], signals: IntArray) -> Decimated:
    """All signals of a segment, low-passed at 8 Hz and decimated to 25 Hz.

    ``signals`` is the layout's: which signal each feature is, (features,).
    """
    inner = counted(motion)
    time = decimate(motion.time[inner])
    low = np.zeros((int(signals.max()) + 1, len(time)))
    known = np.zeros(len(low), dtype=bool)
    live = fill(low, motion, all_columns(motion, effects), signals, known)
    taut, rest = taut_moments(motion, inner, drive_told(effects)), rest_moments(motion.position[inner])
    return Decimated(low.T, taut, time, motion, rest, np.array(live))


def fill(
    low: Array, motion: Motion, columns: Iterable[Column], signals: IntArray, known: BoolArray
) -> list[int]:
    """Filter the signals that are not ``known`` (signals,) into ``low``; gives those that are not zero."""
    inner = counted(motion)
    # Single precision is a hundred times finer than the sensors, and twice as fast.
    length = max(inner.stop - inner.start, 0)
    wide = np.zeros((AT_ONCE, padded_length(length)), np.float32)
    live: list[int] = []
    waiting = 0
    done = known.tolist()
    for place, (values, shift, _, _) in zip(signals.tolist(), columns, strict=True):
        if done[place]:
            continue
        done[place] = True
        column = _shifted(values, shift, motion.sample_rate_hz, inner)
        if not _is_zero(column):  # a force where nothing is touched, a stop that no joint reaches
            wide[waiting, :length] = column
            live.append(place)
            waiting += 1
        if waiting == AT_ONCE:
            low[live[-waiting:]] = decimate(wide, length)
            waiting = 0
    if waiting:
        low[live[-waiting:]] = decimate(wide[:waiting], length)
    return live


def _is_zero(values: Array) -> bool:
    if len(values) == 0 or values.strides == (0,):  # one value all along
        return len(values) == 0 or bool(values[0] == 0.0)
    return bool(values[len(values) // 2] == 0.0 and not values.any())


def _shifted(values: Array, shift: int | None, rate: float, inner: slice) -> Array:
    """Samples ``inner`` of a channel, later by a kept shift, or of its derivative; the margin has room."""
    if shift is None:
        return values[inner]
    if shift == SLOPE:
        return np.asarray(np.gradient(values, 1.0 / rate)[inner])
    late = SHIFT_SAMPLES[shift]
    return values[inner.start - late : max(inner.stop - late, 0)]


def repeating_bases(low: Decimated, run: Run, seek: bool = False) -> tuple[Array, Array] | None:
    """What a stretch may repeat: bases of its cycle, (n, harmonics), and of a slow trend, (n, degrees).

    ``seek`` a cycle in the motion itself where the run does not tell it. None where there is no cycle that
    repeats often enough.
    """
    frequency = told_frequency(run)
    if frequency is None and seek:
        frequency = _sought(low, run)
    if frequency is None:
        return None
    count = int(np.ceil(0.5 * NARROW_RATE_HZ / frequency)) - 1
    if 2 * count + 1 > 0.6 * len(low.time):
        return None
    return _harmonics(frequency, count, float(low.time[0]), float(low.time[-1]), len(low.time))


def _sought(low: Decimated, run: Run) -> float | None:
    """Cycles a second of a stretch, Hz, by its command, or else by its motion; None: neither comes again.

    A finger that presses settles for a while, and hardly moves: its command is the better witness.
    """
    motion = low.wide
    if run.has("motor_command"):
        step = max(round(run.sample_rate_hz / motion.sample_rate_hz), 1)
        first, last = (round(float(t) * run.sample_rate_hz) for t in low.time[[0, -1]])
        command = run.channel("motor_command", first, last + 1)[::step]
        found = found_frequency(command, run.sample_rate_hz / step) if np.isfinite(command).all() else None
        if found is not None:
            return found
    return found_frequency(motion.position[counted(motion)], motion.sample_rate_hz)


@lru_cache(maxsize=4)
def _harmonics(frequency: float, count: int, first: float, last: float, samples: int) -> tuple[Array, Array]:
    """Orthonormal bases of a constant and harmonics, (samples, 2 count + 1), and of a trend beside them.

    ``frequency`` in Hz, ``first`` and ``last`` sample in s. The runs of a session share them.
    """
    phase = 2 * np.pi * frequency * np.outer(np.linspace(first, last, samples), np.arange(1, count + 1))
    trend = legvander(np.linspace(-1.0, 1.0, samples), TREND_DEGREE)
    basis = np.linalg.qr(np.hstack((trend[:, :1], np.cos(phase), np.sin(phase), trend[:, 1:])))[0]
    return basis[:, :-TREND_DEGREE], basis[:, -TREND_DEGREE:]
