"""One look for all plots of pyqtgraph: axes, curves, keys; and what looks closer: wheel, box, cursors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QRectF, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QFocusEvent, QFontMetricsF, QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from fingerlab.core.text import ScreenUnit, with_minus
from fingerlab.sessions.model import Array

from .series import envelope
from .theme import Colours, colours_of, line, small_font

if TYPE_CHECKING:
    from pyqtgraph import GraphicsView as _View
else:
    _View = object


class NumberAxis(pg.AxisItem):
    """As pyqtgraph's own but for the sign."""

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[str]:
        return [with_minus(text) for text in super().tickStrings(list(values), scale, spacing)]


FULL_LABEL = "full_label"
"""Attribute of an axis with its whole label, which a low plot shortens."""


def prepare_plot(plot: pg.PlotItem) -> None:
    """Once for each plot: no auto-ranging, readable ticks."""
    plot.setAxisItems({name: NumberAxis(name) for name in ("left", "bottom")})
    plot.hideButtons()
    plot.getViewBox().disableAutoRange()
    for name in ("left", "bottom"):
        axis = plot.getAxis(name)
        axis.enableAutoSIPrefix(False)  # the label carries the unit that we chose
        axis.setStyle(tickFont=small_font(), tickTextOffset=4)
        axis.label.setFont(small_font())
    plot.getAxis("bottom").setTickDensity(0.7)
    plot.showGrid(x=True, y=True, alpha=0.12)


def colour_plot(plot: pg.PlotItem, colours: Colours) -> None:
    """Axis colours for light or dark."""
    for name in ("left", "bottom"):
        axis = plot.getAxis(name)
        axis.setPen(QColor(colours.muted))
        axis.setTextPen(QColor(colours.text))


def label_left(plot: pg.PlotItem, quantity: str, unit: ScreenUnit) -> None:
    """Quantity and unit along the left axis; the unit alone where the plot is too low for both."""
    text = unit.label(quantity)
    setattr(plot.getAxis("left"), FULL_LABEL, text)
    metrics = QFontMetricsF(small_font())
    if metrics.horizontalAdvance(text) > 1.05 * plot.getViewBox().height() and unit.symbol:
        text = unit.symbol
    if metrics.horizontalAdvance(text) > 1.05 * plot.getViewBox().height():
        text = text.split(" re ")[0]  # decibels above what, the whole label tells
    if plot.getAxis("left").labelText != text:
        plot.setLabel("left", text)
        plot.getAxis("left").resizeEvent()  # puts a label of another length in the middle again


def bottom_axis_height() -> int:
    """Room for ticks and label of a time axis; pyqtgraph's own guess leaves a gap."""
    return round(2.6 * QFontMetricsF(small_font()).height())


class DecimatedCurve(pg.PlotCurveItem):
    """Holds the whole series; draws the visible part, reduced to about one bucket a pixel."""

    def __init__(self, **options: Any) -> None:
        super().__init__(connect="finite", antialias=True, **options)
        self._x = np.empty(0)
        self._y = np.empty(0)
        self._shown: tuple[int, int, int] | None = None

    def set_series(self, x: Array, y: Array) -> None:
        """Replace the series: x increasing, shape (n,); y shape (n,), NaN where there is a gap."""
        self._x, self._y = x, y
        self._shown = None
        self.refresh()

    @property
    def series(self) -> tuple[Array, Array]:
        """The whole series, not only what is drawn."""
        return self._x, self._y

    def viewRangeChanged(self) -> None:
        super().viewRangeChanged()
        self.refresh()

    def refresh(self) -> None:
        """Draw again if the visible part or its width in pixels has changed."""
        view = self.getViewBox()
        if view is None or not len(self._x):
            if self.xData is not None and len(self.xData):
                self.setData(np.empty(0), np.empty(0))
            return
        (left, right), _ = view.viewRange()
        # One sample more on each side, so that the line runs to the edge.
        first = max(int(np.searchsorted(self._x, left)) - 1, 0)
        last = min(int(np.searchsorted(self._x, right)) + 1, len(self._x))
        buckets = max(int(view.width()), 16)
        if self._shown == (first, last, buckets):
            return
        self._shown = (first, last, buckets)
        x, y = envelope(self._x[first:last], self._y[first:last], buckets)
        self.setData(x, y)


class Cursor(pg.InfiniteLine):
    """A line that the reader moves; no part of what is shown, so that no figure has it."""


