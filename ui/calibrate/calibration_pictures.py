"""What Calibrate draws: what to do now, the stability light, the live reading, the fit and its residuals."""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from fingerlab.calibration.outcome import CalibrationOutcome
from fingerlab.calibration.sensors import CalibrationPlan, mark_text
from fingerlab.calibration.wizard import Light, Wizard

from ..widgets.layout import FLUSH, described, hbox
from ..widgets.plots import QuietPlot
from ..widgets.theme import Colours, colours_of, large_font, small_font, tint

WORDS: dict[Light, str] = {"none": "no reading", "moving": "moving", "stable": "stable"}


class _Dot(QWidget):
    """Full while stable, half while moving, a ring where nothing is read."""

    light: Light = "none"

    def sizeHint(self) -> QSize:
        return QSize(24, 24)

    def paintEvent(self, event: QPaintEvent) -> None:
        colours = colours_of(self)
        colour = QColor(
            {"none": colours.muted, "moving": colours.residual, "stable": colours.candidate}[self.light]
        )
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        middle = QPointF(self.width() / 2, self.height() / 2)
        painter.setPen(QPen(colour, 3))
        painter.drawEllipse(middle, 9, 9)
        if self.light != "none":
            painter.setBrush(colour)
            painter.drawEllipse(middle, *((9, 9) if self.light == "stable" else (3, 3)))


class StabilityLight(QWidget):
    """Dot and word."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._dot = _Dot()
        self._dot.setFixedSize(24, 24)
        self.word = described(QLabel(WORDS["none"]), "stability", font=large_font())
        self.word.setMinimumWidth(112)
        hbox(self, self._dot, (self.word, 1), margins=FLUSH, spacing=8)

    def show_light(self, light: Light) -> None:
        """Show how the reading stands."""
        if self._dot.light != light:
            self._dot.light = light
            self._dot.update()
        self.word.setText(WORDS[light])
        self.setAccessibleName(f"Reading: {WORDS[light]}")


SIZE = QSize(264, 216)


class Picture(QWidget):
    """Drawn in the window's colours; what is to change is blue and has an arrow."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("calibrationPicture")
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._plan: CalibrationPlan | None = None
        self._number = 0

    def sizeHint(self) -> QSize:
        return SIZE

    def show_step(self, plan: CalibrationPlan, number: int) -> None:
        """Show step ``number`` of the plan; the last one once all are done."""
        self._plan, self._number = plan, min(number, len(plan.moves) - 1)
        move = plan.moves[self._number]
        self.setAccessibleName(f"Picture: {move.words}")
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._plan is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(small_font())
        colours = colours_of(self)
        moves = self._plan.moves
        mark = moves[self._number].mark
        before = moves[self._number - 1].mark if self._number else mark
        if self._plan.sensor.mark_unit == "kg":
            _draw_weights(painter, QRectF(self.rect()), colours, round(10 * mark), round(10 * before))
        else:
            _draw_joint(painter, QRectF(self.rect()), colours, self._plan, mark, before)


def _draw_weights(painter: QPainter, room: QRectF, colours: Colours, count: int, before: int) -> None:
    """A cell on its support with ``count`` weights of 100 g; the one to add or take is marked."""
    text, accent = QColor(colours.text), QColor(colours.accent)
    middle, floor = room.center().x() - 24, room.bottom() - 12
    painter.setPen(QPen(text, 1.5))
    painter.setBrush(QColor(colours.line))
    painter.drawRect(QRectF(middle - 80, floor - 12, 160, 12))
    painter.drawRect(QRectF(middle - 20, floor - 28, 40, 16))
    painter.setBrush(QColor(colours.surface))
    painter.drawRect(QRectF(middle - 48, floor - 34, 96, 6))
    height = 14.0
    for number in range(max(count, before)):
        box = QRectF(middle - 32, floor - 34 - (number + 1) * height, 64, height - 2)
        adding, taking = before <= number < count, count <= number < before
        painter.setPen(QPen(accent if adding or taking else text, 1.5, _style(taking)))
        painter.setBrush(accent if adding else QColor(colours.surface))
        painter.drawRect(box)
        if adding or taking:
            start = QPointF(box.right() + 40, box.center().y())
            tip = QPointF(box.right() + 8, box.center().y())
            _arrow(painter, *((start, tip) if adding else (tip, start)), accent)
    painter.setPen(text)
    words = f"{100 * count} g"
    painter.drawText(QRectF(room.right() - 72, floor - 34, 72, 24), Qt.AlignmentFlag.AlignCenter, words)


def _draw_joint(
    painter: QPainter, room: QRectF, colours: Colours, plan: CalibrationPlan, mark: float, before: float
) -> None:
    """The sheet's quarter circle with its marks, the fixed phalanx, and the one to be flexed."""
    text, accent, muted = QColor(colours.text), QColor(colours.accent), QColor(colours.muted)
    centre, radius = QPointF(room.left() + 92, room.top() + 44), 116.0

    def place(angle: float, distance: float) -> QPointF:
        turn = math.radians(angle)
        return centre + QPointF(distance * math.cos(turn), distance * math.sin(turn))

    painter.setPen(QPen(muted, 1))
    painter.drawArc(QRectF(centre.x() - radius, centre.y() - radius, 2 * radius, 2 * radius), 0, -90 * 16)
    for angle in sorted(set(plan.marks)):
        wanted = angle == mark
        painter.setPen(QPen(accent if wanted else muted, 3 if wanted else 1))
        painter.drawLine(place(angle, radius - 6), place(angle, radius + 6))
        painter.setPen(accent if wanted else muted)
        at = place(angle, radius + 22)
        label = QRectF(at.x() - 20, at.y() - 10, 40, 20)
        painter.drawText(label, Qt.AlignmentFlag.AlignCenter, mark_text(plan.sensor, angle))
    wide = Qt.PenCapStyle.RoundCap
    painter.setPen(QPen(text, 16, Qt.PenStyle.SolidLine, wide))
    painter.drawLine(centre, centre - QPointF(72, 0))
    if before != mark:
        painter.setPen(QPen(muted, 2, Qt.PenStyle.DashLine))
        painter.drawLine(centre, place(before, 84))
        end = place(mark + (6 if mark < before else -6), 100)
        _arrow(painter, place(before, 100), end, accent)
    painter.setPen(QPen(accent, 14, Qt.PenStyle.SolidLine, wide))
    painter.drawLine(centre, place(mark, 84))
    painter.setPen(QPen(text, 2))
    painter.setBrush(QColor(colours.surface))
    painter.drawEllipse(centre, 7, 7)


