"""The rail at the left: one button a tab, in the order of the work."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFont, QFontMetrics
from PySide6.QtWidgets import QButtonGroup, QPushButton, QVBoxLayout, QWidget

from .registry import Entry

PADDING = 28
"""Room that the style puts around a title, in pixels."""


class Rail(QWidget):
    """Signal ``chosen(key)``."""

    chosen = Signal(str)

    def __init__(self, tabs: Sequence[Entry], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("rail")
        self.setAccessibleName("Tabs")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 8, 0, 8)
        layout.setSpacing(0)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for tab in tabs:
            button = QPushButton(tab.title)
            button.setObjectName(f"tab_{tab.key}")
            button.setProperty("rail", "true")
            button.setCheckable(True)
            button.setToolTip(f"{tab.help} (Ctrl+{tab.number})")
            button.setAccessibleName(tab.title)
            button.clicked.connect(lambda _checked=False, key=tab.key: self.chosen.emit(key))
            self._group.addButton(button)
            self._buttons[tab.key] = button
            bold = QFont(button.font())
            bold.setBold(True)  # as the style draws the one in front
            button.setMinimumWidth(QFontMetrics(bold).horizontalAdvance(tab.title) + PADDING)
            layout.addWidget(button)
        layout.addStretch(1)

    def show_current(self, key: str) -> None:
        """Mark a tab as the one in front (without going there)."""
        self._buttons[key].setChecked(True)

    def take_focus(self) -> None:
        """The keyboard begins at the tab in front; Qt would begin at the topmost, and Space go there."""
        checked = self._group.checkedButton()
        if checked is not None:
            checked.setFocus()
