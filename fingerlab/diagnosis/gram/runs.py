"""The sums of one run: its segments read or taken from the cache, and reduced to products of signals.

A second look asks the same runs for few other columns. Opening the file again, differentiating its channels
and forming what every model holds would cost more than those: a first reading keeps the motion of every
segment, and the signals of every model.
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
from fingerlab.diagnosis.gram.decimation import Narrow, _fill, narrow_columns, repeating_bases
from fingerlab.diagnosis.gram.sums import Part, RunSums, Sums
from fingerlab.diagnosis.signals.segments import senses, stretches
from fingerlab.effects.base import Effect
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, Run, Session

MOST_BYTES = 48_000_000
"""So much is kept in each process, about forty runs of half a minute; longer recordings are read again."""


_NUMBERS = count()


@dataclass(frozen=True)
class Seen:
    """A stretch as it was read, and what every model sees of it at the narrow rate.

    ``low`` (signals, n), in single precision as the filter gives it, holds the signals of the first
    ``features`` features; ``live`` are those that are not zero throughout. ``taut``, ``rest`` (n,) bool and
    ``time`` (n,) s as in :class:`decimation.Narrow`.
    """

    motion: Motion
    features: int
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


@dataclass
class Recall:
    """Who reads the runs of one analysis, and what they keep of them.

    Attributes:
        executor: a second process that takes a share of the runs; None: there is none.
        number: tells analyses apart in the second process, which keeps what it read itself.
        elsewhere: runs that the second process has read; runs are told by their numbers.
    """

    executor: Executor | None = None
    number: int = field(default_factory=partial(next, _NUMBERS))
    elsewhere: set[int] = field(default_factory=set)
    _runs: dict[int, list[Seen]] = field(default_factory=dict, repr=False)
    _size: int = 0

    def stretches(self, run: int) -> Iterator[Seen]:
        """The stretches of a run that is kept; none of others. States of friction are formed anew."""
        for seen in self._runs.get(run, ()):
            yield replace(seen, motion=replace(seen.motion, _memory={}))

    def keep(self, run: int, stretches: Sequence[Seen]) -> None:
        """Keep a run that was read to its end."""
        self._size += sum(seen.size for seen in stretches)
        self._runs[run] = [replace(s, motion=replace(s.motion, _memory={})) for s in stretches]

    def has_room(self, stretches: Sequence[Seen]) -> bool:
        """Whether these could be kept, too."""
        return self._size + sum(seen.size for seen in stretches) <= MOST_BYTES

    def __contains__(self, run: int) -> bool:
        return run in self._runs


Keep = Callable[[Session, Run, Narrow], None]
"""Who is shown every stretch of a run as it passes."""


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


def run_sums(
    number: int,
    session: Session,
    run: Run,
    effects: Sequence[Effect],
    asked: Asked,
    keep: Keep | None,
    recall: Recall,
) -> RunSums:
    """Products of all signals over a run, in stretches of at most a minute; ``number`` is its own."""
    result = RunSums(run.name)
    for low in _narrowed(number, session, run, effects, asked, recall):
        motion = low.wide
        sense = senses(run, motion)
        result.senses += [] if sense is None else [sense]
        live = np.ascontiguousarray(low.columns.T[low.live])
        part = _products(low, live)
        repeating = repeating_bases(low, run, asked.seek_cycle)
        if repeating is None:
            result.add(Part(low.live + asked.start, part))
        else:
            cyclic, trend = live @ repeating[0], live @ repeating[1]
            noise = part.products - cyclic @ cyclic.T
            result.add(Part(low.live + asked.start, part, noise, len(low.time) - cyclic.shape[1]))
            result.trends.append((low.live + asked.start, trend))
        result.encoder_variance = (motion.radius * motion.position_step) ** 2 / 12.0
        if keep is not None:
            keep(session, run, low)
    return result


def _narrowed(
    number: int, session: Session, run: Run, effects: Sequence[Effect], asked: Asked, recall: Recall
) -> Iterator[Narrow]:
    """All signals of a run's stretches, read or recalled."""
    if number in recall:
        for seen in recall.stretches(number):
            yield narrow_again(seen, effects, asked.signals)
        return
    found: list[Seen] | None = []
    for motion in stretches(run, session.rig):
        low = narrow_columns(motion, effects, asked.signals)
        yield low
        if found is not None:
            found.append(to_recall(low, asked))
            found = found if recall.has_room(found) else None
    if found is not None:
        recall.keep(number, found)


def _products(low: Narrow, live: Array) -> Sums:
    """Sums over one stretch, of its live signals, (live, n)."""
    taut = int(low.taut.sum())
    loose, still = live[:, ~low.taut], live[:, low.taut & low.rest]
    return Sums(
        live @ live.T,
        loose @ loose.T if loose.shape[1] else None,
        taut,
        len(low.taut) - taut,
        still @ still.T if still.shape[1] else None,
        still.shape[1],
    )
