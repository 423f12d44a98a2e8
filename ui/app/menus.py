"""The menus: what the window does, what the tab in front does, and any plot copied or saved.

A context menu that no widget wants goes up to the window: here every plot of every tab has its own, and no
tab need know of it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, QPoint, Qt
from PySide6.QtGui import QAction, QActionGroup, QContextMenuEvent, QGuiApplication, QImage, QKeySequence
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QLineEdit,
    QMainWindow,
    QMenu,
    QWidget,
)

from fingerlab.core.errors import UserError

from ..widgets.fields import choice, number
from ..widgets.layout import described, vbox
from ..widgets.series import ShowsSeries
from .context import ApplicationContext, Settings
from .stop_key import STOP_KEYS
from .tab_registry import Command, Tab, TabEntry

if TYPE_CHECKING:
    from ..widgets.plot_figure import Paper

# What draws and writes plots is imported late: without it the window opens sooner.
ENDINGS = {".png": "Picture", ".svg": "Vector picture", ".pdf": "Vector picture", ".csv": "Numbers"}
FORMATS = ";;".join(f"{words} (*{ending})" for ending, words in ENDINGS.items())
COPY_KEYS, SAVE_KEYS = "Ctrl+Shift+C", "Ctrl+Shift+S"


class PlotMenu(QObject):
    """Belongs to one window; plots of others are left alone.

    Args:
        source: says what a plot is of, such as session, model and run.
    """

    def __init__(
        self, window: QWidget, context: ApplicationContext, source: Callable[[QWidget], str]
    ) -> None:
        super().__init__(window)
        self._window, self._context, self._source = window, context, source
        self.menu: QMenu | None = None
        self.dialog: SavePlotDialog | None = None

    def offer(self, event: QContextMenuEvent) -> bool:
        """The menu of the plot under the mouse, or of that with the keyboard; False where there is none."""
        by_key = event.reason() == QContextMenuEvent.Reason.Keyboard
        plot = plot_at(QApplication.focusWidget() if by_key else self._window.childAt(event.pos()))
        if plot is None or plot.window() is not self._window:
            return False
        self.open(plot, plot.mapToGlobal(plot.rect().center()) if by_key else event.globalPos())
        return True

    def open(self, plot: QWidget, place: QPoint) -> None:
        """The plot's menu at a place on the screen."""
        from ..widgets.plot_figure import series_of

        menu = self.menu = QMenu(self._window)
        menu.setObjectName("plotMenu")
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("&Copy as a picture", lambda: self.copy_picture(plot))
        menu.addAction("Copy &numbers (CSV)", lambda: self.copy_numbers(plot)).setEnabled(
            bool(series_of(plot))
        )
        menu.addSeparator()
        menu.addAction("&Save as PNG, SVG, PDF or CSV…", lambda: self.ask_and_save(plot))
        menu.popup(place)

    # what the View menu asks

    def copy_current(self) -> None:
        """Copy the plot that has the keyboard, or the first of the tab."""
        plot = self.current()
        if plot is not None:
            self.copy_picture(plot)

    def save_current(self) -> None:
        """Save the plot that has the keyboard, or the first of the tab."""
        plot = self.current()
        if plot is not None:
            self.ask_and_save(plot)

    def current(self) -> QWidget | None:
        """The plot that has the keyboard; else the topmost of the tab in front."""
        focus = plot_at(QApplication.focusWidget())
        if focus is not None and focus.window() is self._window:
            return focus
        seen = [w for w in self._window.findChildren(QWidget) if is_plot(w) and w.isVisible()]
        if not seen:
            self._context.tell("No plot is shown in this tab.")
            return None
        return min(seen, key=lambda w: (w.mapTo(self._window, w.rect().topLeft()).y(), w.x()))

    # what is done

    def copy_picture(self, plot: QWidget) -> None:
        """The picture to the clipboard."""
        from ..widgets.plot_figure import picture

        shown = picture(plot, "png", self._paper(plot))
        QGuiApplication.clipboard().setImage(QImage.fromData(shown))
        self._context.say(f"Copied as a picture: {_words(plot)}")

    def copy_numbers(self, plot: QWidget) -> None:
        """The numbers to the clipboard, as CSV."""
        from ..widgets.plot_figure import series_of, to_csv

        QGuiApplication.clipboard().setText(to_csv(series_of(plot)))
        self._context.say(f"Copied as numbers: {_words(plot)}")

    def ask_and_save(self, plot: QWidget) -> None:
        """Ask how large and how fine, then where; the ending says in which format."""
        self.dialog = SavePlotDialog(self._window, self._paper(plot), self._context.settings)
        self.dialog.accepted.connect(lambda dialog=self.dialog: self.save_as(plot, dialog.paper))
        self.dialog.open()

    def _paper(self, plot: QWidget) -> Paper:
        """As it is on the screen, under a title that tells of which session, model and runs it is."""
        from ..widgets.plot_figure import paper_of

        return paper_of(plot, self._source(plot))

    def save_as(self, plot: QWidget, paper: Paper) -> None:
        """Ask where, and write the plot on ``paper``."""
        from ..widgets.plot_figure import save_plot

        proposed = Path(self._context.settings.folder()) / f"{self._name_for(plot, paper.title)}.png"
        name, chosen = QFileDialog.getSaveFileName(self._window, "Save the plot", str(proposed), FORMATS)
        if not name:
            return
        path = Path(name)
        if not path.suffix and "*" in chosen:
            path = path.with_suffix(chosen.partition("*")[2].rstrip(")"))
        try:
            save_plot(plot, path, paper)
        except UserError as error:
            self._context.tell(str(error))
            return
        self._context.announce(f"Plot saved: {path}", path)

    def _name_for(self, plot: QWidget, title: str) -> str:
        """A file's name: title, and before it the session that the tab in front shows."""
        session, _, known = self._window.windowTitle().rpartition(" – ")
        name = file_name(Path(session).stem) if session and known else ""
        words = file_name(title.partition(" – ")[0] or _words(plot))
        return words if not name or words.startswith(name) else f"{name}-{words}"


