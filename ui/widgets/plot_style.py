"""One look for all plots."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPen

from fingerlab.core.text import ScreenUnit

from ..theme import Colours, small_font

if TYPE_CHECKING:
    import pyqtgraph as pg

FULL_LABEL = "full_label"
"""Attribute of an axis with its whole label, which a low plot shortens."""


def prepare_plot(plot: pg.PlotItem) -> None:
    """Once for each plot: no auto-ranging, readable ticks."""
    from .number_axis import NumberAxis  # with pyqtgraph, which is imported where plots are

    plot.setAxisItems({name: NumberAxis(name) for name in ("left", "bottom")})
    plot.hideButtons()
    plot.getViewBox().disableAutoRange()
    for name in ("left", "bottom"):
        axis = plot.getAxis(name)
        axis.enableAutoSIPrefix(False)  # the label carries the unit that we chose
        axis.setStyle(tickFont=small_font(), tickTextOffset=4)
        axis.label.setFont(small_font())
    plot.getAxis("bottom").setTickDensity(0.7)
    plot.showGrid(x=True, y=True, alpha=0.12)


def colour_plot(plot: pg.PlotItem, colours: Colours) -> None:
    """Axis colours for light or dark."""
    for name in ("left", "bottom"):
        axis = plot.getAxis(name)
        axis.setPen(QColor(colours.muted))
        axis.setTextPen(QColor(colours.text))


def label_left(plot: pg.PlotItem, quantity: str, unit: ScreenUnit) -> None:
    """Quantity and unit along the left axis; the unit alone where the plot is too low for both."""
    text = unit.label(quantity)
    setattr(plot.getAxis("left"), FULL_LABEL, text)
    metrics = QFontMetricsF(small_font())
    if metrics.horizontalAdvance(text) > 1.05 * plot.getViewBox().height() and unit.symbol:
        text = unit.symbol
    if plot.getAxis("left").labelText != text:
        plot.setLabel("left", text)
        plot.getAxis("left").resizeEvent()  # puts a label of another length in the middle again


def bottom_axis_height() -> int:
    """Room for ticks and label of a time axis; pyqtgraph's own guess leaves a gap."""
    return round(2.6 * QFontMetricsF(small_font()).height())


def line(colour: str, width: float = 1.0, dashed: bool = False) -> QPen:
    """A pen whose width (device pixels) does not change with zoom."""
    style = Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine
    pen = QPen(QColor(colour), width, style)
    pen.setCosmetic(True)
    return pen


def tint(colour: str, alpha: float) -> QColor:
    """A see-through colour for bands."""
    result = QColor(colour)
    result.setAlphaF(alpha)
    return result
