"""All quantities of a run stacked over one time axis, with cursors, markers and other runs over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from fingerlab.library.reviewing import Cycles, Marker
from fingerlab.sessions.model import Array

from ..widgets.plots import FocusFrame, bottom_axis_height, colour_plot, move_by_key, prepare_plot
from ..widgets.theme import colours_of, line
from .review_data import MARGIN, PANES, Layer, PaneSpec, limits_of
from .review_pane import RUN_TIME, ClockAxis, ReviewPane, over_pen

AXIS_WIDTH = 64
WHOLE_ROOM = 16_777_215.0
"""px, Qt's own limit; a row that is not seen has none, or a strip below the others would stay empty."""
SHORTEST_VIEW = 0.02
"""Seconds: twenty samples at 1 kHz."""
FEED_MS = 15
DENSE = 32
"""Samples a pixel from which curves are drawn thin and whole (half a minute at 1 kHz on a small window): wide
or dashed lines up and down the whole plot cost many times more time a frame."""
SMOOTH = 1
"""Samples a pixel up to which curves are smoothed: more, and it would double the time of a frame for nothing
that can be seen."""


class ReviewPlots(FocusFrame, pg.GraphicsLayoutWidget):
    """Keys: + and − zoom, ← and → move, Home shows the whole run.

    Signals:
        samples_wanted(layer, left, right): between two times of its run, s.
        cursors_moved(a, b): on the screen's time axis, s.
    """

    samples_wanted = Signal(object, float, float)
    cursors_moved = Signal(float, float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("reviewPlots")
        self.setAccessibleName("Channels of the run against time")
        self.setAcceptDrops(False)
        self.setFocusPolicy(Qt.FocusPolicy.WheelFocus)
        self.ci.setContentsMargins(0, 4, 8, 0)
        self.ci.setSpacing(4)
        self.layers: list[Layer] = []
        self.strokes: dict[int, Cycles] = {}
        self.clock = ClockAxis()
        self.fits_heights = False
        self._left_out: frozenset[str] = frozenset()
        self._drawn_as: tuple[bool, bool] | None = None
        self._fed = (0.0, 0.0, 0.0)
        self._fed_state: tuple[Any, ...] = ()
        self._cursors: list[float] | None = None
        self._shown_markers: tuple[Marker, ...] = ()
        self.panes = [self._add_pane(row, spec) for row, spec in enumerate(PANES)]
        self.top = self.panes[0].plot
        for pane in self.panes[1:]:
            pane.plot.setXLink(self.top)
        self._timer = QTimer(self, singleShot=True, interval=FEED_MS)
        self._timer.timeout.connect(self.feed)
        self.top.getViewBox().sigXRangeChanged.connect(lambda *_: self._timer.start())
        self.top.getViewBox().sigResized.connect(lambda *_: self._timer.start())
        self._recolour()

    def _add_pane(self, row: int, spec: PaneSpec) -> ReviewPane:
        axes = {"top": self.clock} if row == 0 else {}
        plot: pg.PlotItem = self.addPlot(row=row, col=0, enableMenu=False, axisItems=axes)
        prepare_plot(plot)
        plot.showGrid(x=False, y=False)  # Grid draws it
        plot.getAxis("left").setWidth(AXIS_WIDTH)
        plot.getAxis("left").setCacheMode(pg.GraphicsObject.CacheMode.DeviceCoordinateCache)
        for name in ("top", "right"):  # pyqtgraph lets axes follow the view that nobody sees
            if name != "top" or row != 0:
                plot.getAxis(name).unlinkFromView()
        plot.setMouseEnabled(x=True, y=False)
        self.ci.layout.setRowStretchFactor(row, spec.share)
        if row == 0:
            self.clock.enableAutoSIPrefix(False)
            self.clock.setHeight(bottom_axis_height() // 2)  # one line, always: nothing is laid out anew
            plot.showAxis("top")
            self.clock.setStyle(tickFont=plot.getAxis("left").style["tickFont"], tickTextOffset=2)
            self.clock.setTickDensity(0.7)
        pane = ReviewPane(spec, plot)
        for number, cursor in enumerate(pane.cursors):
            cursor.sigDragged.connect(lambda item, k=number: self._on_cursor(k, float(item.value())))
        plot.getViewBox().sigResized.connect(lambda *_: pane.label_axis())
        return pane

    # what is shown

    def show_layers(self, layers: list[Layer], began: datetime | None, markers: Sequence[Marker]) -> None:
        """Show a run, and others over it. The view stays where the first run stays the same."""
        same = bool(self.layers and layers and self.layers[0].run is layers[0].run)
        self.layers = layers
        self._fed_state = ()
        self._drawn_as = None
        for pane in self.panes:
            pane.line = layers[0].line if layers else pane.line
            for layer in layers:
                pane.add_curves(layer.number, layer.name)
        if self.strokes and not same:
            self.strokes = {}
        self.clock.set_began(began)
        self._shown_markers = tuple(markers)
        self._arrange()
        self._show_markers()
        self._show_legends()
        if not same:
            self.show_whole()
        self.set_heights()
        self.feed()

    def leave_out(self, titles: frozenset[str]) -> None:
        """Plots that are not to be seen, by their titles."""
        if titles != self._left_out:
            self._left_out = titles
            self._arrange()
            self._show_markers()
            self._show_legends()

    def _arrange(self) -> None:
        """Plots of channels that the runs have, and that are not left out."""
        present = {name for layer in self.layers for name in layer.pyramid.channels}
        last = None
        for pane in self.panes:
            here = any(name in present for name in pane.spec.channels)
            shown = here and pane.spec.title not in self._left_out
            pane.plot.setVisible(shown)
            row = self.panes.index(pane)
            self.ci.layout.setRowStretchFactor(row, pane.spec.share if shown else 0)
            self.ci.layout.setRowMaximumHeight(row, WHOLE_ROOM if shown else 0)
            last = pane if shown else last
        for pane in self.panes:
            pane.show_time_axis(pane is last, RUN_TIME)

    @property
    def cycles(self) -> Cycles | None:
        """The strokes of the run under review, where strokes are shown."""
        return self.strokes.get(0)

    def show_cycles(self, strokes: Mapping[int, Cycles]) -> None:
        """Strokes over one another, by the numbers of the layers, in place of the runs; none: the runs."""
        self.strokes = dict(strokes)
        self.clock.setVisible(not strokes)
        layers = {layer.number: layer for layer in self.layers}
        for pane in self.panes:
            for (number, name), item in pane.strokes.items():
                series = strokes[number].series if number in strokes else {}
                x, y = series.get(name, _NOTHING)
                item.setData(x, y * layers[number].factor(name) if len(y) else y)
            for curve in pane.curves.values():
                curve.setVisible(not strokes)
            if pane.plot.getAxis("bottom").isVisible():
                pane.plot.setLabel("bottom", "Time in the stroke (s)" if strokes else RUN_TIME)
        self._show_markers()
        self._show_legends()
        self.show_whole()
        self.set_heights()

    def show_whole(self) -> None:
        """The whole run, or the whole stroke."""
        self.set_limits()
        self.top.setXRange(*self.span, padding=0)

    def set_limits(self) -> None:
        """Nothing to see beyond the ends; they are known for certain when the whole run has been read."""
        start, stop = self.span
        least = min(SHORTEST_VIEW, stop - start)
        for pane in self.panes:
            pane.plot.getViewBox().setLimits(xMin=start, xMax=stop, minXRange=least)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time that can be shown."""
        if self.strokes:
            return 0.0, max(cycles.period for cycles in self.strokes.values())
        spans = [layer.span for layer in self.layers]
        return (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else (0.0, 1.0)

    def feed(self) -> None:
        """Give every curve what the view needs; ask for samples where memory is too coarse."""
        if self.strokes:
            return
        (left, right), pixels = self.top.viewRange()[0], max(int(self.top.getViewBox().width()), 16)
        rate = self.layers[0].run.sample_rate_hz if self.layers else 1.0
        samples = (right - left) * rate / pixels
        self._set_pens(samples > DENSE, samples <= SMOOTH)
        for layer in self.layers:
            wanted = layer.wants_samples(left, right, pixels)
            if wanted is not None and wanted != layer.asked:
                layer.asked = wanted
                self.samples_wanted.emit(layer, *wanted)
        if not self._is_fed(left, right, pixels):
            self._feed_curves(left, right, pixels)
        if self.fits_heights:
            self.set_heights()

    def _is_fed(self, left: float, right: float, pixels: int) -> bool:
        """Whether the curves hold all that lies in view, so that moving costs nothing but painting."""
        state = (
            pixels,
            *((one.shift, one.pyramid.filled, one.version) for one in self.layers),
            *(one.has_samples(left, right) for one in self.layers),
        )
        low, high, width = self._fed
        covers = low <= left and right <= high and abs(right - left - width) < 1e-6 * width
        if covers and state == self._fed_state:
            return True
        wide = MARGIN * (right - left)
        self._fed, self._fed_state = (left - wide, right + wide, right - left), state
        return False

    def _feed_curves(self, left: float, right: float, pixels: int) -> None:
        layers = {layer.number: layer for layer in self.layers}
        for pane in self.panes:
            for (number, name), curve in pane.curves.items():
                layer = layers.get(number)
                if layer is None or name not in layer.pyramid.channels:
                    curve.set_series(*_NOTHING)
                    continue
                time, values = layer.series(name, left, right, pixels)
                curve.set_series(time, values * layer.factor(name))

    def set_heights(self) -> None:
        """Scale the heights to the whole run, or to what is seen."""
        left, right = self.top.viewRange()[0]
        for pane in self.panes:
            parts: list[Array] = []
            for name in pane.spec.channels:
                if self.strokes:
                    parts += [
                        self.strokes[one.number].series[name][1] * one.factor(name)
                        for one in self.layers
                        if one.number in self.strokes and name in self.strokes[one.number].series
                    ]
                elif self.fits_heights:
                    for layer in self.layers:
                        x, y = pane.curves[layer.number, name].series
                        parts.append(y[(x >= left) & (x <= right)])
                else:
                    for layer in self.layers:
                        if name in layer.pyramid.channels:
                            parts.append(np.array(layer.pyramid.extremes(name)) * layer.factor(name))
            pane.plot.setYRange(*limits_of(parts, pane.spec.least_of(pane.line)), padding=0)
            pane.label_axis()

    # cursors and markers

    @property
    def cursors(self) -> tuple[float, float] | None:
        """Where the two cursors stand, s; None where there are none."""
        return None if self._cursors is None else (self._cursors[0], self._cursors[1])

    def show_cursors(self, on: bool) -> None:
        """Two cursors at a third and two thirds of what is shown, or none."""
        self._cursors = None
        if on:
            left, right = self.top.viewRange()[0]
            self._cursors = [left + (right - left) / 3, left + 2 * (right - left) / 3]
        self._place_cursors()

    def move_cursor(self, number: int, time: float) -> None:
        """Put a cursor somewhere."""
        if self._cursors is not None:
            self._cursors[number] = time
            self._place_cursors()

    def _on_cursor(self, number: int, time: float) -> None:
        self.move_cursor(number, time)

    def _place_cursors(self) -> None:
        for pane in self.panes:
            pane.show_cursors(self._cursors)
        if self._cursors is not None:
            self.cursors_moved.emit(*self._cursors)

    def _show_legends(self) -> None:
        present = {name for layer in self.layers for name in layer.pyramid.channels}
        over = [one for one in self.layers[1:] if not self.strokes or one.number in self.strokes]
        for pane in self.panes:
            pane.show_legend(present, over if pane is self._first_pane() else (), colours_of(self))

    def _show_markers(self) -> None:
        colour = colours_of(self).muted
        for pane in self.panes:
            markers = self._shown_markers if not self.strokes else ()
            pane.show_markers(markers, pane is self._first_pane(), colour)

    def _first_pane(self) -> ReviewPane:
        return next((pane for pane in self.panes if pane.plot.isVisible()), self.panes[0])

    # how it looks

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.DevicePixelRatioChange:
            self._recolour()
        return bool(super().event(event))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "panes"):
            self._recolour()
            self._show_markers()
            self._show_legends()

    def _set_pens(self, dense: bool, smooth: bool) -> None:
        if (dense, smooth) == self._drawn_as:
            return
        self._drawn_as = dense, smooth
        colours, width = colours_of(self), self.devicePixelRatioF()
        for pane in self.panes:
            for (number, name), curve in pane.curves.items():
                # Of two curves in a plot one is wide; another run is dashed: colour never tells alone.
                wide = 1.6 * width if name in pane.spec.wide and not dense else width
                role = pane.spec.channels[name]
                pen = over_pen(number, colours, wide) if number else line(getattr(colours, role), wide)
                if dense:
                    pen.setStyle(Qt.PenStyle.SolidLine)
                curve.opts["antialias"] = smooth
                curve.setPen(pen)
                pane.strokes[number, name].setPen(pen)

    def _recolour(self) -> None:
        drawn_as, self._drawn_as = self._drawn_as or (False, False), None
        self._set_pens(*drawn_as)
        colours, width = colours_of(self), self.devicePixelRatioF()
        self.setBackground(colours.surface)
        self.clock.setPen(colours.muted)
        self.clock.setTextPen(colours.text)
        for pane in self.panes:
            colour_plot(pane.plot, colours)
            pane.grid.set_colour(colours.line)
            for cursor, colour in zip(pane.cursors, (colours.accent, colours.residual), strict=True):
                cursor.setPen(line(colour, 1.5 * width))
                cursor.label.setColor(colour)
                cursor.setHoverPen(line(colour, 3.0 * width))

    # hand

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Home:
            self.show_whole()
        elif not move_by_key(self.top, event):
            super().keyPressEvent(event)


_NOTHING: tuple[Array, Array] = (np.empty(0), np.empty(0))
