"""The tab's plots: the live reading, the fitted line, and what is left over."""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent
from PySide6.QtGui import QPen
from PySide6.QtWidgets import QWidget

from fingerlab.calibration.outcome import CalibrationOutcome
from fingerlab.calibration.wizard import Wizard

from ..widgets.plots import bottom_axis_height, colour_plot, prepare_plot
from ..widgets.theme import colours_of, line, tint

SHOWN_S = 60.0
LEAST_V = 0.02
"""The live plot shows at least this much, V, so that noise does not fill it."""
BANDS = 4
"""Captured stretches that fit into the live plot."""
SYMBOLS = ("o", "t1")
SIZES = (12, 6)
AXIS_WIDTH = 72
SMALL_N = 0.1
"""Below this a force is shown in mN, as in the numbers beside the plots."""


class _Plot(pg.PlotWidget):
    """Prepared and recoloured like all plots of the window; ``_made`` once it may be coloured."""

    _made = False

    def __init__(self, name: str, accessible: str, parent: QWidget | None = None) -> None:
        super().__init__(parent, enableMenu=False)
        self.setObjectName(name)
        self.setAcceptDrops(False)  # a file dropped here is for the tab
        self.setAccessibleName(accessible)
        plot = self.getPlotItem()
        prepare_plot(plot)
        plot.setMouseEnabled(x=False, y=False)
        plot.setContentsMargins(0, 8, 8, 0)
        plot.getAxis("left").setWidth(AXIS_WIDTH)
        plot.getAxis("bottom").setHeight(bottom_axis_height())

    def pen(self, colour: str, width: float = 1.0, dashed: bool = False) -> QPen:
        """A pen so many of the window's pixels wide, however fine the screen."""
        return line(colour, width * self.devicePixelRatioF(), dashed)

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.DevicePixelRatioChange and self._made:
            self.recolour()
        return bool(super().event(event))

    def recolour(self) -> None:
        """Colours for light or dark."""
        self._made = True
        colours = colours_of(self)
        self.setBackground(colours.surface)
        colour_plot(self.getPlotItem(), colours)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and self._made:
            self.recolour()


class LivePlot(_Plot):
    """The last minute of the reading; captured stretches are tinted."""

    def __init__(self) -> None:
        super().__init__("calibrationLive", "Reading in volts over the last minute")
        plot = self.getPlotItem()
        plot.setLabel("left", "reading (V)")
        plot.setLabel("bottom", "time from now (s)")
        self._curve = pg.PlotCurveItem(connect="finite")
        self._range = (0.0, 0.0)
        plot.addItem(self._curve)
        self._bands = [pg.LinearRegionItem(movable=False) for _ in range(BANDS)]
        for band in self._bands:
            band.setZValue(-10)
            plot.addItem(band, ignoreBounds=True)
        self.recolour()

    def recolour(self) -> None:
        super().recolour()
        colours = colours_of(self)
        self._curve.setPen(self.pen(colours.measured, 1.5))
        for band in self._bands:
            band.setBrush(tint(colours.candidate, 0.25))
            for edge in band.lines:
                edge.setPen(self.pen(colours.candidate))

    def show_wizard(self, wizard: Wizard) -> None:
        """Draw what the wizard has of the last minute."""
        now = float(wizard.time[-1]) if len(wizard.time) else 0.0
        recent = wizard.time >= now - SHOWN_S
        volts = wizard.volts[recent]
        self._curve.setData(wizard.time[recent] - now, volts)
        known = volts[np.isfinite(volts)]
        if len(known):
            middle = (known.min() + known.max()) / 2
            half = max((known.max() - known.min()) * 0.6, LEAST_V)
            self._show_range(float(middle - half), float(middle + half))
        captures = wizard.captures[-BANDS:]
        for number, band in enumerate(self._bands):
            capture = captures[number] if number < len(captures) else None
            shown = capture is not None and now - SHOWN_S < capture.end < now
            band.setVisible(shown)
            if shown and capture is not None:
                band.setRegion((capture.start - now, capture.end - now))

    def _show_range(self, low: float, high: float) -> None:
        """The vertical range; left as it is while it still fits, so that the picture stands still."""
        before_low, before_high = self._range
        span = high - low
        if low < before_low or high > before_high or span < 0.7 * (before_high - before_low):
            self._range = (low - 0.1 * span, high + 0.1 * span)
            self.getPlotItem().setRange(xRange=(-SHOWN_S, 0), yRange=self._range, padding=0)


