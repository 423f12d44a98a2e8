"""One live plot: its readings as large numbers above, its curves below, its scale."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from PySide6.QtCore import QSignalBlocker, QSize, Signal
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QCheckBox, QGridLayout, QLabel, QSizePolicy, QToolButton, QWidget

from fingerlab.sessions.model import Array

from ..widgets.fields import NumberField, form_menu
from ..widgets.layout import FLUSH, described, hbox, vbox
from ..widgets.tables import ElidedLabel, heading, remark
from ..widgets.theme import colours_of, large_font, line, small_font
from .live_canvas import Canvas
from .live_curves import ShownPart
from .live_history import MODELLED, QUANTITIES, LiveHistory, LivePlotSpec, LiveQuantity, LiveTrace

LARGEST = 1e6


class PlotScale:
    """Automatic while ``fixed`` is None, else (low, high) in the screen's unit."""

    def __init__(self, least: float) -> None:
        self.least = least
        self.fixed: tuple[float, float] | None = None


class ScaleButton(QToolButton):
    """Opens a small form: automatic, or from where to where."""

    def __init__(self, spec: LivePlotSpec, scale: PlotScale, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._scale = scale
        self._short = False
        self._shown = (-spec.least / 2, spec.least / 2)
        self.setObjectName(f"scale_{spec.key}")
        self.setAccessibleName(f"Scale of {spec.title}")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setToolTip("Scale of this plot: automatic, or as you set it.")
        form = QWidget()
        self.automatic = QCheckBox("&Automatic")
        self.automatic.setChecked(True)
        self.low, self.high = (self._field(name, spec) for name in ("From", "To"))
        layout = QGridLayout(form)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.addWidget(heading(f"{spec.title} ({spec.unit.symbol})"), 0, 0, 1, 2)
        layout.addWidget(self.automatic, 1, 0, 1, 2)
        for row, (words, field) in enumerate((("&From", self.low), ("&To", self.high)), start=2):
            label = QLabel(words)
            label.setBuddy(field)
            layout.addWidget(label, row, 0)
            layout.addWidget(field, row, 1)
        form_menu(self, form).aboutToShow.connect(self._fill)
        self.automatic.toggled.connect(self._changed)
        self.low.valueChanged.connect(self._changed)
        self.high.valueChanged.connect(self._changed)
        self._say()

    def _field(self, name: str, spec: LivePlotSpec) -> NumberField:
        field = NumberField()
        field.setRange(-LARGEST, LARGEST)
        field.setDecimals(2 if spec.least < 1 else 1)
        field.setAccessibleName(f"{name}, {spec.title}")
        field.setEnabled(False)
        return field

    def show_range(self, shown: tuple[float, float]) -> None:
        """What the plot shows now: what the form starts from."""
        self._shown = shown

    def _fill(self) -> None:
        if self._scale.fixed is None:
            for field, value in ((self.low, self._shown[0]), (self.high, self._shown[1])):
                with QSignalBlocker(field):
                    field.setValue(value)

    def _changed(self) -> None:
        hand = not self.automatic.isChecked()
        self.low.setEnabled(hand)
        self.high.setEnabled(hand)
        order = hand and self.low.value() >= self.high.value()
        if not self.high.complaint or not order:
            self.high.complain("To: it is not above From; give a larger number." if order else "")
        if hand and not order:
            self._scale.fixed = self.low.value(), self.high.value()
        elif not hand:
            self._scale.fixed = None
        self._say()

    def shorten(self, on: bool) -> None:
        """Without the word for how it is, where room is short."""
        if on != self._short:
            self._short = on
            self._say()

    def width_of(self, short: bool) -> int:
        """What it needs, short or not, px."""
        more = 0 if self._short else self._words_width()
        return self.sizeHint().width() - more + (0 if short else self._words_width())

    def _words_width(self) -> int:
        return self.fontMetrics().horizontalAdvance(self._how())

    def _how(self) -> str:
        return ": auto" if self._scale.fixed is None else ": set"

    def _say(self) -> None:
        self.setText("Scale" if self._short else f"Scale{self._how()}")
        self.setAccessibleDescription("automatic" if self._scale.fixed is None else "as it was set")


SHRINK_BELOW = 0.35
"""An automatic scale is tightened when its data fill less than this share of it."""

SCALE_MARGIN = 1.15
SPARED = ("motor_speed",), ("motor_current",)
"""Readings that a narrow window leaves out, and those that go next; the cursors tell them all the same."""
NAMED = ("motor_command",)
"""Readings of which only the name is left in the end, with the sample of its curve."""
WITH_ERROR = ("torque", "force")
"""Plots of what a model tells."""
UNKNOWN = "–"
ERROR_ROOM = 2
"""Beside the words of an error, px."""
GAP, MARGIN, SAMPLE_GAP = 16, 8, 4
"""Between the readings, at either end of their row, and within one, px."""


class Swatch(QWidget):
    """A short piece of a curve as it is drawn: the legend."""

    def __init__(self, trace: LiveTrace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._trace = trace
        self.setFixedSize(QSize(20, 12))

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        colour = getattr(colours_of(self), self._trace.role)
        painter.setPen(line(colour, 3.0 if self._trace.wide else 1.5))
        painter.drawLine(0, self.height() // 2, self.width(), self.height() // 2)
        painter.end()


class LargeReading(QWidget):
    """A large number with its name, its unit, and the curve it belongs to."""

    def __init__(
        self, quantity: LiveQuantity, trace: LiveTrace | None, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._quantity = quantity
        self.value = QLabel(quantity.text(math.nan))
        self.value.setObjectName(f"reading_{quantity.column}")
        self.value.setAccessibleName(quantity.title)
        font = large_font()
        font.setBold(True)
        self.value.setFont(font)
        widest = QLabel(quantity.unit.after("−8888." + "8" * quantity.digits))
        # Nothing moves as digits come and go, and a label of fixed size does not lay out the window.
        self.value.setFixedSize(widest.sizeHint().width() * 5 // 4, self.value.sizeHint().height())
        self.setToolTip(quantity.help)
        layout = hbox(self, margins=FLUSH, spacing=SAMPLE_GAP)
        if trace is not None:
            layout.addWidget(Swatch(trace))
        layout.addWidget(remark(quantity.title, wrap=False))
        layout.addWidget(self.value)

    def width_of(self, valued: bool) -> int:
        """What it needs with its value or without, px."""
        more = self.value.width() + SAMPLE_GAP
        return self.sizeHint().width() + more * (int(valued) - int(not self.value.isHidden()))

    def show_value(self, value: float) -> None:
        """Show a value in SI."""
        text = self._quantity.text(value)
        if text != self.value.text():
            self.value.setText(text)
            if (wanted := self.value.sizeHint().width()) > self.value.width():
                self.value.setFixedWidth(wanted)


class ErrorReading(ElidedLabel):
    """What the model leaves over, with its unit; where room is short a sign stands for the word."""

    def __init__(self, quantity: LiveQuantity) -> None:
        super().__init__()
        self.setFont(small_font())
        self.setProperty("role", "muted")
        self._quantity = quantity
        self._short = False
        widest = quantity.unit.after("88." + "8" * quantity.digits)
        self._widths = [self._width(text) for text in self._words(widest)]
        self.shorten(False)
        self.show_value(math.nan)

    @staticmethod
    def _words(value: str) -> tuple[str, str]:
        return f"error {value}", value if value == UNKNOWN else f"± {value}"

    def show_value(self, value: float) -> None:
        """Root mean square of measured less modelled, SI; NaN where none is known yet."""
        words = self._words(self._quantity.text(value) if value == value else UNKNOWN)
        if words[0] == self.text():
            return
        self.set_texts(words)
        needed = [self._width(text) for text in words]
        if any(new > old for new, old in zip(needed, self._widths, strict=True)):
            self._widths = list(map(max, needed, self._widths))  # nothing moves as digits come and go
            self.shorten(self._short)
        self.setToolTip("")

    def width_of(self, short: bool) -> int:
        """What it needs, with the word before the number or a sign, px."""
        return self._widths[short] + ERROR_ROOM

    def shorten(self, on: bool) -> None:
        """A sign in place of the word before the number."""
        self._short = on
        self.setFixedWidth(self.width_of(on))


class LivePane(QWidget):
    """Signals: moved_by_hand(left, right) in s; cursor_moved(number, time)."""

    moved_by_hand = Signal(float, float)
    cursor_moved = Signal(int, float)

    def __init__(self, spec: LivePlotSpec, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.spec = spec
        self.setObjectName(f"pane_{spec.key}")
        self.canvas = described(Canvas(spec.title, spec.unit.symbol), accessible=f"{spec.title} against time")
        self.canvas.notes = spec.key == "displacement"
        self.canvas.moved_by_hand.connect(self.moved_by_hand)
        self.canvas.cursor_moved.connect(self.cursor_moved)
        self.scale = PlotScale(spec.least)
        self._model = False
        self._spared: dict[QWidget, int] = {}
        self._named: list[LargeReading] = []
        self._range = (-spec.least / 2, spec.least / 2)
        self.canvas.y_range = self._range
        first = spec.readings[0] if spec.readings else spec.traces[0].column
        self.error = described(ErrorReading(QUANTITIES[first]), f"error_{spec.key}")
        self._build()

    def _build(self) -> None:
        spec = self.spec
        self.readings: dict[str, LargeReading] = {}
        row = hbox(None, margins=(MARGIN, 0, MARGIN, 0), spacing=GAP)
        drawn = {trace.column: trace for trace in spec.traces}
        for column in spec.readings:
            self.readings[column] = LargeReading(QUANTITIES[column], drawn.get(column))
            row.addWidget(self.readings[column])
            if column in NAMED:
                self._named.append(self.readings[column])
            for step, columns in enumerate(SPARED, 1):
                if column in columns:
                    self._spared[self.readings[column]] = step
        self.modelled: list[QWidget] = []
        for column, trace in drawn.items():
            if column not in spec.readings:
                legend = hbox(None, spacing=4)
                legend.addWidget(swatch := Swatch(trace))
                legend.addWidget(words := remark(QUANTITIES[column].title, wrap=False))
                row.addLayout(legend)
                self.modelled += [swatch, words]
                self._spared[words] = 1
                swatch.setToolTip(QUANTITIES[column].title)
        row.addWidget(self.error)
        row.addStretch(1)
        self.scale_button = ScaleButton(spec, self.scale)
        row.addWidget(self.scale_button)
        vbox(self, row, (self.canvas, 1), margins=FLUSH, spacing=0)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    # room

    def minimumSizeHint(self) -> QSize:
        return QSize(self._needed(len(SPARED)), super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share_room()

    def _wanted(self, step: int) -> Mapping[QWidget, bool]:
        """What stands above the plot, and whether it is shown once so much is left out."""
        everything: dict[QWidget, bool] = dict.fromkeys(self.readings.values(), True)
        everything |= dict.fromkeys(self.modelled, self._model or self.spec.model)
        everything[self.error] = self._model and self.spec.key in WITH_ERROR
        last = len(SPARED) + 1
        return {one: on and step < self._spared.get(one, last) for one, on in everything.items()}

    def _needed(self, step: int) -> int:
        """Width of the row once so much is left out."""
        last = step == len(SPARED)
        widths = []
        for one, shown in self._wanted(step).items():
            valued = not (last and one in self._named)
            if isinstance(one, LargeReading):
                width = one.width_of(valued)
            else:
                width = one.width_of(last) if isinstance(one, ErrorReading) else one.sizeHint().width()
            widths += [width] if shown else []
        widths.append(self.scale_button.width_of(last))
        return sum(widths) + GAP * len(widths) + 2 * MARGIN

    def _share_room(self) -> None:
        """Leave out what can be spared where there is no room for all of it."""
        last = len(SPARED)
        step = next((one for one in range(last) if self._needed(one) <= self.width()), last)
        self.scale_button.shorten(step == last)
        self.error.shorten(step == last)
        for reading in self._named:
            reading.value.setHidden(step == last)
        for widget, shown in self._wanted(step).items():
            if widget.isHidden() == shown:
                widget.setVisible(shown)

    # what is shown

    @property
    def y_range(self) -> tuple[float, float]:
        """From where to where the scale goes, in the screen's unit."""
        return self.canvas.y_range

    def drawn(self, column: str) -> tuple[Array, Array]:
        """Times (s) and values (screen unit) of a curve as they are drawn."""
        number = [trace.column for trace in self.spec.traces].index(column)
        curve = self.canvas.lines[number]
        return curve.x, curve.y

    def show_time_axis(self, on: bool) -> None:
        """Only the lowest plot has ticks and label below."""
        self.canvas.show_time_axis(on)

    def show_model(self, on: bool) -> None:
        """Whether what belongs to the model is shown."""
        self._model = on
        self._share_room()
        self.updateGeometry()

    def show_part(self, history: LiveHistory, start: int, stop: int) -> None:
        """Draw samples ``start`` to ``stop`` and keep to the scale."""
        hidden = frozenset() if self._model else frozenset(MODELLED)
        part = ShownPart(history, self.spec.traces, hidden, start, stop, self.spec.unit.factor)
        self._fit(*self.canvas.show_part(part))

    def _fit(self, least: float, most: float) -> None:
        if self.scale.fixed is not None:
            self._range = self.scale.fixed
        elif least <= most:
            self._range = self._automatic(least, most)
        if self._range != self.canvas.y_range:
            self.canvas.set_scale(self._range)
            self.scale_button.show_range(self._range)

    def _automatic(self, least: float, most: float) -> tuple[float, float]:
        """The range now, if the data still fit and fill it well; else a better one."""
        low, high = self._range
        span = max(most - least, self.spec.least)
        if low <= least and most <= high and span >= SHRINK_BELOW * (high - low):
            return low, high
        middle, half = (least + most) / 2, 0.5 * span * SCALE_MARGIN
        return middle - half, middle + half

    def show_cursors(self, times: Sequence[float] | None) -> None:
        """Put the cursors somewhere, or hide them."""
        self.canvas.cursors = (times[0], times[1]) if times is not None else None
        self.canvas.update()

    def show_marks(self, marks: Sequence[tuple[float, str]]) -> None:
        """Vertical lines, with their notes in the first plot."""
        self.canvas.marks = marks
        self.canvas.update()
