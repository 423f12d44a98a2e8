"""Buttons and fields, and the keyboard's focus, which does not move by itself.

Qt hands the focus of a widget that is disabled or hidden to the next one, where the next key presses a button
or changes a number that nobody meant. Here it stays away until the widget can be used again, or the user
takes it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from PySide6.QtCore import QEvent, QPoint, Qt, Signal
from PySide6.QtGui import QColor, QPalette, QStandardItemModel, QValidator
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QButtonGroup,
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLayout,
    QMenu,
    QProgressBar,
    QPushButton,
    QToolButton,
    QToolTip,
    QVBoxLayout,
    QWidget,
    QWidgetAction,
)

from .layout import FLUSH, USUAL_LETTER, Spacer, as_written, described, hbox, vbox
from .theme import colours_of

WAITS_FOR_FOCUS = "waitsForFocus"


def set_usable(widget: QWidget, on: bool) -> None:
    """Enable or disable a widget."""
    _change(widget, widget.setEnabled, on)


def set_shown(widget: QWidget, on: bool) -> None:
    """Show or hide a widget."""
    _change(widget, widget.setVisible, on)


def _change(widget: QWidget, change: Callable[[bool], None], on: bool) -> None:
    if not on and widget.window().focusWidget() is widget:
        widget.setProperty(WAITS_FOR_FOCUS, True)
        widget.clearFocus()
    change(on)
    if on and widget.property(WAITS_FOR_FOCUS) and widget.isEnabled():
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
        self.setToolTip(as_written(sentence or self._help))
        self.setAccessibleDescription(sentence or self._help)


COMPLAINT = QEvent.Type(QEvent.registerEventType())


class Complaint(QEvent):
    """To a field's window: what is wrong with what was typed, and what was before; empty for nothing."""

    def __init__(self, sentence: str, before: str) -> None:
        super().__init__(COMPLAINT)
        self.sentence, self.before = sentence, before


class NumberField(QDoubleSpinBox):
    """Keeps what was typed, right or wrong, and says what is wrong; its value then stays the last right one.

    Qt's own drops keys that would lead out of the range: who types 170 where 120 is the most has 17 there.
    Comma and point both stand before the decimals.

    Attributes:
        complaint: what is wrong with what stands there, one sentence; empty where nothing is.

    Signal ``complained(sentence)``.
    """

    complained = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        self._kept: str | None = None
        self.complaint = self._help = self._special = ""
        super().__init__(parent)
        self.setKeyboardTracking(False)
        self.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.lineEdit().textEdited.connect(self._on_typed)

    def setValue(self, value: float) -> None:
        self._forget()
        super().setValue(value)

    def stepBy(self, steps: int) -> None:
        self._forget()
        super().stepBy(steps)

    def validate(self, text: str, position: int) -> tuple[QValidator.State, str, int]:
        right = QValidator.State.Intermediate if self._fault(text) else QValidator.State.Acceptable
        return right, text, position

    def fixup(self, text: str) -> str:
        self._keep(text, self._fault(text))
        return text

    def valueFromText(self, text: str) -> float:
        if text == self.specialValueText():
            return self.minimum()
        return float(_plain(self._bare(text)))

    def textFromValue(self, value: float) -> str:
        return super().textFromValue(value) if self._kept is None else self._kept

    def complain(self, sentence: str) -> None:
        """What stands there is wrong for a reason that lies beside it; empty where it is not."""
        if sentence:
            self._keep(self.text(), sentence)
        else:
            self._forget()

    def _bare(self, text: str) -> str:
        return text.removeprefix(self.prefix()).removesuffix(self.suffix()).strip()

    def _fault(self, text: str) -> str:
        """What is wrong with a text, or nothing."""
        if text and text == (self._special or self.specialValueText()):
            return ""
        name, bare = self.accessibleName() or "This number", self._bare(text)
        right = f"give a number from {self.minimum():g} to {self.maximum():g}."
        if not bare:
            return f"{name}: nothing stands there; {right}"
        try:
            value = float(_plain(bare))
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            return f"{name}: {bare!r} is no number; {right}"
        if not self.minimum() <= value <= self.maximum():
            return f"{name}: {bare} is {'less' if value < self.minimum() else 'more'} than it takes; {right}"
        if abs(value - round(value, self.decimals())) > 1e-9 * max(abs(value), 1.0):
            digits = f"at most {self.decimals()} decimal{'s' * (self.decimals() != 1)}"
            wanted = f"a number with {digits}" if self.decimals() else "a whole number"
            return f"{name}: {bare} is finer than it takes; give {wanted}."
        return ""

    def _keep(self, text: str, sentence: str) -> None:
        self._kept = self._bare(text)
        if self.specialValueText():  # Qt would show it in place of what was typed
            self._special = self.specialValueText()
            self.setSpecialValueText("")
        palette = QPalette()
        for role in (QPalette.ColorRole.Text, QPalette.ColorRole.Window):  # the style's outline, too
            palette.setColor(role, QColor(colours_of(self).stop))
        self.setPalette(palette)
        self._say(sentence)

    def _forget(self) -> None:
        if self._kept is None and not self.complaint:
            return
        self._kept = None
        if self._special:
            self.setSpecialValueText(self._special)
            self._special = ""
        self.setPalette(QPalette())
        self._say("")

    def _say(self, sentence: str) -> None:
        before, self.complaint = self.complaint, sentence
        if sentence == before:
            return
        if not before:
            self._help = self.toolTip()
        self.setToolTip(as_written(sentence or self._help))
        self.setAccessibleDescription(sentence)
        self.complained.emit(sentence)
        heard = QApplication.sendEvent(self.window(), Complaint(sentence, before))
        if sentence and not heard and self.isVisible():  # a dialog, which has no place for messages
            QToolTip.showText(self.mapToGlobal(QPoint(0, self.height())), as_written(sentence), self)

    def _on_typed(self, text: str) -> None:
        if self.complaint and not self._fault(text):
            self._forget()  # what stands there is taken once the field is left
            self.lineEdit().setText(text)


