"""Two or more views of one tab, one button each, side by side."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QPushButton, QWidget


class ViewChoice(QWidget):
    """Signal ``chosen(key)``.

    Args:
        views: key, words on the button and help of each.
    """

    chosen = Signal(str)

    def __init__(self, views: Sequence[tuple[str, str, str]], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("View")
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(4)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for key, words, explained in views:
            button = QPushButton(words)
            button.setToolTip(explained)
            button.setObjectName(f"view_{key}")
            button.setCheckable(True)
            button.setProperty("view", "true")
            button.clicked.connect(lambda _checked=False, k=key: self.chosen.emit(k))
            self._group.addButton(button)
            self._buttons[key] = button
            row.addWidget(button, 1)
        self.current_button().setChecked(True)

    def current_button(self) -> QPushButton:
        """The pressed one; the first before any was."""
        pressed = self._group.checkedButton()
        return pressed if isinstance(pressed, QPushButton) else next(iter(self._buttons.values()))

    @property
    def current(self) -> str:
        """Key of the view that is chosen."""
        button = self.current_button()
        return next(key for key, one in self._buttons.items() if one is button)

    def choose(self, key: str) -> None:
        """Choose a view as a click does."""
        self._buttons[key].click()