class Tints(pg.GraphicsObject):
    """Lies behind the curves.

    Args:
        hatched: strokes, where a tint would be taken for another. name: of what they are, in a legend.
    """

    def __init__(self, hatched: bool = False, name: str = "") -> None:
        super().__init__()
        self.hatched, self.name = hatched, name
        self.stretches: tuple[tuple[float, float], ...] = ()
        self.colour = QColor(Qt.GlobalColor.transparent)
        self.setZValue(-20)

    def show_stretches(self, stretches: Sequence[tuple[float, float]]) -> None:
        """From where to where on the horizontal axis, each."""
        self.stretches = tuple(stretches)
        self.update()

    def set_colour(self, colour: QColor) -> None:
        """With its transparency."""
        self.colour = colour
        self.update()

    def viewRangeChanged(self) -> None:
        self.prepareGeometryChange()

    def boundingRect(self) -> QRectF:
        return QRectF(self.viewRect())

    def paint(self, painter: QPainter, *_: Any) -> None:
        view = self.viewRect()
        seen = [
            QRectF(start, view.top(), stop - start, view.height()).intersected(view)
            for start, stop in self.stretches
            if stop > view.left() and start < view.right()
        ]
        if not self.hatched:
            for room in seen:
                painter.fillRect(room, self.colour)
            return
        # A pattern would be stretched as the axes are: it is drawn in pixels.
        to_pixels, brush = painter.worldTransform(), QBrush(self.colour, Qt.BrushStyle.BDiagPattern)
        painter.resetTransform()
        for room in seen:
            painter.fillRect(to_pixels.mapRect(room), brush)


EDGE_PX = 2.0
"""Between words and the ends of their stretch."""


class WordsOver(pg.TextItem):
    """Stands in the middle of a stretch, hanging from its height, in the first wording that has room.

    Args:
        texts: wordings, the longest first. stretch: ends of the stretch, in the plot's own unit across.
        turns: where none has room across, the first stands upwards, if a line has room.
    """

    def __init__(
        self, texts: Sequence[str], stretch: tuple[float, float], colour: str, turns: bool = False
    ) -> None:
        super().__init__(texts[0], color=colour, anchor=(0.5, 0.0))
        self._texts, self._stretch, self._turns = tuple(texts), stretch, turns
        self._shown = (texts[0], 0.0)
        self.setFont(small_font())

    def viewTransformChanged(self) -> None:
        """The plot has another size or range."""
        self._fit()
        super().viewTransformChanged()

    def _fit(self) -> None:
        view = self.getViewBox()
        if view is None:
            return
        (left, right), _ = view.viewRange()
        start, stop = self._stretch
        room = (stop - start) / (right - left) * view.width() - 2 * EDGE_PX
        letters = QFontMetricsF(small_font())
        text = next((one for one in self._texts if letters.horizontalAdvance(one) <= room), "")
        upwards = not text and self._turns and letters.height() <= room + 2 * EDGE_PX
        shown = (self._texts[0], 90.0) if upwards else (text, 0.0)
        if shown == self._shown:
            return
        self._shown = shown
        self.setVisible(bool(shown[0]))
        self.setAnchor((1.0, 0.5) if upwards else (0.5, 0.0))
        self.setAngle(shown[1])
        self.setPlainText(shown[0])


ZOOM_STEP = 1.5
PAN_STEP = 0.1
"""Share of the shown time that one press of an arrow moves."""


def move_by_key(plot: pg.PlotItem, event: QKeyEvent) -> bool:
    """Zoom with plus and minus, pan with the arrows; False where the key is another one."""
    left, right = plot.viewRange()[0]
    middle, half = (left + right) / 2, (right - left) / 2
    key = event.key()
    if key in (Qt.Key.Key_Plus, Qt.Key.Key_Equal):
        half /= ZOOM_STEP
    elif key == Qt.Key.Key_Minus:
        half *= ZOOM_STEP
    elif key in (Qt.Key.Key_Left, Qt.Key.Key_Right):
        middle += (1 if key == Qt.Key.Key_Right else -1) * 2 * half * PAN_STEP
    else:
        return False
    plot.setXRange(middle - half, middle + half, padding=0)
    return True


AXIS_WIDTH = 60
MARGIN = 0.08


