"""The Predict tab: forces of any number of models beside the load cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QFileDialog, QStackedWidget, QWidget

from fingerlab.core.errors import UserError
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel, load_model

from ..app.context import ApplicationContext
from ..app.tab_registry import Command, Tab, run_commands
from ..app.undo import UndoSteps
from ..app.worker import IsCancelled, Progress
from ..widgets.fields import ViewChoice
from ..widgets.layout import FLUSH, Panes, described, fix_width, hbox, vbox
from ..widgets.tables import ElidedLabel, EmptyPage, header_name
from ..widgets.theme import small_font
from .force_panel import PANEL_WIDTH, ForceTable, PredictPanel
from .force_plots import ForcePlot, PeriodPlot, SweepPlot
from .wanted_force import WantedView

if TYPE_CHECKING:
    from fingerlab.prediction.comparing import ModelComparison, ModelForces
    from fingerlab.sessions.model import Session

    from .force_panel import ModelsDialog

MODEL_FILTER = "Model files (*.json)"
OWNER = "predict"
NO_SESSION = (
    "Open a session with contact runs and add model files. Measured and modelled endpoint force will stand "
    "here, raw and normalised, with peaks, delay, R² and error by phase, for any number of models."
)
NO_MODEL = (
    "Add a model file: one that the Fit tab saved predicts by the thesis' equation; one that the Model lab "
    'saved predicts with its effects and a 90 % interval. "Predict the force" in the Model lab brings its '
    "model here without a file."
)
VIEWS = (
    ("measured", "&Measured force", "Forces by the models beside the load cell (Alt+1)."),
    ("wanted", "&Wanted force", "The other way round: the torque that a wanted force needs (Alt+2)."),
)
PREDICTING = "Predicting the force in"
WAITS = "A session with contact runs is needed to predict with {files}."
NO_CONTACT = (
    "{file} has no contact run with a cable, whose endpoint force could be predicted or wanted; {models} "
    "will wait for a session that has one."
)


class PredictTab(Tab):
    """Asks :func:`predict_beside` and shows what comes back."""

    history: UndoSteps[tuple[dict[str, SavedModel], ModelForces | None]]

    def __init__(self, context: ApplicationContext) -> None:
        super().__init__(context)
        self.sessions: tuple[Session, ...] = ()
        self.models: dict[str, SavedModel] = {}
        self.found: ModelForces | None = None
        self._compared: ModelsDialog | None = None
        self._due = self._shown = False
        self.history = UndoSteps(self)
        self._given: tuple[object, object] = ((), ())
        self.panel = PredictPanel()
        self.force, self.period, self.sweep = ForcePlot(), PeriodPlot(), SweepPlot()
        self.numbers = ForceTable()
        self.header = self.name = header_name("predictSession", "Session whose force is predicted")
        self.widget, self.pages = QWidget(), QStackedWidget()
        self.empty = EmptyPage("predictEmpty", context.open_asked)
        self.wanted = WantedView(context, self)
        self._build()
        self.widget.installEventFilter(self)
        self.panel.add_asked.connect(self.ask_and_add)
        context.model_handed.connect(lambda model, name: self._predict({**self.models, name: model}))
        self.panel.remove_asked.connect(self.remove)
        self.panel.changed.connect(self._show_choice)
        self._under_way = ""
        context.tasks.started.connect(self._on_started)
        context.tasks.ended.connect(lambda _how: self._on_started(""))
        self.commands = (
            Command("&Add model files…", self.ask_and_add, "Ctrl+M"),
            Command("Com&pare on runs left out…", self.compare, None, self._comparable),
            *run_commands(lambda: self.panel.run, lambda: self.found is not None),
            Command("&Measured force", lambda: self.views.choose("measured"), "Alt+1"),
            Command("&Wanted force", lambda: self.views.choose("wanted"), "Alt+2"),
            Command("Whole run", self.force.show_whole, "Alt+Home", lambda: self.found is not None),
            Command("&Cursors A and B", self.force.toggle_cursors, None, lambda: self.found is not None),
        )
        self._refresh()

    def _build(self) -> None:
        middle = QWidget()
        hbox(middle, self.period, self.sweep, margins=FLUSH)
        upper, self.read = QWidget(), described(ElidedLabel(), "forceRead", font=small_font())
        self.read.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.force.read.connect(self._show_read)
        self.read.hide()
        vbox(upper, self.read, (self.force, 1), margins=FLUSH, spacing=0)
        parts = ((upper, 6), (middle, 5), (self.numbers, 3))
        self.panes = Panes("predict", parts, (270, 230, 190))
        for panes in (self.panes, self.wanted.widget):
            panes.remember(self.context.settings)
        for page in (self.empty, self.panes, self.wanted.widget):
            self.pages.addWidget(page)
        self.views = ViewChoice(VIEWS)
        self.views.chosen.connect(lambda _key: self._refresh())
        self.sides = QStackedWidget()
        self.sides.addWidget(self.panel)
        self.sides.addWidget(self.wanted.panel)
        side = QWidget()
        vbox(side, self.views, (self.sides, 1), margins=(8, 0, 0, 0), spacing=8)
        fix_width(side, PANEL_WIDTH)
        hbox(self.widget, (self.pages, 1), side, margins=(8, 8, 8, 8))

    def _show_read(self, wordings: tuple[str, ...]) -> None:
        """What two cursors read, in the longest wording that has room."""
        self.read.set_texts(wordings or ("",))
        self.read.setVisible(bool(wordings))

    # what the frame asks

    def window_title(self) -> str:
        return self.sessions[0].path.name if self.sessions else ""

    def figure_source(self, plot: QWidget) -> str:
        from fingerlab.report.recording_words import figure_source

        if not self.sessions:
            return ""
        return figure_source(self.sessions[0], ", ".join(self.models), (self.panel.run.currentText(),))

    def on_shown(self) -> None:
        self._shown = True
        if self._due:
            self._predict(self.models)
        self._refresh()

    def on_hidden(self) -> None:
        self._shown = False
        self.wanted.set_shown(False)

    def on_session_opened(self, sessions: tuple[Session, ...]) -> None:
        self.sessions, self.found = sessions, None
        self.history.forget()  # they are of another session
        self._due = bool(sessions and self.models)
        self._refresh()
        if self._due and self._shown:
            self._predict(self.models)

    def accept_files(self, paths: Sequence[Path]) -> bool:
        if not all(path.suffix.lower() == ".json" for path in paths):
            return False
        self.add_files(paths)
        return True

    # models

    def ask_and_add(self) -> None:
        """Add model files chosen in a dialog."""
        folder = self.context.settings.folder()
        names, _ = QFileDialog.getOpenFileNames(self.widget, "Add model files", folder, MODEL_FILTER)
        if names:
            self.add_files([Path(name) for name in names])

    def add_files(self, paths: Sequence[Path]) -> None:
        """Read model files and predict with them; one of the same name takes the other's place."""
        self.context.hush()
        try:
            added = {path.name: load_model(path) for path in paths}
        except UserError as error:
            self.context.tell(str(error))
            return
        self._predict({**self.models, **added})

    def undo(self) -> None:
        """The models as they were before one was added or removed."""
        if self.can_undo:
            self.models, self.found = self.history.back((self.models, self.found))
            self._refresh()

    def redo(self) -> None:
        if self.can_redo:
            self.models, self.found = self.history.forth((self.models, self.found))
            self._refresh()

    def _note(self) -> None:
        """Other models are about to be there."""
        self.history.add((dict(self.models), self.found))

    def remove(self, file: str) -> None:
        """Take a model off the list; what the others predict is kept."""
        self._note()
        self.models = {name: model for name, model in self.models.items() if name != file}
        if self.found is not None:
            kept = {n: f for n, f in self.found.forces.items() if n.partition(": ")[0] in self.models}
            self.found = replace(self.found, forces=kept) if kept else None
        self._refresh()

    def _predict(self, models: Mapping[str, SavedModel]) -> None:
        if not self.sessions or not self.sessions[0].contact_runs():
            self.models, self._due = dict(models), False
            self._refresh()
            return
        opened, given = self.sessions, dict(models)
        self._due = False

        def work(progress: Progress, cancelled: IsCancelled) -> ModelForces:
            from fingerlab.prediction.comparing import predict_beside

            return predict_beside(opened[0], given, progress)

        def done(found: ModelForces) -> None:
            if self.sessions is opened:
                if given != self.models:
                    self._note()
                self.models, self.found = given, found
                self._refresh()

        self.context.tasks.start(f"{PREDICTING} {opened[0].path.name}", work, done, OWNER)

    def _on_started(self, title: str) -> None:
        """Say that the force is being predicted, where none is shown yet."""
        self._under_way = title if title.startswith(PREDICTING) else ""
        if self.found is None:
            self._refresh()

    def _comparable(self) -> bool:
        return bool(self.sessions) and any(one.method == DIAGNOSIS_METHOD for one in self.models.values())

    def compare(self) -> None:
        """The models with effects on runs that their values have not seen, in a window of its own."""
        if not self._comparable():
            return
        session = self.sessions[0]
        given = {name: one for name, one in self.models.items() if one.method == DIAGNOSIS_METHOD}

        def work(progress: Progress, cancelled: IsCancelled) -> ModelComparison:
            from fingerlab.prediction import extended_model
            from fingerlab.prediction.comparing import compare_models

            return compare_models(session, {n: extended_model(one, n) for n, one in given.items()}, progress)

        self.context.hush()
        self.context.tasks.start(
            f"Comparing models on {session.path.name}", work, self.show_comparison, OWNER
        )

    def show_comparison(self, found: ModelComparison) -> None:
        """Show models that were compared."""
        from .force_panel import ModelsDialog

        if self._compared is None:
            self._compared = ModelsDialog(self.widget)
        self._compared.show_comparison(found)
        self._compared.show()
        self._compared.raise_()

    # what is shown

    def _refresh(self) -> None:
        found, opened = self.found, bool(self.sessions)
        self.name.setText(self.sessions[0].path.name if opened else "")
        self.panel.set_next(opened and found is None and bool(self.sessions[0].contact_runs()))
        if found is None:
            waits = bool(self.models)
            lacks = opened and not self.sessions[0].contact_runs()
            no_force = "No force predicted" if waits else "No model yet"
            text = WAITS.format(files=", ".join(self.models)) if waits else NO_MODEL
            text = text if opened or waits else NO_SESSION
            if lacks:
                no_force = "No force to predict"
                text = NO_CONTACT.format(
                    file=self.sessions[0].path.name, models=", ".join(self.models) or "models"
                )
            text = "" if opened and self._under_way else text
            self.empty.say(self._under_way or no_force, text, opened)
            self.panel.show_models((), (), ())
            self.pages.setCurrentIndex(0)
        else:
            self.panel.show_models(tuple(found.forces), found.preferred, found.runs)
            self.pages.setCurrentIndex(1)
        self._show_wanted(found is not None)
        self._show_choice()
        self.context.commands_changed.emit()

    def _show_wanted(self, predicted: bool) -> None:
        """The view that is chosen, and whether it has something to work with."""
        wanted = self.views.current == "wanted"
        self.sides.setCurrentIndex(1 if wanted else 0)
        if wanted and predicted:
            self.pages.setCurrentIndex(2)
        given = (self.sessions, tuple(self.models.values())) if predicted else ((), ())
        if given != self._given:
            self._given = given
            self.wanted.take(self.sessions[0] if predicted else None, self.models if predicted else {})
        self.wanted.set_shown(wanted and predicted and self._shown)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.PaletteChange:
            self._show_choice()  # the samples of the lines, in the colours of now
        return False

    def _show_choice(self) -> None:
        found, run = self.found, self.panel.run.currentText()
        shown = {}
        if found is not None:
            shown = {
                name: (one, found.forces[name][run])
                for name, one in self.panel.ticked().items()
                if run in found.forces[name]
            }
        for part in (self.force, self.period, self.sweep, self.numbers):
            part.show_forces(shown)
