"""Plots of the Predict tab: force over the run, the same over one period and normalised, contact angles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor, QIcon, QKeyEvent, QPainter, QPen, QPixmap
from PySide6.QtWidgets import QWidget

from fingerlab.core.text import NEWTON, UNITLESS, fixed, r2_text
from fingerlab.prediction.comparing import RunForce
from fingerlab.sessions.model import Array

from ..widgets.plots import HELP, CursorPair, LookBox, QuietPlot, move_by_key, plain_curve, span_of
from ..widgets.theme import Colours, colours_of, tint

PATTERNS = (
    ("modelled", Qt.PenStyle.DashLine, "dashed"),
    ("candidate", Qt.PenStyle.DashDotLine, "dash-dotted"),
    ("residual", Qt.PenStyle.DotLine, "dotted"),
    ("muted", Qt.PenStyle.DashDotDotLine, "dash-dot-dotted"),
    ("floor", Qt.PenStyle.SolidLine, "solid"),
)
"""Colour and line style by turns; the measured force is the solid near-black line."""


@dataclass(frozen=True)
class ModelLine:
    """How one model is drawn. ``words`` say it without colour."""

    colour: str
    style: Qt.PenStyle
    words: str

    def pen(self, colours: Colours, width: float) -> QPen:
        """A pen whose width does not change with zoom."""
        pen: QPen = pg.mkPen(getattr(colours, self.colour), width=width, style=self.style)
        return pen


def model_line(number: int) -> ModelLine:
    """The look of the model with that number; after five they begin again."""
    return ModelLine(*PATTERNS[number % len(PATTERNS)])


def sample(one: ModelLine, colours: Colours) -> QIcon:
    """A piece of the line, for lists and tables."""
    picture = QPixmap(24, 12)
    picture.fill(QColor(0, 0, 0, 0))
    painter = QPainter(picture)
    painter.setPen(one.pen(colours, 2.0))
    painter.drawLine(0, 6, 24, 6)
    painter.end()
    return QIcon(picture)


MOST_PEAKS = 4.0
"""A force of so many measured peaks is none that a finger would press with (assumed)."""
SWEEP_WORDS_PX = 340
"""Width of a plot in which the words of all angles stand beside each other."""

ShownForces = Mapping[str, tuple[ModelLine, RunForce]]
"""What is ticked, by predictor, for the run shown."""


class ShownPlot(QuietPlot):
    """A plot of the models that are ticked."""

    def __init__(
        self, name: str, accessible: str, parent: QWidget | None = None, box: pg.ViewBox | None = None
    ) -> None:
        super().__init__(name, accessible, parent, box)
        self.shown: ShownForces = {}

    def show_forces(self, shown: ShownForces) -> None:
        """Other models or another run."""
        self.shown = shown
        self.redraw()


class ForcePlot(ShownPlot):
    """Measured and modelled force over the run, with the 90 % interval where a model has one.

    Signal ``read(wordings)``: what two cursors (C) read, the longest wording first; () for none.
    """

    read = Signal(object)
    pair: CursorPair | None = None

    def __init__(self, parent: QWidget | None = None) -> None:
        box = LookBox()
        super().__init__("forcePlot", "Measured and modelled endpoint force over the run", parent, box)
        self.setFocusPolicy(Qt.FocusPolicy.WheelFocus)
        box.whole_asked.connect(self.show_whole)
        self.pair = CursorPair((self.getPlotItem(),), self)
        self.pair.moved.connect(self._tell)
        self.pair.recolour(self)
        self.name_axes("Endpoint force", NEWTON, "Time in the run (s)")
        self.setToolTip(
            "F, N: force of the fingertip on the load cell, compression positive.\n"
            "Modelled by F = (s·b·T + L2 − LHS2) / lever, thesis (3.18), by the MCP equation, or by both.\n"
            f"{HELP}"
        )

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = event.key()
        if key == Qt.Key.Key_C:
            self.toggle_cursors()
        elif key == Qt.Key.Key_Home:
            self.show_whole()
        elif key == Qt.Key.Key_F:
            self.fit_height()
        elif not move_by_key(self.getPlotItem(), event):
            super().keyPressEvent(event)

    def toggle_cursors(self) -> None:
        """Two cursors, or none."""
        if self.pair is not None:
            self.pair.show(self.pair.times is None)

    def fit_height(self) -> None:
        """The height of what is in view."""
        left, right = self.getPlotItem().viewRange()[0]
        seen = [
            values[(force.time >= left) & (force.time <= right)]
            for _, force in self.shown.values()
            for values in (force.measured, force.modelled)
        ]
        if seen:
            self.getPlotItem().setYRange(*span_of(np.concatenate(seen)), padding=0)

    def _tell(self) -> None:
        times = self.pair.times if self.pair is not None else None
        if times is None or not self.shown:
            self.read.emit(())
            return
        first = next(iter(self.shown.values()))[1]
        apart = f"B − A: {fixed(times[1] - times[0], 3)} s"
        said = [f"measured {_less(first.time, first.measured, times)}"]
        said += [f"{name} {_less(one.time, one.modelled, times)}" for name, (_, one) in self.shown.items()]
        wordings = [[apart, *said[:many]] for many in range(len(said), 0, -1)]
        if len(said) > 2:  # the names are long; none of the models is left out before them
            less = [_less(one.time, one.modelled, times) for _, one in self.shown.values()]
            wordings.insert(1, [apart, said[0], f"models in the order of the list {less[0]}", *less[1:]])
        self.read.emit(tuple(f"{', '.join(wording)} N" for wording in wordings))

    def redraw(self) -> None:
        plot, colours = self.getPlotItem(), colours_of(self)
        plot.clear()
        if not self.shown:
            return
        everything, width = [], 1.5 * self.devicePixelRatioF()
        first = next(iter(self.shown.values()))[1]
        for name, (one, force) in self.shown.items():
            brush = tint(getattr(colours, one.colour), 0.2)
            self.draw_band(force.time, force.modelled, force.half_width, brush, name)
            everything += [force.measured, force.modelled]
        plot.addItem(plain_curve(first.time, first.measured, self.pen("measured"), "measured"))
        for name, (one, force) in self.shown.items():
            plot.addItem(plain_curve(force.time, force.modelled, one.pen(colours, width), name))
        if self.pair is not None:
            self.pair.recolour(self)
            self.pair.draw_again()
        ends = float(first.time[0]), float(first.time[-1])
        plot.setLimits(xMin=ends[0], xMax=ends[1])
        plot.setRange(xRange=ends, yRange=span_of(np.concatenate(everything)), padding=0)

    def show_whole(self) -> None:
        """The whole run after a zoom."""
        self.redraw()


def _less(time: Array, values: Array, times: tuple[float, float]) -> str:
    """B less A, in N with three decimals: a load cell tells some mN; a dash beyond the values."""
    at = np.interp(times, time, values, left=np.nan, right=np.nan)
    change = float(at[1] - at[0])
    if not np.isfinite(change):
        return "–"
    return f"{'+' if change >= 0 else ''}{fixed(change, 3)}"


class PeriodPlot(ShownPlot):
    """The average period, each force scaled to run from 0 to 1: the shape, whatever the size."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("periodPlot", "Normalised force over the average period", parent)
        self.name_axes("Normalised force", UNITLESS, "Share of the period")
        self.setToolTip(
            "(F − least F) / (greatest F − least F) of the average period, each force by itself: 0 to 1.\n"
            "What differs here is shape and delay; the size is in the plot above."
        )

    def redraw(self) -> None:
        plot, colours = self.getPlotItem(), colours_of(self)
        plot.clear()
        plot.setRange(xRange=(0, 1), yRange=(-0.06, 1.06), padding=0)
        periodic = {name: pair for name, pair in self.shown.items() if len(pair[1].phase)}
        if self.shown and not periodic:
            self.write("This run does not repeat: it has no period.", 0.5, 0.5, (0.5, 0.5))
        for number, (name, (one, force)) in enumerate(periodic.items()):
            if number == 0:
                measured = plain_curve(force.phase, force.measured_period, self.pen("measured"), "measured")
                plot.addItem(measured)
            pen = one.pen(colours, 1.5 * self.devicePixelRatioF())
            plot.addItem(plain_curve(force.phase, force.modelled_period, pen, name))


