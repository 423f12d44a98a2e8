"""The small pictures of motor motion: asked for when a row is painted, read by a thread, kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import QModelIndex, QObject, QPersistentModelIndex, QPointF, QRectF, QSize, Signal
from PySide6.QtGui import QPainter, QPolygonF
from PySide6.QtWidgets import QStyle, QStyledItemDelegate, QStyleOptionViewItem

from fingerlab.library.pyramid import Thumbnail, make_thumbnail

from ..theme import colours_of
from ..widgets.plot_style import line, tint
from .background import Background, IsCancelled, Tell
from .table_model import PATH_ROLE

KEPT = 4000
"""Thumbnails held in memory: 1.5 kB each."""


class Thumbnails(QObject):
    """Signal ``ready(path)``: a thumbnail that was asked for is there."""

    ready = Signal(object)

    def __init__(
        self, parent: QObject | None = None, make: Callable[[Path], Thumbnail] = make_thumbnail
    ) -> None:
        super().__init__(parent)
        self._make = make
        self._kept: dict[tuple[Path, float], Thumbnail | None] = {}
        self._thread = Background(self)
        self._thread.done.connect(self._keep)
        self._thread.failed.connect(self._give_up)

    def get(self, path: Path, modified: float) -> Thumbnail | None:
        """The thumbnail of a file as it was at a time; None while it is not read yet or cannot be."""
        key = (path, modified)
        if key not in self._kept:
            self._kept[key] = None
            self._thread.ask(key, partial(_work, self._make, path))
        return self._kept[key]

    def shut_down(self) -> None:
        self._thread.shut_down()

    def _keep(self, key: tuple[Path, float], found: Thumbnail) -> None:
        while len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = found
        self.ready.emit(key[0])

    def _give_up(self, key: object, sentence: str, details: str) -> None:
        """A file without a picture; the row says itself what is wrong with it."""


def _work(make: Callable[[Path], Thumbnail], path: Path, tell: Tell, cancelled: IsCancelled) -> Thumbnail:
    return make(path)


class ThumbnailDelegate(QStyledItemDelegate):
    """Paints the motor position of a session between its smallest and largest value."""

    def __init__(self, find: Callable[[Path], Thumbnail | None], parent: QObject) -> None:
        super().__init__(parent)
        self._find = find

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        super().paint(painter, option, index)
        view: Any = option.widget
        found = self._find(Path(str(index.data(PATH_ROLE))))
        if found is None or not len(found.low):
            return
        room = QRectF(option.rect.adjusted(6, 5, -6, -5))
        selected = bool(option.state & QStyle.StateFlag.State_Selected)
        colours = colours_of(view)
        colour = colours.on_accent if selected else colours.measured
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(line(colour, 1.0))
        painter.setBrush(tint(colour, 0.35))
        painter.drawPolygon(outline(found, room))
        painter.setPen(line(colours.on_accent if selected else colours.line, 1.0))
        for place in found.breaks[1:] if len(found.breaks) <= len(found.low) // 3 else ():
            x = room.left() + room.width() * place / len(found.low)
            painter.drawLine(QPointF(x, room.top()), QPointF(x, room.bottom()))
        painter.restore()

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        return QSize(112, super().sizeHint(option, index).height())


def outline(found: Thumbnail, room: QRectF) -> QPolygonF:
    """Along the largest values and back along the smallest, as large as there is room."""
    count = len(found.low)
    bottom, top = float(np.nanmin(found.low)), float(np.nanmax(found.high))
    scale = room.height() / (top - bottom) if top > bottom else 0.0
    x = room.left() + room.width() * (np.arange(count) + 0.5) / count
    upper = room.bottom() - scale * (found.high - bottom)
    lower = room.bottom() - scale * (found.low - bottom)
    there = [QPointF(float(a), float(b)) for a, b in zip(x, upper, strict=True)]
    back = [QPointF(float(a), float(b)) for a, b in zip(x[::-1], lower[::-1], strict=True)]
    return QPolygonF(there + back)
