"""How nominal and present model do on each motion, on the runs that the fit has not seen."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHeaderView, QTableWidgetItem, QWidget

from fingerlab.identify.results import HeldOutRuns
from fingerlab.report.diagnosis_words import PHASE_WORDS
from fingerlab.report.screen import score_text

from ..widgets.number_table import NumberTable
from .wording import motor_words

FLOORS = (
    "Error over all equations on these runs, in multiples of the floor (1.00), by fits that have not seen "
    "them; what the other runs leave open of the model's constants is allowed for."
)
COLUMNS = (
    (
        "Held-out runs",
        "Runs that were told the same motion; each is left out of the fit that is scored on it.",
    ),
    ("Nominal", f"{FLOORS} With the nominal model."),
    ("Now", f"{FLOORS} With the present model."),
)
LEAST_ROWS = 2


class HeldOutTable(NumberTable):
    """One row a motion."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("heldOutRuns", "Error on held-out runs by motion", COLUMNS, parent=parent)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        line = self.fontMetrics().lineSpacing()
        self.setMinimumHeight((LEAST_ROWS + 2) * line)

    def show_runs(self, nominal: Sequence[HeldOutRuns], now: Sequence[HeldOutRuns]) -> None:
        """Scores by the nominal and by the present model."""
        before = {one.runs: one.score for one in nominal}
        self.setRowCount(len(now))
        for row, one in enumerate(now):
            first = before.get(one.runs)
            texts = runs_text(one), "–" if first is None else score_text(first), score_text(one.score)
            for column, text in enumerate(texts):
                item = QTableWidgetItem(text)
                side = Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
                item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
                item.setToolTip(COLUMNS[column][1] if column else text)
                self.setItem(row, column, item)


def runs_text(one: HeldOutRuns) -> str:
    """``4 runs, contact, flexion, sine, 3°, 1 Hz``; a single one by its number."""
    what = f"Run {one.runs[0]}" if len(one.runs) == 1 else f"{len(one.runs)} runs from {one.runs[0]} on"
    cable = f", {one.cable}" if one.cable != "none" else ""
    return f"{what} · {PHASE_WORDS.get(one.phase, one.phase)}{cable}, {motor_words(one.trajectory)}"
