"""An axis whose negative numbers have a minus sign, as everywhere else on the screen, and not a hyphen."""

from __future__ import annotations

from collections.abc import Sequence

import pyqtgraph as pg

from fingerlab.core.text import with_minus


class NumberAxis(pg.AxisItem):
    """As pyqtgraph's own but for the sign."""

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[str]:
        return [with_minus(text) for text in super().tickStrings(list(values), scale, spacing)]