class FocusFrame(_View):
    """A frame about a plot that has the keyboard; to be named before a graphics view among its bases."""

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self.hasFocus():
            painter = QPainter(self.viewport())
            painter.setPen(QColor(colours_of(self).accent))
            painter.drawRect(self.viewport().rect().adjusted(0, 0, -1, -1))
            painter.end()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.viewport().update()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.viewport().update()


class QuietPlot(FocusFrame, pg.PlotWidget):
    """One plot that keeps quantity and unit on its axes and follows light and dark."""

    def __init__(
        self, name: str, accessible: str, parent: QWidget | None = None, box: pg.ViewBox | None = None
    ) -> None:
        """``box``: one that hands can zoom and move; None: the plot stands still."""
        super().__init__(parent, enableMenu=False, **({"viewBox": box} if box is not None else {}))
        self.setObjectName(name)
        self.setAccessibleName(accessible)
        self.setAcceptDrops(False)  # a file dropped here is for the window
        self._left: tuple[str, ScreenUnit] | None = None
        plot = self.getPlotItem()
        prepare_plot(plot)
        if box is None:
            plot.setMouseEnabled(x=False, y=False)
        plot.setContentsMargins(0, 4, 8, 0)
        plot.getAxis("left").setWidth(AXIS_WIDTH)
        plot.getAxis("bottom").setHeight(bottom_axis_height())
        plot.getViewBox().sigResized.connect(self._label)
        self._recolour_frame()

    def name_axes(self, left: str, unit: ScreenUnit, bottom: str) -> None:
        """Quantity and unit of both axes."""
        self._left = (left, unit)
        self.getPlotItem().setLabel("bottom", bottom)
        self._label()

    def redraw(self) -> None:
        """Draw again with the colours of now."""

    def _label(self) -> None:
        if self._left is not None:
            label_left(self.getPlotItem(), *self._left)

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.DevicePixelRatioChange and hasattr(self, "_left"):
            self.redraw()  # pens are in device pixels
        return bool(super().event(event))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_left"):
            self._recolour_frame()
            self.redraw()

    def _recolour_frame(self) -> None:
        colours = colours_of(self)
        self.setBackground(colours.surface)
        colour_plot(self.getPlotItem(), colours)

    def pen(self, colour: str, width: float = 1.5, dashed: bool = False) -> Any:
        """A pen in one of the window's colours, by name."""
        value = getattr(colours_of(self), colour)
        return line(value, width * self.devicePixelRatioF(), dashed)

    def draw_band(
        self,
        x: np.ndarray[Any, Any],
        middle: np.ndarray[Any, Any],
        half: np.ndarray[Any, Any],
        brush: Any,
        name: str = "",
    ) -> None:
        """A shaded 90 % interval where it is known; ``name`` stands over its numbers where they are saved."""
        known = np.isfinite(half) & np.isfinite(middle)
        if not known.any():
            return
        start = f"{name}, " if name else ""
        edges = [
            plain_curve(
                x[known],
                (middle + sign * half)[known],
                pg.mkPen(None),
                f"{start}{side} end of the 90 % interval",
            )
            for sign, side in ((1, "upper"), (-1, "lower"))
        ]
        for edge in edges:
            self.getPlotItem().addItem(edge)
        self.getPlotItem().addItem(pg.FillBetweenItem(*edges, brush=brush))

    def write(self, text: str, x: float, y: float, anchor: tuple[float, float] = (0.5, 0.0)) -> None:
        """Words inside the plot."""
        item = pg.TextItem(text, color=colours_of(self).text, anchor=anchor)
        item.setFont(small_font())
        self.getPlotItem().addItem(item, ignoreBounds=True)
        item.setPos(x, y)

    def write_over(
        self, texts: Sequence[str], stretch: tuple[float, float], y: float, turns: bool = False
    ) -> None:
        """Words over a stretch, none of them cut; see :class:`WordsOver`."""
        item = WordsOver(texts, stretch, colours_of(self).text, turns)
        self.getPlotItem().addItem(item, ignoreBounds=True)
        item.setPos(sum(stretch) / 2, y)


def plain_curve(x: np.ndarray[Any, Any], y: np.ndarray[Any, Any], pen: Any, name: str) -> pg.PlotCurveItem:
    """A curve; ``name`` stands over its numbers where they are saved."""
    return pg.PlotCurveItem(x, y, pen=pen, name=name, connect="finite", antialias=True)


