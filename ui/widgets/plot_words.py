"""Words over a stretch of a plot that are never cut: shorter, turned upwards, or left out."""

from __future__ import annotations

from collections.abc import Sequence

import pyqtgraph as pg
from PySide6.QtGui import QFontMetricsF

from ..theme import small_font

EDGE_PX = 2.0
"""Between words and the ends of their stretch."""


class WordsOver(pg.TextItem):
    """Stands in the middle of a stretch, hanging from its height, in the first wording that has room.

    Args:
        texts: wordings, the longest first. stretch: ends of the stretch, in the plot's own unit across.
        turns: where none has room across, the first stands upwards, if a line has room.
    """

    def __init__(
        self, texts: Sequence[str], stretch: tuple[float, float], colour: str, turns: bool = False
    ) -> None:
        super().__init__(texts[0], color=colour, anchor=(0.5, 0.0))
        self._texts, self._stretch, self._turns = tuple(texts), stretch, turns
        self._shown = (texts[0], 0.0)
        self.setFont(small_font())

    def viewTransformChanged(self) -> None:
        """The plot has another size or range."""
        self._fit()
        super().viewTransformChanged()

    def _fit(self) -> None:
        view = self.getViewBox()
        if view is None:
            return
        (left, right), _ = view.viewRange()
        start, stop = self._stretch
        room = (stop - start) / (right - left) * view.width() - 2 * EDGE_PX
        letters = QFontMetricsF(small_font())
        text = next((one for one in self._texts if letters.horizontalAdvance(one) <= room), "")
        upwards = not text and self._turns and letters.height() <= room + 2 * EDGE_PX
        shown = (self._texts[0], 90.0) if upwards else (text, 0.0)
        if shown == self._shown:
            return
        self._shown = shown
        self.setVisible(bool(shown[0]))
        self.setAnchor((1.0, 0.5) if upwards else (0.5, 0.0))
        self.setAngle(shown[1])
        self.setPlainText(shown[0])
