"""The result: line, residuals, numbers, what speaks against it; accept, accept with a reason, reject."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QLineEdit, QVBoxLayout, QWidget

from fingerlab.calibration.outcome import CalibrationOutcome, amount_text
from fingerlab.calibration.store import CalibrationRecord

from ..widgets.fields import ActionButton
from ..widgets.labels import WholeLabel, heading, remark
from ..widgets.layout import FLUSH, SideRoom, hbox
from .calibration_pictures import FitPlot, ResidualPlot
from .calibration_words import listed, number_rows, verdict_words

PANEL_WIDTH = 400
REASON_FIRST = "There are objections; say below why it is good all the same, then accept with the reason."


class ResultPage(QWidget):
    """Its buttons call ``decide(accept, reason)``, or ``back`` to undo the last step or leave."""

    def __init__(self, decide: Callable[[bool, str], None], back: Callable[[], None]) -> None:
        super().__init__()
        self.verdict = heading(large=True)
        self.verdict.setObjectName("calibrationVerdict")
        self.verdict.setWordWrap(True)
        self.fit, self.residuals = FitPlot(), ResidualPlot()
        self.legend = remark()
        self.numbers = QGridLayout()
        self.numbers.setHorizontalSpacing(16)
        self.numbers.setVerticalSpacing(8)
        self.numbers.setColumnStretch(1, 1)
        self._rows: list[tuple[QLabel, QLabel]] = []
        self.objections_title = heading("What speaks against it")
        self.objections = WholeLabel()
        self.objections.setObjectName("calibrationObjections")
        self.notes = remark()
        self.reason = QLineEdit()
        self.reason.setObjectName("calibrationReason")
        self.reason.setPlaceholderText("Reason, if it is accepted all the same")
        self.reason.setAccessibleName("Reason for accepting")
        self.accept = ActionButton(
            "&Accept",
            "acceptCalibration",
            "Store it as the calibration that counts from the next connection on.",
            lambda: decide(True, ""),
        )
        self.accept.setProperty("primary", "true")
        self.with_reason = ActionButton(
            "Accept with the &reason",
            "acceptWithReason",
            "Store it with the reason as the calibration that counts.",
            lambda: decide(True, self.reason.text()),
        )
        self.reject = ActionButton(
            "Re&ject",
            "rejectCalibration",
            "Store it as rejected; the calibration before goes on to count.",
            lambda: decide(False, self.reason.text()),
        )
        self.back = ActionButton("Back", "backToSteps", "Back to the last step, or to the start.", back)
        self.reason.textChanged.connect(lambda _: self._refuse())
        self._outcome: CalibrationOutcome | None = None
        self._build()

    def _build(self) -> None:
        left = QVBoxLayout()
        left.setContentsMargins(16, 16, 8, 8)
        left.setSpacing(8)
        left.addWidget(self.verdict)
        left.addWidget(self.legend)
        left.addWidget(self.fit, 3)
        left.addWidget(self.residuals, 2)
        told = QWidget()
        told.setFixedWidth(PANEL_WIDTH - 1)
        words = QVBoxLayout(told)
        words.setContentsMargins(16, 16, 16, 0)
        words.setSpacing(8)
        words.addLayout(self.numbers)
        words.addSpacing(8)
        words.addWidget(self.objections_title)
        words.addWidget(self.objections)
        words.addWidget(self.notes)
        words.addStretch(1)
        decision = QVBoxLayout()
        decision.setContentsMargins(16, 8, 16, 16)
        decision.setSpacing(8)
        decision.addWidget(self.reason)
        for button in (self.accept, self.with_reason, self.reject, self.back):
            decision.addWidget(button)
        panel = QWidget()
        panel.setObjectName("acquirePanel")
        panel.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        side = QVBoxLayout(panel)
        side.setContentsMargins(1, 0, 0, 0)  # beside the panel's edge
        side.setSpacing(0)
        side.addWidget(SideRoom(told), 1)  # many words scroll; the buttons stay in sight
        side.addLayout(decision)
        hbox(self, (left, 1), panel, margins=FLUSH, spacing=0)

    def show_outcome(
        self, outcome: CalibrationOutcome, previous: CalibrationRecord | None, notes: list[str], back: str
    ) -> None:
        """Show a result; ``back`` is what the last button says."""
        self._outcome = outcome
        self.verdict.setText(verdict_words(outcome))
        names = [sweep.name for sweep in outcome.sweeps]
        shapes = f"Circles: {names[0]}" + (f"; triangles: {names[1]}" if len(names) > 1 else "")
        limit = amount_text(outcome.sensor, outcome.sensor.accuracy.high)
        ring = " A ring marks a doubtful step." if outcome.misplaced else ""
        self.legend.setText(f"{shapes}. Grey: within the ±{limit} of the data sheet.{ring}")
        self.fit.show_outcome(outcome)
        self.residuals.show_outcome(outcome)
        self._show_numbers(number_rows(outcome, previous))
        self.objections.setText(listed(outcome.objections) or "Nothing.")
        self.notes.setText(listed(notes))
        self.notes.setVisible(bool(notes))
        self.reason.clear()
        self.back.setText(back)
        self._refuse()

    def _show_numbers(self, rows: list[tuple[str, str, str]]) -> None:
        while len(self._rows) < len(rows):
            title, value = remark(wrap=False), WholeLabel()
            self.numbers.addWidget(title, len(self._rows), 0)
            self.numbers.addWidget(value, len(self._rows), 1)
            self._rows.append((title, value))
        for number, (left, right) in enumerate(self._rows):
            name, text, explained = rows[number] if number < len(rows) else ("", "", "")
            left.setText(name)
            right.setText(text)
            right.setObjectName(f"number-{name}" if name else "")
            right.setAccessibleName(name)
            for label in (left, right):
                label.setToolTip(explained)
                label.setVisible(bool(name))

    def _refuse(self) -> None:
        objected = self._outcome is not None and bool(self._outcome.objections)
        self.accept.refuse(REASON_FIRST if objected else "")
        self.with_reason.refuse("" if self.reason.text().strip() else "Write the reason first.")
