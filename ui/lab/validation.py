"""After the search: does the model hold, what to record next, and where the result goes from here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QFileDialog, QHeaderView, QPushButton, QTableWidgetItem, QVBoxLayout, QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.files import put_in_place
from fingerlab.core.text import score_text
from fingerlab.diagnosis.answer.results import Diagnosis, HeldOutRuns
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.models.file import ModelKey
from fingerlab.report.diagnosis_words import (
    PHASE_WORDS,
    alone,
    as_good_sentence,
    could_hide,
    holds,
    in_sentence,
    judged_on,
    listed,
    needless_title,
    on_the_path,
    one_run,
    rivalled,
    unsure,
)
from fingerlab.report.recording_words import next_experiment_words, paired_sentence
from fingerlab.report.score_words import row_words
from fingerlab.sessions.model import Session

from ..app.context import ApplicationContext
from ..app.worker import IsCancelled, Progress, Work
from ..widgets.layout import WrappedRow, described
from ..widgets.tables import NumberTable, WholeLabel
from ..widgets.theme import large_font, small_font
from .controller import LabController, ModelHistory
from .result_words import error_texts, motor_words

if TYPE_CHECKING:
    from fingerlab.models.file import SavedModel

FLOORS = (
    "Error over all equations on these runs, in multiples of the floor (1.00), by fits that have not seen "
    "them; what the other runs leave open of the model's constants is allowed for."
)
COLUMNS = (
    (
        "Held-out runs",
        "Runs that were told the same motion; each is left out of the fit that is scored on it.",
    ),
    ("Nominal, × floor", f"{FLOORS} With the nominal model."),
    ("Now, × floor", f"{FLOORS} With the present model."),
)
LEAST_ROWS = 3
ROOM = 4
"""About the words of a row, px."""


class HeldOutTable(NumberTable):
    """One row a motion. Signal ``run_chosen(name)``: a click on it, or Enter, asks for its curves."""

    run_chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("heldOutRuns", "Error on held-out runs by motion", COLUMNS, parent=parent)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self._runs: list[str] = []
        self.cellClicked.connect(lambda row, _column: self.run_chosen.emit(self._runs[row]))
        self.cellActivated.connect(lambda row, _column: self.run_chosen.emit(self._runs[row]))
        self.setToolTip("A click on a row shows its curves above.")
        self.setWordWrap(False)  # a row is a line; one that is too long ends in … and is whole in its tooltip
        line = QFontMetrics(small_font()).height() + ROOM
        self.verticalHeader().setMinimumSectionSize(line)
        self.verticalHeader().setDefaultSectionSize(line)
        self.horizontalHeader().setFixedHeight(line + ROOM)
        self.setMinimumHeight((LEAST_ROWS + 1) * line + ROOM + 2 * self.frameWidth())

    def show_runs(
        self, nominal: Sequence[HeldOutRuns], now: Sequence[HeldOutRuns], radius: float = 0.0
    ) -> None:
        """Scores by the nominal and by the present model; without any the table is not seen.

        Args:
            radius: of the arc as which a linear axis is told, m; 0: it turns.
        """
        self.setVisible(bool(now))
        self._runs = [one.runs[0] for one in now]
        single = [len(one.runs) for one in now] == [1]
        title = self.horizontalHeaderItem(0)
        assert title is not None
        title.setText("Run" if single else COLUMNS[0][0])
        title.setToolTip("The fit has seen it, for there is no other." if single else COLUMNS[0][1])
        before = {one.runs: one.score for one in nominal}
        self.setRowCount(len(now))
        for row, one in enumerate(now):
            first = before.get(one.runs)
            texts = runs_text(one, radius), "–" if first is None else score_text(first), score_text(one.score)
            for column, text in enumerate(texts):
                item = QTableWidgetItem(text)
                side = Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
                item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
                item.setToolTip(COLUMNS[column][1] if column else whole_text(one, radius))
                self.setItem(row, column, item)


def runs_text(one: HeldOutRuns, radius: float = 0.0) -> str:
    """``001 · on air, extension, sine, 15°, 1 Hz``; of several the first is named."""
    first, *others = one.runs
    named = f"{first} and {len(others)} more" if others else first
    return f"{named} · {motion_text(one, radius)}"


def motion_text(one: HeldOutRuns, radius: float = 0.0) -> str:
    """What these runs have in common: phase, cable, what the motor was told."""
    cable = f", {one.cable}" if one.cable != "none" else ""
    change = f", {one.change}" if one.change else ""
    return f"{PHASE_WORDS.get(one.phase, one.phase)}{cable}, {motor_words(one.trajectory, radius)}{change}"


def whole_text(one: HeldOutRuns, radius: float = 0.0) -> str:
    """All that a row says, with every run."""
    return f"Run{'s' if len(one.runs) > 1 else ''} {listed(one.runs)} · {motion_text(one, radius)}"


FORCE = "endpoint_force"
"""Key of ``Diagnosis.errors``."""


class ValidationPanel(QWidget):
    """Words on the present model.

    Signals ``hand_asked``: the proposed recording; ``predict_asked``, ``save_asked``: with the present model;
    ``report_asked``.
    """

    report_asked = Signal()
    hand_asked = Signal()
    predict_asked = Signal()
    save_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.title = described(WholeLabel(), font=large_font(), role="heading")
        self.held_out = WholeLabel()
        self.next = described(WholeLabel(), font=small_font(), role="muted")
        self.runs = HeldOutTable()
        self.hand = _button("Hand it to Ac&quire", "handExperiment", "The proposed recording as a protocol.")
        self.predict = _button(
            "&Predict the force",
            "predictForce",
            "Endpoint force of the contact runs by this model, in Predict.",
        )
        self.save = _button(
            "Save mode&l…", "saveModel", "As a file, for Predict and 'fingerlab predict --model'."
        )
        self.report = _button(
            "Save report page…", "saveReport", "The whole comparison as one self-contained page (Ctrl+S)."
        )
        for button, signal in (
            (self.hand, self.hand_asked),
            (self.predict, self.predict_asked),
            (self.save, self.save_asked),
            (self.report, self.report_asked),
        ):
            button.clicked.connect(signal)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        for widget in (self.title, self.held_out, self.next):
            layout.addWidget(widget)
        layout.addWidget(WrappedRow((self.hand, self.predict, self.save, self.report)))
        layout.addWidget(self.runs, 1)
        layout.addStretch()

    def show_history(self, history: ModelHistory | None, pressed: bool = False, radius: float = 0.0) -> None:
        """Say how the present model does on runs that the fit has not seen; ``pressed``: some in contact.

        Args:
            radius: of the arc as which a linear axis is told, m; 0: it turns.
        """
        if history is None:
            for label in (self.title, self.held_out, self.next):
                label.setText("")
            self.runs.show_runs((), ())
            return
        diagnosis = history.now.diagnosis
        names = [in_sentence(on_the_path(diagnosis, effect)) for effect in history.now.added]
        model = "The nominal model" if not names else f"The model with {listed(names)}"
        if diagnosis.better is not None:
            self.title.setText("Not true: another model is better")
        elif diagnosis.smaller is not None:
            self.title.setText(f"More than is needed: {needless_title(diagnosis)}")
        elif rivalled(diagnosis) and diagnosis.verdict == Verdict.NOTHING_MISSING:
            self.title.setText("Perhaps true: another model is as good")
        elif holds(diagnosis) and one_run(diagnosis):
            seen = ", which the fit has seen" if alone(diagnosis) else ""
            self.title.setText(f"True of this one run{seen}")
        elif holds(diagnosis) and (could_hide(diagnosis) is not None or unsure(diagnosis)):
            self.title.setText("Perhaps true: an effect could hide")
        elif holds(diagnosis):
            self.title.setText("True, as far as these recordings can show")
        elif diagnosis.verdict == Verdict.NOTHING_MISSING:
            self.title.setText("Not shown to be true: too much is left")
        elif diagnosis.verdict == Verdict.NOT_IN_CATALOGUE:
            self.title.setText("Not true yet, and the catalogue cannot make it so")
        else:
            self.title.setText("Not true yet")
        runs = "the one run there is" if alone(diagnosis) else judged_on(diagnosis).rstrip(",")
        misses = f"{model} misses {runs} by {score_text(diagnosis.score)} times the floor"
        before = f"; the nominal model missed them by {score_text(history.first.diagnosis.score)} times"
        seen = " The fit has seen it: only" if alone(diagnosis) else " Only"
        second = f"{seen} a second run shows whether that holds." if one_run(diagnosis) else ""
        rows = f" {row_words(diagnosis)}".rstrip()
        self.held_out.setText(f"{misses}{before if names else ''}.{second}{_force_words(history)}{rows}")
        self.next.setText(
            " ".join(
                filter(
                    None,
                    (
                        as_good_sentence(diagnosis),
                        paired_sentence(diagnosis),
                        next_experiment_words(diagnosis, radius),
                    ),
                )
            )
        )
        self.runs.show_runs(history.first.diagnosis.held_out, diagnosis.held_out, radius)
        proposed = diagnosis.next_experiment is not None
        self.hand.setEnabled(proposed)
        self.hand.setToolTip(
            "The proposed recording as a protocol in the Acquire tab." if proposed else self.next.text()
        )
        self.predict.setEnabled(pressed)
        self.predict.setToolTip(
            "Endpoint force of the contact runs by this model, in Predict."
            if pressed
            else "These sessions have no contact run, whose force could be predicted."
        )


def _force_words(history: ModelHistory) -> str:
    """What became of the error of the force, which all of this is for; empty without contact runs."""
    first, now = history.first.diagnosis.errors.get(FORCE), history.now.diagnosis.errors.get(FORCE)
    if now is None:
        return ""
    before, after, floor, unit = error_texts(first or now, now)
    change = f"{before} to {after}" if history.now.added else after
    goes = "goes from" if history.now.added else "is"
    return f" The error of the endpoint force on them {goes} {change} {unit} (floor {floor} {unit})."


def _button(text: str, name: str, words: str) -> QPushButton:
    return described(QPushButton(text), name, tip=words)


def write_page(
    sessions: Sequence[Session],
    path: Path,
    models: Sequence[Diagnosis],
    progress: Progress,
    cancelled: IsCancelled,
) -> Path:
    """Write the report of what the window shows; returns the path.

    ``models``: diagnoses of the models that were made, the first one's first, and at last of the one shown.
    A page that is there already is replaced: the save dialog has asked. It is replaced only when the new
    one is whole.

    Raises:
        UserError: the place cannot be written to.
        Cancelled: the user stopped it; what was there stays.
    """
    progress(0.0, "preparing")
    from fingerlab.report.page import write_report

    *before, now = models
    if not path.exists():
        return write_report(sessions, path, now.model, now, progress, cancelled, before=before)
    fresh = path.with_name(f"{path.stem}.new{path.suffix}")
    fresh.unlink(missing_ok=True)
    write_report(sessions, fresh, now.model, now, progress, cancelled, before=before)
    put_in_place(fresh, path, "close it elsewhere or choose another name.", "replaced")
    return path


NAME = "Model lab"
"""What stands in Predict where a file's name would."""

