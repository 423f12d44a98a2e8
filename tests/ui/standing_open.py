"""Everything of the program that can stand open over its window or beside it, and how it is opened.

What is listed by hand has the places of the source that make it; ``test_stop_everywhere.py`` compares them
with the source, so that nothing can be added there and forgotten here. Lists and menus are found in the
window itself.
"""

from __future__ import annotations

import ast
import dataclasses
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QContextMenuEvent, QCursor, QGuiApplication
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QDialog,
    QFileDialog,
    QLineEdit,
    QMenu,
    QPlainTextEdit,
    QPushButton,
    QToolButton,
    QWidget,
)

import fingerlab.ui
from fingerlab.ui import own_files
from fingerlab.ui.acquire.connect_page import ConnectPage
from fingerlab.ui.acquire.details_dialog import DetailsDialog
from fingerlab.ui.acquire.tab import ask_to_close
from fingerlab.ui.acquire.toolbar import FROM_FILE
from fingerlab.ui.browse.import_dialog import ImportDialog
from fingerlab.ui.calibrate.tab import ask_to_leave
from fingerlab.ui.lab.own_effects import OwnEffects
from fingerlab.ui.registry import TABS
from fingerlab.ui.stop_guard import StandIn
from fingerlab.ui.window import MainWindow

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
)
"""Qt's classes for what stands open; lists and menus are found in the window."""

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
        if isinstance(child, ast.ClassDef) and any(_opens(base) for base in child.bases):
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


# what is needed to open some of them


def _of(window: MainWindow, kind: type) -> Any:
    return window.findChildren(kind)[-1]


def _details(stage: Stage) -> None:
    stage.tab("acquire").panel.details.click()


def _own_effects(stage: Stage) -> None:
    stage.tab("model_lab").show_own_effects()


def _own_file(stage: Stage) -> tuple[Path, bytes]:
    path = stage.folder / "own.py"
    path.write_text("pass\n", encoding="utf-8")
    return path, path.read_bytes()


def _fit_save(stage: Stage) -> None:
    tab = stage.tab("fit")
    tab.found = tab.found or SimpleNamespace()
    tab.save()


def _save_wanted(stage: Stage) -> None:
    wanted = stage.tab("predict").wanted
    wanted.plan = SimpleNamespace(beyond=())
    wanted.ask_and_save()


def _texts(stage: Stage) -> list[Path]:
    path = stage.folder / "bench.txt"
    path.write_text("".join(f"{n / 1000} 0 0 0 0 0 0\n" for n in range(200)), encoding="utf-8")
    return [path]


def _import(stage: Stage) -> None:
    stage.tab("sessions").writer.import_texts(_texts(stage), stage.folder)


def _take_session(stage: Stage) -> None:
    dialog = QApplication.activeModalWidget()
    assert isinstance(dialog, QFileDialog)
    field = dialog.findChild(QLineEdit)
    assert isinstance(field, QLineEdit)
    field.setText(str(stage.session))
    dialog.accept()


def _own_device(stage: Stage) -> None:
    page: ConnectPage = stage.tab("acquire").connect_page
    page._browse_own()


def _first_plot(stage: Stage) -> QWidget:
    plot = stage.window.plots.current()
    assert plot is not None
    return plot


def _amplitude(stage: Stage) -> QWidget:
    field = stage.tab("acquire").panel.motion.numbers["amplitude_deg"].findChild(QLineEdit)
    assert isinstance(field, QWidget)
    return field


def _notes(stage: Stage) -> QWidget:
    notes = _of(stage.window, DetailsDialog).notes
    assert isinstance(notes, QPlainTextEdit)
    return notes.viewport()


def _log_over_stop(stage: Stage) -> None:
    stage.window.menus.log.trigger()
    dialog = standing(stage.window)[-1]
    button = stage.window.header.stop
    dialog.move(button.mapToGlobal(QPoint(-260, -100)))


def _context_menu(of: Callable[[Stage], QWidget]) -> Step:
    def open_it(stage: Stage) -> None:
        field = of(stage)
        field.setFocus()
        centre = field.rect().center()
        event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, centre, field.mapToGlobal(centre))
        QApplication.sendEvent(field, event)

    return open_it