SIZES = {
    "screen": ("As on the screen", None),
    "column": ("One column, 85 mm wide", 85.0),
    "page": ("Text width, 170 mm wide", 170.0),
}
"""Of a figure, with its width in mm; journals' usual columns."""
SMALLEST_MM, LARGEST_MM = 30.0, 1000.0
DIALOG_WIDTH = 520
"""Room for a title and for the words of every choice, px."""
FINENESS = {"192": "192, for the screen", "300": "300, for print", "600": "600, for fine print"}


class SavePlotDialog(QDialog):
    """How large, how fine and under which title a figure is saved; what was chosen last is offered again."""

    def __init__(self, parent: QWidget, shown: Paper, settings: Settings) -> None:
        super().__init__(parent)
        self.setObjectName("savePlot")
        self.setWindowTitle("Save the plot – FingerLab")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._shown, self._settings = shown, settings
        self.title = described(QLineEdit(shown.title), "plotTitle", accessible="Title over the figure")
        words = {key: title for key, (title, _) in SIZES.items()}
        self.size_choice = choice("plotSize", words, "Size: of the figure on paper.")
        self.width_mm = number("plotWidth", shown.width, SMALLEST_MM, LARGEST_MM, 1, 5, "Width in mm.")
        self.height_mm = number("plotHeight", shown.height, SMALLEST_MM, LARGEST_MM, 1, 5, "Height in mm.")
        self.fineness = choice("plotDots", FINENESS, "Dots per inch: of a PNG; SVG and PDF are lines.")
        form = QFormLayout()
        for label, field in (
            ("&Title", self.title),
            ("&Size", self.size_choice),
            ("&Width, mm", self.width_mm),
            ("&Height, mm", self.height_mm),
            ("&Dots per inch (PNG)", self.fineness),
        ):
            form.addRow(label, field)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        save = buttons.addButton("&Save…", QDialogButtonBox.ButtonRole.AcceptRole)
        save.setDefault(True)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        vbox(self, form, buttons, spacing=8)
        self.setMinimumWidth(DIALOG_WIDTH)
        self.title.setCursorPosition(0)
        self.size_choice.currentIndexChanged.connect(self._resize)
        size, dots = settings.figure()
        self.size_choice.setCurrentIndex(max(self.size_choice.findData(size), 0))
        self.fineness.setCurrentIndex(max(self.fineness.findData(dots), 0))

    @property
    def paper(self) -> Paper:
        """What was chosen."""
        dots = float(self.fineness.currentData())
        return replace(
            self._shown,
            width=self.width_mm.value(),
            height=self.height_mm.value(),
            dots_per_inch=dots,
            title=self.title.text().strip(),
        )

    def accept(self) -> None:
        self._settings.set_figure(self.size_choice.currentData(), self.fineness.currentData())
        super().accept()

    def _resize(self) -> None:
        wide = SIZES[self.size_choice.currentData()][1] or self._shown.width
        self.width_mm.setValue(wide)
        self.height_mm.setValue(self._shown.height * wide / self._shown.width)


