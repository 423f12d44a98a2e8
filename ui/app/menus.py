"""The menus: what the window does, and a menu for what the tab in front does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu

from .plot_menu import COPY_KEYS, SAVE_KEYS
from .stop_key import STOP_KEYS
from .tab_registry import Command, Tab, TabEntry


@dataclass(frozen=True)
class WindowCommands:
    """What the menus of the window itself call."""

    open: Callable[[], Any]
    close_session: Callable[[], Any]
    quit: Callable[[], Any]
    undo: Callable[[], Any]
    redo: Callable[[], Any]
    tab: Callable[[str], Any]
    copy_plot: Callable[[], Any]
    save_plot: Callable[[], Any]
    appearance: Callable[[str], Any]
    stop_key: Callable[[str], Any]
    documents: Callable[[], Any]
    glossary: Callable[[], Any]
    whats_this: Callable[[], Any]
    shortcuts: Callable[[], Any]
    log: Callable[[], Any]
    about: Callable[[], Any]


@dataclass(frozen=True)
class MenuChoices:
    """What is chosen at the start of that of which the menus offer one of several."""

    appearance: str
    stop_key: str


TAKEN = "FEVH"
"""Letters of the window's own menus."""


def with_mnemonic(title: str) -> str:
    """A menu's title with the first letter marked that no menu of the window has."""
    place = next((k for k, letter in enumerate(title) if letter.upper() not in f"{TAKEN} "), 0)
    return f"{title[:place]}&{title[place:]}"


class Menus:
    """Builds the menu bar, and anew the menu of the tab in front."""

    def __init__(
        self, window: QMainWindow, commands: WindowCommands, tabs: Sequence[TabEntry], chosen: MenuChoices
    ) -> None:
        self._window = window
        self._entries: list[tuple[QAction, Command]] = []
        self._file(commands)
        self._edit(commands, chosen)
        self._view(commands, tabs, chosen)
        self.tab_menu = window.menuBar().addMenu("&Tab")
        menu = window.menuBar().addMenu("&Help")
        self._action(menu, "&Documents…", None, commands.documents)
        self._action(menu, "&Glossary…", None, commands.glossary)
        self._action(menu, "&What is this?", "Shift+F1", commands.whats_this)
        menu.addSeparator()
        self._action(menu, "&Keys…", "F1", commands.shortcuts)
        self.log = self._action(menu, "&Log…", None, commands.log)
        menu.addSeparator()
        self._action(menu, "&About FingerLab", None, commands.about)

    def _action(
        self, menu: QMenu, text: str, keys: str | QKeySequence.StandardKey | None, call: Callable[[], Any]
    ) -> QAction:
        action = menu.addAction(text)
        if keys is not None:
            action.setShortcut(QKeySequence(keys))
        action.triggered.connect(lambda _checked=False: call())
        return action

    def _file(self, commands: WindowCommands) -> None:
        menu = self._window.menuBar().addMenu("&File")
        self._action(menu, "&Open…", QKeySequence.StandardKey.Open, commands.open)
        self.recent = menu.addMenu("Open &recent")
        self.close_session = self._action(menu, "&Close session", "Ctrl+W", commands.close_session)
        menu.addSeparator()
        self._action(menu, "&Quit", "Ctrl+Q", commands.quit)

    def _edit(self, commands: WindowCommands, chosen: MenuChoices) -> None:
        menu = self._window.menuBar().addMenu("&Edit")
        self.undo = self._action(menu, "&Undo", "Ctrl+Z", commands.undo)
        self.redo = self._action(menu, "&Redo", "Ctrl+Shift+Z", commands.redo)
        menu.addSeparator()
        words = {name: name for name in STOP_KEYS}
        self._one_of(menu.addMenu("&Stop key"), words, chosen.stop_key, commands.stop_key)

    def _one_of(self, menu: QMenu, words: dict[str, str], now: str, choose: Callable[[str], Any]) -> None:
        """Entries of which one is chosen."""
        group = QActionGroup(menu)
        for key, text in words.items():
            action = self._action(menu, text, None, lambda key=key: choose(key))  # type: ignore[misc]
            action.setCheckable(True)
            action.setChecked(key == now)
            group.addAction(action)

    def _view(self, commands: WindowCommands, tabs: Sequence[TabEntry], chosen: MenuChoices) -> None:
        menu = self._window.menuBar().addMenu("&View")
        for tab in tabs:
            self._action(menu, tab.title, f"Ctrl+{tab.number}", lambda key=tab.key: commands.tab(key))  # type: ignore[misc]
        menu.addSeparator()
        self._action(menu, "&Copy plot", COPY_KEYS, commands.copy_plot)
        self._action(menu, "&Save plot…", SAVE_KEYS, commands.save_plot)
        menu.addSeparator()
        looks = {"system": "As the system", "light": "Light", "dark": "Dark"}
        self._one_of(menu.addMenu("&Appearance"), looks, chosen.appearance, commands.appearance)

    def show_tab(self, title: str, tab: Tab) -> None:
        """Make the menu of the tab in front; the keys of the others do nothing now."""
        self.tab_menu.clear()
        self.tab_menu.setTitle(with_mnemonic(title))
        self._entries = []
        for command in tab.commands:
            if not command.text:
                self.tab_menu.addSeparator()
                continue
            action = self._action(self.tab_menu, command.text, command.keys, command.call)
            action.setCheckable(command.checked is not None)
            self._entries.append((action, command))
        self.tab_menu.menuAction().setVisible(bool(self._entries))
        self.update(tab, sessions=self.close_session.isEnabled())

    def update(self, tab: Tab, *, sessions: bool) -> None:
        """Enable what makes sense now."""
        self.close_session.setEnabled(sessions)
        self.undo.setEnabled(tab.can_undo)
        self.redo.setEnabled(tab.can_redo)
        for action, command in self._entries:
            action.setEnabled(command.enabled())
            if command.checked is not None:
                action.setChecked(command.checked())

    def keys(self, others: Sequence[tuple[str, Tab]] = ()) -> list[tuple[str, list[tuple[str, str]]]]:
        """For the sheet of keys: title of a menu, and words and key of each of its entries.

        Args:
            others: title and tab of those that are not in front.
        """
        sheet = []
        for top in self._window.menuBar().actions():
            menu = top.menu()
            if isinstance(menu, QMenu) and top.isVisible():
                found = [
                    (action.text().replace("&", "").rstrip("…"), action.shortcut().toString())
                    for action in menu.actions()
                    if not action.shortcut().isEmpty()
                ]
                if found:
                    sheet.append((top.text().replace("&", ""), found))
        for title, tab in others:
            found = [
                (command.text.replace("&", "").rstrip("…"), QKeySequence(command.keys).toString())
                for command in tab.commands
                if command.keys is not None
            ]
            if found:
                sheet.append((title, found))
        return sheet
