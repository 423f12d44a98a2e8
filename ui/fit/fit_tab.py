"""The Fit tab: how to fit, and the fit and how it came about."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QComboBox, QFileDialog, QLabel, QPushButton, QStackedWidget, QWidget

from fingerlab.core.errors import UserError
from fingerlab.models.file import save_model
from fingerlab.report.line_units import line_units
from fingerlab.signals.periods import THRESHOLDS_PERCENT
from fingerlab.thesis.fitting import model_of_fit, on_air_runs
from fingerlab.thesis.inspection import Inspection, inspect_session
from fingerlab.thesis.traces import Delay, FitSpec, Method

from ..app.context import ApplicationContext
from ..app.tab_registry import SEPARATOR, Command, Tab, run_commands
from ..app.worker import IsCancelled, Progress
from ..widgets.layout import described, fix_width, hbox, vbox
from ..widgets.tables import EmptyPage, header_name, heading, remark
from .fit_view import FitResultView

if TYPE_CHECKING:
    from fingerlab.sessions.model import Session

    from .fit_view import ReplicateDialog

METHOD_WORDS: dict[Method, str] = {
    "regions": "four regions",
    "flexion-extension": "flexion and extension",
    "whole": "whole run",
}
DELAY_WORDS: dict[Delay, str] = {
    "none": "no delay",
    "xcorr": "by cross-correlation, one a run",
    "findsignal": "by least squares, one a region",
    "finddelay": "as the thesis: finddelay",
}
PANEL_WIDTH = 240


class FitPanel(QWidget):
    """Signals ``analyse_asked``, ``save_asked``, ``run_chosen(name)``."""

    analyse_asked = Signal()
    save_asked = Signal()
    run_chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.method = _choice("method", "Regions", [(METHOD_WORDS[m], m) for m in get_args(Method)])
        self.delay = _choice("delay", "Delay", [(DELAY_WORDS[d], d) for d in get_args(Delay)])
        self.threshold = _choice(
            "threshold", "Threshold", [(f"{t} % of the speed range", float(t)) for t in THRESHOLDS_PERCENT]
        )
        self.method.setToolTip("Into which parts of the period the runs are cut; each has a line of its own.")
        self.threshold.setToolTip(
            "Joint speed that parts motion from standstill, thesis sections 4.1 and 4.2."
        )
        self.delay.setToolTip("The tension is shifted by the delay before the line is fitted.")
        self.analyse = described(QPushButton("&Analyse the runs on air"), "analyse", primary="true")
        self.save = described(QPushButton("&Save model file…"), "saveModel")
        self.run = _choice("fitRun", "Run shown", [])
        self.run.setToolTip("Run that the plots show (Alt+Up, Alt+Down for the next); the table is of all.")
        self.remarks = described(remark(), "fitRemarks")
        layout = vbox(self, heading("How to fit"), margins=(8, 0, 0, 0), spacing=4)
        for title, box in (("Re&gions", self.method), ("&Delay", self.delay), ("&Threshold", self.threshold)):
            layout.addWidget(_label(title, box))
            layout.addWidget(box)
        layout.addSpacing(4)
        layout.addWidget(self.analyse)
        layout.addSpacing(16)
        layout.addWidget(heading("What is shown"))
        layout.addWidget(_label("&Run", self.run))
        layout.addWidget(self.run)
        layout.addWidget(self.remarks)
        layout.addStretch(1)
        layout.addWidget(self.save)
        fix_width(self, PANEL_WIDTH)
        self.analyse.clicked.connect(self.analyse_asked)
        self.save.clicked.connect(self.save_asked)
        self.run.currentTextChanged.connect(self.run_chosen)
        self.set_ready(False, "There is no fit yet: analyse first.")

    def spec(self) -> FitSpec:
        """What is chosen."""
        return FitSpec(self.method.currentData(), self.delay.currentData(), self.threshold.currentData())

    def set_ready(self, ready: bool, why_not: str = "") -> None:
        """Whether there is a fit to keep."""
        self.save.setEnabled(ready)
        self.save.setToolTip("Parameters, intervals and origin; never over a file." if ready else why_not)

    def show_runs(self, names: Sequence[str], remarks: str) -> None:
        """Runs of another fit; the one that was shown stays if it is there."""
        before = self.run.currentText()
        with QSignalBlocker(self.run):
            self.run.clear()
            self.run.addItems(list(names))
            self.run.setCurrentIndex(max(self.run.findText(before), 0))
        self.remarks.setText(remarks)


def _choice(name: str, words: str, entries: Sequence[tuple[str, object]]) -> QComboBox:
    box = described(QComboBox(), name, accessible=words)
    for text, data in entries:
        box.addItem(text, data)
    return box


def _label(text: str, buddy: QWidget) -> QLabel:
    label = QLabel(text)
    label.setBuddy(buddy)
    return label


MODEL_FILTER = "Model file (*.json)"
OWNER = "fit"
NO_SESSION = (
    "Open a session with runs on air. Moment arms, friction losses and delays of both joints will stand "
    "here, with the regions of the motion and the line behind each number."
)
FITTING = "Fitting"
NOT_YET = (
    "Analyse the runs on air: the joints' speeds with their regions, joint torque against cable tension with "
    "the regression line, R² and delay of each run, and a table of the parameters will stand here."
)
NOTHING_TO_FIT = "{file} has no run on air with a cable, which moment arms, losses and delays are fitted to."
AXIS_ALONE = " It is the log of an axis alone, whose {mass} and friction the Model lab finds."


class FitTab(Tab):
    """Asks :func:`inspect_session` and shows what comes back."""

    def __init__(self, context: ApplicationContext) -> None:
        super().__init__(context)
        self.sessions: tuple[Session, ...] = ()
        self.found: Inspection | None = None
        self._replicate: ReplicateDialog | None = None
        self.panel = FitPanel()
        self.view = FitResultView()
        self.view.panes.remember(context.settings)
        self.header = self.name = header_name("fitSession", "Session that is fitted")
        self.empty = EmptyPage("fitEmpty", context.open_asked)
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self.view)
        self.widget = QWidget()
        hbox(self.widget, (self.pages, 1), self.panel, margins=(8, 8, 8, 8))
        self.panel.analyse_asked.connect(self.analyse)
        self.panel.save_asked.connect(self.save)
        self.panel.run_chosen.connect(self.view.show_run)
        self.view.run_wanted.connect(self.panel.run.setCurrentText)
        self._under_way = ""
        context.tasks.started.connect(self._on_started)
        context.tasks.ended.connect(lambda _how: self._on_started(""))
        self.commands = (
            Command("&Analyse the runs on air", self.analyse, "Ctrl+Return", self._can_analyse),
            *run_commands(lambda: self.panel.run, lambda: self.found is not None),
            Command("&Save model file…", self.save, "Ctrl+S", lambda: self.found is not None),
            SEPARATOR,
            Command("The &thesis' experiment again…", self.show_replicate),
        )
        self._refresh()

    def window_title(self) -> str:
        return self.sessions[0].path.name if self.sessions else ""

    def figure_source(self, plot: QWidget) -> str:
        from fingerlab.report.recording_words import figure_source

        from .fit_plots import RunBars

        if self.found is None:
            return ""
        runs = tuple(self.found.views) if isinstance(plot, RunBars) else (self.panel.run.currentText(),)
        return figure_source(self.sessions[0], f"fitted by {self.found.fit.spec.title}", runs)

    def on_session_opened(self, sessions: tuple[Session, ...]) -> None:
        self.sessions, self.found = sessions, None
        self._refresh()

    def _can_analyse(self) -> bool:
        return bool(self.sessions) and not lacking(self.sessions[0])

    def analyse(self) -> None:
        """Fit the first open session off the GUI thread."""
        if not self._can_analyse():
            return
        session, spec, opened = self.sessions[0], self.panel.spec(), self.sessions
        self.context.hush()

        def work(progress: Progress, cancelled: IsCancelled) -> Inspection:
            return inspect_session(session, spec, progress)

        def done(found: Inspection) -> None:
            if self.sessions is opened:
                self.found = found
                self._refresh()

        self.context.tasks.start(f"{FITTING} {session.path.name}", work, done, OWNER)

    def show_replicate(self) -> None:
        """The thesis' experiment on the simulated rig, beside the published numbers."""
        from .fit_view import ReplicateDialog

        if self._replicate is None:
            self._replicate = ReplicateDialog(self.widget)
        self._replicate.show()
        self._replicate.raise_()

    def shut_down(self) -> None:
        if self._replicate is not None:
            self._replicate.shut_down()

    def save(self) -> None:
        """Keep the fit as a model file; a file that exists is refused by the writer itself."""
        found = self.found
        if found is None:
            return
        session = self.sessions[0]
        start = Path(self.context.settings.folder()) / f"{session.path.stem}-fit.json"
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

        self.context.tasks.start(
            "Saving the model",
            work,
            lambda done: self.context.announce(f"Model file saved: {done}", done),
            OWNER,
        )

    def _on_started(self, title: str) -> None:
        """Say that the runs are being analysed, where nothing is shown yet."""
        self._under_way = title if title.startswith(FITTING) else ""
        if self.found is None:
            self._refresh()

    def _refresh(self) -> None:
        found, opened = self.found, bool(self.sessions)
        self.name.setText(self.sessions[0].path.name if opened else "")
        lacks = lacking(self.sessions[0]) if opened else ""
        self.panel.analyse.setEnabled(self._can_analyse())
        self.panel.analyse.setToolTip((lacks or "Ctrl+Return") if opened else "No session is open.")
        self.panel.set_ready(found is not None, "There is no fit yet: analyse first.")
        if found is None:
            text = ("" if self._under_way else lacks or NOT_YET) if opened else NO_SESSION
            title = "Nothing to fit" if lacks else "Not analysed yet"
            self.empty.say(self._under_way or title, text, opened)
            self.panel.show_runs((), "")
            self.pages.setCurrentWidget(self.empty)
        else:
            self.view.show_inspection(found)
            self.panel.show_runs(tuple(found.views), _remarks(found, len(self.sessions)))
            self.view.show_run(self.panel.run.currentText())
            self.pages.setCurrentWidget(self.view)
        self.context.commands_changed.emit()


def lacking(session: Session) -> str:
    """Why nothing of a session can be fitted here; empty where something can."""
    try:
        on_air_runs(session)
    except UserError:
        said = NOTHING_TO_FIT.format(file=session.path.name)
        alone = all(run.phase == "motor_bench" for run in session.runs)
        return said + AXIS_ALONE.format(mass=line_units([session]).called("inertia")) if alone else said
    return ""


def _remarks(found: Inspection, sessions: int) -> str:
    words = ["± is half the 90 % interval."]
    if sessions > 1:
        words.append("Of the open sessions, the first is fitted.")
    if found.fit.skipped:
        names = ", ".join(name for name, _ in found.fit.skipped)
        reasons = " or ".join(dict.fromkeys(reason for _, reason in found.fit.skipped))
        words.append(f"Not used: {names} ({reasons}).")
    return " ".join(words)
