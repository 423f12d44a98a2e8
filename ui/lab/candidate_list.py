"""The candidates as a list model: effects and the two other outcomes, ranked together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QAbstractListModel, QModelIndex, QObject, QPersistentModelIndex, Qt

from fingerlab.core.text import percent
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.diagnosis_words import suspects

from .wording import NOTHING, OUTCOME_TITLES, UNKNOWN

Index = QModelIndex | QPersistentModelIndex


@dataclass(frozen=True)
class Row:
    """``key`` is an effect id, or ``nothing_missing`` or ``not_in_catalogue``."""

    key: str
    title: str
    probability: float
    in_set: bool
    detectable: bool
    remark: str = ""


def rows_of(diagnosis: Diagnosis) -> list[Row]:
    """All rows, the verdict's first, then by probability, what the data cannot show last."""
    many = len(suspects(diagnosis)) > 1
    rows = [
        Row(c.effect, c.title, c.probability, c.in_set and many, c.detectable, _remark(c.detectable))
        for c in diagnosis.candidates
    ]
    rows += [
        Row(NOTHING, OUTCOME_TITLES[NOTHING], diagnosis.probability_nothing, False, True),
        Row(UNKNOWN, OUTCOME_TITLES[UNKNOWN], diagnosis.probability_unknown, False, True),
    ]
    first = diagnosis.verdict
    return sorted(rows, key=lambda row: (row.key != first, not row.detectable, -row.probability))


def _remark(detectable: bool) -> str:
    return "" if detectable else "these data cannot show it"


class CandidateList(QAbstractListModel):
    """Rows for the list; ``RowRole`` gives the whole row."""

    RowRole = Qt.ItemDataRole.UserRole + 1

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.rows: list[Row] = []

    def show(self, diagnosis: Diagnosis | None) -> None:
        self.beginResetModel()
        self.rows = rows_of(diagnosis) if diagnosis is not None else []
        self.endResetModel()

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self.rows)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        if not index.isValid():
            return None
        row = self.rows[index.row()]
        if role == Qt.ItemDataRole.DisplayRole:
            return row.title
        if role == self.RowRole:
            return row
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            return _spoken(row)
        return None

    def index_of(self, key: str) -> QModelIndex:
        """The row of an effect or outcome; an invalid index where it is not listed."""
        for number, row in enumerate(self.rows):
            if row.key == key:
                return self.index(number, 0)
        return QModelIndex()


def _spoken(row: Row) -> str:
    text = f"{row.title}: probability {percent(row.probability)}"
    if row.in_set:
        text += ", cannot be told apart from the others that are marked"
    return f"{text}, {row.remark}" if row.remark else text
