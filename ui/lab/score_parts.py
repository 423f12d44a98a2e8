"""What the headline is made of: the squared error by equations and runs, and what was left aside."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QHeaderView, QTableWidgetItem, QWidget

from fingerlab.core.text import score_text
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.score_words import ASIDE_HELP, ScoreTable, aside_sentence, score_table

from ..widgets.labels import WholeLabel, heading, remark
from ..widgets.layout import described, vbox
from ..widgets.tables import NumberTable
from ..widgets.theme import colours_of, small_font, tint

WIDTH, HEIGHT = 960, 560
ROOM = 8
"""About the words of a row, px."""
FLOOR_ROW, SQUARED_ROW = "The floor", "Squared error"
LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
STRONGEST = 0.45
"""Tint of a cell that is the whole of what is missed."""


class ScorePartsDialog(QDialog):
    """A table that adds up. Signal ``part_chosen(equation, run)``: a click on a part asks for its curves."""

    part_chosen = Signal(str, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("scoreParts")
        self.setWindowTitle("What the error is made of – FingerLab")
        self.resize(WIDTH, HEIGHT)
        self.title = heading()
        self.words = described(WholeLabel(), "scorePartsWords", font=small_font())
        self.table = NumberTable("scoreTable", "Parts of the squared error", ())
        self.table.setSelectionBehavior(NumberTable.SelectionBehavior.SelectItems)
        self.table.setWordWrap(False)  # a row is a line; what is cut is whole in its tooltip
        self.table.verticalHeader().setDefaultSectionSize(QFontMetrics(small_font()).height() + ROOM)
        self.table.cellClicked.connect(self._choose)
        self.table.cellActivated.connect(self._choose)
        self._told: ScoreTable | None = None
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        hint = remark("Click a number to see its curves. Ctrl+C copies the table, or what is chosen of it.")
        vbox(self, self.title, self.words, (self.table, 1), hint, close, spacing=8)

    def show_diagnosis(self, diagnosis: Diagnosis) -> None:
        """The parts of another model's error."""
        self._told = told = score_table(diagnosis)
        self.title.setText(f"The error is {score_text(diagnosis.score)} times the floor")
        if told is None:
            self.words.setText("It is not known of what: no run could be left out of the fit.")
            self.table.setVisible(False)
            return
        self.words.setText(
            f"Its square, {told.squared}, is the sum of {told.floor} for the floor and of what each equation "
            f"misses beyond it in the runs of each motion: every number below, {told.together} together. "
            f"{aside_sentence(diagnosis)}"
        )
        self._fill(told)
        self.table.setVisible(True)

    def _fill(self, told: ScoreTable) -> None:
        columns = [
            ("Runs", "Runs that were told the same motion."),
            ("Samples", "Their share of all samples that are judged."),
            *(
                (title, f"What the equation of the {title[:1].lower()}{title[1:]} adds.")
                for title in told.titles
            ),
            ("Together", "What these runs add."),
            ("Left aside", "\n".join(ASIDE_HELP.values())),
        ]
        self.table.set_columns(columns)
        rows = [(row.title, row.samples, *row.cells, row.together, row.aside) for row in told.rows]
        blank = [""] * (len(told.equations) + 1)
        rows += [("All runs", "", *told.sums, told.together, "")]
        rows += [(FLOOR_ROW, *blank, told.floor, ""), (SQUARED_ROW, *blank, told.squared, "")]
        self.table.setRowCount(len(rows))
        largest = max((_number(cell) for row in told.rows for cell in row.cells), default=0.0)
        colour = colours_of(self).residual
        for place, row in enumerate(rows):
            for column, text in enumerate(row):
                item = QTableWidgetItem(text)
                words = column in (0, len(row) - 1)
                item.setTextAlignment(LEFT if words else RIGHT)
                part = place < len(told.rows) and 2 <= column < 2 + len(told.equations)
                if part and largest > 0 and _number(text) > 0:
                    item.setBackground(tint(colour, STRONGEST * _number(text) / largest))
                if place >= len(told.rows):
                    font = item.font()
                    font.setBold(True)
                    item.setFont(font)
                item.setToolTip(text if words else "")
                self.table.setItem(place, column, item)
        last = self.table.horizontalHeaderItem(len(columns) - 1)
        assert last is not None
        last.setTextAlignment(LEFT)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(len(columns) - 1, QHeaderView.ResizeMode.Stretch)

    def _choose(self, row: int, column: int) -> None:
        told = self._told
        if told is None or row >= len(told.rows):
            return
        equations = told.equations
        parts = [_number(cell) for cell in told.rows[row].cells]
        own = 2 <= column < 2 + len(equations)
        place = column - 2 if own else max(range(len(parts)), key=parts.__getitem__)
        self.part_chosen.emit(equations[place], told.rows[row].runs[0])


def _number(text: str) -> float:
    return float(text) if text else 0.0
