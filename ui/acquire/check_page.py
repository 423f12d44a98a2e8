"""The check of a rig in the window: one question at a time, beside all that was found so far.

It is the check of ``fingerlab check-rig``: the same steps, over the same loop, limits and guardian.
"""

from __future__ import annotations

import math
import threading
from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QHeaderView, QLabel, QTableWidgetItem, QWidget

from fingerlab.acquisition.bench.bench import Bench

from ..widgets.fields import ActionButton
from ..widgets.layout import FLUSH, Spacer, described, hbox, vbox
from ..widgets.tables import NumberTable, WholeLabel, heading, remark
from ..widgets.theme import large_font
from .bench_controller import BenchController

if TYPE_CHECKING:
    from fingerlab.acquisition.check_rig.look import CheckProtocol, Outcome

    from ..app.worker import Failed

MARKS = {"confirmed": "✓", "failed": "✗", "skipped": "○", "noted": "i", "not applicable": "–"}
"""Before the word: a state is not told by a sign alone."""
COLUMNS = (
    ("Result", "Confirmed, failed, left out, noted, or not applicable to this bench."),
    ("Step", "What was looked at."),
    ("Finding", "What was measured, and what to do where it failed."),
)
MEASURING = "Looking at the bench …"


class CheckRun(QObject):
    """Walks through the steps off the GUI thread and waits for answers.

    Signals:
        asked(step, question). found(outcome). ended(protocol, place): place is where it is kept, or empty.
        failed(sentence): nothing came of it.
    """

    asked = Signal(str, str)
    outcome_found = Signal(object)
    ended = Signal(object, str)
    failed = Signal(str)

    def __init__(self, controller: BenchController) -> None:
        super().__init__(controller)
        self._controller = controller
        self._answered = threading.Event()
        self._answer = ""
        self._bench: Bench | None = None
        self.under_way = False

    def start(self) -> None:
        """Check the bench that is open for it."""
        opened = self._controller.opened
        assert opened is not None
        assert opened.to_check is not None
        what, rig = opened.to_check, opened.rig
        self._bench, self.under_way = opened.bench, True

        def work(bench: Bench) -> tuple[CheckProtocol, str]:
            from fingerlab.acquisition.check_rig.walk import check_rig, keep

            protocol = check_rig(bench, rig, self, what.source, what.card, key=what.key)
            place = keep(protocol, what.folder) if what.folder is not None else ""
            return protocol, str(place)

        self._controller.do(
            "The check", work, self._on_ended, self._on_failed, True, doing="check of the rig"
        )

    def answer(self, word: str) -> None:
        """``yes``, ``no`` or ``skip``, to the question that was asked."""
        self._answer = word
        self._answered.set()

    # in the worker, as the operator of the check

    def tell(self, text: str) -> None:
        """What is told beside outcomes is seen on the page anyway."""

    def found(self, outcome: Outcome) -> None:
        self.outcome_found.emit(outcome)

    def ask(self, step: str, question: str) -> str:
        from fingerlab.acquisition.check_rig.look import as_bench_failed

        assert self._bench is not None
        self._answered.clear()
        with as_bench_failed():  # whoever has pressed STOP is not waited for
            self._bench.wait_until(
                self._answered.is_set, math.inf, "", lambda: self.asked.emit(step, question)
            )
        return self._answer

    # its end

    def _on_ended(self, result: tuple[CheckProtocol, str]) -> None:
        self.under_way = False
        self.ended.emit(*result)

    def _on_failed(self, failure: Failed) -> None:
        self.under_way = False
        self.failed.emit(failure.sentence)


class CheckPage(QWidget):
    """Signals: drive_asked: with the same bench, now that it is known; leave_asked."""

    drive_asked = Signal()
    leave_asked = Signal()

    def __init__(self, controller: BenchController, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.run = CheckRun(controller)
        self.title = described(heading(large=True), "checkTitle")
        self.hint = remark(
            "Stand at the bench with the cable off the pulley and the amplifier's switch within reach. "
            "Nothing moves before you say yes to it; STOP ends the check."
        )
        self.table = NumberTable("checkFindings", "What was found so far", COLUMNS, words=3)
        self.table.setWordWrap(True)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
        self.step = described(QLabel(), "checkStep", role="muted")
        self.question = described(WholeLabel(), "checkQuestion", font=large_font())
        answers = (
            ("yes", "&Yes", "It is so, or may begin."),
            ("no", "N&o", "It is not so: the step has failed, and nothing is driven after it."),
            ("skip", "S&kip", "Go on without it: nothing is driven after a step that was left out."),
        )
        self.answers = [
            ActionButton(text, f"check_{word}", tip, partial(self._on_answer, word))
            for word, text, tip in answers
        ]
        self.answers[0].setProperty("primary", "true")
        self.drive = ActionButton(
            "&Drive this bench", "checkDrive", "Connect it again, to be driven.", self.drive_asked.emit
        )
        self.leave = ActionButton(
            "&Close", "checkLeave", "End the check and let the device go.", self.leave_asked.emit
        )
        buttons = hbox(None, *self.answers, Spacer(1), self.drive, self.leave, margins=FLUSH, spacing=8)
        vbox(
            self,
            self.title,
            self.hint,
            (self.table, 1),
            self.step,
            self.question,
            buttons,
            margins=(16, 8, 16, 8),
            spacing=8,
        )
        self.run.asked.connect(self._on_asked)
        self.run.outcome_found.connect(self._on_found)
        self.run.ended.connect(self._on_ended)
        self.run.failed.connect(lambda sentence: self._say("", sentence, asking=False))

    def begin(self, device: str) -> None:
        """Check the bench that is open for it, from the first step on."""
        self.title.setText(f"Check of {device}")
        self.table.setRowCount(0)
        self._say("", MEASURING, asking=False)
        self.run.start()

    def _on_answer(self, word: str) -> None:
        self._say("", MEASURING, asking=False)
        self.run.answer(word)

    def _on_asked(self, step: str, question: str) -> None:
        self._say(f"Step {step}", question, asking=True)

    def _say(self, step: str, words: str, asking: bool) -> None:
        self.step.setText(step)
        self.question.setText(words)
        for button in self.answers:
            button.refuse("" if asking else "Nothing is asked now.")
        busy = self.run.under_way or words == MEASURING
        self.drive.refuse("The check is under way; STOP ends it." if busy else "")

    def _on_found(self, outcome: Outcome) -> None:
        row = self.table.rowCount()
        self.table.setRowCount(row + 1)
        state = f"{MARKS.get(outcome.state, '')} {outcome.state}"
        for column, text in enumerate((state, outcome.title.rstrip("."), outcome.sentence)):
            item = QTableWidgetItem(text)
            item.setToolTip(outcome.question or outcome.sentence)
            item.setTextAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
            self.table.setItem(row, column, item)
        self.table.resizeRowToContents(row)
        self.table.scrollToBottom()

    def _on_ended(self, protocol: Any, place: str) -> None:
        open_steps = [outcome.id for outcome in protocol.outcomes if outcome.open]
        kept = f" Kept in {place}." if place else " A rehearsal, which says nothing about a real bench."
        words = "All confirmed."
        if open_steps:
            words = f"Not confirmed: {', '.join(open_steps)}. Correct wiring or rig file, and check again."
        self._say("", words + kept, asking=False)