SWEEP_HELP = (
    "Angle by which the contact force leans from the load cell's axis towards the base.\n"
    "A line ends where the force would grow beyond all bounds, as its lever vanishes."
)

UNBOUNDED = "a line ends: the force has no bound"


class SweepPlot(ShownPlot):
    """Peak of the modelled force as the contact force leans, with R² at each angle (thesis figure 5.2)."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("sweepPlot", "Peak of the modelled force against the contact angle", parent)
        self.name_axes("Peak force", NEWTON, "Contact angle (°)")
        self.setToolTip(SWEEP_HELP)

    def redraw(self) -> None:
        plot, colours = self.getPlotItem(), colours_of(self)
        plot.clear()
        swept = [(name, one, force) for name, (one, force) in self.shown.items() if force.sweep]
        if not swept:
            plot.setRange(xRange=(0, 60), yRange=(0, 1), padding=0)
            if self.shown:
                self.write("Parameters that switch with the region, or a run", 30, 0.5, (0.5, 1.0))
                self.write("that does not repeat, are not swept.", 30, 0.5)
            return
        measured = swept[0][2].numbers.prediction.peak_measured
        peaks, bounded = [measured], True
        for name, one, force in swept:
            angles = np.array([step.angle_deg for step in force.sweep])
            heights = np.array([step.peak for step in force.sweep])
            # Where the force's line comes to pass through the joint, the force has no end: the curve ends.
            # Past it the force pulls; a line from push to pull would hide what lies between.
            within = (heights > 0) & (heights < MOST_PEAKS * max(measured, heights[0]))
            heights = np.where(np.logical_and.accumulate(within), heights, np.nan)
            bounded = bounded and bool(np.isfinite(heights).all())
            peaks += heights[np.isfinite(heights)].tolist()
            plot.addItem(plain_curve(angles, heights, one.pen(colours, 1.5 * self.devicePixelRatioF()), name))
        low, high = span_of(np.array(peaks))
        plot.addItem(
            pg.InfiniteLine(pos=measured, angle=0, movable=False, pen=self.pen("measured")), ignoreBounds=True
        )
        plot.setRange(xRange=(-2, 62), yRange=(min(low, 0.0), 1.1 * high), padding=0)
        if not bounded:
            self.write(UNBOUNDED, 61, min(low, 0.0), (1.0, 1.0))
        self._tell(swept)
        if len(swept) > 1:
            return  # whose numbers they are would not be seen; all are in the tooltip
        steps = swept[0][2].sweep
        # Where there is no room for all the words, the first and the last say it.
        roomy = self.getViewBox().width() > SWEEP_WORDS_PX
        for step in steps if roomy else (steps[0], steps[-1]):
            if step.peak < high:
                words = f"{fixed(step.peak, 2)} N, R² {r2_text(step.r2)}"
                anchor = (1.0, 1.0) if step.angle_deg > 0 else (0.0, 1.0)
                self.write(words, step.angle_deg, step.peak, anchor)

    def _tell(self, swept: Sequence[tuple[str, ModelLine, RunForce]]) -> None:
        """Every number in the tooltip, and for a screen reader."""
        lines = [
            f"{name}: " + "; ".join(
                f"{step.angle_deg:.0f}° {fixed(step.peak, 2)} N, R² {r2_text(step.r2)}"
                for step in force.sweep
            )
            for name, _, force in swept
        ]  # fmt: skip
        self.setToolTip("\n".join((SWEEP_HELP, *lines)))
        self.setAccessibleDescription("\n".join(lines))
