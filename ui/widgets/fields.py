"""Buttons and fields, and the keyboard's focus, which does not move by itself.

Qt hands the focus of a widget that is disabled or hidden to the next one, where the next key presses a button
or changes a number that nobody meant. Here it stays away until the widget can be used again, or the user
takes it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QButtonGroup,
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLayout,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from .layout import FLUSH, Spacer, described, hbox, vbox

WAITS_FOR_FOCUS = "waitsForFocus"


def set_usable(widget: QWidget, on: bool) -> None:
    """Enable or disable a widget."""
    _change(widget, widget.setEnabled, on)


def set_shown(widget: QWidget, on: bool) -> None:
    """Show or hide a widget."""
    _change(widget, widget.setVisible, on)


def _change(widget: QWidget, change: Callable[[bool], None], on: bool) -> None:
    if not on:
        _let_go(widget)
    change(on)
    if on:
        _take_back(widget)


def _let_go(widget: QWidget) -> None:
    if widget.window().focusWidget() is widget:
        widget.setProperty(WAITS_FOR_FOCUS, True)
        widget.clearFocus()


def _take_back(widget: QWidget) -> None:
    if widget.property(WAITS_FOR_FOCUS) and widget.isEnabled():
        widget.setProperty(WAITS_FOR_FOCUS, None)
        if widget.window().focusWidget() is None:
            widget.setFocus()


PROGRESS_STEPS = 1000
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
    bar = described(QProgressBar(), name, accessible=title)
    bar.setRange(0, PROGRESS_STEPS)
    return bar


def choice(name: str, entries: dict[str, str], help_text: str) -> QComboBox:
    """A list of words, each with its key."""
    field = described(QComboBox(), name, accessible=help_text.split(":")[0].split(".")[0], tip=help_text)
    field.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    field.setMinimumContentsLength(8)
    for key, words in entries.items():
        field.addItem(words, key)
    return field


def row(*widgets: QWidget | QLayout) -> QHBoxLayout:
    """Side by side, equal in width."""
    layout = hbox(None, margins=FLUSH, spacing=8)
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
    vbox(page, Spacer(2), across, Spacer(3))
    return inner


def across(*entries: QWidget) -> QHBoxLayout:
    """Side by side with the first as wide as its words; numbers keep their width, the rest fills the line."""
    layout = QHBoxLayout()
    layout.setSpacing(8)
    for number_, entry in enumerate(entries):
        fixed = number_ == 0 or isinstance(entry, (QAbstractSpinBox, QPushButton))
        layout.addWidget(entry, 0 if fixed else 1)
    return layout


class ViewChoice(QWidget):
    """Signal ``chosen(key)``.

    Args:
        views: key, words on the button and help of each.
    """

    chosen = Signal(str)

    def __init__(self, views: Sequence[tuple[str, str, str]], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("View")
        row = hbox(self, margins=FLUSH, spacing=4)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for key, words, explained in views:
            button = described(QPushButton(words), f"view_{key}", tip=explained)
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
