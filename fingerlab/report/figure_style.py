"""How every figure looks: colours that hold for colour-blind eyes, one type family, quiet axes.

Figures are made with the object API and never registered with pyplot, so that they can be drawn from any
thread, with or without a display.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

MEASURED = "#1a1a1a"
MODELLED = "#0072B2"
RESIDUAL = "#E69F00"
CANDIDATE = "#009E73"
FLOOR = "#bdbdbd"
SECOND = "#CC79A7"
THIRD = "#56B4E9"
"""Okabe and Ito's palette; the first five are reserved as their names say where they meet in one plot."""

JOINT_COLOURS = {"mcp": MODELLED, "pip": RESIDUAL}
"""As in thesis figure 4.3: MCP blue, PIP orange."""

REGION_SHADES = {"flexion": "#cfe9df", "static_1": "#f2f2f2", "extension": "#dbe9f5", "static_2": "#e2e2e2"}

SIZE_INCHES = (7.2, 4.2)
DPI = 150
TITLE_SIZE, LABEL_SIZE, TICK_SIZE = 10.5, 9.0, 8.0


def new_figure(
    rows: int = 1, columns: int = 1, size: tuple[float, float] = SIZE_INCHES, **options: Any
) -> tuple[Figure, list[Axes]]:
    """A figure and its axes, row by row; ``options`` go to ``Figure.subplots``."""
    figure = Figure(figsize=size, dpi=DPI, layout="constrained", facecolor="white")
    axes = np.atleast_1d(figure.subplots(rows, columns, **options)).ravel().tolist()
    for one in axes:
        _quiet(one)
    return figure, axes


def _quiet(axes: Axes) -> None:
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(labelsize=TICK_SIZE)
    axes.xaxis.set_major_locator(MaxNLocator(7))
    axes.yaxis.set_major_locator(MaxNLocator(6))


def label(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Quantity and unit on both axes, and a title."""
    axes.set_xlabel(x, fontsize=LABEL_SIZE)
    axes.set_ylabel(y, fontsize=LABEL_SIZE)
    if title:
        axes.set_title(title, fontsize=TITLE_SIZE, loc="left")


def legend(axes: Axes, **options: Any) -> None:
    """A legend without a frame, where there is something to name."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=TICK_SIZE, frameon=False, **options)


def legend_below(figure: Figure, handles: Mapping[str, Any]) -> None:
    """One legend for the whole figure, under it."""
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower center",
        ncols=max(len(handles), 1),
        fontsize=TICK_SIZE,
        frameon=False,
    )
