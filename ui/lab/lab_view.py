"""The Model lab put together. Any frame can host it: it needs a controller and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QSize, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QPushButton, QStackedWidget, QWidget

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.answer.error_parts import Comparison, equation_of
from fingerlab.diagnosis.answer.residual_profiles import Profile, full_rate, stretches_in, worst_run
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.models.file import View
from fingerlab.report.budget_words import bin_words
from fingerlab.report.diagnosis_words import not_shown
from fingerlab.sessions.model import Array

from ..widgets.layout import FLUSH, GAP, Panes, Spacer, described, hbox, vbox
from ..widgets.theme import small_font
from .candidates import CandidatesPanel
from .comparison_bar import ComparisonBar, LegendRow
from .comparison_plot import ComparisonPlot
from .controller import LabController, ModelStep
from .error_path import PathPanel
from .evidence import EvidencePanel
from .lab_frame import BetterModelBanner, StepsColumn
from .model_dialogs import ScorePartsDialog
from .parameters import ParametersPanel
from .path_fold import PathFold
from .residual_profiles import ProfilePanel
from .result_words import best_choice, find_candidate, step_results
from .validation import ValidationPanel

if TYPE_CHECKING:
    from .budget import BudgetDialog
    from .model_dialogs import SideBySideDialog

STEPS_WIDTH = 152


class LabView(QWidget):
    """Steps at the left; plots above, candidates and evidence in the middle, error path below where it fits.

    Signals ``report_asked``; ``looked_elsewhere``: another equation, run or time is shown.
    """

    report_asked = Signal()
    looked_elsewhere = Signal()

    def __init__(self, controller: LabController, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.controller = controller
        self.steps = StepsColumn()
        self.bar = ComparisonBar()
        self.legend = LegendRow()
        self.plot = ComparisonPlot()
        self.candidates = CandidatesPanel()
        self.evidence = EvidencePanel()
        self.where = ProfilePanel()
        self.validation = ValidationPanel()
        self.path = PathPanel()
        self.better = BetterModelBanner()
        self.parameters = ParametersPanel()
        self.numbers = described(QPushButton("Parameters"), "showParameters", font=small_font(), link="true")
        self.numbers.setToolTip("Every number of the model, with bounds and source: move it, hold it (F9).")
        self._shown_step: ModelStep | None = None
        self._parts: ScorePartsDialog | None = None
        self._budget: BudgetDialog | None = None
        self._beside: SideBySideDialog | None = None
        self._recorded: tuple[tuple[str, ...], tuple[Array, Array] | None] = ((), None)
        self._build()
        self._connect()
        self.refresh()

    def _build(self) -> None:
        upper = self._upper = QWidget()
        vbox(upper, self.bar, self.legend, (self.plot, 1), margins=FLUSH, spacing=4)
        self.right = QStackedWidget()
        for panel in (self.evidence, self.where, self.validation):
            self.right.addWidget(panel)
        middle = self._middle = QWidget()
        beside = QWidget()
        hbox(beside, (self.candidates, 4), (self.right, 5), margins=FLUSH, spacing=16)
        self.below = QStackedWidget()
        for page in (beside, self.parameters):
            self.below.addWidget(page)
        vbox(middle, self.better, (self.below, 1), margins=(0, 4, 0, 4), spacing=4)
        self.fold = PathFold(self.path, self.below)
        parts = ((upper, 11), (middle, 9), (self.fold, 4))
        self.panes = Panes("model_lab", parts, (360, 272, 100))
        self.steps.setFixedWidth(max(STEPS_WIDTH, self.steps.width_of_score()))
        self._column = vbox(None, self.steps, self.numbers, self.fold.link, Spacer(1))
        hbox(self, self._column, (self.panes, 1), margins=(GAP, GAP, GAP, GAP), spacing=GAP)

    def _connect(self) -> None:
        self.steps.chosen.connect(self.go_to)
        self.bar.changed.connect(self._show_comparison)
        self.bar.changed.connect(self.looked_elsewhere)
        self.plot.top.getViewBox().sigXRangeChanged.connect(lambda *_: self.looked_elsewhere.emit())
        self.plot.pointed.connect(self.legend.show_values)
        self.plot.stretch_named.connect(self.legend.name_stretch)
        self.plot.place_named.connect(self.legend.name_place)
        self.plot.recorded_named.connect(self.legend.name_recorded)
        self.plot.aside_named.connect(self.legend.name_aside)
        self.steps.score_asked.connect(self.show_score_parts)
        self.where.place_chosen.connect(self._on_place)
        self.candidates.chosen.connect(self._on_candidate)
        self.candidates.add_asked.connect(self.controller.add)
        self.better.exchange_asked.connect(self.controller.exchange)
        self.better.take_off_asked.connect(self.controller.take_off)
        self.path.undo_asked.connect(self.controller.undo)
        self.path.redo_asked.connect(self.controller.redo)
        self.validation.runs.run_chosen.connect(lambda run: self.bar.go_to(self.bar.equation() or "", run))
        self.validation.report_asked.connect(self.report_asked)
        self.numbers.clicked.connect(self.show_parameters)
        self.fold.asked.connect(self.show_path)
        self.parameters.moved.connect(self._show_comparison)
        self.parameters.refit_asked.connect(self.controller.hold)
        self.parameters.closed.connect(self.leave_parameters)
        self.parameters.kept.connect(self.controller.keep_moved)
        self.controller.result_changed.connect(self.refresh)
        self.controller.activity_changed.connect(self._on_activity)
        self.controller.first_look_changed.connect(self._on_first_look)

    # room

    def _height(self, folded: bool) -> int:
        """What the parts beside the steps need above one another, px."""
        parts = [self._upper.minimumSizeHint().height(), self._middle.minimumSizeHint().height()]
        parts += [] if folded else [self.fold.needed]
        return sum(parts) + self.panes.handleWidth() * (len(parts) - 1) + 2 * GAP

    def minimumSizeHint(self) -> QSize:
        column = self._column.minimumSize().height() + 2 * GAP
        return QSize(super().minimumSizeHint().width(), max(self._height(folded=True), column))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share_height()

    def event(self, event: QEvent) -> bool:
        done = super().event(event)
        if event.type() == QEvent.Type.LayoutRequest:  # words that wrap need another height
            self._share_height()
        return done

    def _share_height(self) -> None:
        self.fold.fold(self.height() < self._height(folded=False))
        if not self.fold.folded and self.below.currentWidget() is self.fold.page:
            self.below.setCurrentIndex(0)

    def show_path(self) -> None:
        """The error path in place of the candidates where it is folded, or these again."""
        shown = self.below.currentWidget() is self.fold.page
        if self.shows_parameters:
            self.leave_parameters()
        self.below.setCurrentIndex(0 if shown else self.below.indexOf(self.fold.page))

    def refresh(self) -> None:
        """Show the controller's present diagnosis."""
        history = self.controller.history
        if history is None:
            self._shown_step = None
            self._recorded = ((), None)
            for dialog in (self._parts, self._budget, self._beside):
                if dialog is not None:
                    dialog.hide()
            self.parameters.show_model(None, None)
            self.below.setCurrentIndex(0)
            self.numbers.hide()
            self.bar.show_comparisons((), (), None)
            self.plot.show_comparison(None, None, keep_view=False)
            self.candidates.show_diagnosis(None)
            self.better.show_diagnosis(None)
            self.evidence.show_choice(None, None)
            self.where.show_equation((), None)
            self.path.show_history(None)
            self.validation.show_history(None)
            self.steps.set_results({})
            self.steps.set_current("compare")
            return
        diagnosis = history.now.diagnosis
        first_look = self._shown_step is None
        self._shown_step = history.now
        self.numbers.show()
        self._lay_out()
        failure = diagnosis.failure
        wanted = (failure.equation, failure.run) if first_look and failure is not None else None
        self.bar.show_comparisons(diagnosis.comparisons, self.controller.sessions, wanted)
        self.candidates.show_diagnosis(diagnosis)
        for dialog in (self._parts, self._budget):
            if dialog is not None and dialog.isVisible():
                dialog.show_diagnosis(diagnosis)
        self.better.show_diagnosis(diagnosis)
        self.evidence.show_choice(best_choice(diagnosis), diagnosis)
        self.path.show_history(history)
        self.path.path.show_forecast(best_choice(diagnosis))
        pressed = any(run.phase == "contact" for one in self.controller.sessions for run in one.runs)
        radius = self.controller.sessions[0].rig.line_radius if self.controller.sessions else 0.0
        self.validation.show_history(history, pressed, radius)
        self.steps.set_results(step_results(diagnosis, history))
        if history.now.added or diagnosis.verdict == Verdict.NOTHING_MISSING:
            self.steps.set_current("true")
        else:
            self.steps.set_current("missing" if diagnosis.verdict == Verdict.NOT_IN_CATALOGUE else "add")
        # Where nothing is missing but not all was visible, the proposed run is what to look at next.
        validation = history.now.added or not_shown(diagnosis)
        self.right.setCurrentWidget(self.validation if validation else self.evidence)
        if first_look:
            self.candidates.view.setFocus()

    def show_parameters(self) -> None:
        """The table of parameters in place of the candidates."""
        if self.controller.diagnosis is not None:
            self.below.setCurrentWidget(self.parameters)
            self._lay_out()
            self.parameters.table.setFocus()

    def leave_parameters(self) -> None:
        """The candidates again, and the model as it was fitted."""
        self.parameters.show_model(None, None)
        self.below.setCurrentIndex(0)
        self._show_comparison()

    @property
    def shows_parameters(self) -> bool:
        """Whether the table of parameters stands below the plots."""
        return self.below.currentWidget() is self.parameters

    def _lay_out(self) -> None:
        """Have the present model's parameters laid out, if they are looked at."""
        if not self.shows_parameters:
            return
        diagnosis, project = self.controller.diagnosis, self.controller.project
        moved = project.moved if project is not None else ()
        self.parameters.show_model(None, diagnosis)
        self.controller.lay_out(lambda found: self.parameters.show_model(found, diagnosis, moved))

    def show_score_parts(self) -> None:
        """What the error of the present model is made of, in a window of its own."""
        diagnosis = self.controller.diagnosis
        if diagnosis is None:
            return
        if self._parts is None:
            self._parts = ScorePartsDialog(self)
            self._parts.part_chosen.connect(self.bar.go_to)
        self._parts.show_diagnosis(diagnosis)
        self._parts.show()
        self._parts.raise_()

    def show_budget(self) -> None:
        """What would mend the errors of the present model, in a window of its own."""
        from .budget import BudgetDialog

        diagnosis = self.controller.diagnosis
        if diagnosis is None:
            return
        if self._budget is None:
            self._budget = BudgetDialog(self)
        self._budget.show_diagnosis(diagnosis)
        self._budget.show()
        self._budget.raise_()

    def show_side_by_side(self) -> None:
        """Two of the models that were fitted to these sessions, in a window of their own."""
        from .model_dialogs import SideBySideDialog

        history = self.controller.history
        if history is None:
            return
        if self._beside is None:
            self._beside = SideBySideDialog(self)
            self._beside.chosen.connect(self.controller.go_to)
        self._beside.show_models(self.controller.known, history.now.key, self.bar.comparison())
        self._beside.show()
        self._beside.raise_()

    def go_to(self, step: str) -> None:
        """Go to a step of the work: show what it is about and put the keyboard there."""
        self.steps.set_current(step)
        diagnosis = self.controller.diagnosis
        if diagnosis is None:
            return
        if self.shows_parameters:
            self.leave_parameters()
        self.below.setCurrentIndex(0)
        self.right.setCurrentWidget({"true": self.validation, "where": self.where}.get(step, self.evidence))
        self._show_where()
        if step == "compare":
            self.plot.show_whole()
            self.plot.setFocus()
        elif step == "where":
            if diagnosis.failure is not None:
                self.bar.go_to(diagnosis.failure.equation, diagnosis.failure.run)
                self.plot.show_stretch()
            self.where.plot.setFocus()
        elif step == "missing":
            self.candidates.choose(best_choice(diagnosis))
            self.candidates.view.setFocus()
        elif step == "add":
            target = self.candidates.add_button
            (target if target.isEnabled() else self.candidates.view).setFocus()
        else:
            self.validation.report.setFocus()

    @property
    def looked_at(self) -> View:
        """The equation, run and time that are shown, for the project."""
        comparison = self.bar.comparison()
        if comparison is None:
            return View()
        start, stop = self.plot.top.viewRange()[0]
        whole = self.plot.shows_whole()
        ends = (0.0, 0.0) if whole else (float(start), float(stop))
        return View(comparison.equation, comparison.run, *ends)

    def look_at(self, view: View) -> None:
        """Show what was shown before; what is not there any more leaves all as it is."""
        self.bar.go_to(view.equation, view.run)
        if view.stop > view.start:
            self.plot.top.setXRange(view.start, view.stop, padding=0)

    def show_what_gave_it_away(self, effects: Sequence[str]) -> None:
        """The fingerprint of a revealed effect, as it was while no model had it."""
        history = self.controller.history
        if history is None:
            return
        for step in history.done:
            found = [e for e in effects if e not in step.added and find_candidate(step.diagnosis, e)]
            if found:
                self.evidence.show_choice(found[0], step.diagnosis)
                candidate = find_candidate(step.diagnosis, found[0])
                seen = candidate is not None and candidate.detectable
                prefix = "What gave it away" if seen else "Not to be seen in these data"
                self.evidence.title.setText(f"{prefix}: {self.evidence.title.text()}")
                self.right.setCurrentWidget(self.evidence)
                self.steps.set_current("missing")
                return

    def _show_comparison(self) -> None:
        history, comparison = self.controller.history, self.bar.comparison()
        if history is None or comparison is None:
            self.plot.show_comparison(None, None, keep_view=False)
            return
        diagnosis = history.now.diagnosis
        before = self.plot.comparison
        same = before is not None and (before.equation, before.session, before.run) == (
            comparison.equation,
            comparison.session,
            comparison.run,
        )
        self.plot.show_comparison(
            self.parameters.comparison(comparison) or comparison, diagnosis.failure, keep_view=same
        )
        self.plot.show_full_rate(self._full_rate(comparison))
        self._show_where()
        family = equation_of(comparison.equation).family
        now = diagnosis.errors.get(family)
        first = history.first.diagnosis.errors.get(family, now)
        moved = self.parameters.errors_of(family)
        self.bar.show_error(*(moved or (first, now)), what_if=moved is not None)

    def _full_rate(self, comparison: Comparison) -> tuple[Array, Array] | None:
        """The measured side as it was recorded; read once for each curve shown."""
        key = (comparison.equation, comparison.session, comparison.run)
        if self._recorded[0] != key:
            run = self.bar.run()
            try:
                found = full_rate(comparison, run) if run is not None else None
            except UserError:  # the file has gone since; what was compared stays
                found = None
            self._recorded = (key, found)
        return self._recorded[1]

    def _show_where(self) -> None:
        """The panel is filled when it is looked at: eight pictures are not made for nobody."""
        diagnosis = self.controller.diagnosis
        if diagnosis is not None and self.right.currentWidget() is self.where:
            self.where.show_run(self.bar.comparison())
            self.where.show_equation(diagnosis.comparisons, self.bar.equation())

    def _on_place(self, found: Profile, number: int) -> None:
        """Show a place that the user chose in the curves, of the run shown or else of the worst one there."""
        diagnosis, shown = self.controller.diagnosis, self.bar.comparison()
        if diagnosis is None or shown is None:
            return
        runs = [one for one in diagnosis.comparisons if one.equation == found.equation]
        here = [one for one in runs if (one.session, one.run) == (shown.session, shown.run)]
        if not any(stretches_in(found, number, one) for one in here):
            worst = worst_run(found, number, runs)
            if worst is None:
                return
            self.bar.go_to(worst.equation, worst.run)
            here = [one for one in runs if (one.session, one.run) == (worst.session, worst.run)]
        self.plot.show_whole()
        places = [stretch for one in here for stretch in stretches_in(found, number, one)]
        self.plot.show_places(places, bin_words(found, number))

    def _on_candidate(self, key: str) -> None:
        self.path.path.show_forecast(key)
        self.evidence.show_choice(key, self.controller.diagnosis)
        self.right.setCurrentWidget(self.evidence)

    def _on_first_look(self) -> None:
        history, look = self.controller.history, self.controller.first_look
        if history is not None and look is not None:
            self.path.show_first_look(history, look)
        else:
            self.path.show_history(history)

    def _on_activity(self) -> None:
        self.candidates.set_busy(self.controller.tasks.busy)
        self.better.set_busy(self.controller.tasks.busy)
        self.parameters.set_busy(self.controller.tasks.busy)
