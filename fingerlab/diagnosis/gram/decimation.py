"""Signals of a stretch, low-passed and decimated, and what is kept of them for a later pass.

Low-passing decides which samples of a segment count, which of them are judged apart (those of a taut cable,
and those at which the motor stands), how a delayed channel is read, and what a second reading takes over from
the first.

A later pass asks the same runs for few other columns, or for none. Opening the file again, differentiating
its channels and forming the columns would cost more than all the rest: the first reading keeps the motion of
every segment, and its signals.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields, replace
from functools import partial
from itertools import count

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fingerlab.diagnosis.equations.coefficients import SHIFT_SAMPLES, SLOPE
from fingerlab.diagnosis.equations.columns import Column, ReadRequest, all_columns, effect_columns
from fingerlab.diagnosis.settings import (
    AT_ONCE,
    AT_REST_DEG,
    INERTIA_SPREADS,
    LOW_PASS_REACH,
    MOST_BYTES,
    PULLED_SHARE,
    REST_REACH,
    SLACK_NOISES,
    SLACK_REACH,
    SLACK_TENSION_N,
    STUCK_MIX,
    STUCK_REACH,
    STUCK_SHARE,
    STUCK_STEPS,
    TENSION_SAMPLES,
)
from fingerlab.diagnosis.signals.filters import (
    NARROW_HALF,
    NARROW_STEP,
    decimate,
    decimated_count,
    padded_length,
)
from fingerlab.effects.base import Effect, Shape
from fingerlab.effects.transmission import DRIVE, driven_tension
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, BoolArray, IntArray


def drive_shape(effects: Sequence[Effect]) -> Shape:
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
    smooth = np.convolve(pull, np.ones(TENSION_SAMPLES) / TENSION_SAMPLES, mode="same")
    noise = float(np.median(np.abs(pull - smooth)[inner])) if len(pull[inner]) else 0.0
    loose = (smooth < max(SLACK_TENSION_N, SLACK_NOISES * noise))[inner]
    return ~near_moments(loose, int(SLACK_REACH * NARROW_HALF))


def near_moments(moments: BoolArray, reach: int) -> BoolArray:
    """Decimated samples with one of the ``moments`` (n,) within so many samples at the wide rate."""
    near = np.convolve(moments.astype(float), np.ones(2 * reach + 1), mode="same") > 0.5
    return np.asarray(near[NARROW_HALF::NARROW_STEP][: decimated_count(len(moments))])


def stuck_moments(motion: Motion, inner: slice) -> BoolArray:
    """Samples ``inner`` of a motor alone at which it does not move while its torque does, (n,).

    A loop that pulls at what sticks takes its torque from one side of the friction to the other; no law of
    travel says how far it has come.
    """
    position, torque = motion.position, motion.torque
    usual = float(np.sqrt(np.mean(motion.velocity[inner] ** 2))) / motion.sample_rate_hz  # in a sample
    # So long that the motor usually moves several steps of its encoder meanwhile.
    reach = max(math.ceil(0.5 * STUCK_STEPS * motion.position_step / max(usual, 1e-300)), 1)
    if reach > STUCK_REACH or len(position) <= 2 * reach:
        return np.zeros(len(position[inner]), dtype=bool)
    least = max(motion.position_step, STUCK_SHARE * 2 * reach * usual)
    still = np.pad(np.ptp(sliding_window_view(position, 2 * reach + 1), axis=1) < least, reach)
    pulled = PULLED_SHARE * float(np.std(torque[inner]))
    within = np.pad(np.ptp(sliding_window_view(torque, 2 * reach + 1), axis=1), reach)
    stuck = still & (within > pulled)
    # However slowly a loop winds up: from where it came to rest until it moves on.
    smooth = np.convolve(torque, np.full(2 * reach + 1, 1.0 / (2 * reach + 1)), mode="same")
    ends = np.flatnonzero(np.diff(still.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    for begin, end in ends:
        stuck[begin:end] |= float(np.ptp(smooth[begin:end])) > pulled
    return np.asarray(stuck[inner])


def rest_moments(motion: Motion, inner: slice) -> BoolArray:
    """Decimated samples around which the motor stands, and those that the low-pass mixes with them, (n,).

    What sticks holds an unknown force to the end of a standstill; the low-pass carries it over the edge.
    """
    standing = _standing(motion.position[inner])
    if motion.finger is not None:
        return standing
    return standing | near_moments(stuck_moments(motion, inner), int(STUCK_MIX * NARROW_HALF))


def _standing(position: Array) -> BoolArray:
    angle = np.pad(decimate(position), REST_REACH, mode="edge")
    windows = sliding_window_view(angle, 2 * REST_REACH + 1)
    still = np.ptp(windows, axis=1) < np.radians(AT_REST_DEG)
    reach = REST_REACH + LOW_PASS_REACH
    return np.asarray(sliding_window_view(np.pad(still, reach), 2 * reach + 1).any(axis=1))


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
    taut, rest = taut_moments(motion, inner, drive_shape(effects)), rest_moments(motion, inner)
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


@dataclass(frozen=True)
class CachedSegment:
    """A segment as the first reading saw it, with its signals at the decimated rate.

    ``low`` (live, n), in single precision as the filter gives it, holds the signals ``live``, (live,), which
    are those that are not zero throughout. ``taut``, ``rest`` (n,) bool and ``time`` (n,) s as in
    :class:`Decimated`.
    """

    motion: Motion
    low: np.ndarray[tuple[int, ...], np.dtype[np.float32]]
    live: IntArray
    taut: BoolArray
    rest: BoolArray
    time: Array

    @property
    def size(self) -> int:
        """Bytes, about."""
        joints = self.motion.joints
        arrays = [getattr(self.motion, f.name) for f in fields(self.motion)]
        arrays += [] if joints is None else list(vars(joints).values())
        return self.low.nbytes + sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))


_NUMBERS = count()


@dataclass
class SegmentCache:
    """Who reads the runs of one analysis, and what they keep of them.

    Attributes:
        executor: a second process that takes a share of the runs; None: there is none.
        number: tells analyses apart in the second process, which keeps what it read itself.
        elsewhere: runs that the second process has read; runs are told by their numbers.
    """

    executor: Executor | None = None
    number: int = field(default_factory=partial(next, _NUMBERS))
    elsewhere: set[int] = field(default_factory=set)
    _runs: dict[int, list[CachedSegment]] = field(default_factory=dict, repr=False)
    _size: int = 0

    def segments(self, run: int) -> Iterator[CachedSegment]:
        """The segments of a run that is kept; none of others. States of friction are formed anew."""
        for segment in self._runs.get(run, ()):
            yield replace(segment, motion=replace(segment.motion, _memory={}))

    def keep(self, run: int, segments: Sequence[CachedSegment]) -> None:
        """Keep a run that was read to its end."""
        self._size += sum(one.size for one in segments)
        self._runs[run] = list(segments)

    def has_room(self, segments: Sequence[CachedSegment]) -> bool:
        """Whether these could be kept, too."""
        return self._size + sum(one.size for one in segments) <= MOST_BYTES

    def __contains__(self, run: int) -> bool:
        return run in self._runs


def decimated_again(segment: CachedSegment, effects: Sequence[Effect], asked: ReadRequest) -> Decimated:
    """The signals that are asked for, of a segment that was read before; few are formed."""
    low = np.zeros((len(asked.cached), len(segment.time)))
    rows = np.full(max(int(segment.live.max(initial=-1)), int(asked.cached.max())) + 1, -1)
    rows[segment.live] = np.arange(len(segment.live))
    known = asked.cached >= 0
    places = np.flatnonzero(known)
    cached = rows[asked.cached[places]]
    places, cached = places[cached >= 0], cached[cached >= 0]
    low[places] = segment.low[cached]
    wanted = [effects[k] for k in asked.formed]
    # Positions of their features, in the order in which the columns come.
    signals = np.concatenate([asked.features[k] for k in asked.formed] or [np.zeros(0, dtype=int)])
    formed = fill(low, segment.motion, effect_columns(segment.motion, wanted), signals, known)
    live = np.sort(np.concatenate((places, np.array(formed, dtype=places.dtype))))
    drive = drive_shape(effects)
    taut = (
        taut_moments(segment.motion, counted(segment.motion), drive) if any(drive.values()) else segment.taut
    )
    return Decimated(low.T, taut, segment.time, segment.motion, segment.rest, live)


def to_cache(low: Decimated) -> CachedSegment:
    """What later passes need of a segment; what its motion remembers, many times its size, is formed anew."""
    signals = low.columns.T[low.live].astype(np.float32)
    return CachedSegment(replace(low.wide, _memory={}), signals, low.live, low.taut, low.rest, low.time)
