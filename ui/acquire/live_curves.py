"""The curves of a live plot: measured column by column, kept as pixels, only new ones drawn.

Qt takes several milliseconds for one noisy curve of a minute, and thirty times a second each of six plots
moves by a column at most. So the columns stay where they are, new ones take the place of the oldest, and the
picture is shown in two pieces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from PySide6.QtCore import QPoint, QPointF, QRectF
from PySide6.QtGui import QColor, QImage, QPainter

from fingerlab.sessions.model import Array

from ..widgets.series import live_envelope
from .live_history import ColumnRun, ColumnView, LiveHistory, LiveTrace, PixelColumns


@dataclass(frozen=True)
class RasterLook:
    """All that a column's pixels depend on besides its samples; another look draws all columns anew.

    Attributes:
        size: columns and rows. ratio: pixels of the screen in one of the window.
        scale: from where to where. rows: those of its grid lines. factor: from samples to the scale.
        across: columns between two grid lines of the time axis.
        curves: colour of each, and its width in pixels of the window.
        surface, grid, axis: colours.
    """

    size: tuple[int, int]
    ratio: float
    scale: tuple[float, float]
    rows: tuple[int, ...]
    across: float
    curves: tuple[tuple[int, int], ...]
    factor: float
    surface: int
    grid: int
    axis: int


class Raster:
    """Pixels that follow :class:`PixelColumns`."""

    def __init__(self, look: RasterLook) -> None:
        self.look = look
        width, height = look.size
        self._pixels = np.empty((height, width), dtype=np.uint32)
        self._image = QImage(self._pixels.data, width, height, 4 * width, QImage.Format.Format_RGB32)
        self._image.setDevicePixelRatio(look.ratio)
        self._empty = np.full((height, 1), look.surface, dtype=np.uint32)
        self._empty[list(look.rows)] = look.grid
        self._empty[height - 1 - max(round(look.ratio) - 1, 0) :] = look.axis
        self._row = np.arange(height, dtype=np.float32)[:, np.newaxis]

    @property
    def reach(self) -> int:
        """How many columns to the right a column's samples show: the width of the widest line."""
        return max((self._thick(wide) for _, wide in self.look.curves), default=1)

    def draw(self, columns: PixelColumns, view: ColumnView, run: ColumnRun) -> None:
        """Draw the columns of ``run``, which lie in ``view``."""
        start, stop = run
        width = view.count
        while start < stop:
            slot = start % width
            count = min(stop - start, width - slot)
            self._draw(columns, view, start, slice(slot, slot + count))
            start += count

    def paint(self, painter: QPainter, place: QPoint, view: ColumnView) -> None:
        """Show all columns, the first of them at ``place``."""
        width, height = self.look.size
        head = view.first % width
        painter.drawImage(QPointF(place), self._image, QRectF(head, 0, width - head, height))
        if head:
            later = QPointF(place.x() + (width - head) / self.look.ratio, place.y())
            painter.drawImage(later, self._image, QRectF(0, 0, head, height))

    def _thick(self, wide: int) -> int:
        return max(round(wide * self.look.ratio), 1)

    def _draw(self, columns: PixelColumns, view: ColumnView, start: int, slots: slice) -> None:
        look, block = self.look, self._pixels[:, slots]
        numbers = np.arange(start, start + slots.stop - slots.start)
        block[:] = self._empty
        block[:-1, grid_columns(numbers[0], numbers[-1] + 1, look.across) - start] = look.grid
        low, high = look.scale
        lowest, a_unit = look.size[1] - 1, look.size[1] / (high - low)
        for row, (colour, wide) in enumerate(look.curves):
            thick = self._thick(wide)
            least, most = columns.low[row, slots], columns.high[row, slots]
            for back in range(1, thick):
                before = np.maximum(numbers - back, view.first) % view.count
                least = np.fmin(least, columns.low[row, before])
                most = np.fmax(most, columns.high[row, before])
            top = np.rint(lowest - (most * look.factor - low) * a_unit) - thick // 2
            bottom = np.rint(lowest - (least * look.factor - low) * a_unit) + (thick - 1) // 2
            covered = (self._row >= top.astype(np.float32)) & (self._row <= bottom.astype(np.float32))
            np.copyto(block, np.uint32(colour), where=covered)


