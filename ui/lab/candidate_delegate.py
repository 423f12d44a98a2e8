"""Draws a candidate: mark of the set, title, probability, bar."""

from __future__ import annotations

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRect, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter
from PySide6.QtWidgets import QStyle, QStyledItemDelegate, QStyleOptionViewItem, QWidget

from fingerlab.core.text import percent

from ..theme import Colours, colours_of
from ..widgets.plot_style import tint
from .candidate_list import CandidateList, Row

SET_MARK = "≈"
BAR_SHARE = 0.16
GAP = 8
WORTH_SAYING = 0.005
"""Probability from which an effect that the data could not show has its number, too."""


class CandidateDelegate(QStyledItemDelegate):
    """One line a candidate. The chosen one is tinted; those in the set carry ≈ at the left."""

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        return QSize(160, QFontMetrics(option.font).height() + GAP)

    def paint(
        self, painter: QPainter, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        row: Row = index.data(CandidateList.RowRole)
        widget = option.widget
        if row is None or not isinstance(widget, QWidget):
            return
        colours = colours_of(widget)
        painter.save()
        room = QRect(option.rect)
        if option.state & QStyle.StateFlag.State_Selected:
            painter.fillRect(room, tint(colours.accent, 0.18))
            painter.fillRect(QRect(room.left(), room.top(), 3, room.height()), QColor(colours.accent))
        self._paint_row(painter, option, room.adjusted(GAP, 0, -GAP, 0), row, colours)
        painter.restore()

    def _paint_row(
        self, painter: QPainter, option: QStyleOptionViewItem, room: QRect, row: Row, colours: Colours
    ) -> None:
        metrics = QFontMetrics(option.font)
        middle = Qt.AlignmentFlag.AlignVCenter
        mark_width = metrics.horizontalAdvance(SET_MARK) + GAP // 2
        bar_width = int(room.width() * BAR_SHARE)
        number_width = metrics.horizontalAdvance("> 99 %")
        text_width = room.width() - mark_width - bar_width - number_width - 2 * GAP
        font = QFont(option.font)
        painter.setFont(font)
        painter.setPen(QColor(colours.text if row.detectable else colours.muted))
        if row.in_set:
            painter.drawText(QRect(room.left(), room.top(), mark_width, room.height()), middle, SET_MARK)
        title = QRect(room.left() + mark_width, room.top(), text_width, room.height())
        painter.drawText(
            title, middle, metrics.elidedText(row.title, Qt.TextElideMode.ElideRight, text_width)
        )
        number = QRect(title.right() + GAP, room.top(), number_width, room.height())
        if not row.detectable:
            wide = number.adjusted(0, 0, bar_width + GAP, 0)
            worth = row.probability >= WORTH_SAYING
            words = f"{percent(row.probability)}, not visible" if worth else "not visible here"
            text = metrics.elidedText(words, Qt.TextElideMode.ElideRight, wide.width())
            painter.drawText(wide, middle | Qt.AlignmentFlag.AlignRight, text)
            return
        painter.drawText(number, middle | Qt.AlignmentFlag.AlignRight, percent(row.probability))
        self._paint_bar(
            painter, QRect(number.right() + GAP, room.top(), bar_width, room.height()), row, colours
        )

    def _paint_bar(self, painter: QPainter, room: QRect, row: Row, colours: Colours) -> None:
        height = max(6, room.height() // 3)
        bar = QRect(room.left(), room.center().y() - height // 2, room.width(), height)
        painter.fillRect(bar, tint(colours.floor, 0.25))
        bar.setWidth(max(1, round(room.width() * min(max(row.probability, 0.0), 1.0))))
        painter.fillRect(bar, QColor(colours.candidate))
