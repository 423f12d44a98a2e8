"""Escape stops the motor wherever the keyboard is: in a field, a menu, a dialog, another tab."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent


class StopKey(QObject):
    """Sees every key of the application while it is armed. The key goes on to where it was meant for, too.

    A shortcut would not do: it is not delivered while a menu, a list or a dialog is open.
    """

    def __init__(self, stop: Callable[[], None], parent: QObject) -> None:
        super().__init__(parent)
        self._stop = stop
        self._armed = False

    def arm(self, on: bool) -> None:
        """Look at keys, or leave them alone."""
        app = QCoreApplication.instance()
        if on == self._armed or app is None:
            return
        self._armed = on
        # The system's own file dialogs would keep Escape to themselves.
        QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs, on)
        if on:
            app.installEventFilter(self)
        else:
            app.removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if (
            isinstance(event, QKeyEvent)  # first: the type of each event of the application takes longer
            and event.type() == QEvent.Type.KeyPress
            and event.key() == Qt.Key.Key_Escape
            and not event.isAutoRepeat()
        ):
            self._stop()
        return False
