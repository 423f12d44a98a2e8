"""One plot of the review: its curves by layer and channel, cursors, markers, grid, and the clock above."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime, timedelta
from html import escape
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QLineF, QRectF
from PySide6.QtGui import QColor, QPainter

from fingerlab.library.reviewing import Marker

from ..widgets.plots import Cursor, DecimatedCurve, bottom_axis_height
from ..widgets.series import round_ticks
from ..widgets.theme import Colours, line, tint
from .overlays import GLYPHS
from .review_data import CHANNELS, Layer, PaneSpec


class ClockAxis(pg.AxisItem):
    """Labels seconds of a run with the clock; empty while it is not known when the run began."""

    def __init__(self) -> None:
        super().__init__("top")
        self.began: datetime | None = None

    def set_began(self, began: datetime | None) -> None:
        """The moment at which the run's time is 0."""
        self.began = began
        self.picture = None
        self.update()

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[Any]:
        if self.began is None:
            return ["" for _ in values]
        return [clock_text(self.began, value, spacing) for value in values]


def clock_text(began: datetime, seconds: float, resolution: float) -> str:
    """Time of day, with as many decimals as steps of ``resolution`` seconds need."""
    decimals = 0 if resolution >= 1 else 1 if resolution >= 0.1 else 2 if resolution >= 0.01 else 3
    moment = began + timedelta(seconds=round(seconds, decimals))
    text = f"{moment:%H:%M:%S}"
    return f"{text}.{moment.microsecond:06d}"[: len(text) + 1 + decimals] if decimals else text


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


RUN_TIME = "Run time (s)"


class ReviewPane:
    """One plot of the stack: its curves by layer and channel, its cursors, its markers."""

    def __init__(self, spec: PaneSpec, plot: pg.PlotItem) -> None:
        self.spec, self.plot = spec, plot
        self.curves: dict[tuple[int, str], DecimatedCurve] = {}
        self.strokes: dict[tuple[int, str], pg.PlotCurveItem] = {}
        names = (
            {"label": "A", "labelOpts": {"position": 0.06}},
            {"label": "B", "labelOpts": {"position": 0.06}},
        )
        self.cursors = [Cursor(angle=90, movable=True, **name) for name in names]
        self.markers: list[pg.InfiniteLine] = []
        self.legend = pg.TextItem(anchor=(0, 0))
        self.legend.setParentItem(plot.getViewBox())
        self.legend.setPos(4, 0)
        self.legend.setZValue(30)
        for cursor in self.cursors:
            cursor.setZValue(20)
        self.grid = Grid(plot)
        plot.addItem(self.grid, ignoreBounds=True)
        self.add_curves(0)

    def add_curves(self, number: int, run: str = "") -> None:
        """Curves for the layer of that number, with the name of its run; they stay when it goes."""
        for name in self.spec.channels:
            if (number, name) not in self.curves:
                self.curves[number, name] = DecimatedCurve()
                self.strokes[number, name] = pg.PlotCurveItem(connect="finite", antialias=True)
                for item in (self.curves[number, name], self.strokes[number, name]):
                    item.setZValue(number)
                    self.plot.addItem(item, ignoreBounds=True)
            for item in (self.curves[number, name], self.strokes[number, name]):
                item.opts["name"] = f"{CHANNELS[name].title}, {run}" if run else None

    def show_cursors(self, times: Sequence[float] | None) -> None:
        """Put the cursors somewhere; None for none. While they are not shown they cost nothing."""
        for number, cursor in enumerate(self.cursors):
            there = cursor in self.plot.items
            if times is None and there:
                self.plot.removeItem(cursor)
            elif times is not None:
                if not there:
                    self.plot.addItem(cursor, ignoreBounds=True)
                cursor.setValue(times[number])

    def show_time_axis(self, on: bool, words: str) -> None:
        """Times and label below, or nothing."""
        axis = self.plot.getAxis("bottom")
        self.plot.showAxis("bottom", on)
        if on:
            axis.linkToView(self.plot.getViewBox())
            axis.setHeight(bottom_axis_height())
            self.plot.setLabel("bottom", words)
        else:
            axis.unlinkFromView()

    def show_legend(self, present: Collection[str], over: Sequence[Layer], colours: Colours) -> None:
        """Name the curves where there is more than one, each as it is drawn; and the runs laid over."""
        names = [name for name in self.spec.channels if name in present]
        parts = []
        for name in names if len(names) > 1 else ():
            title = escape(CHANNELS[name].title)
            title = f"<b>{title}</b>" if name in self.spec.wide else title
            colour = getattr(colours, self.spec.channels[name])
            parts.append(f'<span style="color:{colour}">{title}</span>')
        for layer in over:
            drawn_as = f"{GLYPHS[layer.number - 1]}&nbsp;{escape(layer.name)}"
            parts.append(f'<span style="color:{colours.over[layer.number - 1]}">{drawn_as}</span>')
        self.legend.setHtml(" &nbsp; ".join(parts))
        self.legend.fill = pg.mkBrush(tint(colours.surface, 0.75))
        self.legend.setVisible(bool(parts))

    def show_markers(self, markers: Sequence[Marker], with_text: bool, colour: str) -> None:
        """A line for each marker; its note beside it in one pane only."""
        for old in self.markers:
            self.plot.removeItem(old)
        self.markers = []
        for marker in markers:
            text = (
                {"label": marker.note, "labelOpts": {"position": 0.18, "color": colour}} if with_text else {}
            )
            item = pg.InfiniteLine(marker.time, angle=90, pen=line(colour, 1.0, dashed=True), **text)
            self.plot.addItem(item, ignoreBounds=True)
            self.markers.append(item)