class WholeField(NumberField):
    """A number field for whole numbers."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setDecimals(0)

    def value(self) -> int:
        return round(super().value())


def _plain(text: str) -> str:
    return text.replace(",", ".").replace("−", "-")


def complaint_of(fields: Sequence[QWidget]) -> str:
    """The first complaint of number fields that can be seen and changed; empty for none."""
    numbers = (one for one in fields if isinstance(one, NumberField) and one.isEnabled())
    return next((one.complaint for one in numbers if one.complaint and not one.isHidden()), "")


def take_typed(fields: Sequence[QWidget]) -> str:
    """Take what stands in number fields, one that is being typed into included; the first complaint."""
    for one in fields:
        if isinstance(one, NumberField):
            one.interpretText()
    return complaint_of(fields)


def number(
    name: str, value: float, low: float, high: float, decimals: int, step: float, help_text: str
) -> NumberField:
    """A number field; its unit stands in the label beside it."""
    field = described(NumberField(), name)
    field.setRange(low, high)
    field.setDecimals(decimals)
    field.setSingleStep(step)
    field.setValue(value)
    field.setToolTip(help_text)
    field.setAccessibleName(help_text.split(":")[0].split(".")[0])
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


def refuse_entries(field: QComboBox, reasons: Mapping[str, str]) -> None:
    """Grey out entries of a list by their keys, each with the reason why it cannot be chosen now.

    All other entries can be; the reason stands at the entry when the mouse rests on it.
    """
    model = field.model()
    assert isinstance(model, QStandardItemModel)
    for number_ in range(field.count()):
        reason, item = reasons.get(str(field.itemData(number_)), ""), model.item(number_)
        if item.isEnabled() == bool(reason):
            item.setEnabled(not reason)
        if (item.toolTip() or "") != reason:
            item.setToolTip(reason)


def form_menu(button: QPushButton | QToolButton, form: QWidget) -> QMenu:
    """A form that opens below a button, as its menu."""
    menu = QMenu(button)
    action = QWidgetAction(menu)
    action.setDefaultWidget(form)
    menu.addAction(action)
    button.setMenu(menu)
    return menu


def row(*widgets: QWidget | QLayout) -> QHBoxLayout:
    """Side by side, equal in width."""
    return hbox(None, *((widget, 1) for widget in widgets), margins=FLUSH, spacing=8)


def centred_column(page: QWidget, width: int) -> QVBoxLayout:
    """A column at most so wide in the middle of an otherwise empty page, a little above its centre."""
    larger = page.fontMetrics().averageCharWidth() / USUAL_LETTER  # where letters are
    column = QWidget(maximumWidth=round(width * max(larger, 1.0)))
    inner = vbox(column, spacing=16)
    # The column takes all up to its widest, so that its text gets the height it needs.
    vbox(page, Spacer(2), hbox(None, Spacer(1), (column, 100), Spacer(1)), Spacer(3))
    return inner


def across(*entries: QWidget) -> QHBoxLayout:
    """Side by side with the first as wide as its words; numbers keep their width, the rest fills the line."""
    layout = hbox(None, spacing=8)
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
