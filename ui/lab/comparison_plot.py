"""Measured and modelled above, the residual below, one time axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from fingerlab.diagnosis.answer.error_parts import Comparison, equation_of
from fingerlab.diagnosis.answer.results import Failure
from fingerlab.sessions.model import Array

from ..widgets.plots import (
    HELP,
    Cursor,
    CursorPair,
    DecimatedCurve,
    FocusFrame,
    LookBox,
    Tints,
    bottom_axis_height,
    colour_plot,
    label_left,
    move_by_key,
    prepare_plot,
    span_of,
)
from ..widgets.theme import colours_of, line, tint
from .comparison_bar import WEIGHED_TINT
from .comparison_curves import (
    MARGIN,
    ScaledComparison,
    aside_words,
    describe,
    ends,
    largest,
    scaled,
    stretches_of,
    values_at,
    values_between,
)
from .result_words import failure_words

AXIS_WIDTH = 72
LEAST_HEIGHT = 156
"""Pixels: so low that the steps below it stand whole in a low window with letters 1.5 times as large."""
SHORTEST_VIEW = 0.05
"""Seconds; closer than a few samples there is nothing to see."""


class ComparisonPlot(FocusFrame, pg.GraphicsLayoutWidget):
    """Two plots stacked. Keys: + and − zoom, ← and → move, Home shows all, F fits the heights to what is in
    view, C shows two cursors.

    Signals:
        pointed(wordings): the values under the mouse or of the two cursors, the longest first; () for none.
        stretch_named(text): the name of the tinted worst stretch, empty where none is tinted.
        place_named(text): the name of what is tinted in its place.
        recorded_named(on): whether the measured side is drawn as it was recorded, too.
        aside_named(left, weighed): what is left aside of the run, and what is weighed less in it, each
            with its share; empty where nothing is.
    """

    pointed = Signal(object)
    stretch_named = Signal(str)
    place_named = Signal(str)
    aside_named = Signal(str, str)
    recorded_named = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("comparisonPlot")
        self.setMinimumHeight(LEAST_HEIGHT)
        self._shown: ScaledComparison | None = None
        self._failure: Failure | None = None
        self.setAcceptDrops(False)  # a file dropped here is for the window
        self.setAccessibleName("Measured and modelled against time, and the residual")
        self.setFocusPolicy(Qt.FocusPolicy.WheelFocus)
        self.ci.setContentsMargins(0, 4, 8, 0)
        self.ci.setSpacing(4)
        boxes = LookBox(), LookBox()
        self.top: pg.PlotItem = self.addPlot(row=0, col=0, enableMenu=False, viewBox=boxes[0])
        self.bottom: pg.PlotItem = self.addPlot(row=1, col=0, enableMenu=False, viewBox=boxes[1])
        for box in boxes:
            box.whole_asked.connect(self.show_all)
        self.ci.layout.setRowStretchFactor(0, 10)
        self.ci.layout.setRowStretchFactor(1, 9)
        for plot in (self.top, self.bottom):
            prepare_plot(plot)
            plot.getAxis("left").setWidth(AXIS_WIDTH)
            plot.getViewBox().sigResized.connect(self._label_axes)
        self.top.getAxis("bottom").setStyle(showValues=False)
        self.bottom.getAxis("bottom").setHeight(bottom_axis_height())
        self.bottom.setLabel("bottom", "Time in the run (s)")
        self.bottom.setXLink(self.top)
        self._add_items()
        self.pair = CursorPair((self.top, self.bottom), self)
        self.pair.moved.connect(self._tell_pair)
        self.setToolTip(HELP)
        self.scene().sigMouseMoved.connect(self._on_mouse_moved)
        self._recolour()

    def _add_items(self) -> None:
        self.recorded = DecimatedCurve(name="as recorded")
        self.recorded.setZValue(-5)
        self.measured = DecimatedCurve(name="measured")
        self.modelled = DecimatedCurve(name="modelled")
        self.residual = DecimatedCurve(name="residual")
        horizontal = pg.LinearRegionItem.Horizontal
        self.floor_band = pg.LinearRegionItem((0, 0), orientation=horizontal, movable=False)
        self.zero = pg.InfiniteLine(angle=0, movable=False)
        self.stretches = [pg.LinearRegionItem((0, 0), movable=False) for _ in range(2)]
        self.places = [Tints(), Tints()]
        self.aside = [Tints(hatched=True, name="left aside") for _ in range(2)]
        self.weighed = [Tints(name="weighed less") for _ in range(2)]
        self.cursors = [Cursor(angle=90, movable=False) for _ in range(2)]
        for plot, stretch, cursor in zip((self.top, self.bottom), self.stretches, self.cursors, strict=True):
            stretch.setZValue(-20)
            stretch.hide()
            cursor.hide()
            plot.addItem(stretch, ignoreBounds=True)
            plot.addItem(cursor, ignoreBounds=True)
        for tints in (self.places, self.weighed, self.aside):
            for plot, places in zip((self.top, self.bottom), tints, strict=True):
                plot.addItem(places, ignoreBounds=True)
        self.floor_band.setZValue(-10)
        for item in (self.floor_band, self.zero, self.residual):
            self.bottom.addItem(item, ignoreBounds=True)
        for item in (self.recorded, self.measured, self.modelled):
            self.top.addItem(item, ignoreBounds=True)

    # what is shown

    @property
    def comparison(self) -> Comparison | None:
        """The equation and run shown."""
        return self._shown.comparison if self._shown is not None else None

    @property
    def figure_title(self) -> str:
        """Over a figure of what is shown: quantity and run."""
        comparison = self.comparison
        if comparison is None:
            return ""
        return f"{equation_of(comparison.equation).quantity}, run {comparison.run}"

    def show_comparison(
        self, comparison: Comparison | None, failure: Failure | None, keep_view: bool
    ) -> None:
        """Show one equation of one run, and the worst stretch where it lies in this one.

        ``keep_view`` leaves the time range as the user set it (a refit of the same run).
        """
        self._failure = failure
        self._forget_pointer()  # what was read there was of another curve
        if comparison is None:
            self._shown = None
            self._show_stretch()
            self._show_aside()
            for curve in (self.recorded, self.measured, self.modelled, self.residual):
                curve.set_series(np.empty(0), np.empty(0))
            return
        before = self._shown
        keep_view = keep_view and before is not None
        self._shown = shown = scaled(comparison, before if keep_view else None)
        self.measured.set_series(shown.time, shown.measured)
        self.modelled.set_series(shown.time, shown.modelled)
        self.residual.set_series(shown.time, shown.residual)
        floor = comparison.floor * shown.residual_unit.factor
        self.floor_band.setRegion((-floor, floor))
        self._label_axes()
        if not keep_view:
            self.top.setYRange(*span_of(np.concatenate([shown.measured, shown.modelled]), MARGIN), padding=0)
        # The residual's own axis follows it: what is left after an effect was added is seen, not a flat line.
        height = max(largest(shown.residual), 2.0 * floor) * (1 + MARGIN)
        self.bottom.setYRange(-height, height, padding=0)
        if not keep_view:
            self.show_whole()
        self._show_stretch()
        self._show_aside()
        self._tell_pair()
        self.setAccessibleDescription(describe(shown, floor))

    def show_full_rate(self, found: tuple[Array, Array] | None) -> None:
        """Draw the measured side as it was recorded, behind the filtered one; time in s, values in SI."""
        shown = self._shown
        there = found is not None and shown is not None
        time, values = found if found is not None and shown is not None else (np.empty(0), np.empty(0))
        self.recorded.set_series(time, values * (shown.unit.factor if shown is not None else 1.0))
        self.recorded_named.emit(there)

    def _show_aside(self) -> None:
        """Hatch what the equation is not judged by, and tint what it is judged by the less."""
        comparison = self.comparison
        for both, weighed in ((self.aside, False), (self.weighed, True)):
            found = [(one.start, one.stop) for one in stretches_of(comparison, weighed)]
            for tints in both:
                tints.show_stretches(found)
        words = [
            aside_words(comparison, weighed) if comparison is not None else "" for weighed in (False, True)
        ]
        self.aside_named.emit(*words)

    def _label_axes(self) -> None:
        shown = self._shown
        if shown is None:
            return
        label_left(self.top, equation_of(shown.comparison.equation).quantity, shown.unit)
        label_left(self.bottom, "Residual", shown.residual_unit)

    def fit_heights(self) -> None:
        """Heights of what is in view now."""
        shown = self._shown
        if shown is None:
            return
        left, right = self.top.viewRange()[0]
        seen = (shown.time >= left) & (shown.time <= right)
        floor = shown.comparison.floor * shown.residual_unit.factor
        self.top.setYRange(
            *span_of(np.concatenate([shown.measured[seen], shown.modelled[seen]]), MARGIN), padding=0
        )
        height = max(largest(shown.residual[seen]), 1.2 * floor) * (1 + MARGIN)
        self.bottom.setYRange(-height, height, padding=0)

    def show_all(self) -> None:
        """The whole run in its whole height."""
        self.show_whole()
        self.fit_heights()

    def show_whole(self) -> None:
        """The whole run."""
        if self._shown is not None and len(self._shown.time):
            start, stop = ends(self._shown.comparison)
            for plot in (self.top, self.bottom):
                plot.getViewBox().setLimits(xMin=start, xMax=stop, minXRange=SHORTEST_VIEW)
            self.top.setXRange(start, stop, padding=0)

    def shows_whole(self) -> bool:
        """Whether the whole run is in view."""
        if self._shown is None or not len(self._shown.time):
            return True
        start, stop = self.top.viewRange()[0]
        first, last = ends(self._shown.comparison)
        return bool(start <= first and stop >= last)

    def show_stretch(self) -> None:
        """The worst stretch, with as much again on either side."""
        if self._failure_is_here() and self._failure is not None:
            length = max(self._failure.stop - self._failure.start, 0.2)
            middle = (self._failure.start + self._failure.stop) / 2
            self.top.setXRange(middle - 2 * length, middle + 2 * length, padding=0)

    def _failure_is_here(self) -> bool:
        shown, failure = self._shown, self._failure
        return (
            shown is not None
            and failure is not None
            and failure.equation == shown.comparison.equation
            and failure.run == shown.comparison.run
        )

    def _show_stretch(self) -> None:
        here = self._failure_is_here()
        self.show_places((), "")
        for stretch in self.stretches:
            stretch.setVisible(here)
            if here and self._failure is not None:
                stretch.setRegion((self._failure.start, self._failure.stop))
        self.stretch_named.emit(failure_words(self._failure) if here else "")

    def show_places(self, stretches: Sequence[tuple[float, float]], words: str) -> None:
        """Tint other stretches in place of the worst one; none leaves that as it is."""
        for places in self.places:
            places.show_stretches(stretches)
        if stretches:
            for stretch in self.stretches:
                stretch.hide()
            self.place_named.emit(words)

    # how it looks

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.DevicePixelRatioChange and hasattr(self, "pair"):
            self._recolour()  # pens are in device pixels
        return bool(super().event(event))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "pair"):
            self._recolour()

    def _recolour(self) -> None:
        colours = colours_of(self)
        self.setBackground(colours.surface)
        for plot in (self.top, self.bottom):
            colour_plot(plot, colours)
        width = self.devicePixelRatioF()
        self.recorded.setPen(pg.mkPen(tint(colours.muted, 0.35), width=width))
        self.measured.setPen(line(colours.measured, width))
        self.modelled.setPen(line(colours.modelled, width, dashed=True))
        self.residual.setPen(line(colours.residual, width))
        self.zero.setPen(line(colours.muted))
        self.floor_band.setBrush(tint(colours.floor, 0.35))
        for stretch in self.stretches:
            stretch.setBrush(tint(colours.residual, 0.18))
        for places in self.places:
            places.set_colour(tint(colours.residual, 0.18))
        for left in self.aside:
            left.set_colour(tint(colours.muted, 0.4))
        for weighed in self.weighed:
            weighed.set_colour(tint(colours.muted, WEIGHED_TINT))
        for edge in (*self.floor_band.lines, *(e for s in self.stretches for e in s.lines)):
            edge.setPen(pg.mkPen(None))
        for cursor in self.cursors:
            cursor.setPen(line(colours.muted))
        self.pair.recolour(self)

    # hand

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Home:
            self.show_all()
        elif event.key() == Qt.Key.Key_F:
            self.fit_heights()
        elif event.key() == Qt.Key.Key_C:
            self.pair.show(self.pair.times is None)
        elif not move_by_key(self.top, event):
            super().keyPressEvent(event)

    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        self._forget_pointer()

    def _forget_pointer(self) -> None:
        for cursor in self.cursors:
            cursor.hide()
        self._tell_pair()

    def _tell_pair(self) -> None:
        """What the two cursors read, or nothing."""
        shown, times = self._shown, self.pair.times
        self.pointed.emit(values_between(shown, times) if shown is not None and times is not None else ())

    def _on_mouse_moved(self, place: QPointF) -> None:
        shown = self._shown
        if self.pair.times is not None:
            return
        for plot in (self.top, self.bottom):
            if shown is not None and plot.sceneBoundingRect().contains(place):
                time = plot.getViewBox().mapSceneToView(place).x()
                index = int(np.clip(np.searchsorted(shown.time, time), 0, len(shown.time) - 1))
                for cursor in self.cursors:
                    cursor.setPos(shown.time[index])
                    cursor.show()
                self.pointed.emit(values_at(shown, index))
                return
