"""The Model lab as a tab: nothing open, waiting for the first comparison, or the lab itself."""

from __future__ import annotations

import traceback
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, QTimer, SignalInstance
from PySide6.QtWidgets import QFileDialog, QWidget

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.answer.error_parts import EQUATIONS
from fingerlab.report.line_units import line_units

from ..app.context import ApplicationContext
from ..app.tab_registry import SEPARATOR, Command, Tab, run_commands
from ..app.worker import IsCancelled, Progress
from ..widgets.layout import OnePage
from . import practice, validation
from .controller import DiagnoseCall, LabController
from .lab_frame import STEPS, LabHeader, LabStartPage, WaitingPage
from .result_words import sessions_text
from .validation import ResultActions

if TYPE_CHECKING:
    from fingerlab.diagnosis.draft.laws import DraftLaw
    from fingerlab.sessions.model import Session

    from .lab_view import LabView
    from .parameters import ParametersPanel

GLANCE_MS = 400
"""A view that has stayed so long is kept."""
REPORT_FILTER = "Web page (*.html);;PDF (*.pdf)"


class ModelLabTab(Tab):
    """Composes the lab; all that it shows comes from the controller."""

    def __init__(self, context: ApplicationContext, diagnose: DiagnoseCall | None = None) -> None:
        super().__init__(context)
        self.controller = LabController(context.tasks, diagnose, self)
        self.empty = LabStartPage()
        self.waiting = WaitingPage()
        self._view: LabView | None = None
        self.pages = OnePage()
        for page in (self.empty, self.waiting):
            self.pages.addWidget(page)
        self.widget = self.pages
        self.actions = ResultActions(context, self.controller, self.pages)
        self.header = self.bar = LabHeader()
        self.commands = self._commands()
        self._shown = self._waits = False
        self._recording = self._answer = ""
        self._glance = QTimer(self, singleShot=True, interval=GLANCE_MS)
        self._glance.timeout.connect(self._keep_view)
        self._connect()
        self._refresh()

    def _connect(self) -> None:
        context = self.context
        self.bar.open_asked.connect(context.open_asked)
        self.bar.report_asked.connect(self.save_report)
        self.bar.reveal_asked.connect(self.reveal)
        self.empty.open_asked.connect(context.open_asked)
        self.empty.practise_asked.connect(self.practise)
        self.empty.connect_asked.connect(lambda: context.show_tab("acquire"))
        self.empty.example_asked.connect(lambda name: practice.show_example(context, name))
        self.empty.recent_asked.connect(lambda path: context.open_paths([Path(path)]))
        self.waiting.compare_asked.connect(self.controller.compare)
        for signal in self._changes():
            signal.connect(self._refresh)
        self.controller.restored.connect(self._on_restored)
        self.controller.kept_badly.connect(context.tell)
        context.tasks.progressed.connect(self._on_progress)
        context.tasks.started.connect(self._on_started)
        context.tasks.ended.connect(lambda _how: self._on_started(""))

    def _changes(self) -> tuple[SignalInstance, ...]:
        controller = self.controller
        return controller.sessions_changed, controller.result_changed, controller.activity_changed

    @property
    def view(self) -> LabView:
        """The lab itself; made for the first session, since the window opens sooner without its plots."""
        return self._view or self._make_view()

    def _make_view(self) -> LabView:
        from .lab_view import LabView

        self._view = view = LabView(self.controller)
        view.panes.remember(self.context.settings)
        self.pages.addWidget(view)
        view.report_asked.connect(self.save_report)
        view.candidates.own_asked.connect(self.write_own_effect)
        view.looked_elsewhere.connect(self._glance.start)
        view.parameters.history.changed.connect(self.context.commands_changed)
        view.validation.hand_asked.connect(self.actions.hand_experiment)
        view.validation.predict_asked.connect(self.actions.predict)
        view.validation.save_asked.connect(self.actions.ask_and_save)
        for signal in self._changes():  # the tab after the view, whose buttons it asks
            signal.disconnect(self._refresh)
            signal.connect(self._refresh)
        return view

    def _commands(self) -> tuple[Command, ...]:
        compared = self._compared
        steps = (
            Command(title, lambda s=step: self.view.go_to(s), f"F{number}", compared)  # type: ignore[misc]
            for number, (step, (title, _)) in enumerate(STEPS.items(), start=2)
        )
        equations = (
            Command(
                words.title,
                lambda e=equation: self.view.bar.choose_equation(e),  # type: ignore[misc]
                f"Alt+{number}",
                lambda e=equation: e in self._equations(),  # type: ignore[misc]
                within="E&quation",
            )
            for number, (equation, words) in enumerate(EQUATIONS.items(), start=1)
        )
        return (
            *steps,
            SEPARATOR,
            *equations,
            SEPARATOR,
            *run_commands(lambda: self.view.bar.runs, compared),
            Command("What the &error is made of…", lambda: self.view.show_score_parts(), "F7", compared),
            Command("What would &mend the error…", lambda: self.view.show_budget(), "Shift+F7", compared),
            Command("&Draft a law for what is missing…", self.draft_a_law, None, compared),
            Command("Whole run", lambda: self.view.plot.show_all(), "Alt+Home", compared),
            Command(
                "&Fit the heights to what is shown", lambda: self.view.plot.fit_heights(), None, compared
            ),
            Command(
                "&Cursors A and B",
                lambda: self.view.plot.pair.show(self.view.plot.pair.times is None),
                None,
                compared,
                lambda: self._compared() and self.view.plot.pair.times is not None,
            ),
            SEPARATOR,
            Command(
                "&Add the chosen effect to the model",
                lambda: self.view.candidates.add_button.click(),
                "Ctrl+Return",
                compared,
            ),
            Command(
                "&Hand the proposed recording to Acquire",
                lambda: self.view.validation.hand.click(),
                None,
                self._proposed,
            ),
            Command(
                "&Predict the force with this model",
                lambda: self.view.validation.predict.click(),
                None,
                lambda: self._compared() and self.view.validation.predict.isEnabled(),
            ),
            Command("Save &model…", self.actions.ask_and_save, "Ctrl+Shift+M", compared),
            Command("&Open a saved model…", self.open_model, None, lambda: bool(self.controller.sessions)),
            Command("Models &tried…", self.show_tried, None, compared),
            Command("Models side &by side…", lambda: self.view.show_side_by_side(), "F8", compared),
            Command("Pa&rameters", lambda: self.view.show_parameters(), "F9", compared),
            Command("&Notes…", self.show_notes, None, compared),
            Command("&Save report page…", self.save_report, "Ctrl+S", compared),
            SEPARATOR,
            Command("&Practise on a hidden effect", self.practise),
            Command("Re&veal the hidden effect", self.reveal, None, self._sealed),
            SEPARATOR,
            Command("&Own effects…", self.show_own_effects),
        )

    def open_model(self) -> None:
        """Show the open sessions with the effects of a saved model."""
        name, _ = QFileDialog.getOpenFileName(
            self.widget, "Open a saved model", self.context.settings.folder(), validation.MODELS
        )
        if not name:
            return
        try:
            self.controller.wanted = validation.model_of(Path(name))
        except UserError as error:
            self.context.tell(str(error))
            return
        self.controller.compare()

    def show_tried(self) -> None:
        """Every model that was tried on these sessions; one can be shown again."""
        from .model_dialogs import TriedDialog

        project, history = self.controller.project, self.controller.history
        if project is not None and history is not None:
            dialog = TriedDialog(self.pages, project.tried, history.now.key)
            dialog.chosen.connect(self.controller.go_to)
            dialog.open()

    def show_notes(self) -> None:
        """Notes that are kept with the project."""
        from .model_dialogs import NotesDialog

        controller = self.controller
        if controller.project is None:
            return
        place = controller.project_path.name
        dialog = NotesDialog(self.pages, controller.project.notes, place)
        dialog.noted.connect(self._keep_notes)
        dialog.open()

    def _keep_notes(self, text: str) -> None:
        if self.controller.project is not None:
            self.controller.keep_project(replace(self.controller.project, notes=text))

    def _keep_view(self) -> None:
        project = self.controller.project
        if project is not None and self.controller.history is not None:
            looked_at = self.view.looked_at
            if looked_at != project.view:
                self.controller.keep_project(replace(project, view=looked_at))

    def _on_restored(self) -> None:
        project = self.controller.project
        if project is not None:
            self.view.look_at(project.view)
            with suppress(UserError):  # the seal is damaged; Reveal says so
                self._tell_answer()
            kept = self.controller.project_path.name
            self.context.say(f"As you left it: models, notes and view are from {kept}")

    def show_own_effects(self) -> None:
        """The folder of own effects, and which of its files may be run."""
        from .own_effects import OwnEffects

        OwnEffects(self.pages, self.context.settings.folder()).open()

    def write_own_effect(self) -> None:
        """A file to start an own effect from, with the equation in which the present model fails."""
        from .own_effects import OwnEffects

        diagnosis = self.controller.diagnosis
        failure = diagnosis.computed.failure if diagnosis is not None else None
        dialog = OwnEffects(self.pages, self.context.settings.folder())
        if failure is not None:
            dialog.start_from(failure.equation, failure.text)
        dialog.open()
        dialog.write_new()

    def draft_a_law(self) -> None:
        """Laws for what is missing and not in the catalogue, in a window of their own."""
        from .own_effects import DraftDialog

        def show(laws: tuple[DraftLaw, ...]) -> None:
            dialog = DraftDialog(self.pages)
            dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            dialog.own_asked.connect(self.write_drafted_effect)
            diagnosis = self.controller.diagnosis
            last = None if diagnosis is None else diagnosis.last
            dialog.show_laws(laws, last, line_units(self.controller.sessions))
            dialog.show()

        self.controller.draft(show)

    def write_drafted_effect(self, law: DraftLaw) -> None:
        """A file of an own effect that is a drafted law."""
        from fingerlab.diagnosis.draft.own_file import own_effect_text

        from .own_effects import OwnEffects

        dialog = OwnEffects(self.pages, self.context.settings.folder())
        dialog.start_from_law(lambda path: own_effect_text(path, law))
        dialog.open()
        dialog.write_new()

    # what the frame asks

    def window_title(self) -> str:
        sessions = self.controller.sessions
        return sessions[0].path.name if sessions else ""

    def figure_source(self, plot: QWidget) -> str:
        from fingerlab.report.diagnosis_words import model_words
        from fingerlab.report.recording_words import recorded_words

        diagnosis = self.controller.diagnosis
        if diagnosis is None:
            return ""
        model = model_words(diagnosis.model, diagnosis)
        return f"{recorded_words(self.controller.sessions)}; {model}"

    def on_shown(self) -> None:
        self._shown = True
        self._compare_if_due()

    def on_hidden(self) -> None:
        self._shown = False
        self._keep_view()

    def can_close(self) -> bool:
        self._keep_view()
        return True

    def on_session_opened(self, sessions: tuple[Session, ...]) -> None:
        self._keep_view()
        self._glance.stop()
        if sessions and self._view is None:
            self._make_view()  # so that it hears of them
        self._answer = ""
        self.controller.take(sessions)
        self._waits = bool(sessions)
        self._compare_if_due()

    def undo(self) -> None:
        """What was moved or marked in the table of parameters comes before the models."""
        if self._by_hand is not None and self._by_hand.history.can_undo:
            self._by_hand.undo()
        else:
            self.controller.undo()

    def redo(self) -> None:
        if self._by_hand is not None and self._by_hand.history.can_redo:
            self._by_hand.redo()
        else:
            self.controller.redo()

    @property
    def _by_hand(self) -> ParametersPanel | None:
        return self._view.parameters if self._view is not None and self._view.shows_parameters else None

    @property
    def can_undo(self) -> bool:
        if self._by_hand is not None and self._by_hand.history.can_undo:
            return True
        return self.controller.history is not None and self.controller.history.can_undo

    @property
    def can_redo(self) -> bool:
        if self._by_hand is not None and self._by_hand.history.can_redo:
            return True
        return self.controller.history is not None and self.controller.history.can_redo

    # practice and report

    def practise(self) -> None:
        """Simulate a session with a sealed effect and open it."""
        practice.start(self.context)

    def reveal(self) -> None:
        """Say which effect the practice session holds."""
        history = self.controller.history
        model = history.now.added if history is not None else ()
        fitted = history.now.diagnosis.parameters if history is not None else {}
        try:
            sealed = [session for session in self.controller.sessions if practice.is_sealed(session)]
            self.context.announce(" ".join(practice.reveal(session, model, fitted) for session in sealed))
            self.view.show_what_gave_it_away([e for s in sealed for e in practice.hidden_effects(s)])
            if sealed and self.controller.project is not None:
                self.controller.keep_project(replace(self.controller.project, revealed=True))
            self._tell_answer()
        except UserError as error:
            self.context.tell(str(error), traceback.format_exc())

    def _tell_answer(self) -> None:
        """Once it is revealed, what was hidden stands where the button was."""
        project = self.controller.project
        sealed = [session for session in self.controller.sessions if practice.is_sealed(session)]
        if project is not None and project.revealed and sealed:
            self._answer = "; ".join(dict.fromkeys(map(practice.answer_words, sealed)))
            self._refresh()

    def save_report(self) -> None:
        """Write the report page of what is open, off the GUI thread."""
        sessions, history = self.controller.sessions, self.controller.history
        if not sessions or history is None:
            return
        start = Path(self.context.settings.folder()) / f"{sessions[0].path.stem}.html"
        name, _ = QFileDialog.getSaveFileName(self.widget, "Save report page", str(start), REPORT_FILTER)
        if not name:
            return
        path, models = Path(name), [step.diagnosis.computed for step in history.done]

        def work(progress: Progress, cancelled: IsCancelled) -> Path:
            return validation.write_page(sessions, path, models, progress, cancelled)

        self.context.tasks.start(
            "Writing the report page",
            work,
            lambda done: self.context.announce(f"Report page saved: {done}", done),
        )

    # what is shown

    def _compare_if_due(self) -> None:
        """Sessions that were opened while another tab was in front wait until this one is looked at."""
        if self._waits and self._shown:
            self._waits = False
            self.controller.compare()

    def _on_progress(self, _share: float, what: str) -> None:
        self.waiting.show_state(True, what)
        self.empty.tell_recording(self._recording, what)

    def _on_started(self, title: str) -> None:
        ours = title.startswith((practice.TITLE, practice.EXAMPLE_TITLE))
        self._recording = title if ours else ""
        self.empty.show_recording(self._recording)

    def _proposed(self) -> bool:
        return self._compared() and self.view.validation.hand.isEnabled()

    def _compared(self) -> bool:
        return self.controller.history is not None

    def _equations(self) -> frozenset[str]:
        diagnosis = self.controller.diagnosis
        return frozenset(c.equation for c in diagnosis.comparisons) if diagnosis is not None else frozenset()

    def _sealed(self) -> bool:
        return not self._answer and any(practice.is_sealed(session) for session in self.controller.sessions)

    def _refresh(self) -> None:
        sessions, history = self.controller.sessions, self.controller.history
        self.bar.show_session(
            sessions_text(sessions) if sessions else "", self._sealed(), history is not None, self._answer
        )
        if not sessions:
            self.empty.show_recent(self.context.settings.recent())
            self.pages.setCurrentWidget(self.empty)
        elif history is None:
            self.waiting.show_state(self.context.tasks.busy, "")
            self.pages.setCurrentWidget(self.waiting)
        else:
            self.pages.setCurrentWidget(self.view)
        self.context.commands_changed.emit()
