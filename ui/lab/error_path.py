"""The error path: one bar for each model tried, what would follow in outline, the floor as a grey band."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QEvent, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QHelpEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from fingerlab.core.text import score_text
from fingerlab.report.diagnosis_words import effect_title

from ..theme import Colours, colours_of, small_font
from ..widgets.plot_series import Series
from ..widgets.plot_style import tint
from .equations import SCORE_HELP
from .history import History

BAR_WIDTH = 40.0
MIN_COLUMN = 96.0
FLOOR_SCORE = 1.0


@dataclass(frozen=True)
class Bar:
    """One model of the path; ``tried`` ones are filled, the diagnosis' own suggestions outlined."""

    title: str
    score: float
    tried: bool


def bars_of(history: History) -> list[Bar]:
    """What was done, then what the present diagnosis would add."""
    done = history.done
    bars = [
        Bar(
            f"+ {effect_title(step.last_added)}" if step.last_added else "Nominal",
            step.diagnosis.score,
            True,
        )
        for step in done
    ]
    suggested = [step for step in history.now.diagnosis.path if step.added is not None]
    bars += [Bar(f"+ {effect_title(str(step.added))}", step.score, False) for step in suggested]
    return bars


class ErrorPath(QWidget):
    """Painted bars; the text of all of them is in the accessible description and the tooltip."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("errorPath")
        self.setAccessibleName("Error path")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.bars: list[Bar] = []

    def sizeHint(self) -> QSize:
        return QSize(400, 104)

    def minimumSizeHint(self) -> QSize:
        return QSize(160, 72)

    def show_history(self, history: History | None) -> None:
        """Show the path up to the present model."""
        self.bars = bars_of(history) if history is not None else []
        self.setAccessibleDescription(self.text())
        self.update()

    def text(self) -> str:
        """The path in words."""
        words = [
            f"{bar.title} {score_text(bar.score)}" + ("" if bar.tried else " (would be)") for bar in self.bars
        ]
        return " → ".join(words) + (", in multiples of the floor" if words else "")

    def numbers(self) -> list[Series]:
        """For CSV: the error of each model in multiples of the floor, by how many effects it has."""
        tried = [bar for bar in self.bars if bar.tried]
        parts = (("", 0, tried), ("would be", len(tried), [bar for bar in self.bars if not bar.tried]))
        return [
            Series(
                name,
                "Effects in the model",
                "Error (floors)",
                first + np.arange(len(bars), dtype=np.float64),
                np.array([bar.score for bar in bars]),
            )
            for name, first, bars in parts
            if bars
        ]

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            QToolTip.showText(event.globalPos(), f"{self.text()}\n\n{SCORE_HELP}", self)
            return True
        return super().event(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        if not self.bars:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(small_font())
        colours = colours_of(self)
        metrics = QFontMetricsF(painter.font())
        text_height = metrics.height()
        ground = self.height() - text_height - 2  # titles below
        room = ground - text_height - 2  # numbers above
        finite = [bar.score for bar in self.bars if math.isfinite(bar.score)]
        top = max([*finite, FLOOR_SCORE])
        floor_height = room * FLOOR_SCORE / top
        painter.fillRect(
            QRectF(0, ground - floor_height, self.width(), floor_height), tint(colours.floor, 0.35)
        )
        painter.setPen(QColor(colours.muted))
        label = "floor 1.0"
        painter.drawText(
            QRectF(0, ground - floor_height - text_height, self.width() - 4, text_height),
            Qt.AlignmentFlag.AlignRight,
            label,
        )
        left_room = self.width() - metrics.horizontalAdvance(label) - 8
        widest = max(metrics.horizontalAdvance(bar.title) for bar in self.bars)
        column = min(max(widest + 24, MIN_COLUMN), left_room / len(self.bars))
        for number, bar in enumerate(self.bars):
            height = room * min(bar.score, top) / top if math.isfinite(bar.score) else room
            self._paint_bar(painter, bar, QRectF(number * column, ground - height, column, height), colours)

    def _paint_bar(self, painter: QPainter, bar: Bar, room: QRectF, colours: Colours) -> None:
        metrics = QFontMetricsF(painter.font())
        width = min(BAR_WIDTH, room.width() - 8)
        body = QRectF(room.left() + 4, room.top(), width, max(room.height(), 1.0))
        if bar.tried:
            painter.fillRect(body, QColor(colours.residual))
        else:
            painter.setPen(QPen(QColor(colours.residual), 1, Qt.PenStyle.DashLine))
            painter.drawRect(body.adjusted(0.5, 0.5, -0.5, 0))
        painter.setPen(QColor(colours.text if bar.tried else colours.muted))
        number = score_text(bar.score) if bar.tried else f"({score_text(bar.score)})"
        above = QRectF(body.left(), body.top() - metrics.height() - 1, room.width() - 8, metrics.height())
        painter.drawText(above, Qt.AlignmentFlag.AlignLeft, number)
        below = QRectF(body.left(), body.bottom() + 1, room.width() - 8, metrics.height())
        title = metrics.elidedText(bar.title, Qt.TextElideMode.ElideRight, below.width())
        painter.drawText(below, Qt.AlignmentFlag.AlignLeft, title)
