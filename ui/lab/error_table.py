"""The error of each equation on held-out runs: before, now, floor."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from fingerlab.core.text import r2_text
from fingerlab.report.diagnosis_words import FAMILY_TITLES

from ..theme import small_font
from .equations import FLOOR_HELP
from .history import History
from .wording import error_texts

HEADINGS = ("held-out error", "nominal", "now", "floor", "", "R²")
HELP = (
    "",
    "Root mean square of the residual with the nominal model.",
    "Root mean square of the residual with the present model.",
    FLOOR_HELP,
    "",
    "Share of the variance that the present model explains on held-out runs.",
)


class ErrorTable(QWidget):
    """At most four rows, one for each kind of equation."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("errorTable")
        self.setAccessibleName("Error of each equation on held-out runs")
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(12)
        self._grid.setVerticalSpacing(1)
        self._grid.setColumnStretch(len(HEADINGS), 1)
        self._labels: list[QLabel] = []

    def show_history(self, history: History | None) -> None:
        """Rebuild the rows for the present model."""
        while self._labels:
            label = self._labels.pop()
            self._grid.removeWidget(label)
            label.deleteLater()
        if history is None:
            return
        for column, text in enumerate(HEADINGS):
            self._put(0, column, text, muted=True, help_text=HELP[column])
        first, now = history.first.diagnosis.errors, history.now.diagnosis.errors
        spoken = []
        for row, (family, error) in enumerate(now.items(), start=1):
            before, after, floor, unit = error_texts(first.get(family, error), error)
            title = FAMILY_TITLES.get(family, family)
            cells = (title, before, after, floor, unit, r2_text(error.r2))
            for column, text in enumerate(cells):
                self._put(row, column, text, bold=column == 2, help_text=HELP[column])
            spoken.append(f"{title}: nominal {before}, now {after}, floor {floor} {unit}")
        self._grid.setRowStretch(len(now) + 1, 1)
        self.setAccessibleDescription("; ".join(spoken))

    def cell(self, family: str, column: str) -> str:
        """The text in a row (by key of ``Diagnosis.errors``) and a column (by heading)."""
        for row in range(1, self._grid.rowCount()):
            item = self._grid.itemAtPosition(row, 0)
            label = item.widget() if item is not None else None
            if isinstance(label, QLabel) and label.text() == FAMILY_TITLES.get(family, family):
                found = self._grid.itemAtPosition(row, HEADINGS.index(column))
                cell = found.widget() if found is not None else None
                return cell.text() if isinstance(cell, QLabel) else ""
        return ""

    def _put(
        self, row: int, column: int, text: str, muted: bool = False, bold: bool = False, help_text: str = ""
    ) -> None:
        label = QLabel(text)
        font = small_font()
        font.setBold(bold)
        label.setFont(font)
        label.setToolTip(help_text)
        if muted:
            label.setProperty("role", "muted")
        right = column in (1, 2, 3, 5)
        side = Qt.AlignmentFlag.AlignRight if right else Qt.AlignmentFlag.AlignLeft
        self._grid.addWidget(label, row, column, side)
        self._labels.append(label)