def file_name(title: str) -> str:
    """A name for the file: the words of a title, without what a file system refuses."""
    return re.sub(r"[^\w.-]+", "-", title).strip("-.").lower() or "plot"


def plot_at(watched: QObject | None) -> QWidget | None:
    """The plot that an object is, or is inside of."""
    while isinstance(watched, QWidget):
        if is_plot(watched):
            return watched
        watched = watched.parentWidget()
    return None


def is_plot(widget: QWidget) -> bool:
    """Of pyqtgraph, where that has been imported, or one that says itself what it shows."""
    pyqtgraph = sys.modules.get("pyqtgraph")
    return isinstance(widget, ShowsSeries) or (
        pyqtgraph is not None and isinstance(widget, pyqtgraph.GraphicsView)
    )


def _words(plot: QWidget) -> str:
    return plot.accessibleName() or plot.objectName() or "plot"


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


LOOK_WAITS = "The appearance can be changed when the motor is off."
"""New colours take the window up to a second, and a window that does not answer stops the motor."""
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

    def _one_of(
        self, menu: QMenu, words: dict[str, str], now: str, choose: Callable[[str], Any]
    ) -> list[QAction]:
        """Entries of which one is chosen."""
        group = QActionGroup(menu)
        for key, text in words.items():
            action = self._action(menu, text, None, lambda key=key: choose(key))  # type: ignore[misc]
            action.setCheckable(True)
            action.setChecked(key == now)
            group.addAction(action)
        return group.actions()

    def _view(self, commands: WindowCommands, tabs: Sequence[TabEntry], chosen: MenuChoices) -> None:
        menu = self._window.menuBar().addMenu("&View")
        for tab in tabs:
            self._action(menu, tab.title, f"Ctrl+{tab.number}", lambda key=tab.key: commands.tab(key))  # type: ignore[misc]
        menu.addSeparator()
        self._action(menu, "&Copy plot", COPY_KEYS, commands.copy_plot)
        self._action(menu, "&Save plot…", SAVE_KEYS, commands.save_plot)
        menu.addSeparator()
        looks = {"system": "As the system", "light": "Light", "dark": "Dark"}
        appearance = menu.addMenu("&Appearance")
        appearance.setToolTipsVisible(True)
        self.looks = self._one_of(appearance, looks, chosen.appearance, commands.appearance)

    def show_motor(self, live: bool) -> None:
        """While the motor has current nothing is offered that keeps the window busy for long."""
        for action in self.looks:
            if action.isEnabled() == live:
                action.setEnabled(not live)
                action.setToolTip(LOOK_WAITS if live else "")

    def show_tab(self, title: str, tab: Tab) -> None:
        """Make the menu of the tab in front; the keys of the others do nothing now."""
        self.tab_menu.clear()
        for inner in self.tab_menu.findChildren(QMenu):
            inner.deleteLater()
        menus: dict[str, QMenu] = {"": self.tab_menu}
        self.tab_menu.setTitle(with_mnemonic(title))
        self._entries = []
        for command in tab.commands:
            if not command.text:
                self.tab_menu.addSeparator()
                continue
            if command.within not in menus:
                menus[command.within] = self.tab_menu.addMenu(command.within)
            action = self._action(menus[command.within], command.text, command.keys, command.call)
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
                    for action in _entries_of(menu)
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


def _entries_of(menu: QMenu) -> Iterator[QAction]:
    """Entries of a menu and of those in it."""
    for action in menu.actions():
        inner = action.menu()
        if isinstance(inner, QMenu):
            yield from _entries_of(inner)
        else:
            yield action
