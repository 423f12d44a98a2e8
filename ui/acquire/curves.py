"""The curves of a live plot: which samples are shown, measured column by column and kept as pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fingerlab.sessions.model import Array

from ..widgets.series import live_envelope
from .channels import Trace
from .columns import Columns, Run, View
from .history import History
from .raster import Look, Raster

FEWEST_COLUMNS = 16
MOST_RUNS = 64
"""Runs of new columns that wait to be drawn; with more, all columns are."""


@dataclass
class Line:
    """A curve: role of its colour, whether it is drawn over the others in a wider line, and its points."""

    role: str
    wide: bool
    x: Array
    y: Array


@dataclass(frozen=True)
class Part:
    """Samples ``start`` to ``stop`` of a history, and which traces of them; ``factor``: to the scale."""

    history: History
    traces: tuple[Trace, ...]
    hidden: frozenset[str]
    start: int
    stop: int
    factor: float

    @property
    def names(self) -> tuple[str | None, ...]:
        """Columns of the history, None for a hidden one."""
        return tuple(None if trace.column in self.hidden else trace.column for trace in self.traces)

    def lines(self, buckets: int) -> list[Line]:
        """The curves in points, about two in each of so many buckets: for paper and tables."""
        bucket = max((self.stop - self.start) // max(buckets, FEWEST_COLUMNS), 1)
        lines = []
        for trace, name in zip(self.traces, self.names, strict=True):
            first, values = self.history.series(name, self.start, self.stop) if name else (0, np.empty(0))
            places, drawn = live_envelope(first, values, bucket)
            lines.append(Line(trace.role, trace.wide, places / self.history.rate_hz, drawn * self.factor))
        return lines


class Curves:
    """Columns and pixels that follow a part.

    Attributes:
        view: the columns shown.
    """

    def __init__(self) -> None:
        self.view = View(0, 0, 1.0)
        self._columns = Columns()
        self._raster: Raster | None = None
        self._fresh: list[Run] = []

    def follow(self, part: Part, count: int) -> list[Run]:
        """Measure what is new in a part that fills ``count`` columns; the columns that may have changed."""
        count = max(count, FEWEST_COLUMNS)
        self.view = view = View.ending(part.stop, part.stop - part.start, count)
        runs, whole = self._columns.follow(part.history, part.names, view), [(view.first, view.stop)]
        self._fresh = whole if runs == whole or len(self._fresh) >= MOST_RUNS else self._fresh + runs
        return runs

    def extremes(self) -> tuple[float, float]:
        """Smallest and largest value in view, in the unit of the samples; NaN where there is none."""
        low, high = self._columns.low, self._columns.high
        return float(np.fmin.reduce(low, None)), float(np.fmax.reduce(high, None))

    def drawn(self, look: Look) -> Raster:
        """The pixels, up to date: new columns, or all of them where they are to look otherwise."""
        view, raster = self.view, self._raster
        if raster is None or raster.look != look:
            raster = self._raster = Raster(look)
            self._fresh = [(view.first, view.stop)]
        for start, stop in self._fresh:
            reach = min(stop + raster.reach - 1, view.stop)
            raster.draw(self._columns, view, (max(start, view.first), reach))
        self._fresh = []
        return raster