def _list(field: QComboBox) -> Step:
    def open_it(_: Stage) -> None:
        if field.count() == 0:
            field.blockSignals(True)
            field.addItems(["one", "two"])
            field.blockSignals(False)
        field.showPopup()

    return open_it


def _menu_entry(window: MainWindow, words: str) -> QAction:
    (found,) = (a for a in window.findChildren(QAction) if a.text().replace("&", "").rstrip("…") == words)
    return found


def _about(stage: Stage) -> None:
    _menu_entry(stage.window, "About FingerLab").trigger()


DIALOGS = (
    Surface("Keys (F1)", (lambda s: _menu_entry(s.window, "Keys").trigger(),)),
    Surface("Log", (lambda s: s.window.menus.log.trigger(),), ("dialogs.py:_show",)),
    Surface("Log, moved over STOP", (_log_over_stop,)),
    Surface("About FingerLab", (_about,), ("window.py:MainWindow._about",)),
    Surface("Open session", (lambda s: s.window.ask_and_open(),), ("window.py:MainWindow.ask_and_open",)),
    Surface(
        "Save the plot",
        (lambda s: s.window.plots.ask_and_save(_first_plot(s)),),
        ("plot_menu.py:PlotMenu.ask_and_save",),
    ),
    Surface("Details of the session", (_details,), ("acquire/details_dialog.py:DetailsDialog",)),
    Surface(
        "Details > Folder for recordings",
        (_details, lambda s: _of(s.window, DetailsDialog)._choose()),
        ("acquire/details_dialog.py:DetailsDialog._choose",),
    ),
    Surface(
        "Stop and close? (Disconnect, Quit)",
        (lambda s: ask_to_close(s.tab("acquire").widget, "The amplifier is on"),),
        ("acquire/tab.py:ask_to_close",),
    ),
    Surface(
        "Model from a file",
        (lambda s: s.tab("acquire").toolbar.model_chosen.emit(FROM_FILE),),
        ("acquire/comparing.py:Comparing._on_chosen",),
    ),
    Surface(
        "Trajectory file",
        (lambda s: s.tab("acquire").panel.motion._choose_file(),),
        ("acquire/motion_form.py:MotionForm._choose_file",),
    ),
    Surface("Own device", (_own_device,), ("acquire/connect_page.py:ConnectPage._browse_own",)),
    Surface(
        "Replay a recording",
        (lambda s: s.tab("acquire").connect_page._on_replay(),),
        ("acquire/connect_page.py:ConnectPage._on_replay",),
    ),
    Surface(
        "Rig file",
        (lambda s: s.tab("acquire").connect_page._on_rig(),),
        ("acquire/connect_page.py:ConnectPage._on_rig",),
    ),
    Surface(
        "Run an own file?",
        (lambda s: own_files.ask_to_run(s.window, *_own_file(s), False, "it"),),
        ("own_files.py:ask_to_run",),
    ),
    Surface(
        "Recording of a sensor",
        (lambda s: s.tab("calibrate")._ask_for_files("load-cell"),),
        ("calibrate/tab.py:CalibrateTab._ask_for_files",),
        "calibrate",
    ),
    Surface(
        "Session to calibrate anew",
        (lambda s: s.tab("calibrate")._ask_for_session(),),
        ("calibrate/tab.py:CalibrateTab._ask_for_session",),
        "calibrate",
    ),
    Surface(
        "Session to calibrate anew > Copy as",
        (lambda s: s.tab("calibrate")._ask_for_session(), _take_session),
        (),
        "calibrate",
    ),
    Surface(
        "Leave the calibration?",
        (lambda s: ask_to_leave(s.tab("calibrate").widget),),
        ("calibrate/tab.py:ask_to_leave",),
        "calibrate",
    ),
    Surface(
        "Folder of sessions",
        (lambda s: s.tab("sessions").ask_folder(),),
        ("browse/tab.py:SessionsTab.ask_folder",),
        "sessions",
    ),
    Surface(
        "Session to lay over",
        (lambda s: s.tab("sessions").review_beside(),),
        ("browse/tab.py:SessionsTab.review_beside",),
        "sessions",
    ),
    Surface(
        "Folder for exported files",
        (lambda s: s.tab("sessions").writer.export(s.session, "csv"),),
        ("browse/writer.py:Writer.export",),
        "sessions",
    ),
    Surface(
        "Merge, cut, copy: new session",
        (lambda s: s.tab("sessions").writer.merge([s.session, s.session]),),
        ("browse/writer.py:Writer._ask_file",),
        "sessions",
    ),
    Surface(
        "Text files to import",
        (lambda s: s.tab("sessions").ask_texts(),),
        ("browse/writer.py:Writer.ask_texts",),
        "sessions",
    ),
    Surface("Import text files", (_import,), ("browse/import_dialog.py:ImportDialog",), "sessions"),
    Surface(
        "Import text files > list of phases",
        (_import, lambda s: _of(s.window, ImportDialog)._each[0][0].showPopup()),
        (),
        "sessions",
    ),
    Surface(
        "Import text files > Rig file",
        (_import, lambda s: _of(s.window, ImportDialog)._choose_rig()),
        ("browse/import_dialog.py:ImportDialog._choose_rig",),
        "sessions",
    ),
    Surface("Save model file (Fit)", (_fit_save,), ("fitting/tab.py:FitTab.save",), "fit"),
    Surface(
        "Add model files",
        (lambda s: s.tab("predict").ask_and_add(),),
        ("predicting/tab.py:PredictTab.ask_and_add",),
        "predict",
    ),
    Surface(
        "Wanted force",
        (lambda s: s.tab("predict").wanted.panel._choose_file(),),
        ("predicting/wanted_panel.py:WantedPanel._choose_file",),
        "predict",
    ),
    Surface(
        "Save trajectory", (_save_wanted,), ("predicting/wanted.py:WantedView.ask_and_save",), "predict"
    ),
    Surface(
        "Save model",
        (lambda s: s.tab("model_lab").onwards.ask_and_save(),),
        ("lab/onwards.py:Onwards.ask_and_save",),
        "model_lab",
    ),
    Surface(
        "Save report page",
        (lambda s: s.tab("model_lab").save_report(),),
        ("lab/tab.py:ModelLabTab.save_report",),
        "model_lab",
    ),
    Surface("Own effects", (_own_effects,), ("lab/own_effects.py:OwnEffects",), "model_lab"),
    Surface(
        "Own effects > Folder",
        (_own_effects, lambda s: _of(s.window, OwnEffects)._choose()),
        ("lab/own_effects.py:OwnEffects._choose",),
        "model_lab",
    ),
    Surface(
        "Own effects > Run it?",
        (
            _own_effects,
            lambda s: own_files.ask_to_run(_of(s.window, OwnEffects), *_own_file(s), True, "it"),
        ),
        (),
        "model_lab",
    ),
    Surface(
        "Menu of a plot", (lambda s: s.window.plots.open(_first_plot(s), QCursor.pos() + QPoint(40, 200)),)
    ),
    Surface("Menu of a text field", (_context_menu(lambda s: s.tab("acquire").panel.note),)),
    Surface(
        "Menu of a number field",
        (_context_menu(_amplitude),),
    ),
    Surface(
        "Menu of a text in a dialog",
        (_details, _context_menu(_notes)),
    ),
)  # fmt: skip


def _at_once() -> bool:
    return True


def _another_program(stage: Stage) -> None:
    """A window that takes the keyboard, in the corner of the screen."""
    stage.others.append(subprocess.Popen([sys.executable, "-c", ANOTHER_PROGRAM]))


def pages(window: MainWindow) -> Iterator[Surface]:
    """Every tab with nothing open; the pages of the wizard."""
    for entry in TABS:
        yield Surface(f"Nothing: {entry.title}", (), (), entry.key, _at_once)
    yield Surface(
        "Nothing: Calibrate, a step of the wizard",
        (lambda s: s.tab("calibrate").start("load-cell"),),
        (),
        "calibrate",
        _at_once,
    )
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
                yield Surface(words, (show, _submenu(menu, action)))
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


def _submenu(menu: QMenu, action: Any) -> Step:
    def open_it(stage: Stage) -> None:
        inner = action.menu()
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