def grid_columns(start: int, stop: int, across: float) -> Any:
    """Columns from ``start`` to ``stop`` that hold a multiple of ``across`` columns; none where it is 0."""
    if across <= 0:
        return np.empty(0, dtype=np.intp)
    first, last = math.ceil((start - 0.5) / across), math.floor((stop - 0.5) / across)
    columns = np.floor(np.arange(first, last + 1) * across + 0.5).astype(np.intp)
    return columns[(columns >= start) & (columns < stop)]


@lru_cache
def pixel(colour: str, over: str = "", share: float = 1.0) -> int:
    """A colour as a pixel; with ``share`` of it, the rest being the colour that it lies over."""
    upper, under = QColor(colour), QColor(over or colour)
    parts = ((upper.red(), under.red()), (upper.green(), under.green()), (upper.blue(), under.blue()))
    return QColor(*(round(share * one + (1 - share) * other) for one, other in parts)).rgb()


FEWEST_COLUMNS = 16
MOST_RUNS = 64
"""Runs of new columns that wait to be drawn; with more, all columns are."""


@dataclass
class CurvePoints:
    """A curve: role of its colour, whether it is drawn over the others in a wider line, and its points."""

    role: str
    wide: bool
    x: Array
    y: Array


@dataclass(frozen=True)
class ShownPart:
    """Samples ``start`` to ``stop`` of a history, and which traces of them; ``factor``: to the scale."""

    history: LiveHistory
    traces: tuple[LiveTrace, ...]
    hidden: frozenset[str]
    start: int
    stop: int
    factor: float

    @property
    def names(self) -> tuple[str | None, ...]:
        """Columns of the history, None for a hidden one."""
        return tuple(None if trace.column in self.hidden else trace.column for trace in self.traces)

    def lines(self, buckets: int) -> list[CurvePoints]:
        """The curves in points, about two in each of so many buckets: for paper and tables."""
        bucket = max((self.stop - self.start) // max(buckets, FEWEST_COLUMNS), 1)
        lines = []
        for trace, name in zip(self.traces, self.names, strict=True):
            first, values = self.history.series(name, self.start, self.stop) if name else (0, np.empty(0))
            places, drawn = live_envelope(first, values, bucket)
            lines.append(
                CurvePoints(trace.role, trace.wide, places / self.history.rate_hz, drawn * self.factor)
            )
        return lines


class LiveCurves:
    """Columns and pixels that follow a part.

    Attributes:
        view: the columns shown.
    """

    def __init__(self) -> None:
        self.view = ColumnView(0, 0, 1.0)
        self._columns = PixelColumns()
        self._raster: Raster | None = None
        self._fresh: list[ColumnRun] = []

    def follow(self, part: ShownPart, count: int) -> list[ColumnRun]:
        """Measure what is new in a part that fills ``count`` columns; the columns that may have changed."""
        count = max(count, FEWEST_COLUMNS)
        self.view = view = ColumnView.ending(part.stop, part.stop - part.start, count)
        runs, whole = self._columns.follow(part.history, part.names, view), [(view.first, view.stop)]
        self._fresh = whole if runs == whole or len(self._fresh) >= MOST_RUNS else self._fresh + runs
        return runs

    def extremes(self) -> tuple[float, float]:
        """Smallest and largest value in view, in the unit of the samples; NaN where there is none."""
        low, high = self._columns.low, self._columns.high
        return float(np.fmin.reduce(low, None)), float(np.fmax.reduce(high, None))

    def drawn(self, look: RasterLook) -> Raster:
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
