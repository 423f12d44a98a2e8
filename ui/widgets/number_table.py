"""A table of numbers to read, not to edit: small, quiet, each column's meaning in its tooltip."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractItemView, QTableWidget, QWidget

from ..theme import small_font


class NumberTable(QTableWidget):
    """A table with fixed columns, each a title and what it means."""

    def __init__(
        self,
        name: str,
        accessible: str,
        columns: Sequence[tuple[str, str]],
        words: int = 1,
        parent: QWidget | None = None,
    ) -> None:
        """Args:
        columns: title and meaning of each. words: so many columns at the left hold words, the rest numbers.
        """
        super().__init__(0, len(columns), parent)
        self.setObjectName(name)
        self.setAccessibleName(accessible)
        self.setHorizontalHeaderLabels([title for title, _ in columns])
        for column, (_, meaning) in enumerate(columns):
            item = self.horizontalHeaderItem(column)
            assert item is not None
            item.setToolTip(meaning)
            side = Qt.AlignmentFlag.AlignLeft if column < words else Qt.AlignmentFlag.AlignRight
            item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
        self.setFont(small_font())
        self.horizontalHeader().setFont(small_font())
        self.verticalHeader().hide()
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setTabKeyNavigation(False)  # Tab leaves the table; the arrows move in it
        self.setShowGrid(False)
