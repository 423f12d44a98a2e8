"""The drawing surface of a live plot: axes, curves, cursors and marks, painted directly.

pyqtgraph's axes and views take several times as long for the same picture, too much for six plots thirty
times a second; its conversion of arrays is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pyqtgraph.functions import arrayToQPolygonF
from PySide6.QtCore import QEvent, QPointF, QRect, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QMouseEvent, QPainter, QPaintEvent, QPen, QWheelEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from fingerlab.sessions.model import Array

from ..theme import Colours, colours_of, small_font
from .ticks import round_ticks

LEFT = 64
RIGHT = 8
TOP = 4
GRIP = 5
"""Pixels from a cursor within which it is taken by the mouse."""

TICK_ROOM = 28
TIME_TICK_ROOM = 80
ZOOM = 1.2


@dataclass
class Line:
    """A curve: role of its colour, whether it is drawn over the others in a wider line, and its points."""

    role: str
    wide: bool
    x: Array
    y: Array


class Canvas(QWidget):
    """Signals: moved_by_hand(left, right) in s; cursor_moved(number, time)."""

    moved_by_hand = Signal(float, float)
    cursor_moved = Signal(int, float)

    def __init__(self, label: str, unit: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.lines: list[Line] = []
        self.x_range = (0.0, 1.0)
        self.y_range = (0.0, 1.0)
        self.cursors: tuple[float, float] | None = None
        self.marks: Sequence[tuple[float, str]] = ()
        self.notes = False
        self.time_axis = False
        self._label, self._unit = label, unit
        self._font = small_font()
        self._metrics = QFontMetrics(self._font)
        self._grabbed: int | None = None
        self._from: tuple[float, float, float] | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumHeight(24)

    # places

    @property
    def area(self) -> QRect:
        """Where curves are drawn."""
        below = 2 * self._metrics.height() + 4 if self.time_axis else 4
        return QRect(LEFT, TOP, self.width() - LEFT - RIGHT, max(self.height() - TOP - below, 1))

    def x_of(self, time: float) -> float:
        """Pixel of a time."""
        area, (left, right) = self.area, self.x_range
        return area.left() + (time - left) / (right - left) * area.width()

    def time_at(self, x: float) -> float:
        """Time at a pixel."""
        area, (left, right) = self.area, self.x_range
        return left + (x - area.left()) / area.width() * (right - left)

    # picture

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setFont(self._font)
        colours, area = colours_of(self), self.area
        painter.fillRect(self.rect(), QColor(colours.surface))
        self._paint_grid(painter, area, colours)
        painter.setClipRect(area)
        for line in self.lines:
            self._paint_line(painter, area, line, QColor(getattr(colours, line.role)))
        self._paint_marks(painter, area, colours)
        painter.end()

    def _paint_grid(self, painter: QPainter, area: QRect, colours: Colours) -> None:
        height, (low, high) = self._metrics.height(), self.y_range
        grid, text = QColor(colours.line), QColor(colours.text)
        grid.setAlpha(120)
        for value, words in round_ticks(low, high, area.height() // TICK_ROOM):
            y = round(area.bottom() - (value - low) / (high - low) * area.height())
            painter.setPen(grid)
            painter.drawLine(area.left(), y, area.right(), y)
            painter.setPen(text)
            room = QRect(16, min(max(y - height // 2, 0), self.height() - height), LEFT - 22, height)
            painter.drawText(room, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, words)
        for value, words in round_ticks(*self.x_range, area.width() // TIME_TICK_ROOM):
            x = round(self.x_of(value))
            painter.setPen(grid)
            painter.drawLine(x, area.top(), x, area.bottom())
            if self.time_axis:
                painter.setPen(text)
                room = QRect(x - 40, area.bottom() + 2, 80, height)
                painter.drawText(room, Qt.AlignmentFlag.AlignHCenter, words)
        painter.setPen(QColor(colours.muted))
        painter.drawLine(area.bottomLeft(), area.topLeft())
        painter.drawLine(area.bottomLeft(), area.bottomRight())
        painter.setPen(text)
        if self.time_axis:
            room = QRect(area.left(), self.height() - height - 1, area.width(), height)
            painter.drawText(room, Qt.AlignmentFlag.AlignHCenter, "Time since connecting (s)")
        whole = f"{self._label} ({self._unit})"
        words = whole if self._metrics.horizontalAdvance(whole) < self.height() else self._unit
        painter.save()
        painter.translate(height, area.center().y() + self._metrics.horizontalAdvance(words) / 2)
        painter.rotate(-90)
        painter.drawText(0, -2, words)
        painter.restore()

    def _paint_line(self, painter: QPainter, area: QRect, line: Line, colour: QColor) -> None:
        if len(line.x) < 2:
            return
        left, right = self.x_range
        low, high = self.y_range
        x = area.left() + (line.x - left) * (area.width() / (right - left))
        y = area.bottom() - (line.y - low) * (area.height() / (high - low))
        painter.setPen(QPen(colour, 2 if line.wide else 1))
        good = np.isfinite(y)
        if good.all():
            painter.drawPolyline(arrayToQPolygonF(x, y))
            return
        edges = np.flatnonzero(np.diff(np.concatenate(([False], good, [False])).astype(np.int8)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):  # a gap stays a gap
            if stop - start == 1:
                painter.drawPoint(QPointF(x[start], y[start]))
            else:
                painter.drawPolyline(arrayToQPolygonF(x[start:stop], y[start:stop]))

    def _paint_marks(self, painter: QPainter, area: QRect, colours: Colours) -> None:
        for time, note in self.marks:
            x = round(self.x_of(time))
            if area.left() <= x <= area.right():
                painter.setPen(QPen(QColor(colours.muted), 1, Qt.PenStyle.DashLine))
                painter.drawLine(x, area.top(), x, area.bottom())
                if self.notes:
                    painter.setPen(QColor(colours.text))
                    painter.drawText(x + 4, area.top() + self._metrics.ascent(), note)
        for number, time in enumerate(self.cursors or ()):
            x = round(self.x_of(time))
            style = Qt.PenStyle.DashLine if number else Qt.PenStyle.SolidLine
            painter.setPen(QPen(QColor(colours.accent), 2 if number == self._grabbed else 1, style))
            painter.drawLine(x, area.top(), x, area.bottom())
            painter.drawText(x + 4, area.bottom() - 4, "AB"[number])
        if self.hasFocus():
            painter.setPen(QColor(colours.accent))
            painter.drawRect(area.adjusted(0, 0, -1, -1))

    # hand

    def mousePressEvent(self, event: QMouseEvent) -> None:
        x = event.position().x()
        self._grabbed = self._cursor_at(x)
        self._from = (x, *self.x_range)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        x = event.position().x()
        if not event.buttons() & Qt.MouseButton.LeftButton:
            over = self._cursor_at(x) is not None
            self.setCursor(Qt.CursorShape.SizeHorCursor if over else Qt.CursorShape.ArrowCursor)
        elif self._grabbed is not None:
            self.cursor_moved.emit(self._grabbed, self.time_at(x))
        elif self._from is not None:
            start, left, right = self._from
            shift = (start - x) / self.area.width() * (right - left)
            self.moved_by_hand.emit(left + shift, right + shift)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._grabbed = self._from = None
        self.update()

    def wheelEvent(self, event: QWheelEvent) -> None:
        turns = event.angleDelta().y() / 120.0
        middle = self.time_at(event.position().x())
        left, right = self.x_range
        factor = ZOOM**-turns
        self.moved_by_hand.emit(middle - (middle - left) * factor, middle + (right - middle) * factor)
        event.accept()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() in (QEvent.Type.PaletteChange, QEvent.Type.FontChange):
            self.update()

    def _cursor_at(self, x: float) -> int | None:
        near = [(abs(self.x_of(time) - x), number) for number, time in enumerate(self.cursors or ())]
        return min(near)[1] if near and min(near)[0] <= GRIP else None
