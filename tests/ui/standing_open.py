"""Everything of the program that can stand open over its window or beside it, and how it is opened.

Dialogs are listed by hand (``dialogs_open.py``) with the places of the source that make them;
``test_stop_everywhere.py`` compares them with the source, so that nothing can be added there and forgotten
here. Lists and menus are found in the window itself (``everything_open.py``).
"""

from __future__ import annotations

import ast
import dataclasses
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QWidget,
)

import fingerlab.ui
from fingerlab.ui.app.stop_guard import StandIn
from fingerlab.ui.app.window import MainWindow

UI = Path(fingerlab.ui.__file__).resolve().parent
OPENING = (
    "QFileDialog",
    "QMessageBox",
    "QInputDialog",
    "QColorDialog",
    "QFontDialog",
    "QProgressDialog",
    "QErrorMessage",
    "QWizard",
    "QDialog",
    "QCompleter",
    "ResultDialog",
)
"""Qt's classes for what stands open, and our own; lists and menus are found in the window."""

WAYS = ("press", "Escape", "key")
ANOTHER_PROGRAM = """
from PySide6.QtWidgets import QApplication, QLineEdit
app = QApplication([])
field = QLineEdit()
field.setGeometry(40, 60, 200, 60)
field.show()
field.activateWindow()
app.exec()
"""


def places_in_source() -> set[str]:
    """``file:function`` of each call that makes a dialog, and ``file:class`` of each class that is one."""
    found = set()
    for path in sorted(UI.rglob("*.py")):
        name = path.relative_to(UI).as_posix()
        found |= {f"{name}:{place}" for place in _places(ast.parse(path.read_text(encoding="utf-8")), "")}
    return found


def _places(node: ast.AST, inside: str) -> Iterator[str]:
    for child in ast.iter_child_nodes(node):
        name = inside
        if isinstance(child, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            name = f"{inside}.{child.name}" if inside else child.name
        opens = isinstance(child, ast.ClassDef) and any(_opens(base) for base in child.bases)
        if opens and name not in OPENING:
            yield name
        if isinstance(child, ast.Call) and _opens(child.func):
            yield name
        yield from _places(child, name)


def _opens(expression: ast.expr) -> bool:
    return any(part in OPENING for part in ast.unparse(expression).split("."))


@dataclass(frozen=True)
class Stage:
    """A window with a rig, a session file, and a folder for what else is needed."""

    window: MainWindow
    session: Path
    folder: Path
    others: list[subprocess.Popen[bytes]] = dataclasses.field(default_factory=list)

    def tab(self, key: str) -> Any:
        """One of the tabs."""
        return self.window.tab(key)


Step = Callable[[Stage], object]


@dataclass(frozen=True)
class Surface:
    """Something that stands open.

    Attributes:
        name: in the table. steps: what opens it; after each, something more stands open, and the step may
            wait until that is shut. places: of the source, as of :func:`places_in_source`.
        page: the tab in front. ready: when it is, where not because something new stands open.
        ways: in which it can be stopped.
    """

    name: str
    steps: tuple[Step, ...] = ()
    places: tuple[str, ...] = ()
    page: str = "acquire"
    ready: Callable[[], bool] | None = None
    ways: tuple[str, ...] = WAYS


def standing(window: MainWindow) -> list[QWidget]:
    """What stands open now."""
    return [
        widget
        for widget in QApplication.topLevelWidgets()
        if widget.isVisible()
        and widget is not window
        and not isinstance(widget, StandIn)
        and widget.windowType() != Qt.WindowType.ToolTip
    ]


def shut_all(window: MainWindow) -> None:
    """Shut what stands open, the last first."""
    popup = QApplication.activePopupWidget()
    modal = QApplication.activeModalWidget()
    if popup is not None:
        popup.close()
    elif isinstance(modal, QDialog):
        modal.reject()
    else:
        for widget in standing(window):
            widget.close()
