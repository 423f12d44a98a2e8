"""From the motion of a stretch to its signals as they are judged: low-passed at 8 Hz, decimated to 25 Hz.

Decides which samples of a stretch count, how a delayed channel is read, and what a second reading takes over
from the first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.diagnosis.bandwidth import WIDE_RATE_HZ, narrow
from fingerlab.diagnosis.columns import Asked, Column, all_columns, effect_columns
from fingerlab.diagnosis.moments import rest_moments, taut_moments
from fingerlab.diagnosis.recall import Seen
from fingerlab.diagnosis.shifts import SHIFTS_S, SLOPE
from fingerlab.diagnosis.sums import BoolArray, IntArray
from fingerlab.effects.base import Effect
from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array, Run, Session

MARGIN = round(max(abs(s) for s in SHIFTS_S) * WIDE_RATE_HZ)
"""Samples at the wide rate on either side of those that are judged: room for the delays."""
AT_ONCE = 64
"""So many signals are filtered together: they fit into the processor's cache."""


@dataclass(frozen=True)
class Narrow:
    """Signals of one stretch, decimated: ``columns`` (n, signals), ``taut`` (n,) bool, ``time`` (n,) s.

    ``rest`` (n,) tells where the motor stands; ``live`` are the signals that are not zero throughout.
    """

    columns: Array
    taut: BoolArray
    time: Array
    wide: Motion
    rest: BoolArray
    live: IntArray


Keep = Callable[[Session, Run, Narrow], None]
"""Who is shown every stretch of a run as it passes."""


def counted(motion: Motion) -> slice:
    """Samples of a stretch, at the wide rate, that are judged: behind its lead, with room for shifts."""
    return slice(motion.lead + MARGIN, len(motion.time) - MARGIN)


def narrow_columns(motion: Motion, effects: Sequence[Effect], signals: IntArray) -> Narrow:
    """All signals of a stretch, low-passed at 8 Hz and decimated to 25 Hz.

    ``signals`` is the layout's: which signal each feature is, (features,).
    """
    inner = counted(motion)
    time = narrow(motion.time[inner])
    low = np.zeros((int(signals.max()) + 1, len(time)))
    live = _fill(low, motion, all_columns(motion, effects), signals, 0)
    taut, rest = taut_moments(motion, inner), rest_moments(motion.position[inner])
    return Narrow(low.T, taut, time, motion, rest, np.array(live))


def narrow_again(seen: Seen, effects: Sequence[Effect], signals: IntArray) -> Narrow:
    """The same of a stretch that was read before; ``signals`` begin as they did then."""
    known = len(seen.low)
    low = np.zeros((max(int(signals.max()) + 1, known), len(seen.time)))
    low[:known] = seen.low
    rest = _fill(low, seen.motion, effect_columns(seen.motion, effects), signals[seen.features :], known)
    live = np.concatenate((seen.live, np.array(rest, dtype=seen.live.dtype)))
    return Narrow(low.T, seen.taut, seen.time, seen.motion, seen.rest, live)


def to_recall(low: Narrow, asked: Asked) -> Seen:
    """What a later reading needs of a stretch beside its motion."""
    known = int(asked.signals[: asked.common].max()) + 1
    common = low.columns.T[:known].astype(np.float32)
    return Seen(low.wide, asked.common, common, low.live[low.live < known], low.taut, low.rest, low.time)


def _fill(low: Array, motion: Motion, columns: Iterable[Column], signals: IntArray, count: int) -> list[int]:
    """Filter the signals from the number ``count`` on into ``low``; gives those that are not zero."""
    inner = counted(motion)
    # Single precision is a hundred times finer than the sensors, and twice as fast.
    wide = np.empty((AT_ONCE, max(inner.stop - inner.start, 0)), np.float32)
    live: list[int] = []
    waiting = 0
    for place, (values, shift, _, _) in zip(signals.tolist(), columns, strict=True):
        if place < count:
            continue
        count += 1
        column = _shifted(values, shift, motion.sample_rate_hz, inner)
        if not _is_zero(column):  # a force where nothing is touched, a stop that no joint reaches
            wide[waiting] = column
            live.append(place)
            waiting += 1
        if waiting == AT_ONCE:
            low[live[-waiting:]] = narrow(wide)
            waiting = 0
    if waiting:
        low[live[-waiting:]] = narrow(wide[:waiting])
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
    late = round(SHIFTS_S[shift] * WIDE_RATE_HZ)
    return values[inner.start - late : max(inner.stop - late, 0)]
