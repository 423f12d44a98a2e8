"""Buttons beside one another that go on in another row where room is short."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QPoint, QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QPushButton, QSizePolicy, QWidget

GAP = 8


class ButtonRows(QWidget):
    """As many rows as the width asks for, each as full as it can be."""

    def __init__(self, buttons: Sequence[QPushButton], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._buttons = tuple(buttons)
        for button in self._buttons:
            button.setParent(self)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)

    def _places(self, room: int) -> list[QPoint]:
        """Where each button begins in so much room."""
        places, x, y = [], 0, 0
        for button in self._buttons:
            size = button.sizeHint()
            if x > 0 and x + size.width() > room:
                x, y = 0, y + size.height() + GAP
            places.append(QPoint(x, y))
            x += size.width() + GAP
        return places

    def _height(self, room: int) -> int:
        tall = (place.y() + b.sizeHint().height() for place, b in self._placed(room))
        return max(tall, default=0)

    def _placed(self, room: int) -> list[tuple[QPoint, QPushButton]]:
        return list(zip(self._places(room), self._buttons, strict=True))

    def sizeHint(self) -> QSize:
        across = sum(button.sizeHint().width() + GAP for button in self._buttons) - GAP
        return QSize(max(across, 0), self._height(self.width()))

    def minimumSizeHint(self) -> QSize:
        widest = max((button.sizeHint().width() for button in self._buttons), default=0)
        return QSize(widest, self._height(self.width()))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._put()
        if event.oldSize().width() != event.size().width():
            self.updateGeometry()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() in (QEvent.Type.FontChange, QEvent.Type.StyleChange):
            self._put()
            self.updateGeometry()

    def _put(self) -> None:
        for place, button in self._placed(self.width()):
            button.move(place)
            button.resize(button.sizeHint())
