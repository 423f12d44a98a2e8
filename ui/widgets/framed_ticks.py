"""Boxes to tick in a list, with a frame that is seen in every theme."""

from __future__ import annotations

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, Qt
from PySide6.QtGui import QPainter, QPalette
from PySide6.QtWidgets import QApplication, QStyle, QStyledItemDelegate, QStyleOptionViewItem

Index = QModelIndex | QPersistentModelIndex


class FramedTicks(QStyledItemDelegate):
    """Draws each box, ticked or not, with a frame in the palette's dark colour.

    The style darkens the window's colour for it, and in a list that is the row's own background, so that on
    black there was none; a style sheet can frame the empty box alone, without a picture for the ticked one.
    """

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        """As the base, and a frame around the box."""
        super().paint(painter, option, index)
        if index.data(Qt.ItemDataRole.CheckStateRole) is None:
            return
        own = QStyleOptionViewItem(option)
        self.initStyleOption(own, index)
        style = own.widget.style() if own.widget is not None else QApplication.style()
        box = style.subElementRect(QStyle.SubElement.SE_ItemViewItemCheckIndicator, own, own.widget)
        painter.save()
        painter.setPen(own.palette.color(QPalette.ColorRole.Dark))
        painter.drawRect(box.adjusted(0, 0, -1, -1))
        painter.restore()
