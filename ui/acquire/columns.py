"""What each pixel column of a live plot shows of its curves, kept from one frame to the next. No Qt.

From frame to frame a live plot only gains the few columns that time has moved on by. A column is numbered by
the samples that lie in it, so that it keeps its number while it moves to the left, and is measured once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.sessions.model import Array

from .history import History

Run = tuple[int, int]
"""Columns from, to (not included)."""


@dataclass(frozen=True)
class View:
    """Columns ``first`` to ``first + count``; column ``c`` reaches from sample ``c * wide`` to the next one.

    Attributes:
        wide: samples in a column, not whole as a rule, and less than one where the picture is closely zoomed.
    """

    first: int
    count: int
    wide: float

    @classmethod
    def ending(cls, stop: int, samples: float, count: int) -> View:
        """The ``count`` columns over ``samples`` samples of which the last holds sample ``stop - 1``."""
        wide = samples / count
        return cls(math.ceil(stop / wide - 1e-9) - count, count, wide)

    @property
    def stop(self) -> int:
        """The column after the last."""
        return self.first + self.count

    def seconds(self, rate_hz: float) -> tuple[float, float]:
        """Times of the outer edges."""
        return self.first * self.wide / rate_hz, self.stop * self.wide / rate_hz


class Columns:
    """Smallest and largest value of each curve within each column, the way to its neighbours included.

    Attributes:
        low, high: shape (curves, columns), in the unit of the samples; column ``c`` is at ``c % columns``;
            NaN where a curve has nothing.
    """

    def __init__(self) -> None:
        self.low = self.high = np.empty((0, 0))
        self._of: tuple[object, ...] = ()
        self._kept: Run = (0, 0)
        self._settled = 0

    def follow(self, history: History, names: Sequence[str | None], view: View) -> list[Run]:
        """Measure what is new in ``view``; the columns that may differ from what they were.

        Args:
            names: the curves' columns in the history; None for a curve that is not shown.
        """
        of = (history, history.epoch, tuple(names), view.count, view.wide)
        if of != self._of:
            self._of = of
            self.low, self.high = (np.full((len(names), view.count), np.nan) for _ in range(2))
            self._kept = (view.first, view.first)
        newest = [(history.known(name) - 1) // view.wide for name in names if name is not None]
        runs = self._changed(view, math.ceil(max(newest, default=view.first)) + 1)
        for start, stop in runs:
            slots = np.arange(start, stop) % view.count
            for row, name in enumerate(names):
                if name is not None:
                    self.low[row, slots], self.high[row, slots] = extremes(
                        history, name, start, stop, view.wide
                    )
        self._kept = (view.first, view.stop)
        self._settled = math.floor(min(newest, default=view.stop))
        return runs

    def _changed(self, view: View, newest: int) -> list[Run]:
        """Columns that are not kept, and those kept that samples have come into since."""
        left, right = max(self._kept[0], view.first), min(self._kept[1], view.stop)
        if right <= left:
            return [(view.first, view.stop)]
        grown = max(min(self._settled, right), left), min(newest, right)
        if grown[1] == right > grown[0]:  # up to the right edge: one run with what is new there
            runs = [(view.first, left), (grown[0], view.stop)]
        else:
            runs = [(view.first, left), grown, (right, view.stop)]
        return [(start, stop) for start, stop in runs if stop > start]


def extremes(history: History, name: str, start: int, stop: int, wide: float) -> tuple[Array, Array]:
    """Smallest and largest value of the broken line through the samples, in columns ``start`` to ``stop``.

    Values at the columns' edges are taken from the line between the samples beside them, so that neighbours
    join; a gap stays a gap, and a sample between two gaps stays a dot.
    """
    edges = np.arange(start, stop + 1) * wide
    begin, end = math.floor(edges[0]), math.floor(edges[-1]) + 2
    first, values = history.series(name, begin, end)
    if len(values) < end - begin:
        padded = np.full(end - begin, np.nan)
        padded[first - begin : first - begin + len(values)] = values
        values = padded
    below = np.floor(edges)
    part, before = edges - below, below.astype(np.intp) - begin
    left = values[before]
    with np.errstate(invalid="ignore"):
        on_edge = np.where(part > 0, left + part * (values[before + 1] - left), left)
    inside = np.ceil(edges).astype(np.intp) - begin
    pairs = np.column_stack((inside[:-1], inside[1:])).ravel()
    low = np.fmin.reduceat(values, pairs)[::2]
    high = np.fmax.reduceat(values, pairs)[::2]
    if wide < 1:
        empty = inside[1:] == inside[:-1]
        low[empty] = high[empty] = np.nan
    low = np.fmin(low, np.fmin(on_edge[:-1], on_edge[1:]))
    high = np.fmax(high, np.fmax(on_edge[:-1], on_edge[1:]))
    return low, high
