"""All that can stand open: pages, dialogs, and menus and lists as they are found in the window."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import (
    QComboBox,
    QMenu,
    QPushButton,
    QToolButton,
    QWidget,
)

from fingerlab.ui.app.tab_registry import TABS
from fingerlab.ui.app.window import MainWindow

from .dialogs_open import DIALOGS, open_list
from .standing_open import ANOTHER_PROGRAM, Stage, Step, Surface


def _list(field: QComboBox) -> Step:
    return lambda _: open_list(field)


def _at_once() -> bool:
    return True


def _another_program(stage: Stage) -> None:
    """A window that takes the keyboard, in the corner of the screen."""
    stage.others.append(subprocess.Popen([sys.executable, "-c", ANOTHER_PROGRAM]))


def _trial_torques(stage: Stage) -> None:
    """As a force trial shows them, before it asks whether the first may be sent."""
    tab = stage.tab("acquire")
    time = np.arange(0.0, 8.0, 0.01)
    force = 0.9 + 0.5 * np.sin(np.pi * time)
    plan = SimpleNamespace(time=time, force=force, torque=0.2 * force, torque_limit=0.37)
    tab._show_torques({"nominal": plan, "found": plan})
    tab.prompt.ask("Look at the torque to come.")


def pages(window: MainWindow) -> Iterator[Surface]:
    """Every tab with nothing open; the pages of the wizard and of a force trial."""
    for entry in TABS:
        yield Surface(f"Nothing: {entry.title}", (), (), entry.key, _at_once)
    yield Surface(
        "Nothing: Calibrate, a step of the wizard",
        (lambda s: s.tab("calibrate").start("load-cell"),),
        (),
        "calibrate",
        _at_once,
    )
    yield Surface("Nothing: Acquire, a force trial's torques", (_trial_torques,), (), "acquire", _at_once)
    if QGuiApplication.platformName() == "xcb":
        yield Surface(
            "Nothing: another program in front",
            (_another_program,),
            (),
            "acquire",
            lambda: QGuiApplication.applicationState() != Qt.ApplicationState.ApplicationActive,
            ("press", "key"),
        )


def menus(window: MainWindow) -> Iterator[Surface]:
    """Every menu of the menu bar with its submenus, and every menu of a button."""
    for top in window.menuBar().actions():
        menu = top.menu()
        assert isinstance(menu, QMenu)
        name = top.text().replace("&", "")
        if not top.isVisible():
            continue
        show = _menu_of_bar(top)
        yield Surface(f"Menu {name}", (show,))
        for action in menu.actions():
            inner = action.menu()
            if isinstance(inner, QMenu):
                words = f"Menu {name} > {action.text().replace('&', '')}"
                page = window.current if menu is window.menus.tab_menu else "acquire"
                yield Surface(words, (show, _submenu(menu, action.text())), page=page)
    for button in window.findChildren(QWidget):
        if isinstance(button, (QPushButton, QToolButton)) and button.menu() is not None:
            key = tab_of(window, button)
            if not (button.objectName() or button.accessibleName()):
                continue
            yield Surface(
                f"Menu of the button {told(button)}", (lambda _, b=button: _button_menu(b),), (), key
            )


def _button_menu(button: QPushButton | QToolButton) -> None:
    menu = button.menu()
    assert isinstance(menu, QMenu)
    if menu.isEmpty():
        menu.addAction("nothing")
    menu.popup(button.mapToGlobal(button.rect().bottomLeft()))


def _menu_of_bar(top: Any) -> Step:
    return lambda s: s.window.menuBar().setActiveAction(top)


def _submenu(menu: QMenu, words: str) -> Step:
    """By its words: a tab's menu is made anew whenever the tab comes to the front."""

    def open_it(stage: Stage) -> None:
        action = next(one for one in menu.actions() if one.text() == words)
        inner = action.menu()
        assert isinstance(inner, QMenu)
        inner.popup(menu.mapToGlobal(menu.actionGeometry(action).topRight()))

    return open_it


def lists(window: MainWindow) -> Iterator[Surface]:
    """Every list of the window; an empty one gets two entries."""
    for field in window.findChildren(QComboBox):
        if field.window() is not window:
            continue
        yield Surface(f"List {told(field)}", (_list(field),), (), tab_of(window, field))


def tab_of(window: MainWindow, widget: QWidget) -> str:
    """Key of the tab that a widget is in; that of Acquire where it is in none."""
    for entry in TABS:
        if window.tab(entry.key).widget.isAncestorOf(widget):
            return entry.key
    return "acquire"


def told(widget: QWidget) -> str:
    """Its name for the table."""
    words = widget.accessibleName() or widget.objectName()
    if isinstance(widget, (QPushButton, QToolButton)):
        words = words or widget.text().replace("&", "")
    return words


def surfaces(stage: Stage) -> list[Surface]:
    """All of them."""
    for entry in TABS:
        stage.tab(entry.key)
    stage.tab("sessions").review_page  # noqa: B018 -- made at its first use
    return [
        *pages(stage.window),
        *DIALOGS,
        *menus(stage.window),
        *lists(stage.window),
    ]