def span_of(values: np.ndarray[Any, Any], margin: float = MARGIN) -> tuple[float, float]:
    """Limits around the finite values, with a margin that is a share of their range."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    room = margin * (high - low) or abs(high) or 1.0
    return low - room, high + room


HELP = (
    "Wheel: closer in time; over the values at the left: closer in height. Drag: move. Shift and drag: a box "
    "to look into. Double click: all of it. C: two cursors. F: the height of what is in view."
)
NAMES = ("A", "B")
GRIP_PX = 1.5


class LookBox(pg.ViewBox):
    """Wheel zooms across, over an axis that one; dragging moves it, with Shift it draws a box to look into.

    Signal ``whole_asked``: a double click asks for all of it.
    """

    whole_asked = Signal()

    def __init__(self) -> None:
        super().__init__(enableMenu=False)
        self.setMouseEnabled(x=True, y=True)

    def wheelEvent(self, ev: Any, axis: int | None = None) -> None:
        """Over the plot itself only time is zoomed: heights are compared with the floor."""
        super().wheelEvent(ev, axis=self.XAxis if axis is None else axis)

    def mouseDragEvent(self, ev: Any, axis: int | None = None) -> None:
        """Left moves in time; Shift and left is a box."""
        if ev.button() != Qt.MouseButton.LeftButton:
            ev.ignore()
            return
        boxed = axis is None and bool(ev.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        self.state["mouseMode"] = self.RectMode if boxed else self.PanMode
        super().mouseDragEvent(ev, axis=None if boxed else self.XAxis if axis is None else axis)

    def showAxRect(self, ax: Any, **_options: Any) -> None:
        """The box as it was drawn, with nothing around it."""
        self.setRange(ax.normalized(), padding=0)
        self.sigRangeChangedManually.emit(self.state["mouseEnabled"])

    def mouseDoubleClickEvent(self, ev: Any) -> None:
        """All of it again."""
        self.whole_asked.emit()
        ev.accept()


class CursorPair(QObject):
    """Two upright lines through plots of one time axis. Signal ``moved``: by hand, shown or hidden."""

    moved = Signal()

    def __init__(self, plots: Sequence[pg.PlotItem], parent: QObject) -> None:
        super().__init__(parent)
        self._plots = tuple(plots)
        self.times: tuple[float, float] | None = None
        self._lines = [[self._line(name, k == 0) for name in NAMES] for k in range(len(self._plots))]
        for lines in self._lines:
            for number, one in enumerate(lines):
                one.sigDragged.connect(lambda item, k=number: self._put(k, float(item.value())))

    def _line(self, name: str, named: bool) -> Cursor:
        options = {"label": name, "labelOpts": {"position": 0.9}} if named else {}
        cursor = Cursor(angle=90, movable=True, **options)
        cursor.setZValue(20)
        return cursor

    def show(self, on: bool) -> None:
        """At a third and two thirds of what is shown, or none."""
        self.times = None
        if on:
            left, right = self._plots[0].viewRange()[0]
            self.times = left + (right - left) / 3, left + 2 * (right - left) / 3
        for plot, lines in zip(self._plots, self._lines, strict=True):
            for one in lines:
                if one in plot.items:
                    plot.removeItem(one)
        self.draw_again()
        self.moved.emit()

    def draw_again(self) -> None:
        """After a plot was cleared, which takes the cursors with it."""
        if self.times is not None:
            for plot, lines in zip(self._plots, self._lines, strict=True):
                for one in lines:
                    if one not in plot.items:
                        plot.addItem(one, ignoreBounds=True)
            self._place()

    def _put(self, number: int, time: float) -> None:
        if self.times is not None:
            a, b = self.times
            self.times = (time, b) if number == 0 else (a, time)
            self._place()

    def _place(self) -> None:
        if self.times is not None:
            for lines in self._lines:
                for one, time in zip(lines, self.times, strict=True):
                    one.setValue(time)
        self.moved.emit()

    def recolour(self, widget: QWidget) -> None:
        """In the colours of now."""
        colours, width = colours_of(widget), widget.devicePixelRatioF()
        for lines in self._lines:
            for one, colour in zip(lines, (colours.accent, colours.residual), strict=True):
                one.setPen(line(colour, GRIP_PX * width))
                one.setHoverPen(line(colour, 2 * GRIP_PX * width))
                if hasattr(one, "label"):
                    one.label.setColor(colour)
