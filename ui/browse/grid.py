"""Grid lines behind the curves of a plot.

pyqtgraph's axes draw the grid with their ticks, see-through and from a recorded picture: with nine axes that
is most of the time of a frame. Here a grid is a dozen plain lines.
"""

from __future__ import annotations

from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QLineF, QRectF
from PySide6.QtGui import QColor, QPainter

from ..acquire.ticks import round_ticks

TIME_ROOM = 90
HEIGHT_ROOM = 36
"""Pixels from one line to the next, at least."""


class Grid(pg.GraphicsObject):
    """Lines at round times and values of the view that it is in; the axes get their ticks at the same."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__()
        self._left, self._bottom = plot.getAxis("left"), plot.getAxis("bottom")
        self._columns: list[float] = []
        self._rows: list[float] = []
        self._seen: tuple[Any, ...] = ()
        self._lines: list[QLineF] = []
        self._pen = pg.mkPen("gray")
        self.setZValue(-10)

    def set_colour(self, colour: str, alpha: int = 120) -> None:
        """Colour of the lines."""
        tone = QColor(colour)
        tone.setAlpha(alpha)
        self._pen = pg.mkPen(tone)  # cosmetic: one pixel wide whatever the zoom
        self.update()

    def viewRangeChanged(self) -> None:
        view = self.getViewBox()
        if not isinstance(view, pg.ViewBox):
            return
        self.prepareGeometryChange()
        (left, right), (low, high) = view.viewRange()
        seen = low, high, view.height()
        if seen != self._seen:
            self._seen = seen
            rows = round_ticks(low, high, max(int(view.height()) // HEIGHT_ROOM, 1))
            self._rows = [value for value, _ in rows]
            self._left.setTicks([rows])
        columns = round_ticks(left, right, max(int(view.width()) // TIME_ROOM, 1))
        self._columns = [time for time, _ in columns]
        if self._bottom.isVisible():
            self._bottom.setTicks([columns])
        self._lines = [QLineF(x, low, x, high) for x in self._columns]
        self._lines += [QLineF(left, y, right, y) for y in self._rows]
        self.update()

    def boundingRect(self) -> QRectF:
        return QRectF(self.viewRect())

    def paint(self, painter: QPainter, *_: Any) -> None:
        painter.setPen(self._pen)
        painter.drawLines(self._lines)
