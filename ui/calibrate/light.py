"""The stability light: a dot and, beside it, the word."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QSize
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from fingerlab.calibration.wizard import Light

from ..theme import colours_of, large_font

WORDS: dict[Light, str] = {"none": "no reading", "moving": "moving", "stable": "stable"}


class _Dot(QWidget):
    """Full while stable, half while moving, a ring where nothing is read."""

    light: Light = "none"

    def sizeHint(self) -> QSize:
        return QSize(24, 24)

    def paintEvent(self, event: QPaintEvent) -> None:
        colours = colours_of(self)
        colour = QColor(
            {"none": colours.muted, "moving": colours.residual, "stable": colours.candidate}[self.light]
        )
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        middle = QPointF(self.width() / 2, self.height() / 2)
        painter.setPen(QPen(colour, 3))
        painter.drawEllipse(middle, 9, 9)
        if self.light != "none":
            painter.setBrush(colour)
            painter.drawEllipse(middle, *((9, 9) if self.light == "stable" else (3, 3)))


class StabilityLight(QWidget):
    """Dot and word."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._dot = _Dot()
        self._dot.setFixedSize(24, 24)
        self.word = QLabel(WORDS["none"])
        self.word.setObjectName("stability")
        self.word.setFont(large_font())
        self.word.setMinimumWidth(112)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        layout.addWidget(self._dot)
        layout.addWidget(self.word, 1)

    def show_light(self, light: Light) -> None:
        """Show how the reading stands."""
        if self._dot.light != light:
            self._dot.light = light
            self._dot.update()
        self.word.setText(WORDS[light])
        self.setAccessibleName(f"Reading: {WORDS[light]}")
