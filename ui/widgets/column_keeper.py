"""Keeps the columns of a table as the user left them: their widths, and by which one it is sorted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QHeaderView, QTableView

if TYPE_CHECKING:
    from ..settings import Settings


class ColumnKeeper(QObject):
    """Watches the header of one table, which owns it; what was kept last time holds from the start.

    Attributes:
        by_hand: whether the widths are the user's own, so that nobody else shall change them.
    """

    def __init__(self, table: QTableView, settings: Settings) -> None:
        super().__init__(table)
        self._table, self._settings, self._name = table, settings, table.objectName()
        self._pressed: tuple[int, ...] | None = None
        self.by_hand = False
        header = table.horizontalHeader()
        self._restore(header)
        header.viewport().installEventFilter(self)
        header.sortIndicatorChanged.connect(self._on_sorted)

    def _restore(self, header: QHeaderView) -> None:
        widths = self._settings.widths(self._name)
        if len(widths) == header.count():
            self.by_hand = True
            for column, width in enumerate(widths):
                if header.sectionResizeMode(column) == QHeaderView.ResizeMode.Interactive:
                    header.resizeSection(column, max(width, header.minimumSectionSize()))
        column, descending = self._settings.sorting(self._name)
        if 0 <= column < header.count():
            order = Qt.SortOrder.DescendingOrder if descending else Qt.SortOrder.AscendingOrder
            self._table.sortByColumn(column, order)

    def _widths(self) -> tuple[int, ...]:
        header = self._table.horizontalHeader()
        return tuple(header.sectionSize(column) for column in range(header.count()))

    def _on_sorted(self, column: int, order: Qt.SortOrder) -> None:
        self._settings.set_sorting(self._name, column, order == Qt.SortOrder.DescendingOrder)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        # Only what happens between press and release is the user's: the window changes widths as well.
        if event.type() in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick):
            self._pressed = self._widths()
        elif event.type() == QEvent.Type.MouseButtonRelease and self._pressed is not None:
            if self._widths() != self._pressed:
                self.by_hand = True
                self._settings.set_widths(self._name, self._widths())
            self._pressed = None
        return False
