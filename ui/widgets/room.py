"""Room for a tab or a panel: all of it where the window is large enough, else scroll bars, no cut words."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QScrollArea, QWidget


class _Fitted(QScrollArea):
    """A scroll area without a look of its own, which fits what is in it anew whenever either changes."""

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

    def _fit(self) -> None:
        raise NotImplementedError


class Room(_Fitted):
    """Gives one widget the whole room, and more where that is less than it needs at least.

    Qt's own resizing goes by the height that wrapped words would like, not by what they need.
    """

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


class SideRoom(_Fitted):
    """Room for a side panel of fixed width, which scrolls by itself where the window is too low for it.

    What stands beside it, such as plots, stays in view meanwhile.
    """

    def __init__(self, inner: QWidget, parent: QWidget | None = None) -> None:
        super().__init__(inner, parent)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setWidgetResizable(True)
        self._fit()

    def minimumSizeHint(self) -> QSize:
        return QSize(self.minimumWidth(), 0)

    def _fit(self) -> None:
        inner = self.widget()
        if inner is not None:
            scrolls = inner.minimumSizeHint().height() > self.height()
            bar = self.verticalScrollBar().sizeHint().width() if scrolls else 0
            self.setFixedWidth(inner.minimumWidth() + bar)
