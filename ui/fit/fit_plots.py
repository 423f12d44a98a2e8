"""Plots of the Fit tab: joint speeds with their regions, the tension-torque plane, bars by run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pyqtgraph as pg

from fingerlab.core.text import DEGREE_A_SECOND, DEGREES, MILLI_NEWTON_METRE, ScreenUnit, r2_text
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.inspection import FitView, Plane
from fingerlab.thesis.traces import JOINT_TITLES, Joint

from ..widgets.plots import QuietPlot, span_of
from ..widgets.series import Series
from ..widgets.theme import colours_of, tint

REGION_COLOURS = {
    "flexion": "candidate",
    "static_1": "floor",
    "extension": "modelled",
    "static_2": "residual",
    "whole": "modelled",
}
"""Names in ``Colours``; the regions' names stand in the plots, too."""


class SpeedPlot(QuietPlot):
    """Speed of one joint over the average period, tinted by region, with its thresholds."""

    def __init__(self, joint: Joint) -> None:
        super().__init__(
            f"speed_{joint}", f"{JOINT_TITLES[joint]} speed over the average period, with regions"
        )
        self.joint = joint
        self.view: FitView | None = None
        self.name_axes(f"{JOINT_TITLES[joint]} speed", DEGREE_A_SECOND, "Time in the period (s)")
        self.setToolTip(
            f"dθ/dt of the {JOINT_TITLES[joint]} joint, °/s, flexion positive: mean over the run's periods.\n"
            "Dashed: the thresholds, ± a share of its range. Above is flexion, below extension, between them "
            "standstill: static 1 after flexion, static 2 after extension (thesis 4.1, 4.2)."
        )

    def show_view(self, view: FitView | None) -> None:
        """Another run, or none."""
        self.view = view
        self.redraw()

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        view = self.view
        if view is None:
            return
        if not len(view.time):
            plot.setRange(xRange=(0, 1), yRange=(-1, 1), padding=0)
            self.write("This run does not repeat: it has no regions.", 0.5, 0.0)
            return
        speed = DEGREES * view.speed[self.joint]
        low, high = span_of(speed)
        high += 0.15 * (high - low)  # room for the regions' names
        colours = colours_of(self)
        duration = float(view.time[-1] + view.time[1])
        for region, start, stop in view.spans[self.joint]:
            brush = tint(getattr(colours, REGION_COLOURS[region]), 0.18)
            band = pg.LinearRegionItem((start, stop), movable=False, brush=brush, pen=pg.mkPen(None))
            band.setZValue(-10)
            self.getPlotItem().addItem(band, ignoreBounds=True)
            self.write_over((REGION_TITLES[region],), (start, stop), high, turns=True)
        for sign in (1, -1):
            level = sign * DEGREES * view.thresholds[self.joint]
            plot.addItem(
                pg.InfiniteLine(pos=level, angle=0, movable=False, pen=self.pen("residual", 1.0, True)),
                ignoreBounds=True,
            )
        plot.addItem(pg.PlotCurveItem(view.time, speed, pen=self.pen("measured"), antialias=True))
        plot.setRange(xRange=(0, duration), yRange=(low, high), padding=0)


