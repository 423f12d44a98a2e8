"""The page of a tab that has nothing to show yet: what will be here, and the action that fills it."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QPushButton, QVBoxLayout, QWidget

MARGIN_PX = 80


def lay_out_invitation(page: QWidget, title: QLabel, text: QLabel, button: QPushButton) -> None:
    """Title, text and button at the left of the page, a little above its middle."""
    column = QVBoxLayout(page)
    column.setContentsMargins(MARGIN_PX, 0, MARGIN_PX, 0)
    column.setSpacing(16)
    column.addStretch(2)
    column.addWidget(title)
    column.addWidget(text)
    column.addWidget(button, 0, Qt.AlignmentFlag.AlignLeft)
    column.addStretch(3)
