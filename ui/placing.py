"""Keeps where the window is, a moment after it was put there: a program that is killed forgets nothing."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QWidget

from .settings import Settings

SETTLED_MS = 800
"""So long after the last move: a window that is dragged would else be written with every pixel."""


class PlaceKeeper(QObject):
    """Watches one window, which owns it."""

    def __init__(self, window: QWidget, settings: Settings) -> None:
        super().__init__(window)
        self._window, self._settings = window, settings
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(SETTLED_MS)
        self._timer.timeout.connect(self.keep)
        window.installEventFilter(self)

    def keep(self) -> None:
        """Write the place down now; not of a window that nobody sees."""
        self._timer.stop()
        if self._window.isVisible():
            self._settings.save_place(self._window)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        moved = (QEvent.Type.Move, QEvent.Type.Resize, QEvent.Type.WindowStateChange)
        if event.type() in moved and self._window.isVisible():
            self._timer.start()
        return False
