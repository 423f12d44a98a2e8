"""A plot without frame or menu that keeps quantity and unit on its axes and follows light and dark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QWidget

from fingerlab.core.text import ScreenUnit

from ..theme import colours_of, small_font
from .plot_style import bottom_axis_height, colour_plot, label_left, line, prepare_plot
from .plot_words import WordsOver

AXIS_WIDTH = 60
MARGIN = 0.08


class QuietPlot(pg.PlotWidget):
    """One plot that keeps quantity and unit on its axes and follows light and dark."""

    def __init__(self, name: str, accessible: str, parent: QWidget | None = None) -> None:
        super().__init__(parent, enableMenu=False)
        self.setObjectName(name)
        self.setAccessibleName(accessible)
        self.setAcceptDrops(False)  # a file dropped here is for the window
        self._left: tuple[str, ScreenUnit] | None = None
        plot = self.getPlotItem()
        prepare_plot(plot)
        plot.setMouseEnabled(x=False, y=False)
        plot.setContentsMargins(0, 4, 8, 0)
        plot.getAxis("left").setWidth(AXIS_WIDTH)
        plot.getAxis("bottom").setHeight(bottom_axis_height())
        plot.getViewBox().sigResized.connect(self._label)
        self._recolour_frame()

    def name_axes(self, left: str, unit: ScreenUnit, bottom: str) -> None:
        """Quantity and unit of both axes."""
        self._left = (left, unit)
        self.getPlotItem().setLabel("bottom", bottom)
        self._label()

    def redraw(self) -> None:
        """Draw again with the colours of now."""

    def _label(self) -> None:
        if self._left is not None:
            label_left(self.getPlotItem(), *self._left)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_left"):
            self._recolour_frame()
            self.redraw()

    def _recolour_frame(self) -> None:
        colours = colours_of(self)
        self.setBackground(colours.surface)
        colour_plot(self.getPlotItem(), colours)

    def pen(self, colour: str, width: float = 1.5, dashed: bool = False) -> Any:
        """A pen in one of the window's colours, by name."""
        value = getattr(colours_of(self), colour)
        return line(value, width * self.devicePixelRatioF(), dashed)

    def draw_band(
        self,
        x: np.ndarray[Any, Any],
        middle: np.ndarray[Any, Any],
        half: np.ndarray[Any, Any],
        brush: Any,
        name: str = "",
    ) -> None:
        """A shaded 90 % interval where it is known; ``name`` stands over its numbers where they are saved."""
        known = np.isfinite(half) & np.isfinite(middle)
        if not known.any():
            return
        start = f"{name}, " if name else ""
        edges = [
            plain_curve(
                x[known],
                (middle + sign * half)[known],
                pg.mkPen(None),
                f"{start}{side} end of the 90 % interval",
            )
            for sign, side in ((1, "upper"), (-1, "lower"))
        ]
        for edge in edges:
            self.getPlotItem().addItem(edge)
        self.getPlotItem().addItem(pg.FillBetweenItem(*edges, brush=brush))

    def write(self, text: str, x: float, y: float, anchor: tuple[float, float] = (0.5, 0.0)) -> None:
        """Words inside the plot."""
        item = pg.TextItem(text, color=colours_of(self).text, anchor=anchor)
        item.setFont(small_font())
        self.getPlotItem().addItem(item, ignoreBounds=True)
        item.setPos(x, y)

    def write_over(
        self, texts: Sequence[str], stretch: tuple[float, float], y: float, turns: bool = False
    ) -> None:
        """Words over a stretch, none of them cut; see :class:`WordsOver`."""
        item = WordsOver(texts, stretch, colours_of(self).text, turns)
        self.getPlotItem().addItem(item, ignoreBounds=True)
        item.setPos(sum(stretch) / 2, y)


def plain_curve(x: np.ndarray[Any, Any], y: np.ndarray[Any, Any], pen: Any, name: str) -> pg.PlotCurveItem:
    """A curve; ``name`` stands over its numbers where they are saved."""
    return pg.PlotCurveItem(x, y, pen=pen, name=name, connect="finite", antialias=True)


def span_of(values: np.ndarray[Any, Any]) -> tuple[float, float]:
    """Limits with a margin around the finite values."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    margin = MARGIN * (high - low) or abs(high) or 1.0
    return low - margin, high + margin
