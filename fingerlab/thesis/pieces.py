"""Long runs in pieces, so that memory depends on the piece and not on the recording."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from fingerlab.sessions.cycle import named_frequency
from fingerlab.sessions.model import Array, Run

LARGEST_PIECE = 300_000
"""Samples of one piece at most: five minutes at 1 kHz, ten times a run of the thesis."""


def in_pieces(runs: Iterable[Run]) -> tuple[Run, ...]:
    """The same runs, those longer than ``LARGEST_PIECE`` cut into about equal pieces.

    A piece starts with a period of its trajectory and is named ``001:2``; it is filtered, settled and
    judged like a run of its own. No sample is read here.
    """
    return tuple(piece for run in runs for piece in _pieces(run))


def _pieces(run: Run) -> tuple[Run, ...]:
    count = math.ceil(run.length / LARGEST_PIECE)
    if count <= 1:
        return (run,)
    frequency = named_frequency(run)
    period = run.sample_rate_hz / frequency if frequency > 0 else 1.0
    cuts = [round(round(k * run.length / count / period) * period) for k in range(count)]
    cuts = [*dict.fromkeys(cuts), run.length]
    return tuple(
        replace(run, name=f"{run.name}:{number}", length=stop - start, reader=_OffsetReader(run, start))
        for number, (start, stop) in enumerate(itertools.pairwise(cuts), start=1)
    )


@dataclass(frozen=True)
class _OffsetReader:
    """Samples of a run counted from one of its samples on. Picklable where the run's reader is."""

    run: Run
    offset: int

    def __call__(self, name: str, start: int, stop: int) -> Array:
        return self.load([name], start, stop)[name]

    def load(self, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
        """Samples of several channels at once."""
        return self.run.load(names, self.offset + start, self.offset + stop)
