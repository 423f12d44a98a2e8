"""Plots of "Wanted force": the force, and the torque that it needs with its interval and the limits."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from fingerlab.core.text import ScreenUnit
from fingerlab.prediction.inverse import TorquePlan

from ..theme import colours_of
from ..widgets.plot_style import tint
from ..widgets.quiet_plot import QuietPlot, plain_curve, span_of
from .plots import NEWTON

TORQUE = ScreenUnit("mN m", 1e3)
NEAR_LIMIT = 0.7
"""The limit is drawn, and the axis reaches to it, where the torque comes to this share of it."""


class PlanPlot(QuietPlot):
    """A plot of the torque that a wanted force needs, or of that force."""

    def __init__(self, name: str, accessible: str, parent: QWidget | None = None) -> None:
        super().__init__(name, accessible, parent)
        self.plan: TorquePlan | None = None

    def show_plan(self, plan: TorquePlan | None) -> None:
        """Another force and its torque, or none."""
        self.plan = plan
        self.redraw()


class WantedForcePlot(PlanPlot):
    """The wanted force over its time."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("wantedForcePlot", "Wanted endpoint force over its time", parent)
        self.name_axes("Wanted force", NEWTON, "Time in the profile (s)")
        self.setToolTip("F, N: force of the fingertip that the load cell is to read, compression positive.")

    def redraw(self) -> None:
        plot, plan = self.getPlotItem(), self.plan
        plot.clear()
        if plan is None:
            return
        plot.addItem(plain_curve(plan.time, plan.force, self.pen("measured"), "wanted"))
        low, high = span_of(plan.force)
        plot.setRange(xRange=(plan.time[0], plan.time[-1]), yRange=(min(low, 0.0), high), padding=0)


class TorquePlot(PlanPlot):
    """Motor torque with its 90 % interval, and the rig's limit where it is near."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("torquePlot", "Motor torque that the wanted force needs", parent)
        self.name_axes("Motor torque", TORQUE, "Time in the profile (s)")
        self.setToolTip(
            "τ, N m at the gearbox output: what the model needs for F.\n"
            "By the PIP equation τ = r·(F·lever + LHS2 − L2) / (s·b), thesis (3.18) for the tension; a "
            "model with effects is solved by the secant method.\n"
            "Shaded: 90 % interval of the force, divided by what a newton metre adds to the force."
        )

    def redraw(self) -> None:
        plot, plan = self.getPlotItem(), self.plan
        plot.clear()
        if plan is None:
            return
        torque, half = 1e3 * plan.torque, 1e3 * plan.half_width
        shown = [torque]
        self.draw_band(plan.time, torque, half, tint(colours_of(self).modelled, 0.2))
        shown += [torque + half, torque - half]
        width = 1.5 * self.devicePixelRatioF()
        plot.addItem(plain_curve(plan.time, torque, self.pen("modelled", width), "needed"))
        low, high = span_of(np.concatenate(shown))
        limit = 1e3 * plan.torque_limit
        if high > NEAR_LIMIT * limit:
            line = pg.InfiniteLine(pos=limit, angle=0, movable=False, pen=self.pen("fault", dashed=True))
            plot.addItem(line, ignoreBounds=True)
            high = max(high, 1.12 * limit)
            self.write(f"limit of the rig, {limit:.4g} mN m", float(plan.time[0]), limit, (0.0, 1.0))
        plot.setRange(xRange=(plan.time[0], plan.time[-1]), yRange=(min(low, 0.0), high), padding=0)
