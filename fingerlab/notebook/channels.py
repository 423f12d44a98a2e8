"""What a run recorded, over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from fingerlab.core.text import screen_unit
from fingerlab.report.figure_style import MEASURED, label, new_figure
from fingerlab.sessions.model import Run

USUAL = ("motor_torque", "mcp_angle", "pip_angle", "endpoint_force")
"""Drawn where nobody asks for others: what the model speaks of."""
WIDTH_INCHES, ROW_INCHES, MARGIN_INCHES = 7.2, 1.3, 0.5


def channel_figure(run: Run, channels: Sequence[str] = ()) -> Figure:
    """The channels over time, one above the other, in the units of the screen (degrees, newtons).

    Args:
        channels: names as in ``run.units``; for none, those of ``USUAL`` that were read.

    Raises:
        UserError: the run has no such channel.
    """
    names = list(channels) or [name for name in USUAL if run.has(name)] or list(run.units)
    values = run.load(dict.fromkeys(("time", *names)))
    if not channels:  # a load cell that was not read holds NaN throughout
        names = [name for name in names if np.isfinite(values[name]).any()] or names
    size = (WIDTH_INCHES, MARGIN_INCHES + ROW_INCHES * len(names))
    figure, rows = new_figure(len(names), 1, size, sharex=True)
    for axes, name in zip(rows, names, strict=True):
        finite = np.abs(values[name][np.isfinite(values[name])])
        unit = screen_unit(run.units[name], float(finite.max()) if len(finite) else 0.0)
        axes.plot(values["time"], unit.factor * values[name], color=MEASURED, lw=1.0)
        axes.margins(x=0.0)
        label(axes, "", unit.label(name.replace("_", " ")))
    label(rows[-1], "time in the run (s)", rows[-1].get_ylabel())
    figure.align_ylabels()
    return figure
