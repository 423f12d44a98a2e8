"""What a first reading leaves for a second one: the motion of every stretch, and the signals of every model.

A second look asks the same runs for few other columns. Opening the file again, differentiating its channels
and forming what every model holds would cost more than those.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields, replace
from functools import partial
from itertools import count

import numpy as np

from fingerlab.diagnosis.sums import BoolArray, IntArray
from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array

MOST_BYTES = 48_000_000
"""So much is kept in each process, about forty runs of half a minute; longer recordings are read again."""


_NUMBERS = count()


@dataclass(frozen=True)
class Seen:
    """A stretch as it was read, and what every model sees of it at the narrow rate.

    ``low`` (signals, n), in single precision as the filter gives it, holds the signals of the first
    ``features`` features; ``live`` are those that are not zero throughout. ``taut``, ``rest`` (n,) bool and
    ``time`` (n,) s as in :class:`narrowing.Narrow`.
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
