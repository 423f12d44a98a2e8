"""The drawing surface of a live plot: axes, curves, cursors and marks, painted directly.

pyqtgraph's axes and views, and Qt's own lines, take many times as long for the same picture, too much for six
plots thirty times a second. On the screen the curves are columns of pixels (:mod:`.raster`), of which only
what has changed is painted; elsewhere (a saved picture, paper) they are lines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRect, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFontMetrics,
    QMouseEvent,
    QPaintEngine,
    QPainter,
    QPaintEvent,
    QPen,
    QPolygonF,
    QRegion,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from fingerlab.sessions.model import Array

from ..widgets.series import Series, round_ticks, tick_step
from ..widgets.theme import Colours, colours_of, small_font
from .live_curves import CurvePoints, LiveCurves, RasterLook, ShownPart, pixel
from .live_history import ColumnRun

LEFT = 64
RIGHT = 8
TOP = 4
GRIP = 5
"""Pixels from a cursor within which it is taken by the mouse."""

LEAST_HEIGHT = 36
"""Of the curves with their margins; less, and nothing is seen of them. More where the unit is longer."""
TICK_ROOM = 28
WORDS_APART = 3
"""px from the digits of a tick to those of the next."""
TIME_TICK_ROOM = 80
ZOOM = 1.2
GRID_SHARE = 0.47
"""How much of the line colour grid lines have over the surface."""


class Canvas(QWidget):
    """Signals: moved_by_hand(left, right) in s; cursor_moved(number, time)."""

    moved_by_hand = Signal(float, float)
    cursor_moved = Signal(int, float)

    def __init__(self, label: str, unit: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
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
        self._part: ShownPart | None = None
        self._curves = LiveCurves()
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setFocusPolicy(Qt.FocusPolicy.WheelFocus)
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._least_height = max(LEAST_HEIGHT, self._metrics.horizontalAdvance(unit) + 2 * TOP)
        self.setMinimumHeight(self._least_height)

    # what is shown

    def show_time_axis(self, on: bool) -> None:
        """Whether times stand below, which takes room of its own."""
        self.time_axis = on
        self.setMinimumHeight(self._least_height + (2 * self._metrics.height() if on else 0))
        self.update()

    def show_part(self, part: ShownPart) -> tuple[float, float]:
        """Show other samples; the least and the greatest of them on the scale, which is still as it was."""
        self._part = part
        before = self._curves.view
        runs = self._follow(part)
        if self._curves.view != before:
            self.update(self._moving())
        for start, stop in runs if self._curves.view == before else ():
            self.update(self._columns_rect(start, stop))
        least, most = self._curves.extremes()
        return least * part.factor, most * part.factor

    def set_scale(self, y_range: tuple[float, float]) -> None:
        """From where to where the scale goes."""
        if y_range != self.y_range:
            self.y_range = y_range
            self.update()

    @property
    def lines(self) -> list[CurvePoints]:
        """The curves in points: for paper and tables."""
        return self._part.lines(self.area.width()) if self._part is not None else []

    def shown_series(self) -> list[Series]:
        """The curves in points with their names and units."""
        label, time = f"{self._label} ({self._unit})", "Time since connecting (s)"
        return [Series(line.role, time, label, line.x, line.y) for line in self.lines if len(line.x)]

    def _follow(self, part: ShownPart) -> list[ColumnRun]:
        runs = self._curves.follow(part, round(self.area.width() * self.devicePixelRatioF()))
        self.x_range = self._curves.view.seconds(part.history.rate_hz)
        return runs

    def _columns_rect(self, start: int, stop: int) -> QRect:
        """Where columns are, and beside them what a wide line reaches."""
        area, ratio = self.area, self.devicePixelRatioF()
        left = area.left() + math.floor((start - self._curves.view.first) / ratio)
        return QRect(left, area.top(), math.ceil((stop - start) / ratio) + 4, area.height()) & area

    def _moving(self) -> QRegion:
        """What changes when time goes on: the curves, the notes above and the times below."""
        area = self.area
        moving = QRegion(area.adjusted(0, TOP - area.top(), RIGHT, 0))
        if not self.time_axis:
            return moving
        below = QRect(area.left() - 40, area.bottom() + 1, self.width(), self.height())
        return moving + QRegion(below & self.rect())

    # places

    @property
    def area(self) -> QRect:
        """Where curves are drawn."""
        below = 2 * self._metrics.height() + 4 if self.time_axis else 4
        top = TOP + (self._metrics.height() if self.notes and self.marks else 0)  # notes stand above curves
        return QRect(LEFT, top, self.width() - LEFT - RIGHT, max(self.height() - top - below, 1))

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
        part = self._part if self._is_screen(painter) else None
        if part is not None and self._curves.view.count != round(area.width() * self.devicePixelRatioF()):
            self._follow(part)  # another size
        beside = event.region() - QRegion(area)
        if part is None or not beside.isEmpty():
            self._paint_axes(painter, area, colours, beside)
        painter.setClipRect(area)
        if part is not None:
            self._curves.drawn(self._look(part, colours)).paint(painter, area.topLeft(), self._curves.view)
        else:
            self._paint_grid(painter, area, colours)
            for line in self.lines:
                self._paint_line(painter, area, line, QColor(getattr(colours, line.role)))
        self._paint_marks(painter, area, colours)
        if self.notes and self.marks:
            self._paint_notes(painter, area, colours)
        painter.end()

    def _is_screen(self, painter: QPainter) -> bool:
        """Whether it is painted pixel by pixel, not into a file or finer than on the screen."""
        pixels = painter.paintEngine().type() == QPaintEngine.Type.Raster
        return pixels and painter.deviceTransform().m11() == self.devicePixelRatioF()

    def _look(self, part: ShownPart, colours: Colours) -> RasterLook:
        area, ratio, view, (low, high) = self.area, self.devicePixelRatioF(), self._curves.view, self.y_range
        height = max(round(area.height() * ratio), 1)
        step = tick_step(*self.x_range, area.width() // TIME_TICK_ROOM)
        ticks = round_ticks(low, high, area.height() // TICK_ROOM)
        rows = (round(height - 1 - (value - low) / (high - low) * height) for value, _ in ticks)
        return RasterLook(
            size=(view.count, height),
            ratio=ratio,
            scale=self.y_range,
            factor=part.factor,
            rows=tuple(row for row in rows if 0 <= row < height),
            across=step * part.history.rate_hz / view.wide,
            curves=tuple((pixel(getattr(colours, t.role)), 2 if t.wide else 1) for t in part.traces),
            surface=pixel(colours.surface),
            grid=pixel(colours.line, colours.surface, GRID_SHARE),
            axis=pixel(colours.muted),
        )

    def _paint_grid(self, painter: QPainter, area: QRect, colours: Colours) -> None:
        grid = QColor(colours.line)
        grid.setAlphaF(GRID_SHARE)
        painter.setPen(grid)
        low, high = self.y_range
        for value, _ in round_ticks(low, high, area.height() // TICK_ROOM):
            y = round(area.bottom() - (value - low) / (high - low) * area.height())
            painter.drawLine(area.left(), y, area.right(), y)
        for value, _ in round_ticks(*self.x_range, area.width() // TIME_TICK_ROOM):
            x = round(self.x_of(value))
            painter.drawLine(x, area.top(), x, area.bottom())
        painter.setPen(QColor(colours.muted))
        painter.drawLine(area.bottomLeft(), area.bottomRight())

    def _paint_axes(self, painter: QPainter, area: QRect, colours: Colours, where: QRegion) -> None:
        """All beside the curves, as far as it is to be painted."""
        height, text = self._metrics.height(), QColor(colours.text)
        painter.fillRect(self.rect(), QColor(colours.surface))
        painter.setPen(text)
        if self.time_axis:
            for value, words in round_ticks(*self.x_range, area.width() // TIME_TICK_ROOM):
                wide = self._metrics.horizontalAdvance(words)
                x = min(round(self.x_of(value) - wide / 2), self.width() - wide - 1)
                painter.drawText(QRect(x, area.bottom() + 2, wide + 1, height), 0, words)
            room = QRect(area.left(), self.height() - height - 1, area.width(), height)
            painter.drawText(room, Qt.AlignmentFlag.AlignHCenter, "Time since connecting (s)")
        if not where.intersects(QRect(0, 0, LEFT, self.height())):
            return
        low, high = self.y_range
        ticks = round_ticks(low, high, area.height() // TICK_ROOM)
        for value, words in ticks[:: self._every(ticks, area.height() / (high - low))]:
            y = round(area.bottom() - (value - low) / (high - low) * area.height())
            room = QRect(16, min(max(y - height // 2, 0), self.height() - height), LEFT - 22, height)
            painter.drawText(room, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, words)
        whole = f"{self._label} ({self._unit})"
        middle = area.center().y()
        along = 2 * min(middle, self.height() - middle)
        words = whole if self._metrics.horizontalAdvance(whole) < along else self._unit
        painter.save()
        painter.translate(height, area.center().y() + self._metrics.horizontalAdvance(words) / 2)
        painter.rotate(-90)
        painter.drawText(0, -2, words)
        painter.restore()
        painter.setPen(QColor(colours.muted))
        painter.drawLine(area.left() - 1, area.top(), area.left() - 1, area.bottom())

    def _every(self, ticks: Sequence[tuple[float, str]], scale: float) -> int:
        """Which of the ticks have words, so that these do not stand on one another: every first, second ...

        Args:
            scale: px a unit.
        """
        if len(ticks) < 2:
            return 1
        apart = (ticks[1][0] - ticks[0][0]) * scale
        return max(math.ceil((self._metrics.capHeight() + WORDS_APART) / apart), 1)

    def _paint_line(self, painter: QPainter, area: QRect, line: CurvePoints, colour: QColor) -> None:
        if len(line.x) < 2:
            return
        left, right = self.x_range
        low, high = self.y_range
        x = area.left() + (line.x - left) * (area.width() / (right - left))
        y = area.bottom() - (line.y - low) * (area.height() / (high - low))
        painter.setPen(QPen(colour, 2 if line.wide else 1))
        good = np.isfinite(y)
        if good.all():
            painter.drawPolyline(polygon(x, y))
            return
        edges = np.flatnonzero(np.diff(np.concatenate(([False], good, [False])).astype(np.int8)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):  # a gap stays a gap
            if stop - start == 1:
                painter.drawPoint(QPointF(x[start], y[start]))
            else:
                painter.drawPolyline(polygon(x[start:stop], y[start:stop]))

    def _paint_notes(self, painter: QPainter, area: QRect, colours: Colours) -> None:
        """Above the curves, each from its line to the next."""
        painter.setClipRect(area.adjusted(0, TOP - area.top(), RIGHT, 0))
        painter.setPen(QColor(colours.text))
        ends = [round(self.x_of(time)) for time, _ in self.marks[1:]] + [area.right() + RIGHT]
        for (time, note), end in zip(self.marks, ends, strict=True):
            x, end = round(self.x_of(time)), min(end, area.right() + RIGHT)
            if area.left() <= x <= area.right():
                text = self._metrics.elidedText(note, Qt.TextElideMode.ElideRight, max(end - x - 4, 0))
                painter.drawText(x, area.top() - self._metrics.descent() - 1, text)

    def _paint_marks(self, painter: QPainter, area: QRect, colours: Colours) -> None:
        for time, _ in self.marks:
            x = round(self.x_of(time))
            if area.left() <= x <= area.right():
                painter.setPen(QPen(QColor(colours.muted), 1, Qt.PenStyle.DashLine))
                painter.drawLine(x, area.top(), x, area.bottom())
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


def polygon(x: Array, y: Array) -> QPolygonF:
    """Points as Qt has them."""
    return QPolygonF([QPointF(*point) for point in zip(x.tolist(), y.tolist(), strict=True)])
