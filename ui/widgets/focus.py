"""The keyboard's focus does not move by itself.

Qt hands the focus of a widget that is disabled or hidden to the next one, where the next key presses a button
or changes a number that nobody meant. Here it stays away until the widget can be used again, or the user
takes it.
"""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QWidget

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
