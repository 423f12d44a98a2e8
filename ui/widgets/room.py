"""Room for a tab: all of it where the window is large enough, else scroll bars instead of cut words."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QScrollArea, QWidget


class Room(QScrollArea):
    """Gives one widget the whole room, and more where that is less than it needs at least.

    Qt's own resizing goes by the height that wrapped words would like, not by what they need.
    """

    def __init__(self, inner: QWidget, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.viewport().setAutoFillBackground(False)
        self.setWidget(inner)
        inner.setAutoFillBackground(False)  # a scroll area turns it on, over the window's own colour

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        # A tab whose page changes may need more or less than before.
        if watched is self.widget() and event.type() == QEvent.Type.LayoutRequest:
            self._fit()
        return super().eventFilter(watched, event)

    def minimumSizeHint(self) -> QSize:
        return QSize(0, 0)

    def _fit(self) -> None:
        inner = self.widget()
        if inner is not None:
            needed = inner.minimumSizeHint().expandedTo(inner.minimumSize())
            room = self.maximumViewportSize()
            bar = self.verticalScrollBar().sizeHint().width()
            across = room.width() - (bar if needed.height() > room.height() else 0)
            down = room.height() - (bar if needed.width() > across else 0)
            inner.resize(QSize(across, down).expandedTo(needed))