def _style(dashed: bool) -> Qt.PenStyle:
    return Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine


def _arrow(painter: QPainter, start: QPointF, tip: QPointF, colour: QColor) -> None:
    along = tip - start
    length = math.hypot(along.x(), along.y())
    if length < 1:
        return
    along /= length
    across = QPointF(-along.y(), along.x())
    painter.setPen(QPen(colour, 2))
    painter.drawLine(start, tip)
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([tip, tip - along * 9 + across * 5, tip - along * 9 - across * 5]))


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


class _Plot(QuietPlot):
    """A plot of the tab, with room for numbers of many digits."""

    def __init__(self, name: str, accessible: str) -> None:
        super().__init__(name, accessible)
        self.getPlotItem().setContentsMargins(0, 8, 8, 0)
        self.getPlotItem().getAxis("left").setWidth(AXIS_WIDTH)


class LivePlot(_Plot):
    """The last minute of the reading; captured stretches are tinted."""

    def __init__(self) -> None:
        super().__init__("calibrationLive", "Reading in volts over the last minute")
        self.setToolTip("U, V: the sensor's reading over the last minute. Tinted: the captured stretches.")
        plot = self.getPlotItem()
        plot.setLabel("left", "Reading (V)")
        plot.setLabel("bottom", "Time from now (s)")
        self._curve = pg.PlotCurveItem(connect="finite")
        self._range = (0.0, 0.0)
        plot.addItem(self._curve)
        self._bands = [pg.LinearRegionItem(movable=False) for _ in range(BANDS)]
        for band in self._bands:
            band.setZValue(-10)
            plot.addItem(band, ignoreBounds=True)
        self.redraw()

    def redraw(self) -> None:
        colours = colours_of(self)
        self._curve.setPen(self.pen("measured"))
        for band in self._bands:
            band.setBrush(tint(colours.candidate, 0.25))
            for edge in band.lines:
                edge.setPen(self.pen("candidate", 1.0))

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

    def redraw(self) -> None:
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
        self.setToolTip(
            "Known value (N or °) = gain · U + offset, U the reading (V): the line of least squares."
        )

    def _draw(self, outcome: CalibrationOutcome) -> None:
        plot, colours = self.getPlotItem(), colours_of(self)
        factor, unit = _screen(outcome)
        calibration = outcome.calibration
        volts = np.array([step.volts for step in calibration.steps])
        ends = np.array([volts.min(), volts.max()])
        plot.plot(ends, factor * calibration.apply(ends), pen=self.pen("modelled", 2))
        _add_points(
            plot, outcome, volts, factor * np.array(calibration.known), colours.measured, self.pen("measured")
        )
        plot.setLabel("left", f"Known value ({unit})")
        plot.setLabel("bottom", "Reading (V)")
        plot.getViewBox().autoRange(padding=0.06)


class ResidualPlot(_OutcomePlot):
    """Known value less line, against the known value; the grey band is what the data sheet allows."""

    def __init__(self) -> None:
        super().__init__("calibrationResiduals", "Known value less line, against the known value")
        self.setToolTip("Known value less line (N or °). Grey: what the data sheet allows.")

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
            pen=self.pen("floor", 1, dashed=True),
        )
        band.setZValue(-10)
        plot.addItem(band, ignoreBounds=True)
        plot.addItem(pg.InfiniteLine(0, angle=0, pen=self.pen("muted", 1)), ignoreBounds=True)
        known = across * np.array(outcome.calibration.known)
        residuals = factor * np.array(outcome.calibration.residuals)
        _add_points(plot, outcome, known, residuals, colours.residual, self.pen("residual"))
        doubtful = [one.number for one in outcome.misplaced]
        if doubtful:
            rings = {"symbol": "o", "symbolSize": 20, "symbolBrush": None}
            pen = self.pen("fault", 2)
            plot.plot(known[doubtful], residuals[doubtful], pen=None, symbolPen=pen, **rings)
        plot.setLabel("left", f"Off the line ({unit})")
        plot.setLabel("bottom", f"Known value ({known_unit})")
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
        look = {"symbol": SYMBOLS[number % 2], "symbolSize": SIZES[number % 2], "symbolPen": pen}
        plot.plot(x[chosen], y[chosen], pen=None, symbolBrush=(None, colour)[number % 2], **look)


def _screen(outcome: CalibrationOutcome, largest: float = math.inf) -> tuple[float, str]:
    """Factor and unit on the screen of values up to ``largest`` (SI)."""
    unit = outcome.sensor.unit
    if unit == "rad":
        return outcome.sensor.screen.factor, "°"
    return (1e3, f"m{unit}") if largest < SMALL_N else (1.0, unit)
