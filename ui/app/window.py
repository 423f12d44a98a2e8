"""The window: rail, header, work area, status bar; opening, dropping and closing; its place; small dialogs.

What a tab is and which there are, ``tab_registry.py`` says; what they share, ``context.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QSize, Qt, QTimer, QUrl, SignalInstance
from PySide6.QtGui import (
    QCloseEvent,
    QContextMenuEvent,
    QDesktopServices,
    QDragEnterEvent,
    QDropEvent,
    QGuiApplication,
)
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QMainWindow,
    QMessageBox,
    QPlainTextEdit,
    QStackedWidget,
    QTextBrowser,
    QWhatsThis,
    QWidget,
)

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.core.files import seen_as
from fingerlab.report.documents import FIRST, GLOSSARY

from ..widgets.fields import Complaint
from ..widgets.layout import FLUSH, Room, as_written, described, hbox, resize_on_screen, vbox
from ..widgets.theme import apply_appearance
from . import tab_registry
from .bars import FrameHeader, MessageBar, StatusBar
from .context import ApplicationContext, OpenCall, RigLine, Settings, read_session
from .menus import MenuChoices, Menus, PlotMenu, WindowCommands
from .stop_guard import StopGuard
from .tab_registry import Rail, Tab, TabEntry
from .worker import Failed, Worker


def ask_to_run(parent: QWidget, path: Path, content: bytes, changed: bool, what: str) -> bool:
    """Whether a file that is new, or was changed, may be run; its text can be looked at.

    Args:
        what: it does, after "It is a program", such as ``it drives the motor, and``.
    """
    box = QMessageBox(parent)
    box.setWindowTitle("FingerLab")
    why = "has changed since you let it be run" if changed else "has not been run yet"
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.setText(
        f"{path.name} {why}. It is a program: {what} may do all that you may. Run it now and from now on?"
    )
    box.setInformativeText(as_written(str(path)))
    box.setDetailedText(content.decode("utf-8", errors="replace"))
    run = box.addButton("&Run it", QMessageBox.ButtonRole.AcceptRole)
    leave = box.addButton("&Leave it", QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(leave)
    box.exec()
    return box.clickedButton() is run


KeySheet = Sequence[tuple[str, Sequence[tuple[str, str]]]]

GENERAL_KEYS = (("Cancel what is running", "Ctrl+."), ("From field to field", "Tab, Shift+Tab"))
PLOT_KEYS = (
    ("Zoom in and out", "+  −"),
    ("Move", "←  →"),
    ("Show all", "Home"),
    ("Copy or save it", "Menu, Shift+F10"),
)


def show_keys(sheet: KeySheet, stop_key: str, parent: QWidget) -> QDialog:
    """All keys on one sheet; stays open beside the window."""
    text = described(QTextBrowser(), "keySheet", accessible="Keys")
    general = (("Stop the motor", "Esc"), ("The same, by a foot switch", stop_key), *GENERAL_KEYS)
    rows = []
    for title, entries in (("Everywhere", general), *sheet, ("In a plot", PLOT_KEYS)):
        rows.append(f'<tr><td colspan="2"><b><br>{escape(title)}</b></td></tr>')
        rows += [
            f"<tr><td>{escape(words)}&nbsp;&nbsp;&nbsp;</td><td><b>{escape(key)}</b></td></tr>"
            for words, key in entries
        ]
    text.setHtml(f"<table>{''.join(rows)}</table>")
    return _show("Keys", text, parent)


def show_log(lines: Sequence[str], parent: QWidget, logged: SignalInstance) -> QDialog:
    """What was said since the window opened, latest at the bottom; ``logged`` brings each new line."""
    text = described(QPlainTextEdit("\n".join(lines)), "log", accessible="Log")
    text.setPlaceholderText("Nothing has been said yet.")
    text.setReadOnly(True)
    dialog = _show("Log", text, parent)
    logged.connect(text.appendPlainText)  # Qt forgets it with the dialog
    text.verticalScrollBar().setValue(text.verticalScrollBar().maximum())
    buttons = dialog.findChild(QDialogButtonBox)
    assert buttons is not None
    copy = buttons.addButton("&Copy all", QDialogButtonBox.ButtonRole.ActionRole)
    copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(text.toPlainText()))
    return dialog


def _show(title: str, text: QWidget, parent: QWidget) -> QDialog:
    dialog = QDialog(parent)
    dialog.setWindowTitle(f"{title} – FingerLab")
    resize_on_screen(dialog, 520, 560)
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    buttons.rejected.connect(dialog.close)
    vbox(dialog, text, buttons, spacing=8)
    dialog.finished.connect(dialog.deleteLater)
    dialog.show()
    return dialog


SETTLED_MS = 800
"""So long after the last move: a window that is dragged would else be written with every pixel."""


class PlaceKeeper(QObject):
    """Watches one window, which owns it."""

    def __init__(self, window: QWidget, settings: Settings) -> None:
        super().__init__(window)
        self._window, self._settings = window, settings
        self._timer = QTimer(self, singleShot=True, interval=SETTLED_MS)
        self._timer.timeout.connect(self.keep)
        window.installEventFilter(self)

    def keep(self) -> None:
        """Write the place down now; not of a window that nobody sees."""
        self._timer.stop()
        if self._window.isVisible():
            self._settings.save_place(self._window)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        moved = (QEvent.Type.Move, QEvent.Type.Resize, QEvent.Type.WindowStateChange)
        if event.type() in moved and self._window.isVisible():
            self._timer.start()
        return False


FIRST_SIZE = QSize(1280, 800)
FIRST_TAB = "model_lab"
"""In front at the first start: its page says what the program is for, and where to begin."""
IMPORTING, TABLES = "sessions", (".txt", ".csv", ".tsv", ".mat")
"""Who takes tables in, and their endings."""
SESSION_ENDINGS = (".h5", ".hdf5")
SHOWN_ELSEWHERE = (".html", ".pdf", ".png", ".svg", ".csv", ".md")
"""Endings of files that a program of the computer shows; of others the folder is opened."""
ASKS_WHAT = (QEvent.Type.WhatsThis, QEvent.Type.QueryWhatsThis, QEvent.Type.WhatsThisClicked)
SESSION_FILTER = "Session files (*.h5 *.hdf5);;All files (*)"


class MainWindow(QMainWindow):
    """The frame around the tabs.

    Args:
        tabs: which there are; those of the registry where it is None.
        read: opens a session file.
    """

    def __init__(
        self,
        settings: Settings | None = None,
        tabs: Sequence[TabEntry] | None = None,
        read: OpenCall = read_session,
    ) -> None:
        super().__init__()
        self.settings = settings if settings is not None else Settings()
        self.tasks = Worker(self, assurance="; the session file is unchanged")
        self.context = ApplicationContext(self.settings, self.tasks, read, self)
        self._entries = {entry.key: entry for entry in (tabs if tabs is not None else tab_registry.TABS)}
        self._tabs: dict[str, Tab] = {}
        self._rooms: dict[str, Room] = {}
        self.current = ""
        self._look_due = False
        self.setWindowTitle("FingerLab")
        self.setMinimumSize(800, 480)
        self.setAcceptDrops(True)
        self._build()
        self.plots = PlotMenu(self, self.context, lambda plot: self.tab().figure_source(plot))
        self.stop_guard = StopGuard(self, self.header.stop, self.context)
        chosen = MenuChoices(self.settings.appearance(), self.stop_guard.key)
        self.menus = Menus(self, self._commands(), list(self._entries.values()), chosen)
        self._connect()
        self.settings.restore_place(self, FIRST_SIZE)
        self.place = PlaceKeeper(self, self.settings)
        first = self.settings.tab()
        beginning = FIRST_TAB if FIRST_TAB in self._entries else next(iter(self._entries))
        self.show_tab(first if first in self._entries else beginning)
        if self.settings.under_way() is not None:  # it ended in the middle of a recording
            self.show_tab("acquire")
        if self.focusWidget() is None:
            self.rail.take_focus()

    def _build(self) -> None:
        self.rail = Rail(list(self._entries.values()))
        self.header = FrameHeader()
        self.message = MessageBar()
        self.work = QStackedWidget()
        self.status = StatusBar(self.tasks)
        self.task_bar = self.status.tasks
        right = vbox(None, self.header, (self.work, 1), spacing=0)
        across = hbox(None, self.rail, (right, 1), spacing=0)
        body = QWidget()
        vbox(body, (across, 1), self.message, self.status, margins=FLUSH, spacing=0)
        self.setCentralWidget(body)

    def _commands(self) -> WindowCommands:
        return WindowCommands(
            open=self.ask_and_open,
            close_session=self.close_session,
            quit=self.close,
            undo=lambda: self.tab().undo(),
            redo=lambda: self.tab().redo(),
            tab=self.show_tab,
            copy_plot=self.plots.copy_current,
            save_plot=self.plots.save_current,
            appearance=self._set_appearance,
            stop_key=self.stop_guard.choose_key,
            documents=self.show_documents,
            glossary=lambda: self.show_documents(GLOSSARY),
            whats_this=QWhatsThis.enterWhatsThisMode,
            shortcuts=lambda: show_keys(self.menus.keys(self._others()), self.stop_guard.key, self),
            log=lambda: show_log(self.context.log, self, self.context.logged),
            about=self._about,
        )

    def _connect(self) -> None:
        context = self.context
        self.rail.chosen.connect(self.show_tab)
        self.tasks.failed.connect(self._on_failed)
        self.menus.recent.aboutToShow.connect(self._fill_recent)
        self.menus.tab_menu.aboutToShow.connect(self._refresh)
        context.tab_asked.connect(self.show_tab)
        context.open_asked.connect(self.ask_and_open)
        context.rig_changed.connect(self._on_rig)
        context.warned.connect(self.message.tell)
        context.announced.connect(self.message.announce)
        self.message.open_asked.connect(self._open_written)
        context.said.connect(self.task_bar.say)
        context.sessions_changed.connect(self._on_sessions)
        context.session_recorded.connect(self._on_recorded)
        context.commands_changed.connect(self._refresh)

    # tabs

    def _others(self) -> list[tuple[str, Tab]]:
        """Title and tab of all that are not in front."""
        entries = self._entries.items()
        return [(entry.title, self.tab(key)) for key, entry in entries if key != self.current]

    def tab(self, key: str = "") -> Tab:
        """A tab, built if it was not yet; the one in front where no key is given."""
        key = key or self.current
        if key not in self._tabs:
            self._tabs[key] = tab = self._entries[key].make(self.context)
            self._rooms[key] = Room(tab.widget)
            self.work.addWidget(self._rooms[key])
            if self.context.sessions:
                tab.on_session_opened(self.context.sessions)
        return self._tabs[key]

    def show_tab(self, key: str) -> None:
        """Bring a tab to the front."""
        if key not in self._entries or key == self.current:
            return
        tab = self.tab(key)
        if self.current:
            self.tab().on_hidden()
        self.current = key
        self.rail.show_current(key)
        self.header.show_own(tab.header)
        self.header.follow(self.rail)
        self.work.setCurrentWidget(self._rooms[key])
        self.menus.show_tab(self._entries[key].title, tab)
        self.settings.set_tab(key)
        self._refresh()
        tab.on_shown()

    # opening and closing

    def ask_and_open(self) -> None:
        """Open session files chosen in a dialog."""
        names, _ = QFileDialog.getOpenFileNames(self, "Open session", self.settings.folder(), SESSION_FILTER)
        if names:
            self.open_paths([Path(name) for name in names])

    def open_paths(self, paths: Sequence[Path]) -> None:
        """Open session files together; what is open stays until they have been read."""
        self.context.hush()
        self.context.open_paths(paths)

    def _open_written(self, path: Path) -> None:
        """What was written: a session here, a page or picture in its own program, the folder of the rest."""
        if path.suffix.lower() in SESSION_ENDINGS:
            self.open_paths([path])
            return
        shown = path if path.suffix.lower() in SHOWN_ELSEWHERE else path.parent
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(shown))):
            self.context.tell(f"No program on this computer opens {shown}; open it by hand.")

    def close_session(self) -> None:
        """Close what is open."""
        self.context.hush()
        self.tasks.cancel()
        self.context.close_sessions()

    def show_documents(self, page: str = "", word: str = "") -> None:
        """The documents at a page, or at a word of the glossary."""
        from .documents import show_documents

        try:
            show_documents(self, page or FIRST, word)
        except UserError as error:
            self.context.tell(str(error))

    def event(self, event: QEvent) -> bool:
        """A number field that says what is wrong with what was typed; a question what something is."""
        if event.type() in ASKS_WHAT:
            from .documents import explains

            return explains(self, event)
        if not isinstance(event, Complaint):
            return super().event(event)
        if event.sentence:
            self.context.tell(event.sentence)
        else:
            self.message.take_back(event.before)
        return True

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """What no widget wanted: over a plot, its copy and save."""
        event.setAccepted(self.plots.offer(event))

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            self.context.hush()
            if not self.tab().accept_files(paths) and not self._imported(paths):
                self.open_paths(paths)

    def _imported(self, paths: Sequence[Path]) -> bool:
        """Whether these are text files or folders, which Sessions imports or shows wherever they fall."""
        texts = all(path.suffix.lower() in TABLES for path in paths)
        if IMPORTING not in self._entries or not (texts or any(seen_as(path) == "folder" for path in paths)):
            return False
        self.show_tab(IMPORTING)
        return self.tab().accept_files(paths)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask where a tab has something to lose; then leave at once to the eye, and wait for what runs."""
        if not all(tab.can_close() for tab in self._tabs.values()):
            event.ignore()
            return
        self.place.keep()
        self.hide()
        self.tasks.shut_down()
        for tab in self._tabs.values():
            tab.shut_down()
        self.stop_guard.arm(False)
        event.accept()

    # what is shown

    def _on_sessions(self, sessions: object) -> None:
        for tab in self._tabs.values():
            tab.on_session_opened(self.context.sessions)
        self._refresh()

    def _on_recorded(self, path: Path) -> None:
        for tab in self._tabs.values():
            tab.on_session_recorded(path)

    def _on_rig(self, line: RigLine) -> None:
        self.header.show_rig(line)
        self.status.show_rig(line)
        self.stop_guard.arm(bool(line.device))
        self.menus.show_motor(line.live)
        if self._look_due and not line.live:
            self.follow_desktop()

    def _refresh(self) -> None:
        if not self.current:
            return
        tab = self.tab()
        name = tab.window_title()
        self.setWindowTitle(f"{name} – FingerLab" if name else "FingerLab")
        self.menus.update(tab, sessions=bool(self.context.sessions))

    def _fill_recent(self) -> None:
        menu = self.menus.recent
        menu.clear()
        for path in self.settings.recent():
            action = menu.addAction(path.name.replace("&", "&&"))
            action.setToolTip(as_written(str(path)))
            action.triggered.connect(lambda _checked=False, p=path: self.open_paths([p]))
        if menu.isEmpty():
            menu.addAction("No recent files").setEnabled(False)

    def _on_failed(self, failed: Failed) -> None:
        version = f"FingerLab {fingerlab.__version__}\n"
        self.context.tell(failed.sentence, version + failed.details)

    def show_mistake(self, sentence: str, details: str) -> None:
        """Show an error that no task caught."""
        self._on_failed(Failed(sentence, details))

    def _set_appearance(self, name: str) -> None:
        app = QApplication.instance()
        if isinstance(app, QApplication) and name in ("system", "light", "dark"):
            self.settings.set_appearance(name)  # type: ignore[arg-type]
            apply_appearance(app, self.settings.appearance())

    def follow_desktop(self) -> None:
        """Light or dark as the desktop is now, unless the user chose one; while the motor is on, later."""
        self._look_due = self.context.rig_line.live
        if not self._look_due and self.settings.appearance() == "system":
            self._set_appearance("system")

    def _about(self) -> None:
        QMessageBox.about(
            self,
            "About FingerLab",
            f"FingerLab {fingerlab.__version__}\n\nDrives a cable-driven finger rig, records it, and tells "
            "which physical effect its model is missing.",
        )