MODELS = "Model files (*.json)"
CONTACT_FORCE_N = 0.8
"""Mean force of a proposed contact run that names no offset, as in a protocol (assumed)."""


def model_of(path: Path) -> ModelKey:
    """Ids of the effects, and what is held, of a model file of the Model lab, or of ``diagnose --save``.

    Raises:
        UserError: it is no such file.
    """
    from fingerlab.models.file import DIAGNOSIS_METHOD, load_model
    from fingerlab.prediction import extended_model

    model = load_model(path)
    if model.method != DIAGNOSIS_METHOD:
        raise UserError(
            f"{path.name} is a fit by {model.method}, which has no effects; open it in Predict, "
            "or give a model that the Model lab has saved."
        )
    held = extended_model(model, path.name).held if model.details.get("held") else {}
    return model.effects, tuple(sorted(held.items()))


class ResultActions(QObject):
    """Acts on the controller's present diagnosis."""

    def __init__(self, context: ApplicationContext, controller: LabController, widget: QWidget) -> None:
        super().__init__(widget)
        self._context, self._controller, self._widget = context, controller, widget

    def hand_experiment(self) -> None:
        """The proposed recording to Acquire, as a protocol of one run."""
        diagnosis = self._controller.diagnosis
        proposal = (
            dict(diagnosis.next_experiment) if diagnosis is not None and diagnosis.next_experiment else None
        )
        if proposal is None:
            return
        from fingerlab.acquisition.protocols.steps import plan_steps
        from fingerlab.twin.protocols import single_run

        try:
            change = proposal.get("intervention")
            run = single_run(proposal["trajectory"], proposal["phase"], proposal.get("cable"), change)
            steps = plan_steps([run], CONTACT_FORCE_N)
        except UserError as error:
            self._context.tell(str(error))
            return
        self._context.hand_protocol(steps, "Proposed by the Model lab")

    def predict(self) -> None:
        """Fit the present model with its interval, and show its force in Predict."""
        self._context.hush()
        self._context.tasks.start(
            "Fitting the model to predict with",
            self._fit(),
            lambda model: self._context.hand_model(model, NAME),
        )

    def ask_and_save(self) -> None:
        """Fit the present model with its interval, and save it for Predict and the command line."""
        sessions = self._controller.sessions
        if not sessions:
            return
        start = Path(self._context.settings.folder()) / f"{sessions[0].path.stem}-model.json"
        name, _ = QFileDialog.getSaveFileName(self._widget, "Save model", str(start), MODELS)
        if not name:
            return
        path, fit = Path(name), self._fit()

        def work(progress: Progress, cancelled: IsCancelled) -> Path:
            from fingerlab.core.files import whole_file
            from fingerlab.models.file import write_model

            with whole_file(path) as part:  # the dialog has asked whether to replace what is there
                write_model(fit(progress, cancelled), part)
            return path

        self._context.tasks.start(
            "Saving the model", work, lambda done: self._context.announce(f"Model saved: {done}", done)
        )

    def _fit(self) -> Work:
        sessions, (added, held) = self._controller.sessions, self._model()

        def work(progress: Progress, cancelled: IsCancelled) -> SavedModel:
            from fingerlab.prediction import fit_extended, model_of_extended

            return model_of_extended(fit_extended(sessions, added, progress, dict(held)))

        return work

    def _model(self) -> ModelKey:
        history = self._controller.history
        return history.now.key if history is not None else ((), ())
