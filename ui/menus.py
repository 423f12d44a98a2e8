"""The menus: every action of the window with its key."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu

from fingerlab.identify.results import EQUATION_TITLES

from .lab.steps_column import STEPS


@dataclass(frozen=True)
class Commands:
    """What the menus call."""

    open: Callable[[], Any]
    practise: Callable[[], Any]
    reveal: Callable[[], Any]
    report: Callable[[], Any]
    close_session: Callable[[], Any]
    quit: Callable[[], Any]
    undo: Callable[[], Any]
    redo: Callable[[], Any]
    add: Callable[[], Any]
    step: Callable[[str], Any]
    equation: Callable[[str], Any]
    next_run: Callable[[], Any]
    previous_run: Callable[[], Any]
    whole_run: Callable[[], Any]
    appearance: Callable[[str], Any]
    about: Callable[[], Any]


class Menus:
    """Builds the menu bar and keeps the actions that change with what is open."""

    def __init__(self, window: QMainWindow, commands: Commands, appearance: str) -> None:
        self._window = window
        self._file(commands)
        self._edit(commands)
        self._view(commands, appearance)
        menu = window.menuBar().addMenu("&Help")
        self._action(menu, "About FingerLab", None, commands.about)
        self.update(session=False, practice=False, result=False, undo=False, redo=False)

    def _action(
        self, menu: QMenu, text: str, keys: str | QKeySequence.StandardKey | None, call: Callable[[], Any]
    ) -> QAction:
        action = menu.addAction(text)
        if keys is not None:
            action.setShortcut(QKeySequence(keys))
        action.triggered.connect(lambda _checked=False: call())
        return action

    def _file(self, commands: Commands) -> None:
        menu = self._window.menuBar().addMenu("&File")
        self._action(menu, "&Open…", QKeySequence.StandardKey.Open, commands.open)
        self.recent = menu.addMenu("Open &recent")
        menu.addSeparator()
        self._action(menu, "&Practise on a hidden effect", None, commands.practise)
        self.reveal = self._action(menu, "Re&veal the hidden effect", None, commands.reveal)
        menu.addSeparator()
        self.report = self._action(menu, "&Save report page…", QKeySequence.StandardKey.Save, commands.report)
        self.close_session = self._action(menu, "&Close session", "Ctrl+W", commands.close_session)
        menu.addSeparator()
        self._action(menu, "&Quit", "Ctrl+Q", commands.quit)

    def _edit(self, commands: Commands) -> None:
        menu = self._window.menuBar().addMenu("&Edit")
        self.undo = self._action(menu, "&Undo", "Ctrl+Z", commands.undo)
        self.redo = self._action(menu, "&Redo", "Ctrl+Shift+Z", commands.redo)
        menu.addSeparator()
        self.add = self._action(menu, "&Add the chosen effect to the model", "Ctrl+Return", commands.add)

    def _view(self, commands: Commands, appearance: str) -> None:
        menu = self._window.menuBar().addMenu("&View")
        self._in_session: list[QAction] = []
        for number, (step, (title, _)) in enumerate(STEPS.items(), start=1):
            self._in_session.append(
                self._action(menu, title, f"Ctrl+{number}", lambda s=step: commands.step(s))  # type: ignore[misc]
            )
        menu.addSeparator()
        self.equations: dict[str, QAction] = {}
        for number, (equation, title) in enumerate(EQUATION_TITLES.items(), start=1):
            action = self._action(
                menu,
                title,
                f"Alt+{number}",
                lambda e=equation: commands.equation(e),  # type: ignore[misc]
            )
            self.equations[equation] = action
        menu.addSeparator()
        for text, keys, call in (
            ("Next run", "Alt+Down", commands.next_run),
            ("Previous run", "Alt+Up", commands.previous_run),
            ("Whole run", "Alt+Home", commands.whole_run),
        ):
            self._in_session.append(self._action(menu, text, keys, call))
        menu.addSeparator()
        looks = menu.addMenu("Appearance")
        group = QActionGroup(self._window)
        for name in ("system", "light", "dark"):
            action = self._action(
                looks,
                "As the system" if name == "system" else name.capitalize(),
                None,
                lambda n=name: commands.appearance(n),  # type: ignore[misc]
            )
            action.setCheckable(True)
            action.setChecked(name == appearance)
            group.addAction(action)

    def update(
        self,
        *,
        session: bool,
        practice: bool,
        result: bool,
        undo: bool,
        redo: bool,
        equations: frozenset[str] = frozenset(),
    ) -> None:
        """Enable what makes sense now."""
        self.close_session.setEnabled(session)
        self.reveal.setEnabled(practice)
        for action in (self.report, self.add, *self._in_session):
            action.setEnabled(result)
        self.undo.setEnabled(undo)
        self.redo.setEnabled(redo)
        for equation, action in self.equations.items():
            action.setEnabled(equation in equations)
