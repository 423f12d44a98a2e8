"""How nominal and present model do on each motion, on the runs that the fit has not seen."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QHeaderView, QTableWidgetItem, QWidget

from fingerlab.core.text import score_text
from fingerlab.diagnosis.answer.results import HeldOutRuns
from fingerlab.report.diagnosis_words import PHASE_WORDS, listed

from ..theme import small_font
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
LEAST_ROWS = 3
ROOM = 4
"""About the words of a row, px."""


class HeldOutTable(NumberTable):
    """One row a motion."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("heldOutRuns", "Error on held-out runs by motion", COLUMNS, parent=parent)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.setWordWrap(False)  # a row is a line; one that is too long ends in … and is whole in its tooltip
        line = QFontMetrics(small_font()).height() + ROOM
        self.verticalHeader().setMinimumSectionSize(line)
        self.verticalHeader().setDefaultSectionSize(line)
        self.horizontalHeader().setFixedHeight(line + ROOM)
        self.setMinimumHeight((LEAST_ROWS + 1) * line + ROOM + 2 * self.frameWidth())

    def show_runs(self, nominal: Sequence[HeldOutRuns], now: Sequence[HeldOutRuns]) -> None:
        """Scores by the nominal and by the present model; without any the table is not seen."""
        self.setVisible(bool(now))
        before = {one.runs: one.score for one in nominal}
        self.setRowCount(len(now))
        for row, one in enumerate(now):
            first = before.get(one.runs)
            texts = runs_text(one), "–" if first is None else score_text(first), score_text(one.score)
            for column, text in enumerate(texts):
                item = QTableWidgetItem(text)
                side = Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
                item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
                item.setToolTip(COLUMNS[column][1] if column else whole_text(one))
                self.setItem(row, column, item)


def runs_text(one: HeldOutRuns) -> str:
    """``001 · on air, extension, sine, 15°, 1 Hz``; of several the first is named."""
    first, *others = one.runs
    named = f"{first} and {len(others)} more" if others else first
    return f"{named} · {motion_text(one)}"


def motion_text(one: HeldOutRuns) -> str:
    """What these runs have in common: phase, cable, what the motor was told."""
    cable = f", {one.cable}" if one.cable != "none" else ""
    return f"{PHASE_WORDS.get(one.phase, one.phase)}{cable}, {motor_words(one.trajectory)}"


def whole_text(one: HeldOutRuns) -> str:
    """All that a row says, with every run."""
    return f"Run{'s' if len(one.runs) > 1 else ''} {listed(one.runs)} · {motion_text(one)}"