class PlanePlot(QuietPlot):
    """Joint torque on cable tension: samples, the run's line with its 90 % interval, the line of all runs."""

    def __init__(self) -> None:
        super().__init__("plane", "Joint torque against cable tension with the regression line")
        self.setToolTip(
            "LHS, mN m: inertia, Coriolis, gravity and spring at the joint, against T = τ/r, N: motor torque "
            "over pulley radius.\n"
            "Line: LHS = s·a·T + L1 at the MCP, s·b·T + L2 at the PIP, thesis (3.16) and (3.17); its slope "
            "is the moment arm, its value at T = 0 the friction loss. Shaded: its 90 % interval; dashed: the "
            "line of all runs."
        )
        self.joint: Joint = "pip"
        self.region = ""
        self.plane: Plane | None = None

    def show_plane(self, joint: Joint, region: str, plane: Plane | None) -> None:
        """One joint and region of a run; None where the run does not show it."""
        self.joint, self.region, self.plane = joint, region, plane
        self.redraw()

    def redraw(self) -> None:
        plot, shown = self.getPlotItem(), self.plane
        plot.clear()
        self.name_axes(f"{JOINT_TITLES[self.joint]} torque", MILLI_NEWTON_METRE, "Cable tension (N)")
        if shown is None:
            plot.setRange(xRange=(-1, 1), yRange=(-1, 1), padding=0)
            if self.region:
                self.write(f"No {REGION_TITLES[self.region]} in this run.", 0.0, 0.0)
            return
        lhs, on_line, half = 1e3 * shown.lhs, 1e3 * shown.line, 1e3 * shown.half
        colours = colours_of(self)
        points = pg.ScatterPlotItem(
            shown.tension, lhs, size=3, pen=pg.mkPen(None), brush=tint(colours.measured, 0.35), name="samples"
        )
        plot.addItem(points)
        self.draw_band(shown.x, on_line, half, tint(colours.modelled, 0.3))
        own = {"pen": self.pen("modelled", 2.0), "name": "line of this run"}
        plot.addItem(pg.PlotCurveItem(shown.x, on_line, antialias=True, **own))
        if shown.pooled is not None:
            plot.addItem(
                pg.PlotCurveItem(
                    shown.x,
                    1e3 * shown.pooled,
                    pen=self.pen("candidate", 2.0, True),
                    antialias=True,
                    name="line of all runs",
                )
            )
        (left, right), (low, high) = span_of(shown.x), span_of(np.concatenate([lhs, on_line]))
        high += 0.12 * (high - low)
        plot.setRange(xRange=(left, right), yRange=(low, high), padding=0)
        r2 = f"R² within the run = {r2_text(shown.r2)}"
        words = f"{JOINT_TITLES[self.joint]}, {REGION_TITLES[self.region]}: {r2}"
        self.write_over((words, r2), (left, right), high)
        self.setAccessibleDescription(words)


class RunBars(QuietPlot):
    """Bars side by side for each run; a missing value leaves its place empty."""

    def __init__(self, name: str, quantity: str, unit: ScreenUnit, top: float | None = None) -> None:
        super().__init__(name, f"{quantity} of each run")
        self.quantity, self.unit, self.top = quantity, unit, top
        self.names: tuple[str, ...] = ()
        self.series: Mapping[str, tuple[float, ...]] = {}
        self.name_axes(quantity, unit, "Run")

    def show_bars(self, names: Sequence[str], series: Mapping[str, tuple[float, ...]]) -> None:
        """Values in SI, one a run, by the name of the region."""
        self.names, self.series = tuple(names), series
        self.redraw()

    def shown_series(self) -> list[Series]:
        """For CSV: of each region one value a run, by the number of the run."""
        runs = np.array([float(n) if n.isdigit() else row for row, n in enumerate(self.names, 1)])
        up = self.unit.label(self.quantity)
        return [
            Series(REGION_TITLES[region], "Run", up, runs, self.unit.factor * np.array(values))
            for region, values in self.series.items()
        ]

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        if not self.names:
            return
        width = 0.8 / max(len(self.series), 1)
        at = np.arange(len(self.names), dtype=float)
        colours, everything = colours_of(self), [np.zeros(1)]
        for number, (region, values) in enumerate(self.series.items()):
            heights = self.unit.factor * np.array(values)
            good = np.isfinite(heights)
            everything.append(heights[good])
            place = at + (number - (len(self.series) - 1) / 2) * width
            brush = getattr(colours, REGION_COLOURS[region])
            plot.addItem(
                pg.BarGraphItem(
                    x=place[good],
                    height=heights[good],
                    width=0.9 * width,
                    brush=brush,
                    pen=pg.mkPen(None),
                    name=REGION_TITLES[region],
                )
            )
        together = np.concatenate(everything)
        low, high = span_of(together)
        if not together.any() and self.top is None:
            low, high = -1.0, 1.0
            found = any(len(part) for part in everything[1:])
            words = f"0 {self.unit.symbol} in every run" if found else "None found."
            self.write(words, (len(self.names) - 1) / 2, 0.0, (0.5, 1.2))
        if self.top is not None:
            low, high = 0.0, self.top
        step = max(len(self.names) // 8, 1)
        ticks = [(float(i), self.names[i].lstrip("0") or "0") for i in range(0, len(self.names), step)]
        plot.getAxis("bottom").setTicks([ticks])
        plot.setRange(xRange=(-0.6, len(self.names) - 0.4), yRange=(low, high), padding=0)
