"""What is drawn by hand: weights or a joint as they are wanted now, and the stability light."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from fingerlab.calibration.sensors import CalibrationPlan, mark_text
from fingerlab.calibration.wizard import Light

from ..widgets.layout import FLUSH, described, hbox
from ..widgets.theme import Colours, colours_of, large_font, small_font

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
        self.word = described(QLabel(WORDS["none"]), "stability", font=large_font())
        self.word.setMinimumWidth(112)
        hbox(self, self._dot, (self.word, 1), margins=FLUSH, spacing=8)

    def show_light(self, light: Light) -> None:
        """Show how the reading stands."""
        if self._dot.light != light:
            self._dot.light = light
            self._dot.update()
        self.word.setText(WORDS[light])
        self.setAccessibleName(f"Reading: {WORDS[light]}")


SIZE = QSize(264, 216)


class Picture(QWidget):
    """Drawn in the window's colours; what is to change is blue and has an arrow."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("calibrationPicture")
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._plan: CalibrationPlan | None = None
        self._number = 0

    def sizeHint(self) -> QSize:
        return SIZE

    def show_step(self, plan: CalibrationPlan, number: int) -> None:
        """Show step ``number`` of the plan; the last one once all are done."""
        self._plan, self._number = plan, min(number, len(plan.moves) - 1)
        move = plan.moves[self._number]
        self.setAccessibleName(f"Picture: {move.words}")
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._plan is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(small_font())
        colours = colours_of(self)
        moves = self._plan.moves
        mark = moves[self._number].mark
        before = moves[self._number - 1].mark if self._number else mark
        if self._plan.sensor.mark_unit == "kg":
            _draw_weights(painter, QRectF(self.rect()), colours, round(10 * mark), round(10 * before))
        else:
            _draw_joint(painter, QRectF(self.rect()), colours, self._plan, mark, before)


def _draw_weights(painter: QPainter, room: QRectF, colours: Colours, count: int, before: int) -> None:
    """A cell on its support with ``count`` weights of 100 g; the one to add or take is marked."""
    text, accent = QColor(colours.text), QColor(colours.accent)
    middle, floor = room.center().x() - 24, room.bottom() - 12
    painter.setPen(QPen(text, 1.5))
    painter.setBrush(QColor(colours.line))
    painter.drawRect(QRectF(middle - 80, floor - 12, 160, 12))
    painter.drawRect(QRectF(middle - 20, floor - 28, 40, 16))
    painter.setBrush(QColor(colours.surface))
    painter.drawRect(QRectF(middle - 48, floor - 34, 96, 6))
    height = 14.0
    for number in range(max(count, before)):
        box = QRectF(middle - 32, floor - 34 - (number + 1) * height, 64, height - 2)
        adding, taking = before <= number < count, count <= number < before
        painter.setPen(QPen(accent if adding or taking else text, 1.5, _style(taking)))
        painter.setBrush(accent if adding else QColor(colours.surface))
        painter.drawRect(box)
        if adding or taking:
            start = QPointF(box.right() + 40, box.center().y())
            tip = QPointF(box.right() + 8, box.center().y())
            _arrow(painter, *((start, tip) if adding else (tip, start)), accent)
    painter.setPen(text)
    words = f"{100 * count} g"
    painter.drawText(QRectF(room.right() - 72, floor - 34, 72, 24), Qt.AlignmentFlag.AlignCenter, words)


def _draw_joint(
    painter: QPainter, room: QRectF, colours: Colours, plan: CalibrationPlan, mark: float, before: float
) -> None:
    """The sheet's quarter circle with its marks, the fixed phalanx, and the one to be flexed."""
    text, accent, muted = QColor(colours.text), QColor(colours.accent), QColor(colours.muted)
    centre, radius = QPointF(room.left() + 92, room.top() + 44), 116.0

    def place(angle: float, distance: float) -> QPointF:
        turn = math.radians(angle)
        return centre + QPointF(distance * math.cos(turn), distance * math.sin(turn))

    painter.setPen(QPen(muted, 1))
    painter.drawArc(QRectF(centre.x() - radius, centre.y() - radius, 2 * radius, 2 * radius), 0, -90 * 16)
    for angle in sorted(set(plan.marks)):
        wanted = angle == mark
        painter.setPen(QPen(accent if wanted else muted, 3 if wanted else 1))
        painter.drawLine(place(angle, radius - 6), place(angle, radius + 6))
        painter.setPen(accent if wanted else muted)
        at = place(angle, radius + 22)
        label = QRectF(at.x() - 20, at.y() - 10, 40, 20)
        painter.drawText(label, Qt.AlignmentFlag.AlignCenter, mark_text(plan.sensor, angle))
    wide = Qt.PenCapStyle.RoundCap
    painter.setPen(QPen(text, 16, Qt.PenStyle.SolidLine, wide))
    painter.drawLine(centre, centre - QPointF(72, 0))
    if before != mark:
        painter.setPen(QPen(muted, 2, Qt.PenStyle.DashLine))
        painter.drawLine(centre, place(before, 84))
        end = place(mark + (6 if mark < before else -6), 100)
        _arrow(painter, place(before, 100), end, accent)
    painter.setPen(QPen(accent, 14, Qt.PenStyle.SolidLine, wide))
    painter.drawLine(centre, place(mark, 84))
    painter.setPen(QPen(text, 2))
    painter.setBrush(QColor(colours.surface))
    painter.drawEllipse(centre, 7, 7)


def _style(dashed: bool) -> Qt.PenStyle:
    return Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine


def _arrow(painter: QPainter, start: QPointF, tip: QPointF, colour: QColor) -> None:
    along = tip - start
    length = math.hypot(along.x(), along.y())
    if length < 1:
        return
    along /= length
    across = QPointF(-along.y(), along.x())
    painter.setPen(QPen(colour, 2))
    painter.drawLine(start, tip)
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([tip, tip - along * 9 + across * 5, tip - along * 9 - across * 5]))
