"""The last step: does the model hold, and what should be recorded next."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget

from fingerlab.core.text import score_text
from fingerlab.report.diagnosis_words import effect_title, in_sentence, listed

from ..theme import large_font, small_font
from ..widgets.button_rows import ButtonRows
from ..widgets.labels import WholeLabel
from .held_out_table import HeldOutTable
from .history import History
from .wording import NOTHING, UNKNOWN, error_texts, next_experiment_words

FORCE = "endpoint_force"
"""Key of ``Diagnosis.errors``."""


class TruthPanel(QWidget):
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
        self.title = WholeLabel()
        self.title.setProperty("role", "heading")
        self.title.setFont(large_font())
        self.held_out = WholeLabel()
        self.next = WholeLabel()
        self.next.setProperty("role", "muted")
        self.next.setFont(small_font())
        self.runs = HeldOutTable()
        self.hand = _button("&Hand it to Acquire", "handExperiment", "The proposed recording as a protocol.")
        self.predict = _button(
            "&Predict the force",
            "predictForce",
            "Endpoint force of the contact runs by this model, in Predict.",
        )
        self.save = _button(
            "Save &model…", "saveModel", "As a file, for Predict and 'fingerlab predict --model'."
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
        layout.addWidget(ButtonRows((self.hand, self.predict, self.save, self.report)))
        layout.addWidget(self.runs, 1)
        layout.addStretch()

    def show_history(self, history: History | None, pressed: bool = False) -> None:
        """Say how the present model does on runs that the fit has not seen; ``pressed``: some in contact."""
        if history is None:
            for label in (self.title, self.held_out, self.next):
                label.setText("")
            self.runs.show_runs((), ())
            return
        diagnosis = history.now.diagnosis
        names = [in_sentence(effect_title(effect)) for effect in history.now.added]
        model = "The nominal model" if not names else f"The model with {listed(names)}"
        if diagnosis.verdict == NOTHING:
            self.title.setText("True, as far as these recordings can show")
        elif diagnosis.verdict == UNKNOWN:
            self.title.setText("Not true yet, and the catalogue cannot make it so")
        else:
            self.title.setText("Not true yet")
        misses = f"{model} misses runs held out of the fit by {score_text(diagnosis.score)} times the floor"
        before = f"; the nominal model missed them by {score_text(history.first.diagnosis.score)} times"
        self.held_out.setText(f"{misses}{before if names else ''}.{_force_words(history)}")
        self.next.setText(next_experiment_words(diagnosis))
        self.runs.show_runs(history.first.diagnosis.held_out, diagnosis.held_out)
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


def _force_words(history: History) -> str:
    """What became of the error of the force, which all of this is for; empty without contact runs."""
    first, now = history.first.diagnosis.errors.get(FORCE), history.now.diagnosis.errors.get(FORCE)
    if now is None:
        return ""
    before, after, floor, unit = error_texts(first or now, now)
    change = f"{before} to {after}" if history.now.added else after
    goes = "goes from" if history.now.added else "is"
    return f" The error of the endpoint force on them {goes} {change} {unit} (floor {floor} {unit})."


def _button(text: str, name: str, words: str) -> QPushButton:
    button = QPushButton(text)
    button.setObjectName(name)
    button.setToolTip(words)
    return button
