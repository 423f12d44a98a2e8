"""The Fit tab: nothing open, a session that waits for its analysis, or the fit and how it came about."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QFileDialog, QHBoxLayout, QPushButton, QStackedWidget, QWidget

from fingerlab.models.file import save_model
from fingerlab.thesis.fitting import model_of_fit
from fingerlab.thesis.inspection import Inspection, inspect_session

from ..desk import Desk
from ..tab import Command, Tab
from ..tasks import IsCancelled, Progress
from ..widgets.invitation import lay_out_invitation
from ..widgets.labels import header_name, heading, remark
from .panel import FitPanel
from .view import FitView

if TYPE_CHECKING:
    from fingerlab.sessions.model import Session

MODEL_FILTER = "Model file (*.json)"
OWNER = "fit"
NO_SESSION = (
    "Open a session with runs on air. Moment arms, friction losses and delays of both joints will stand "
    "here, with the regions of the motion and the line behind each number."
)
NOT_YET = (
    "Analyse the runs on air: the joints' speeds with their regions, joint torque against cable tension with "
    "the regression line, R² and delay of each run, and a table of the parameters will stand here."
)


class FitTab(Tab):
    """Asks :func:`inspect_session` and shows what comes back."""

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.sessions: tuple[Session, ...] = ()
        self.found: Inspection | None = None
        self.panel = FitPanel()
        self.view = FitView()
        self.view.panes.remember(desk.settings)
        self.header = self.name = header_name("fitSession", "Session that is fitted")
        self.empty = QWidget()
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self.view)
        self.widget = QWidget()
        self._build()
        self.panel.analyse_asked.connect(self.analyse)
        self.panel.save_asked.connect(self.save)
        self.panel.run_chosen.connect(self.view.show_run)
        self.view.run_wanted.connect(self.panel.run.setCurrentText)
        self.commands = (
            Command("&Analyse the runs on air", self.analyse, "Ctrl+Return", lambda: bool(self.sessions)),
            Command("Next run", lambda: self._step(1), "Alt+Down", lambda: self.found is not None),
            Command("Previous run", lambda: self._step(-1), "Alt+Up", lambda: self.found is not None),
            Command("&Save model file…", self.save, "Ctrl+S", lambda: self.found is not None),
        )
        self._refresh()

    def _build(self) -> None:
        self.empty_title, self.empty_text = heading(large=True), remark()
        self.empty_title.setObjectName("fitEmpty")
        self.empty_open = QPushButton("&Open a session…")
        self.empty_open.setProperty("primary", "true")
        self.empty_open.clicked.connect(self.desk.open_asked)
        lay_out_invitation(self.empty, self.empty_title, self.empty_text, self.empty_open)
        across = QHBoxLayout(self.widget)
        across.setContentsMargins(8, 8, 8, 8)
        across.addWidget(self.pages, 1)
        across.addWidget(self.panel)

    def window_title(self) -> str:
        return self.sessions[0].path.name if self.sessions else ""

    def on_session_opened(self, sessions: tuple[Session, ...]) -> None:
        self.sessions, self.found = sessions, None
        self._refresh()

    def analyse(self) -> None:
        """Fit the first open session off the GUI thread."""
        if not self.sessions:
            return
        session, spec, opened = self.sessions[0], self.panel.spec(), self.sessions
        self.desk.hush()

        def work(progress: Progress, cancelled: IsCancelled) -> Inspection:
            return inspect_session(session, spec, progress)

        def done(found: Inspection) -> None:
            if self.sessions is opened:
                self.found = found
                self._refresh()

        self.desk.tasks.start(f"Fitting {session.path.name}", work, done, OWNER)

    def save(self) -> None:
        """Keep the fit as a model file; a file that exists is refused by the writer itself."""
        found = self.found
        if found is None:
            return
        session = self.sessions[0]
        start = Path(self.desk.settings.folder()) / f"{session.path.stem}-fit.json"
        name, _ = QFileDialog.getSaveFileName(
            self.widget,
            "Save model file",
            str(start),
            MODEL_FILTER,
            options=QFileDialog.Option.DontConfirmOverwrite,
        )
        if not name:
            return
        path = Path(name)

        def work(progress: Progress, cancelled: IsCancelled) -> Path:
            save_model(model_of_fit(session, found.fit), path)
            return path

        self.desk.tasks.start(
            "Saving the model", work, lambda done: self.desk.tell(f"Model file saved: {done}"), OWNER
        )

    def _step(self, by: int) -> None:
        box = self.panel.run
        box.setCurrentIndex(min(max(box.currentIndex() + by, 0), box.count() - 1))

    def _refresh(self) -> None:
        found, opened = self.found, bool(self.sessions)
        self.name.setText(self.sessions[0].path.name if opened else "")
        self.panel.analyse.setEnabled(opened)
        self.panel.analyse.setToolTip("Ctrl+Return" if opened else "No session is open.")
        self.panel.set_ready(found is not None, "There is no fit yet: analyse first.")
        if found is None:
            self.empty_title.setText("Not analysed yet" if opened else "No session open")
            self.empty_text.setText(NOT_YET if opened else NO_SESSION)
            self.empty_open.setVisible(not opened)
            self.panel.show_runs((), "")
            self.pages.setCurrentWidget(self.empty)
        else:
            self.view.show_inspection(found)
            self.panel.show_runs(tuple(found.views), _remarks(found, len(self.sessions)))
            self.view.show_run(self.panel.run.currentText())
            self.pages.setCurrentWidget(self.view)
        self.desk.commands_changed.emit()


def _remarks(found: Inspection, sessions: int) -> str:
    words = ["± is half the 90 % interval."]
    if sessions > 1:
        words.append("Of the open sessions, the first is fitted.")
    if found.fit.skipped:
        names = ", ".join(name for name, _ in found.fit.skipped)
        reasons = " or ".join(dict.fromkeys(reason for _, reason in found.fit.skipped))
        words.append(f"Not used: {names} ({reasons}).")
    return " ".join(words)