class _OutcomePlot(_Plot):
    """Draws a calibration, anew in other colours."""

    def __init__(self, name: str, accessible: str) -> None:
        super().__init__(name, accessible)
        self._outcome: CalibrationOutcome | None = None
        self.recolour()

    def recolour(self) -> None:
        super().recolour()
        self.show_outcome(self._outcome)

    def show_outcome(self, outcome: CalibrationOutcome | None) -> None:
        """Draw a calibration; None clears the plot."""
        self._outcome = outcome
        self.getPlotItem().clear()
        if outcome is not None:
            self._draw(outcome)

    def _draw(self, outcome: CalibrationOutcome) -> None:
        raise NotImplementedError


class FitPlot(_OutcomePlot):
    """Steps and line: reading on the one axis, known value on the other; each pass has its symbol."""

    def __init__(self) -> None:
        super().__init__("calibrationFit", "Known value against reading, with the fitted line")

    def _draw(self, outcome: CalibrationOutcome) -> None:
        plot, colours = self.getPlotItem(), colours_of(self)
        factor, unit = _screen(outcome)
        calibration = outcome.calibration
        volts = np.array([step.volts for step in calibration.steps])
        ends = np.array([volts.min(), volts.max()])
        plot.plot(ends, factor * calibration.apply(ends), pen=self.pen(colours.modelled, 2))
        _add_points(
            plot,
            outcome,
            volts,
            factor * np.array(calibration.known),
            colours.measured,
            self.pen(colours.measured, 1.5),
        )
        plot.setLabel("left", f"known value ({unit})")
        plot.setLabel("bottom", "reading (V)")
        plot.getViewBox().autoRange(padding=0.06)


class ResidualPlot(_OutcomePlot):
    """Known value less line, against the known value; the grey band is what the data sheet allows."""

    def __init__(self) -> None:
        super().__init__("calibrationResiduals", "Known value less line, against the known value")

    def _draw(self, outcome: CalibrationOutcome) -> None:
        plot, colours = self.getPlotItem(), colours_of(self)
        across, known_unit = _screen(outcome)
        factor, unit = _screen(outcome, max(map(abs, outcome.calibration.residuals)))
        limit = factor * outcome.sensor.accuracy.high
        band = pg.LinearRegionItem(
            (-limit, limit),
            orientation="horizontal",
            movable=False,
            brush=tint(colours.floor, 0.18),
            pen=self.pen(colours.floor, 1, dashed=True),
        )
        band.setZValue(-10)
        plot.addItem(band, ignoreBounds=True)
        plot.addItem(pg.InfiniteLine(0, angle=0, pen=self.pen(colours.muted)), ignoreBounds=True)
        known = across * np.array(outcome.calibration.known)
        residuals = factor * np.array(outcome.calibration.residuals)
        _add_points(plot, outcome, known, residuals, colours.residual, self.pen(colours.residual, 1.5))
        doubtful = [one.number for one in outcome.misplaced]
        if doubtful:
            rings = {"symbol": "o", "symbolSize": 20, "symbolBrush": None}
            pen = self.pen(colours.fault, 2)
            plot.plot(known[doubtful], residuals[doubtful], pen=None, symbolPen=pen, **rings)
        plot.setLabel("left", f"off the line ({unit})")
        plot.setLabel("bottom", f"known value ({known_unit})")
        # What the data sheet allows may be a hundred times wider; the shape of the residuals must be seen.
        largest = float(np.abs(residuals).max()) or limit
        far = 1.2 * max(largest, min(limit, 1.5 * largest))
        room = 0.06 * float(np.ptp(known))
        plot.setRange(xRange=(known.min() - room, known.max() + room), yRange=(-far, far), padding=0)


def _add_points(
    plot: pg.PlotItem, outcome: CalibrationOutcome, x: np.ndarray, y: np.ndarray, colour: str, pen: QPen
) -> None:
    for number, sweep in enumerate(outcome.sweeps):
        chosen = [i for i, move in enumerate(outcome.plan.moves) if move.sweep == sweep.name]
        # Open and large before filled and small: where passes agree, both are still seen.
        look = {
            "symbol": SYMBOLS[number % 2],
            "symbolSize": SIZES[number % 2],
            "symbolPen": pen,
        }
        plot.plot(x[chosen], y[chosen], pen=None, symbolBrush=(None, colour)[number % 2], **look)


def _screen(outcome: CalibrationOutcome, largest: float = math.inf) -> tuple[float, str]:
    """Factor and unit on the screen of values up to ``largest`` (SI)."""
    unit = outcome.sensor.unit
    if unit == "rad":
        return outcome.sensor.screen.factor, "°"
    return (1e3, f"m{unit}") if largest < SMALL_N else (1.0, unit)
