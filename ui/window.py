"""The window: the frame around the work area, opening and closing, messages and progress."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QSize
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import (
    QApplication,
    QFileDialog,
    QMainWindow,
    QMessageBox,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

import fingerlab
from fingerlab.errors import UserError

from . import practice, reporting
from .empty_view import EmptyView, WaitingView
from .header import Header
from .lab.controller import DiagnoseCall, LabController, OpenCall, read_session, run_diagnosis
from .lab.view import LabView
from .lab.wording import sessions_text
from .menus import Commands, Menus
from .message_bar import MessageBar
from .settings import Settings
from .task_bar import TaskBar
from .tasks import Failed, IsCancelled, Progress, TaskRunner
from .theme import apply_appearance

FIRST_SIZE = QSize(1280, 800)
SESSION_FILTER = "Session files (*.h5 *.hdf5);;All files (*)"
REPORT_FILTER = "Web page (*.html)"


class MainWindow(QMainWindow):
    """Composes the frame; all that it shows comes from the controller."""

    def __init__(
        self,
        settings: Settings | None = None,
        diagnose: DiagnoseCall = run_diagnosis,
        read: OpenCall = read_session,
    ) -> None:
        super().__init__()
        self.settings = settings if settings is not None else Settings()
        self.tasks = TaskRunner(self)
        self.controller = LabController(self.tasks, diagnose, read, self)
        self.setWindowTitle("FingerLab")
        self.setMinimumSize(800, 480)
        self.setAcceptDrops(True)
        self._build()
        self.menus = Menus(self, self._commands(), self.settings.appearance())
        self._connect()
        self._refresh()
        self.settings.restore_place(self, FIRST_SIZE)

    def _build(self) -> None:
        self.header = Header()
        self.message = MessageBar()
        self.empty = EmptyView()
        self.waiting = WaitingView()
        self.lab = LabView(self.controller)
        self.work = QStackedWidget()
        for view in (self.empty, self.waiting, self.lab):
            self.work.addWidget(view)
        self.task_bar = TaskBar(self.tasks)
        body = QWidget()
        layout = QVBoxLayout(body)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        for widget in (self.header, self.message):
            layout.addWidget(widget)
        layout.addWidget(self.work, 1)
        layout.addWidget(self.task_bar)
        self.setCentralWidget(body)

    def _commands(self) -> Commands:
        lab = self.lab
        return Commands(
            open=self.ask_and_open,
            practise=self.practise,
            reveal=self.reveal,
            report=self.save_report,
            close_session=self.close_session,
            quit=self.close,
            undo=self.controller.undo,
            redo=self.controller.redo,
            add=lab.candidates.add_button.click,
            step=lab.go_to,
            equation=lab.bar.choose_equation,
            next_run=lambda: lab.bar.step_run(1),
            previous_run=lambda: lab.bar.step_run(-1),
            whole_run=lab.plot.show_whole,
            appearance=self._set_appearance,
            about=self._about,
        )

    def _connect(self) -> None:
        self.header.open_asked.connect(self.ask_and_open)
        self.header.report_asked.connect(self.save_report)
        self.header.reveal_asked.connect(self.reveal)
        self.empty.open_asked.connect(self.ask_and_open)
        self.empty.practise_asked.connect(self.practise)
        self.empty.recent_asked.connect(lambda path: self.open_paths([Path(path)]))
        self.waiting.compare_asked.connect(self.controller.compare)
        self.lab.report_asked.connect(self.save_report)
        self.controller.sessions_changed.connect(self._refresh)
        self.controller.result_changed.connect(self._refresh)
        self.controller.activity_changed.connect(self._refresh)
        self.tasks.progressed.connect(lambda _share, what: self.waiting.show_state(True, what))
        self.tasks.failed.connect(self._on_failed)
        self.menus.recent.aboutToShow.connect(self._fill_recent)

    # opening and closing

    def ask_and_open(self) -> None:
        """Open session files chosen in a dialog."""
        names, _ = QFileDialog.getOpenFileNames(self, "Open session", self.settings.folder(), SESSION_FILTER)
        if names:
            self.open_paths([Path(name) for name in names])

    def open_paths(self, paths: Sequence[Path]) -> None:
        """Open session files together; what is open stays until they have been read."""
        self.message.hide()
        self.controller.open(paths, opened=lambda: self.settings.remember(paths))

    def close_session(self) -> None:
        """Close what is open."""
        self.message.hide()
        self.controller.close()
        self.task_bar.say("Session closed")

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            self.open_paths(paths)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Leave at once to the eye; the running work is asked to stop and waited for."""
        self.settings.save_place(self)
        self.hide()
        self.tasks.shut_down()
        event.accept()

    # practice and report

    def practise(self) -> None:
        """Simulate a session with a sealed effect and open it."""
        self.message.hide()
        self.tasks.start(
            "Recording a practice session", practice.simulate, lambda path: self.open_paths([path])
        )

    def reveal(self) -> None:
        """Say which effect the practice session holds."""
        history = self.controller.history
        model = history.now.added if history is not None else ()
        try:
            sealed = [session for session in self.controller.sessions if practice.is_sealed(session)]
            self.message.tell(" ".join(practice.reveal(session, model) for session in sealed))
        except UserError as error:
            self.message.tell(str(error), traceback.format_exc())

    def save_report(self) -> None:
        """Write the report page of what is open, off the GUI thread."""
        sessions, history = self.controller.sessions, self.controller.history
        if not sessions or history is None:
            return
        start = Path(self.settings.folder()) / f"{sessions[0].path.stem}.html"
        name, _ = QFileDialog.getSaveFileName(self, "Save report page", str(start), REPORT_FILTER)
        if not name:
            return
        path, diagnosis = Path(name), history.now.diagnosis

        def work(progress: Progress, cancelled: IsCancelled) -> Path:
            return reporting.write_page(sessions, path, diagnosis, progress, cancelled)

        self.tasks.start(
            "Writing the report page", work, lambda done: self.message.tell(f"Report page saved: {done}")
        )

    # what is shown

    def _refresh(self) -> None:
        sessions, history = self.controller.sessions, self.controller.history
        sealed = any(practice.is_sealed(session) for session in sessions)
        self.header.show_session(sessions_text(sessions) if sessions else "", sealed, history is not None)
        self.header.setVisible(bool(sessions))
        self.setWindowTitle(f"{sessions[0].path.name} – FingerLab" if sessions else "FingerLab")
        if not sessions:
            self.empty.show_recent(self.settings.recent())
            self.work.setCurrentWidget(self.empty)
        elif history is None:
            self.waiting.show_state(self.tasks.busy, "")
            self.work.setCurrentWidget(self.waiting)
        else:
            self.work.setCurrentWidget(self.lab)
        comparisons = history.now.diagnosis.comparisons if history is not None else ()
        self.menus.update(
            session=bool(sessions),
            practice=sealed,
            result=history is not None,
            undo=history is not None and history.can_undo,
            redo=history is not None and history.can_redo,
            equations=frozenset(c.equation for c in comparisons),
        )

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
        self.message.tell(failed.sentence, version + failed.details)

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
