"""The window: rail, header, work area, status bar; opening, dropping and closing; messages.

What a tab is, ``tab.py`` says; which there are, ``registry.py``; what they share, ``desk.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QSize
from PySide6.QtGui import QCloseEvent, QContextMenuEvent, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import (
    QApplication,
    QFileDialog,
    QHBoxLayout,
    QMainWindow,
    QMessageBox,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

import fingerlab

from . import dialogs, registry
from .desk import Desk, OpenCall, RigLine, read_session
from .frame_header import FrameHeader
from .menus import Chosen, Menus, WindowCommands
from .message_bar import MessageBar
from .placing import PlaceKeeper
from .plot_menu import PlotMenu
from .rail import Rail
from .registry import Entry
from .settings import Settings
from .status_bar import StatusBar
from .stop_guard import StopGuard
from .tab import Tab
from .tasks import Failed, TaskRunner
from .widgets.layout import Room
from .widgets.theme import apply_appearance

FIRST_SIZE = QSize(1280, 800)
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
        tabs: Sequence[Entry] | None = None,
        read: OpenCall = read_session,
    ) -> None:
        super().__init__()
        self.settings = settings if settings is not None else Settings()
        self.tasks = TaskRunner(self)
        self.desk = Desk(self.settings, self.tasks, read, self)
        self._entries = {entry.key: entry for entry in (tabs if tabs is not None else registry.TABS)}
        self._tabs: dict[str, Tab] = {}
        self._rooms: dict[str, Room] = {}
        self.current = ""
        self.setWindowTitle("FingerLab")
        self.setMinimumSize(800, 480)
        self.setAcceptDrops(True)
        self._build()
        self.plots = PlotMenu(self, self.desk)
        self.stop_guard = StopGuard(self, self.header.stop, self.desk)
        chosen = Chosen(self.settings.appearance(), self.stop_guard.key)
        self.menus = Menus(self, self._commands(), list(self._entries.values()), chosen)
        self._connect()
        self.settings.restore_place(self, FIRST_SIZE)
        self.place = PlaceKeeper(self, self.settings)
        first = self.settings.tab()
        self.show_tab(first if first in self._entries else next(iter(self._entries)))
        if self.focusWidget() is None:
            self.rail.take_focus()

    def _build(self) -> None:
        self.rail = Rail(list(self._entries.values()))
        self.header = FrameHeader()
        self.message = MessageBar()
        self.work = QStackedWidget()
        self.status = StatusBar(self.tasks)
        self.task_bar = self.status.tasks
        right = QVBoxLayout()
        right.setSpacing(0)
        right.addWidget(self.header)
        right.addWidget(self.message)
        right.addWidget(self.work, 1)
        across = QHBoxLayout()
        across.setSpacing(0)
        across.addWidget(self.rail)
        across.addLayout(right, 1)
        body = QWidget()
        layout = QVBoxLayout(body)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addLayout(across, 1)
        layout.addWidget(self.status)
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
            shortcuts=lambda: dialogs.show_keys(self.menus.keys(self._others()), self.stop_guard.key, self),
            log=lambda: dialogs.show_log(self.desk.log, self, self.desk.logged),
            about=self._about,
        )

    def _connect(self) -> None:
        desk = self.desk
        self.rail.chosen.connect(self.show_tab)
        self.tasks.failed.connect(self._on_failed)
        self.menus.recent.aboutToShow.connect(self._fill_recent)
        desk.tab_asked.connect(self.show_tab)
        desk.open_asked.connect(self.ask_and_open)
        desk.rig_changed.connect(self._on_rig)
        desk.told.connect(self.message.tell)
        desk.said.connect(self.task_bar.say)
        desk.sessions_changed.connect(self._on_sessions)
        desk.session_recorded.connect(self._on_recorded)
        desk.commands_changed.connect(self._refresh)

    # tabs

    def _others(self) -> list[tuple[str, Tab]]:
        """Title and tab of all that are not in front."""
        entries = self._entries.items()
        return [(entry.title, self.tab(key)) for key, entry in entries if key != self.current]

    def tab(self, key: str = "") -> Tab:
        """A tab, built if it was not yet; the one in front where no key is given."""
        key = key or self.current
        if key not in self._tabs:
            self._tabs[key] = tab = self._entries[key].make(self.desk)
            self._rooms[key] = Room(tab.widget)
            self.work.addWidget(self._rooms[key])
            if self.desk.sessions:
                tab.on_session_opened(self.desk.sessions)
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
        self.desk.hush()
        self.desk.open_paths(paths)

    def close_session(self) -> None:
        """Close what is open."""
        self.desk.hush()
        self.tasks.cancel()
        self.desk.close_sessions()

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
            self.desk.hush()
            if not self.tab().accept_files(paths):
                self.open_paths(paths)

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
            tab.on_session_opened(self.desk.sessions)
        self._refresh()

    def _on_recorded(self, path: Path) -> None:
        for tab in self._tabs.values():
            tab.on_session_recorded(path)

    def _on_rig(self, line: RigLine) -> None:
        self.header.show_rig(line)
        self.status.show_rig(line)
        self.stop_guard.arm(bool(line.device))

    def _refresh(self) -> None:
        if not self.current:
            return
        tab = self.tab()
        name = tab.window_title()
        self.setWindowTitle(f"{name} – FingerLab" if name else "FingerLab")
        self.menus.update(tab, sessions=bool(self.desk.sessions))

    def _fill_recent(self) -> None:
        menu = self.menus.recent
        menu.clear()
        for path in self.settings.recent():
            action = menu.addAction(path.name.replace("&", "&&"))
            action.setToolTip(str(path))
            action.triggered.connect(lambda _checked=False, p=path: self.open_paths([p]))
        if menu.isEmpty():
            menu.addAction("No recent files").setEnabled(False)

    def _on_failed(self, failed: Failed) -> None:
        version = f"FingerLab {fingerlab.__version__}\n"
        self.desk.tell(failed.sentence, version + failed.details)

    def show_mistake(self, sentence: str, details: str) -> None:
        """Show an error that no task caught."""
        self._on_failed(Failed(sentence, details))

    def _set_appearance(self, name: str) -> None:
        app = QApplication.instance()
        if isinstance(app, QApplication) and name in ("system", "light", "dark"):
            self.settings.set_appearance(name)  # type: ignore[arg-type]
            apply_appearance(app, self.settings.appearance())

    def _about(self) -> None:
        QMessageBox.about(
            self,
            "About FingerLab",
            f"FingerLab {fingerlab.__version__}\n\nDrives a cable-driven finger rig, records it, and tells "
            "which physical effect its model is missing.",
        )
