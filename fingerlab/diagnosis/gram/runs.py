"""The sums of one run: its segments read or taken from the cache, and reduced to products of signals.

A later pass asks the same runs for few other columns, or for none. Opening the file again, differentiating
its channels and forming the columns would cost more than all the rest: the first reading keeps the motion of
every segment, and its signals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields, replace
from functools import partial
from itertools import count

import numpy as np

from fingerlab.diagnosis.equations.columns import Asked, effect_columns
from fingerlab.diagnosis.equations.features import BoolArray, IntArray
from fingerlab.diagnosis.gram.decimation import (
    Decimated,
    counted,
    decimated_columns,
    drive_told,
    fill,
    repeating_bases,
    taut_moments,
)
from fingerlab.diagnosis.gram.state_law import state_products
from fingerlab.diagnosis.gram.sums import Part, RunSums, Sums
from fingerlab.diagnosis.settings import MOST_BYTES
from fingerlab.diagnosis.signals.contradictions import facts_of
from fingerlab.diagnosis.signals.segments import segments_of, senses
from fingerlab.effects.base import Effect
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, Run, Session


@dataclass(frozen=True)
class CachedSegment:
    """A segment as the first reading saw it, with its signals at the decimated rate.

    ``low`` (live, n), in single precision as the filter gives it, holds the signals ``live``, (live,), which
    are those that are not zero throughout. ``taut``, ``rest`` (n,) bool and ``time`` (n,) s as in
    :class:`decimation.Decimated`.
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


def decimated_again(segment: CachedSegment, effects: Sequence[Effect], asked: Asked) -> Decimated:
    """The signals that are asked for, of a segment that was read before; few are formed."""
    low = np.zeros((len(asked.cached), len(segment.time)))
    rows = np.full(max(int(segment.live.max(initial=-1)), int(asked.cached.max())) + 1, -1)
    rows[segment.live] = np.arange(len(segment.live))
    known = asked.cached >= 0
    places = np.flatnonzero(known)
    held = rows[asked.cached[places]]
    places, held = places[held >= 0], held[held >= 0]
    low[places] = segment.low[held]
    wanted = [effects[k] for k in asked.formed]
    # Positions of their features, in the order in which the columns come.
    signals = np.concatenate([asked.features[k] for k in asked.formed] or [np.zeros(0, dtype=int)])
    formed = fill(low, segment.motion, effect_columns(segment.motion, wanted), signals, known)
    live = np.sort(np.concatenate((places, np.array(formed, dtype=places.dtype))))
    drive = drive_told(effects)
    taut = (
        taut_moments(segment.motion, counted(segment.motion), drive) if any(drive.values()) else segment.taut
    )
    return Decimated(low.T, taut, segment.time, segment.motion, segment.rest, live)


def to_cache(low: Decimated) -> CachedSegment:
    """What later passes need of a segment; what its motion remembers, many times its size, is formed anew."""
    signals = low.columns.T[low.live].astype(np.float32)
    return CachedSegment(replace(low.wide, _memory={}), signals, low.live, low.taut, low.rest, low.time)


Keep = Callable[[Session, Run, Decimated], None]
"""Who is shown every segment of a run as it passes."""


def run_sums(
    number: int,
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    asked: Asked,
    keep: Keep | None,
    cache: SegmentCache,
) -> RunSums:
    """Products of all signals over a run, in segments of at most a minute; ``number`` is its own."""
    result = RunSums(run.name)
    for low in _decimated(number, session, run, effects, asked, cache):
        motion = low.wide
        if asked.first and result.facts is None:
            result.facts = facts_of(run, motion, session.rig)
        sense = senses(run, motion)
        result.senses += [] if sense is None else [sense]
        result.repairs.update(motion.repairs)
        result.samples += (len(motion.time) - motion.lead) * run.sample_rate_hz / motion.sample_rate_hz
        live = np.ascontiguousarray(low.columns.T[low.live])
        part, totals = _products(low, live)
        repeating = repeating_bases(low, run, asked.seek_cycle)
        if repeating is None:
            result.add(Part(low.live + asked.start, part, totals))
            result.state_products += state_products(low, asked.orders) if motion.finger is None else []
        else:
            cyclic, trend = live @ repeating[0], live @ repeating[1]
            noise = part.products - cyclic @ cyclic.T
            result.add(Part(low.live + asked.start, part, totals, noise, len(low.time) - cyclic.shape[1]))
            result.trends.append((low.live + asked.start, trend))
        result.encoder_variance = (motion.radius * motion.position_step) ** 2 / 12.0
        if keep is not None:
            keep(session, run, low)
    return result


def _decimated(
    number: int, session: Session, run: Run, effects: Sequence[Effect], asked: Asked, cache: SegmentCache
) -> Iterator[Decimated]:
    """All signals of a run's segments, read or from the cache; a first reading is kept."""
    if number in cache:
        for segment in cache.segments(number):
            yield decimated_again(segment, effects, asked)
        return
    found: list[CachedSegment] | None = [] if asked.first else None
    for motion in segments_of(run, session.rig):
        low = decimated_columns(motion, effects, asked.signals)
        yield low
        if found is not None:
            found.append(to_cache(low))
            found = found if cache.has_room(found) else None
    if found is not None:
        cache.keep(number, found)


def _products(low: Decimated, live: Array) -> tuple[Sums, Array]:
    """Sums over one stretch, of products of its live signals, (live, n), and of these, (3, live)."""
    taut = int(low.taut.sum())
    loose, still = live[:, ~low.taut], live[:, low.taut & low.rest]
    sums = Sums(
        live @ live.T,
        loose @ loose.T if loose.shape[1] else None,
        taut,
        len(low.taut) - taut,
        still @ still.T if still.shape[1] else None,
        still.shape[1],
    )
    return sums, np.stack([signals.sum(axis=1) for signals in (live, loose, still)])
