"""Many stretches of a plot tinted from top to bottom: one item, since there may be one for each stroke."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPainter


class Tints(pg.GraphicsObject):
    """Lies behind the curves."""

    def __init__(self) -> None:
        super().__init__()
        self.stretches: tuple[tuple[float, float], ...] = ()
        self._colour = QColor(Qt.GlobalColor.transparent)
        self.setZValue(-20)

    def show_stretches(self, stretches: Sequence[tuple[float, float]]) -> None:
        """From where to where on the horizontal axis, each."""
        self.stretches = tuple(stretches)
        self.update()

    def set_colour(self, colour: QColor) -> None:
        """With its transparency."""
        self._colour = colour
        self.update()

    def viewRangeChanged(self) -> None:
        self.prepareGeometryChange()

    def boundingRect(self) -> QRectF:
        return QRectF(self.viewRect())

    def paint(self, painter: QPainter, *_: Any) -> None:
        view = self.viewRect()
        for start, stop in self.stretches:
            if stop > view.left() and start < view.right():
                painter.fillRect(QRectF(start, view.top(), stop - start, view.height()), self._colour)
