"""To look closer at curves: wheel on either axis, a box, the whole again, and two cursors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QWidget

from .plots import Cursor
from .theme import colours_of, line

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
