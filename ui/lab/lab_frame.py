"""What stands around the lab's plots: the first page, those before a result, the header, the five steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QButtonGroup, QFrame, QLabel, QPushButton, QVBoxLayout, QWidget

from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.file import project_path
from fingerlab.report.diagnosis_words import (
    better_sentence,
    exchange_words,
    needless_sentence,
    needless_title,
)

from ..widgets.fields import centred_column, set_usable
from ..widgets.layout import FLUSH, Item, Spacer, described, hbox, vbox
from ..widgets.tables import ElidedLabel, WholeLabel, header_name, heading, remark
from ..widgets.theme import large_font, small_font
from .practice import EXAMPLES

WIDTH = 1000
MOST_RECENT = 5
PURPOSE = "Which physical effect is your model missing?"
WHAT_FOR = (
    "FingerLab drives a cable-driven finger, records it, lays the model beside what was measured, says where "
    "the model fails, names the effect that it lacks, and foretells the force of the fingertip with what was "
    "found."
)


class LabStartPage(QWidget):
    """Three cards. Signals: a button was pressed; ``example_asked(name)``, ``recent_asked(path)``."""

    open_asked = Signal()
    connect_asked = Signal()
    practise_asked = Signal()
    example_asked = Signal(str)
    recent_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.open = described(QPushButton("&Open a session…"), "emptyOpen", primary="true")
        self.open.clicked.connect(self.open_asked)
        self.connect_rig = described(QPushButton("&Connect a rig"), "emptyConnect")
        self.connect_rig.setToolTip("The Acquire tab: a data acquisition card, or the simulated rig.")
        self.connect_rig.clicked.connect(self.connect_asked)
        self.practise = described(QPushButton("&Practise on a hidden effect"), "practise")
        self.practise.setToolTip(
            "Records a session from the simulated rig with an effect that is not told: find it, reveal it."
        )
        self.practise.clicked.connect(self.practise_asked)
        self.examples = [self._example(name, title) for name, (title, _) in EXAMPLES.items()]
        self.doing = described(remark(), "emptyDoing")
        self.doing.hide()
        self._recent_title = remark("Recent")
        self._recent = vbox(None, spacing=0)
        page = centred_column(self, WIDTH)
        page.addWidget(heading(PURPOSE, large=True))
        page.addWidget(WholeLabel(WHAT_FOR))
        cards = (
            _card("With recordings", RECORDINGS, self.open, self._recent_title, self._recent),
            _card("With a rig", RIG, self.connect_rig),
            _card("With neither", NEITHER, self.practise, *self.examples),
        )
        page.addLayout(hbox(None, *((card, 1) for card in cards), spacing=16))
        page.addWidget(self.doing)

    def _example(self, name: str, title: str) -> QPushButton:
        button = described(QPushButton(f"Example: {title}"), f"example_{name}", link="true")
        button.setToolTip("Recorded from the simulated rig when it is asked for the first time, then kept.")
        button.clicked.connect(lambda: self.example_asked.emit(name))
        return button

    def show_recording(self, title: str) -> None:
        """While a session is recorded for this page say so here, too; an empty title: none is."""
        self.doing.setText(title)
        self.doing.setVisible(bool(title))
        for button in (self.practise, *self.examples):
            set_usable(button, not title)

    def tell_recording(self, title: str, what: str) -> None:
        """How far that is."""
        if not self.doing.isHidden():
            self.doing.setText(f"{title}: {what}")

    def show_recent(self, paths: Sequence[Path]) -> None:
        """Offer recently opened files."""
        while (item := self._recent.takeAt(0)) is not None:
            widget = item.widget()
            if widget is not None:
                widget.deleteLater()
        for path in paths[:MOST_RECENT]:
            kept = " – with your models and notes" if project_path([path]).is_file() else ""
            button = described(QPushButton(path.name.replace("&", "&&") + kept), link="true", tip=str(path))
            button.setAccessibleName(f"Open {path.name} again")
            button.clicked.connect(lambda _checked=False, p=str(path): self.recent_asked.emit(p))
            self._recent.addWidget(button, 0, Qt.AlignmentFlag.AlignLeft)
        self._recent_title.setVisible(bool(paths))


RECORDINGS = (
    "Open a session file, or drop one anywhere. A text or CSV file that is dropped is imported, with a look "
    "at its columns first."
)
RIG = "See it live, drive it within its limits, and record it; then compare."
NEITHER = (
    "A session of the simulated rig, as it would be recorded: one whose effect is hidden, or an example "
    "whose effect is known."
)


def _card(title: str, words: str, *items: Item) -> QFrame:
    card = described(QFrame(), card="true")
    vbox(card, heading(title), described(WholeLabel(words), role="muted"), *items, Spacer(1), spacing=8)
    return card


class LabHeader(QWidget):
    """Signals ``open_asked``, ``report_asked``, ``reveal_asked``."""

    open_asked = Signal()
    report_asked = Signal()
    reveal_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name = header_name("sessionName", "Open sessions", alone=False)
        self.reveal = QPushButton("Reveal the hidden effect")
        self.reveal.setObjectName("reveal")
        self.reveal.setToolTip(
            "Say which effect was put into this practice session. Your guess is what you have added by then."
        )
        self.answer = described(ElidedLabel(), "revealed", accessible="What was hidden")
        self.report = described(QPushButton("Save report page…"), "report")
        self.open = QPushButton("Open…")
        self.open.setObjectName("open")
        self.open.setToolTip("Open a session file (Ctrl+O), or drop one here.")
        layout = hbox(self, (self.name, 1), (self.answer, 1), margins=(16, 4, 8, 4), spacing=8)
        for button, signal in (
            (self.reveal, self.reveal_asked),
            (self.report, self.report_asked),
            (self.open, self.open_asked),
        ):
            button.clicked.connect(signal)
            layout.addWidget(button)
        self.show_session("", False, False)

    def show_session(self, text: str, practice: bool, ready: bool, answer: str = "") -> None:
        """Say what is open; ``ready`` when there is a diagnosis to report on.

        Args:
            practice: an effect is hidden in it. answer: what was, once it is revealed, for the button.
        """
        # Of the runs as much as there is room for.
        self.name.set_texts((text, text.rpartition(": ")[0] or text, text.rpartition(" · ")[0] or text))
        self.reveal.setVisible(practice and not answer)
        self.answer.set_texts((answer, answer.removeprefix("Hidden was: ")))
        self.answer.setVisible(bool(answer))
        self.report.setVisible(ready)
        self.report.setToolTip("The whole comparison as one self-contained page (Ctrl+S).")


class BetterModelBanner(QFrame):
    """That another model of these recordings is better, or needs less; unseen while none does.

    Signals ``exchange_asked``; ``take_off_asked``: refit without the effect that is not needed.
    """

    exchange_asked = Signal()
    take_off_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("betterModel")
        self.text = described(WholeLabel(), "betterModelText")
        self.button = described(QPushButton("E&xchange"), "exchange", primary="true")
        self.button.clicked.connect(self.exchange_asked)
        self.take_off = described(QPushButton("Ta&ke it off"), "takeOff", primary="true")
        self.take_off.clicked.connect(self.take_off_asked)
        hbox(self, (self.text, 1), self.button, self.take_off, margins=(8, 4, 8, 4), spacing=8)
        self.show_diagnosis(None)

    def show_diagnosis(self, diagnosis: Diagnosis | None) -> None:
        """Say which model does better, or as well with less; nothing where the present one is not beaten."""
        better = diagnosis.better if diagnosis is not None else None
        smaller = diagnosis.smaller if diagnosis is not None else None
        self.button.setVisible(better is not None)
        self.take_off.setVisible(smaller is not None)
        self.setVisible(better is not None or smaller is not None)
        if diagnosis is None:
            return
        self.text.setText(better_sentence(diagnosis) or needless_sentence(diagnosis))
        if better is not None:
            self.button.setToolTip(f"Refit with {exchange_words(better, diagnosis)} (Ctrl+Z takes it back).")
        if smaller is not None:
            gone = needless_title(diagnosis)
            self.take_off.setToolTip(f"Refit without {gone} (Ctrl+Z takes it back).")

    def set_busy(self, busy: bool) -> None:
        """While the model is being refitted nothing can be exchanged or taken off."""
        for button in (self.button, self.take_off):
            set_usable(button, not busy)


class WaitingPage(QWidget):
    """A session is open and its first comparison is not there (yet). Signal ``compare_asked``."""

    compare_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.title = heading(large=True)
        self.title.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        self.what = remark()
        self.what.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        self.compare = QPushButton("Compare model a&nd measurement")
        self.compare.setObjectName("compareAgain")
        self.compare.setProperty("primary", "true")
        self.compare.clicked.connect(self.compare_asked)
        layout = QVBoxLayout(self)
        layout.setSpacing(16)
        layout.addStretch(2)
        layout.addWidget(self.title)
        layout.addWidget(self.what)
        layout.addWidget(self.compare, 0, Qt.AlignmentFlag.AlignHCenter)
        layout.addStretch(3)
        self.show_state(False, "")

    def show_state(self, running: bool, what: str) -> None:
        """While the comparison runs, say how far it is; else offer to run it."""
        self.title.setText("Comparing model and measurement" if running else "Not compared yet")
        self.what.setText(what if running else "The comparison was stopped or failed before it had a result.")
        self.compare.setVisible(not running)


STEPS = {
    "compare": ("Compare", "Measured and modelled, side by side: the whole of the run (F2)."),
    "where": ("Where?", "Where the model fails: over time, phase, speed, angle, tension, run (F3)."),
    "missing": ("Missing?", "Which effect is missing: the candidates, best first (F4)."),
    "add": ("Add", "Add an effect to the model and refit (F5)."),
    "true": ("True?", "Does it hold on runs that the fit has not seen, and what to record next (F6)."),
}


LONGEST_SCORE, SCORE_ROOM = "error 12300 × floor", 32
"""The longest headline there is, and the room beside it, px."""


class StepsColumn(QWidget):
    """Five steps. Signals ``chosen(step)``: the user goes to one; ``score_asked``: what is the error of?"""

    chosen = Signal(str)
    score_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("steps")
        self.setAccessibleName("Steps of the Model lab")
        layout = vbox(self, margins=FLUSH, spacing=0)
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        self._results: dict[str, QLabel] = {}
        self.score = described(QPushButton(), "headline", font=small_font(), link="true")
        self.score.setToolTip("What the error is made of: the equations and runs that sum to it (F7).")
        self.score.setAccessibleDescription("Shows the equations and runs that sum to the error.")
        self.score.clicked.connect(self.score_asked)
        for step, (title, help_text) in STEPS.items():
            button = described(QPushButton(title), step="true")
            button.setCheckable(True)
            button.setFont(large_font())
            button.setToolTip(help_text)
            button.setAccessibleName(title)
            button.clicked.connect(lambda _checked=False, s=step: self.chosen.emit(s))
            self._group.addButton(button)
            self._buttons[step] = button
            result = remark()
            result.setContentsMargins(16, 0, 0, 16)
            self._results[step] = result
            layout.addWidget(button)
            if step == "compare":
                layout.addWidget(self.score)
            layout.addWidget(result)

    def width_of_score(self) -> int:
        """What the headline needs, px, whatever letters the system has."""
        return self.score.fontMetrics().horizontalAdvance(LONGEST_SCORE) + SCORE_ROOM

    def set_results(self, results: dict[str, str]) -> None:
        """Show what each done step found; the others stay empty."""
        self.score.setText(results.get("compare", ""))
        self.score.setVisible("compare" in results)
        for step, label in self._results.items():
            text = results.get(step, "")
            label.setText(_shorten(text))
            label.setHidden(step == "compare" and bool(text))  # the headline says it
            label.setToolTip(text)
            self._buttons[step].setAccessibleDescription(text)

    def set_current(self, step: str) -> None:
        """Make a step the current one (without going there)."""
        self._buttons[step].setChecked(True)

    def current(self) -> str:
        """The step that is bold."""
        return next((step for step, button in self._buttons.items() if button.isChecked()), "compare")

    def button(self, step: str) -> QPushButton:
        return self._buttons[step]

    def result(self, step: str) -> str:
        """The words below a step."""
        return self._results[step].toolTip()


def _shorten(text: str, limit: int = 64) -> str:
    """A few words; the whole text is in the tooltip."""
    if len(text) <= limit:
        return text
    return text[: limit - 1].rsplit(" ", 1)[0].rstrip(",;:.") + " …"
