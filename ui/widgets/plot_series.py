"""The numbers that a plot shows, with the names and units of its axes: for CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPen
from PySide6.QtWidgets import QWidget

from fingerlab.sessions.model import Array

from ..theme import Colours, colours_of
from .curve import DecimatedCurve
from .plot_style import FULL_LABEL


@dataclass(frozen=True)
class Series:
    """One curve: its name, the words of both axes with units, and its points, (n,) each."""

    name: str
    across: str
    up: str
    x: Array
    y: Array


def series_of(widget: QWidget) -> list[Series]:
    """Every curve that a plot shows, whole where the screen only draws a part; empty where it shows none."""
    from ..acquire.canvas import Canvas

    colours = colours_of(widget)
    own = getattr(widget, "numbers", None)
    if own is not None:  # a plot that is no curves, such as bars
        found = list(own())
    elif isinstance(widget, Canvas):
        label = f"{widget._label} ({widget._unit})"
        time = "Time since connecting (s)"
        found = [Series(line.role, time, label, line.x, line.y) for line in widget.lines if len(line.x)]
    elif isinstance(widget, pg.GraphicsView):
        found = _of_view(widget, colours)
    else:
        found = []
    return _told_apart(found)


def to_csv(series: list[Series]) -> str:
    """A table with a column each for what runs across and up; curves over the same points share the first.

    The first row has names and units. Columns of unequal length end in empty fields; so does a gap.
    """
    columns: list[tuple[str, Array]] = []
    last: Array | None = None
    for one in series:
        if last is None or not np.array_equal(last, one.x, equal_nan=True):
            columns.append((one.across, one.x))
            last = one.x
        columns.append((f"{one.up}: {one.name}" if one.name else one.up, one.y))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([title for title, _ in columns])
    texts = [[repr(float(v)) if np.isfinite(v) else "" for v in values] for _, values in columns]
    writer.writerows(zip_longest(*texts, fillvalue=""))
    return out.getvalue()


def _of_view(view: pg.GraphicsView, colours: Colours) -> list[Series]:
    plots = [item for item in view.scene().items() if isinstance(item, pg.PlotItem) and item.isVisible()]
    plots.sort(key=lambda plot: plot.sceneBoundingRect().top())
    across = ""
    found: list[Series] = []
    for plot in reversed(plots):  # of plots over one another the lowest names what runs across
        across = _label(plot, "bottom") or across
        found = [s for item in plot.items if (s := _of_item(item, plot, across, colours))] + found
    return found


def _of_item(item: Any, plot: pg.PlotItem, across: str, colours: Colours) -> Series | None:
    up = _label(plot, "left")
    if not isinstance(item, pg.PlotCurveItem | pg.ScatterPlotItem | pg.PlotDataItem) or not item.isVisible():
        return None
    data = item.series if isinstance(item, DecimatedCurve) else item.getData()
    if data[0] is None or not len(data[0]):
        return None
    x, y = (np.asarray(values, dtype=np.float64) for values in data)
    if not np.isfinite(y).any():
        return None
    return Series(_name(item, colours), across, up, x, y)


def _label(plot: pg.PlotItem, side: str) -> str:
    axis = plot.getAxis(side)
    return str(getattr(axis, FULL_LABEL, "") or axis.labelText or "")


def _name(item: Any, colours: Colours) -> str:
    """The curve's own name; else the meaning of its colour, which is the same in all plots."""
    own = item.name() if callable(getattr(item, "name", None)) else None
    if own:
        return str(own)
    pen = item.opts.get("pen")
    if not isinstance(pen, QPen) or pen.style() == Qt.PenStyle.NoPen:
        return ""
    for role in ("measured", "modelled", "residual", "candidate", "floor", "muted", "accent", "fault"):
        if QColor(getattr(colours, role)).rgb() == pen.color().rgb():
            return role
    return ""


def _told_apart(series: list[Series]) -> list[Series]:
    """The same with a number behind a name that comes again."""
    seen: dict[tuple[str, str], int] = {}
    result = []
    for one in series:
        count = seen[(one.up, one.name)] = seen.get((one.up, one.name), 0) + 1
        name = one.name if count == 1 else f"{one.name or 'curve'} {count}"
        result.append(Series(name, one.across, one.up, one.x, one.y))
    return result
