"""Boxes to tick in a list, with a frame that is seen in every theme."""

from __future__ import annotations

from PySide6.QtCore import QModelIndex, QPersistentModelIndex
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QStyledItemDelegate, QStyleOptionViewItem

from ..theme import OUTLINE_DARKER


class FramedTicks(QStyledItemDelegate):
    """Draws each box, ticked or not, with a frame in the palette's dark colour.

    The style darkens the window's colour for it, and in a list that is the list's own background, so that on
    black there was none; a style sheet can frame the empty box alone, without a picture for the ticked one.
    """

    def initStyleOption(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        """As the base, with a window's colour from which the style comes to that of the frame."""
        super().initStyleOption(option, index)
        palette = option.palette
        frame = palette.color(QPalette.ColorRole.Dark)
        palette.setColor(QPalette.ColorRole.Window, frame.lighter(round(100 * OUTLINE_DARKER)))
        option.palette = palette
