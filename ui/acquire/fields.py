"""Buttons and fields to enter something, and the keyboard's focus, which does not move by itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLayout,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from ..widgets.focus import set_usable

STEPS = 1000
"""Of a progress bar."""


class ActionButton(QPushButton):
    """A button that says in its tooltip what it does, or why it cannot be used now."""

    def __init__(self, text: str, name: str, help_text: str, call: Callable[[], Any]) -> None:
        super().__init__(text)
        self.setObjectName(name)
        self._help = help_text
        self._refused = ""
        self.setToolTip(help_text)
        self.clicked.connect(lambda _checked=False: call())

    def refuse(self, sentence: str) -> None:
        """Grey with a reason, or usable where the sentence is empty."""
        if sentence == self._refused:
            return
        self._refused = sentence
        set_usable(self, not sentence)
        self.setToolTip(sentence or self._help)
        self.setAccessibleDescription(sentence or self._help)


def number(
    name: str, value: float, low: float, high: float, decimals: int, step: float, help_text: str
) -> QDoubleSpinBox:
    """A number field; its unit stands in the label beside it."""
    field = QDoubleSpinBox()
    field.setObjectName(name)
    field.setRange(low, high)
    field.setDecimals(decimals)
    field.setSingleStep(step)
    field.setValue(value)
    field.setAlignment(Qt.AlignmentFlag.AlignRight)
    field.setToolTip(help_text)
    field.setAccessibleName(help_text.split(":")[0].split(".")[0])
    field.setKeyboardTracking(False)
    return field


def progress_bar(name: str, title: str) -> QProgressBar:
    """A bar in thousandths."""
    bar = QProgressBar()
    bar.setObjectName(name)
    bar.setAccessibleName(title)
    bar.setRange(0, STEPS)
    return bar


def choice(name: str, entries: dict[str, str], help_text: str) -> QComboBox:
    """A list of words, each with its key."""
    field = QComboBox()
    field.setObjectName(name)
    field.setAccessibleName(help_text.split(":")[0].split(".")[0])
    field.setToolTip(help_text)
    field.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    field.setMinimumContentsLength(8)
    for key, words in entries.items():
        field.addItem(words, key)
    return field


def row(*widgets: QWidget | QLayout) -> QHBoxLayout:
    """Side by side, equal in width."""
    layout = QHBoxLayout()
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(8)
    for widget in widgets:
        if isinstance(widget, QLayout):
            layout.addLayout(widget, 1)
        else:
            layout.addWidget(widget, 1)
    return layout


def centred_column(page: QWidget, width: int) -> QVBoxLayout:
    """A column at most so wide in the middle of an otherwise empty page, a little above its centre."""
    column = QWidget()
    column.setMaximumWidth(width)
    inner = QVBoxLayout(column)
    inner.setSpacing(16)
    across = QHBoxLayout()
    across.addStretch(1)
    across.addWidget(column, 100)  # takes all up to its widest, so that its text gets the height it needs
    across.addStretch(1)
    layout = QVBoxLayout(page)
    layout.addStretch(2)
    layout.addLayout(across)
    layout.addStretch(3)
    return inner


def across(*entries: QWidget) -> QHBoxLayout:
    """Side by side with the first as wide as its words; numbers keep their width, the rest fills the line."""
    layout = QHBoxLayout()
    layout.setSpacing(8)
    for number_, entry in enumerate(entries):
        fixed = number_ == 0 or isinstance(entry, (QAbstractSpinBox, QPushButton))
        layout.addWidget(entry, 0 if fixed else 1)
    return layout
