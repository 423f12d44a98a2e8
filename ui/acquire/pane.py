"""One live plot: its readings as large numbers above, its curves below, its scale."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QSize, Qt, Signal
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from ..theme import Colours, colours_of, large_font
from ..widgets.decimate import live_envelope
from ..widgets.labels import remark
from ..widgets.plot_style import bottom_axis_height, colour_plot, label_left, line, prepare_plot, tint
from .channels import QUANTITIES, PlotSpec, Quantity, Trace
from .history import History
from .scale import Scale, ScaleButton

AXIS_WIDTH = 64
SHRINK_BELOW = 0.35
"""An automatic scale is tightened when its data fill less than this share of it."""


class Swatch(QWidget):
    """A short piece of a curve as it is drawn: the legend."""

    def __init__(self, trace: Trace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._trace = trace
        self.setFixedSize(QSize(20, 12))

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        colour = getattr(colours_of(self), self._trace.role)
        painter.setPen(line(colour, 3.0 if self._trace.bold else 2.0, self._trace.dashed))
        painter.drawLine(0, self.height() // 2, self.width(), self.height() // 2)
        painter.end()


class Reading(QWidget):
    """A large number with its name, its unit, and the curve it belongs to."""

    def __init__(self, quantity: Quantity, trace: Trace | None, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._quantity = quantity
        self.value = QLabel(quantity.text(math.nan))
        self.value.setObjectName(f"reading_{quantity.column}")
        self.value.setAccessibleName(quantity.title)
        font = large_font()
        font.setBold(True)
        self.value.setFont(font)
        widest = "−8888." + "8" * quantity.digits
        self.value.setMinimumWidth(
            QLabel(quantity.unit.after(widest)).sizeHint().width() * 5 // 4
        )  # so that nothing moves as digits come and go
        self.setToolTip(quantity.help)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        if trace is not None:
            layout.addWidget(Swatch(trace))
        layout.addWidget(remark(quantity.title, wrap=False))
        layout.addWidget(self.value)

    def show_value(self, value: float) -> None:
        """Show a value in SI."""
        text = self._quantity.text(value)
        if text != self.value.text():
            self.value.setText(text)


class LiveCurve(pg.PlotCurveItem):
    """Width 1 and no antialiasing: anything else costs tens of milliseconds a frame."""

    def __init__(self, trace: Trace) -> None:
        super().__init__(antialias=False, skipFiniteCheck=True)
        self.trace = trace

    def show_part(
        self, history: History, start: int, stop: int, buckets: int, factor: float
    ) -> tuple[float, float]:
        """Draw samples ``start`` to ``stop``; their smallest and largest value as drawn, NaN for none."""
        first, values = history.series(self.trace.column, start, stop)
        bucket = max((stop - start) // max(buckets, 16), 1)
        places, drawn = live_envelope(first, values, bucket)
        drawn = drawn * factor
        finite = np.isfinite(drawn)
        whole = bool(finite.all())
        if not finite.any():
            self.setData(np.empty(0), np.empty(0))
            return math.nan, math.nan
        self.setData(
            places / history.rate_hz, drawn, connect="all" if whole else "finite", skipFiniteCheck=whole
        )
        good = drawn if whole else drawn[finite]
        return float(good.min()), float(good.max())


class Pane(QWidget):
    """Signals: moved_by_hand() when the user pans or zooms; cursor_moved(number, time)."""

    moved_by_hand = Signal()
    cursor_moved = Signal(int, float)

    def __init__(self, spec: PlotSpec, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.spec = spec
        self.setObjectName(f"pane_{spec.key}")
        self.plot = pg.PlotWidget(enableMenu=False)
        self.plot.setAccessibleName(f"{spec.title} against time")
        self.plot.setAcceptDrops(False)
        self.plot.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.item: pg.PlotItem = self.plot.getPlotItem()
        prepare_plot(self.item)
        self.item.getAxis("left").setWidth(AXIS_WIDTH)
        self.item.setContentsMargins(0, 2, 8, 0)
        self.item.setMouseEnabled(x=True, y=False)
        self.curves = [LiveCurve(trace) for trace in spec.traces]
        for curve in self.curves:
            self.item.addItem(curve, ignoreBounds=True)
        self.cursors = [pg.InfiniteLine(angle=90, movable=True) for _ in range(2)]
        for number, cursor in enumerate(self.cursors):
            cursor.hide()
            self.item.addItem(cursor, ignoreBounds=True)
            cursor.sigDragged.connect(lambda moved, n=number: self.cursor_moved.emit(n, float(moved.value())))
        self._marks: list[pg.InfiniteLine] = []
        self.scale = Scale(spec.least)
        self._range = (-spec.least / 2, spec.least / 2)
        self.error = remark(wrap=False)
        self.error.setObjectName(f"error_{spec.key}")
        self._build()
        self.item.setYRange(*self._range, padding=0)
        view = self.item.getViewBox()
        view.sigRangeChangedManually.connect(lambda *_: self.moved_by_hand.emit())
        view.sigResized.connect(self._label)
        self._recolour()

    def _build(self) -> None:
        spec = self.spec
        self.readings: dict[str, Reading] = {}
        row = QHBoxLayout()
        row.setContentsMargins(8, 0, 8, 0)
        row.setSpacing(16)
        drawn = {trace.column: trace for trace in spec.traces}
        for column in spec.readings:
            self.readings[column] = Reading(QUANTITIES[column], drawn.get(column))
            row.addWidget(self.readings[column])
        self.modelled: list[QWidget] = []
        for column, trace in drawn.items():
            if column not in spec.readings:
                row.addWidget(swatch := Swatch(trace))
                row.addWidget(words := remark(QUANTITIES[column].title, wrap=False))
                self.modelled += [swatch, words]
        row.addWidget(self.error)
        row.addStretch(1)
        self.scale_button = ScaleButton(spec, self.scale)
        row.addWidget(self.scale_button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addLayout(row)
        layout.addWidget(self.plot, 1)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    # what is shown

    def show_time_axis(self, on: bool) -> None:
        """Only the lowest plot has ticks and label below."""
        axis = self.item.getAxis("bottom")
        axis.setStyle(showValues=on)
        axis.setHeight(bottom_axis_height() if on else 4)
        self.item.setLabel("bottom", "Time since connecting (s)" if on else "")

    def show_model(self, on: bool) -> None:
        """Whether what belongs to the model is shown."""
        for widget in self.modelled:
            widget.setVisible(on or self.spec.model)
        self.error.setVisible(on)

    def show_part(self, history: History, start: int, stop: int) -> None:
        """Draw samples ``start`` to ``stop`` and keep to the scale."""
        width = int(self.item.getViewBox().width())
        extremes = [
            curve.show_part(history, start, stop, width, self.spec.unit.factor) for curve in self.curves
        ]
        self.item.setXRange(start / history.rate_hz, stop / history.rate_hz, padding=0)
        self._fit([value for pair in extremes for value in pair if value == value])

    def _fit(self, values: Sequence[float]) -> None:
        low, high = self._range
        if self.scale.fixed is not None:
            wanted = self.scale.fixed
        elif not values:
            return
        else:
            wanted = self._automatic(min(values), max(values))
        if wanted != (low, high):
            self._range = wanted
            self.item.setYRange(*wanted, padding=0)
            self.scale_button.show_range(wanted)

    def _automatic(self, least: float, most: float) -> tuple[float, float]:
        """The range now, if the data still fit and fill it well; else a better one."""
        low, high = self._range
        span = max(most - least, self.spec.least)
        if low <= least and most <= high and span >= SHRINK_BELOW * (high - low):
            return low, high
        middle, half = (least + most) / 2, 0.5 * span * 1.15
        return middle - half, middle + half

    def show_cursors(self, times: Sequence[float] | None) -> None:
        """Put the cursors somewhere, or hide them."""
        for number, cursor in enumerate(self.cursors):
            cursor.setVisible(times is not None)
            if times is not None:
                cursor.setValue(times[number])

    def show_marks(self, marks: Sequence[tuple[float, str]]) -> None:
        """Vertical lines with a note."""
        colours = colours_of(self)
        for number, (time, note) in enumerate(marks[len(self._marks) :], start=len(self._marks)):
            mark = pg.InfiniteLine(
                time,
                90,
                line(colours.muted, dashed=True),
                label=note if self.spec.key == "displacement" else None,
                labelOpts={"position": 0.93, "color": colours.text},
            )
            mark.setZValue(-5)
            self.item.addItem(mark, ignoreBounds=True)
            self._marks.append(mark)
            assert len(self._marks) == number + 1

    def clear(self) -> None:
        """Another bench: forget marks."""
        for mark in self._marks:
            self.item.removeItem(mark)
        self._marks.clear()

    # how it looks

    def _label(self) -> None:
        label_left(self.item, self.spec.title, self.spec.unit)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "scale_button"):
            self._recolour()

    def _recolour(self) -> None:
        colours: Colours = colours_of(self)
        self.plot.setBackground(colours.surface)
        colour_plot(self.item, colours)
        for curve in self.curves:
            curve.setPen(line(getattr(colours, curve.trace.role), 1.0, curve.trace.dashed))
        for number, cursor in enumerate(self.cursors):
            cursor.setPen(line(colours.accent, dashed=number == 1))
            cursor.setHoverPen(line(colours.accent, 3.0))
        for mark in self._marks:
            mark.setPen(line(colours.muted, dashed=True))
        self.item.getViewBox().setBorder(tint(colours.line, 0.0))
