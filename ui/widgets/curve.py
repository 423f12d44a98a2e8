"""A curve that draws only what the view can show."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg

from fingerlab.sessions.model import Array

from .decimate import envelope


class DecimatedCurve(pg.PlotCurveItem):
    """Holds the whole series; draws the visible part, reduced to about one bucket a pixel."""

    def __init__(self, **options: Any) -> None:
        super().__init__(connect="finite", antialias=True, **options)
        self._x = np.empty(0)
        self._y = np.empty(0)
        self._shown: tuple[int, int, int] | None = None

    def set_series(self, x: Array, y: Array) -> None:
        """Replace the series: x increasing, shape (n,); y shape (n,), NaN where there is a gap."""
        self._x, self._y = x, y
        self._shown = None
        self.refresh()

    @property
    def series(self) -> tuple[Array, Array]:
        """The whole series, not only what is drawn."""
        return self._x, self._y

    def viewRangeChanged(self) -> None:
        super().viewRangeChanged()
        self.refresh()

    def refresh(self) -> None:
        """Draw again if the visible part or its width in pixels has changed."""
        view = self.getViewBox()
        if view is None or not len(self._x):
            if self.xData is not None and len(self.xData):
                self.setData(np.empty(0), np.empty(0))
            return
        (left, right), _ = view.viewRange()
        # One sample more on each side, so that the line runs to the edge.
        first = max(int(np.searchsorted(self._x, left)) - 1, 0)
        last = min(int(np.searchsorted(self._x, right)) + 1, len(self._x))
        buckets = max(int(view.width()), 16)
        if self._shown == (first, last, buckets):
            return
        self._shown = (first, last, buckets)
        x, y = envelope(self._x[first:last], self._y[first:last], buckets)
        self.setData(x, y)
