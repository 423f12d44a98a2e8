"""What lines, points and bands mean, beside the values under the cursor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from ..theme import Colours, colours_of, small_font
from ..widgets.labels import ElidedLabel
from ..widgets.plot_style import line, tint

SAMPLE = 24.0
GAP = 16.0


@dataclass(frozen=True)
class Key:
    """One entry: its words, the colour by name, and how it is drawn."""

    words: str
    colour: str
    style: Literal["solid", "dashed", "dotted", "points", "band", "tint"] = "solid"


CURVES = (
    Key("measured", "measured"),
    Key("modelled", "modelled", "dashed"),
    Key("residual", "residual"),
    Key("floor", "floor", "band"),
)
WORST = (Key("worst stretch:", "residual", "tint"),)
CHOSEN = (Key("chosen place:", "residual", "tint"),)
FINGERPRINT = (
    Key("mean residual", "residual", "points"),
    Key("the effect's own curve", "candidate"),
    Key("floor", "floor", "band"),
)


WHERE = (
    Key("root mean square", "residual", "tint"),
    Key("mean, 90 % interval", "residual", "points"),
    Key("floor", "floor", "band"),
)
LOOK_ALIKES = (*FINGERPRINT[:2], Key("look-alikes", "alike", "dotted"), *FINGERPRINT[2:])
RESIDUAL_ONLY = tuple(key for key in FINGERPRINT if key.colour != "candidate")


class LegendKeys(QWidget):
    """Painted samples with their words.

    Args:
        wraps: goes on in another line where room is short; else it keeps the room of one line.
    """

    def __init__(self, keys: tuple[Key, ...], wraps: bool = False, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._wraps = wraps
        self.setFont(small_font())
        across = QSizePolicy.Policy.Preferred if wraps else QSizePolicy.Policy.Fixed
        self.setSizePolicy(across, QSizePolicy.Policy.Fixed)
        self.set_keys(keys)

    def set_keys(self, keys: tuple[Key, ...]) -> None:
        """Show other entries."""
        self._keys = keys
        self.setAccessibleName("Legend: " + ", ".join(f"{key.words} {key.style}" for key in keys))
        self.updateGeometry()
        self.update()

    def _width_of(self, key: Key) -> float:
        return SAMPLE + 4 + QFontMetricsF(small_font()).horizontalAdvance(key.words)

    @property
    def _line_height(self) -> int:
        return int(QFontMetricsF(small_font()).height()) + 4

    def _places(self, room: float) -> list[tuple[float, int]]:
        """Where each entry begins in so much room: x, and the line from 0."""
        x, row, places = 0.0, 0, []
        for key in self._keys:
            width = self._width_of(key)
            if self._wraps and x > 0 and x + width > room:
                x, row = 0.0, row + 1
            places.append((x, row))
            x += width + GAP
        return places

    def sizeHint(self) -> QSize:
        width = sum(map(self._width_of, self._keys)) + GAP * (len(self._keys) - 1)
        return QSize(int(width) + 4, self.minimumSizeHint().height())

    def minimumSizeHint(self) -> QSize:
        if not self._wraps:
            return QSize(0, self._line_height)
        rows = 1 + max((row for _, row in self._places(self.width())), default=0)
        return QSize(int(max(map(self._width_of, self._keys), default=0.0)) + 4, rows * self._line_height)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._wraps and event.oldSize().width() != event.size().width():
            self.updateGeometry()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setFont(small_font())
        colours, high = colours_of(self), self._line_height
        for key, (x, row) in zip(self._keys, self._places(self.width()), strict=True):
            self._paint_sample(painter, QRectF(x, row * high, SAMPLE, high), key, colours)
            painter.setPen(QColor(colours.text))
            place = QRectF(x + SAMPLE + 4, row * high, self._width_of(key) - SAMPLE - 2, high)
            painter.drawText(place, Qt.AlignmentFlag.AlignVCenter, key.words)

    def _paint_sample(self, painter: QPainter, room: QRectF, key: Key, colours: Colours) -> None:
        colour = getattr(colours, key.colour)
        middle = room.center().y()
        if key.style in ("band", "tint"):
            alpha = 0.35 if key.style == "band" else 0.3
            painter.fillRect(QRectF(room.left(), middle - 5, room.width(), 10), tint(colour, alpha))
        elif key.style == "points":
            painter.setPen(line(colour))
            painter.setBrush(QColor(colour))
            painter.drawEllipse(QPointF(room.center().x(), middle), 3, 3)
        else:
            pen = line(colour, 2 * self.devicePixelRatioF(), dashed=key.style == "dashed")
            if key.style == "dotted":
                pen.setStyle(Qt.PenStyle.DotLine)
            painter.setPen(pen)
            painter.drawLine(QPointF(room.left(), middle), QPointF(room.right(), middle))


class LegendRow(QWidget):
    """The legend and the name of the tinted stretch at the left, the values under the cursor at the right."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.stretch_key = LegendKeys(WORST)
        self.stretch = ElidedLabel()
        self.stretch.setObjectName("stretchName")
        self.values = ElidedLabel()
        self.values.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        for label in (self.stretch, self.values):
            label.setFont(small_font())
        layout = QHBoxLayout(self)
        layout.setContentsMargins(72, 0, 8, 0)
        layout.setSpacing(4)
        layout.addWidget(LegendKeys(CURVES))
        layout.addSpacing(8)
        layout.addWidget(self.stretch_key)
        layout.addWidget(self.stretch, 1)
        layout.addWidget(self.values, 1)
        self.name_stretch("")

    def name_stretch(self, text: str) -> None:
        """Name the tinted worst stretch; empty where none is tinted."""
        self._name(text, WORST)

    def name_place(self, text: str) -> None:
        """Name the place that the user chose, which is tinted."""
        self._name(text, CHOSEN)

    def _name(self, text: str, keys: tuple[Key, ...]) -> None:
        self.stretch.setText(text)
        self.stretch_key.set_keys(keys)
        self.stretch_key.setVisible(bool(text))
