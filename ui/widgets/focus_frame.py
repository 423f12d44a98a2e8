"""A frame about what has the keyboard, for plots, which pyqtgraph draws alike with and without."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtGui import QColor, QFocusEvent, QPainter, QPaintEvent

from .theme import colours_of

if TYPE_CHECKING:
    from pyqtgraph import GraphicsView as _View
else:
    _View = object


class FocusFrame(_View):
    """To be named before a graphics view among a class's bases."""

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self.hasFocus():
            painter = QPainter(self.viewport())
            painter.setPen(QColor(colours_of(self).accent))
            painter.drawRect(self.viewport().rect().adjusted(0, 0, -1, -1))
            painter.end()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.viewport().update()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.viewport().update()
