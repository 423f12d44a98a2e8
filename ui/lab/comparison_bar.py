"""Above the plots: which equation and run are shown, its error before and now, and what each line means."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from PySide6.QtCore import QPointF, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QFontMetrics, QFontMetricsF, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QButtonGroup, QComboBox, QLabel, QPushButton, QSizePolicy, QWidget

from fingerlab.diagnosis.answer.error_parts import EQUATIONS, Comparison, EquationError, equation_of
from fingerlab.sessions.model import Run, Session

from ..widgets.layout import FLUSH, WrappedRow, as_written, described, vbox
from ..widgets.tables import ElidedLabel
from ..widgets.theme import Colours, colours_of, line, small_font, tint
from .comparison_curves import joined
from .result_words import FLOOR_HELP, error_texts, run_text

ERROR_HELP = f"Error on held-out runs: nominal model → present model. {FLOOR_HELP}"
WHAT_IF_HELP = f"Error on all runs: as fitted → with the values moved in the table below. {FLOOR_HELP}"
SAMPLE = 24.0
KEY_GAP = 16.0


@dataclass(frozen=True)
class LegendKey:
    """One entry: its words, the colour by name, and how it is drawn."""

    words: str
    colour: str
    style: Literal["solid", "dashed", "dotted", "points", "band", "tint", "pale", "hatch"] = "solid"


CURVES = (
    LegendKey("measured", "measured"),
    LegendKey("modelled", "modelled", "dashed"),
    LegendKey("residual", "residual"),
    LegendKey("floor", "floor", "band"),
)
ASIDE = (LegendKey("left aside", "muted", "hatch"),)
WEIGHED = (LegendKey("weighed less", "muted", "pale"),)
WEIGHED_TINT = 0.14
"""Paler than a place that is looked at, and without strokes: it counts, only less."""
FULL_RATE = (LegendKey("as recorded", "muted"),)
FULL_RATE_HELP = (
    "As recorded, at its full rate: the channel behind what was measured, times arm, radius or gain. The "
    "equations are judged low-passed, up to where the spectrum of the residual ends, which rounds corners."
)
WORST = (LegendKey("worst stretch:", "residual", "tint"),)
CHOSEN = (LegendKey("chosen place:", "residual", "tint"),)
FINGERPRINT = (
    LegendKey("mean residual", "residual", "points"),
    LegendKey("the effect's own curve", "candidate"),
    LegendKey("floor", "floor", "band"),
)


WHERE = (
    LegendKey("root mean square", "residual", "tint"),
    LegendKey("mean, 90 % interval", "residual", "points"),
    LegendKey("floor", "floor", "band"),
)
LOOK_ALIKES = (*FINGERPRINT[:2], LegendKey("look-alikes", "alike", "dotted"), *FINGERPRINT[2:])
RESIDUAL_ONLY = tuple(key for key in FINGERPRINT if key.colour != "candidate")


TINTS = {"band": 0.35, "tint": 0.3, "pale": WEIGHED_TINT}


class LegendKeys(QWidget):
    """Painted samples with their words.

    Args:
        wraps: goes on in another line where room is short; else it keeps the room of one line.
    """

    def __init__(
        self, keys: tuple[LegendKey, ...], wraps: bool = False, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._wraps = wraps
        self.setFont(small_font())
        across = QSizePolicy.Policy.Preferred if wraps else QSizePolicy.Policy.Fixed
        self.setSizePolicy(across, QSizePolicy.Policy.Fixed)
        self.set_keys(keys)

    def set_keys(self, keys: tuple[LegendKey, ...]) -> None:
        """Show other entries."""
        self._keys = keys
        self.setAccessibleName("Legend: " + ", ".join(f"{key.words} {key.style}" for key in keys))
        self.updateGeometry()
        self.update()

    def _width_of(self, key: LegendKey) -> float:
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
            x += width + KEY_GAP
        return places

    def sizeHint(self) -> QSize:
        width = sum(map(self._width_of, self._keys)) + KEY_GAP * (len(self._keys) - 1)
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

    def _paint_sample(self, painter: QPainter, room: QRectF, key: LegendKey, colours: Colours) -> None:
        colour = getattr(colours, key.colour)
        middle = room.center().y()
        if key.style in TINTS:
            alpha = TINTS[key.style]
            painter.fillRect(QRectF(room.left(), middle - 5, room.width(), 10), tint(colour, alpha))
        elif key.style == "hatch":
            brush = QBrush(tint(colour, 0.5), Qt.BrushStyle.BDiagPattern)
            painter.fillRect(QRectF(room.left(), middle - 5, room.width(), 10), brush)
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


MARGINS = 96
"""Of the row, with what lies between its parts, px."""


class LegendRow(QWidget):
    """The legend and the name of the tinted stretch at the left, the values under the cursor at the right."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.stretch_key = LegendKeys(WORST)
        self.aside = described(LegendKeys(ASIDE), "asideKey")
        self.weighed = described(LegendKeys(WEIGHED), "weighedKey")
        self.recorded = described(LegendKeys(FULL_RATE), "recordedKey", tip=FULL_RATE_HELP)
        self.recorded.hide()
        self._is_recorded = False
        self.stretch = described(ElidedLabel(), "stretchName")
        self.curves = LegendKeys(CURVES)
        self.values = described(ElidedLabel(), "valuesRead")
        self.values.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        for label in (self.stretch, self.values):
            label.setFont(small_font())
        keys = (self.curves, self.recorded, self.aside, self.weighed, self.stretch_key)
        row = WrappedRow((*keys, (self.stretch, 1), (self.values, 1)), spacing=8)
        vbox(self, row, margins=(72, 0, 8, 0))
        self.values.hide()
        self.name_stretch("")

    def show_values(self, wordings: Sequence[str]) -> None:
        """What is read off the curves, in the longest of some wordings that has room; none: the legend again.

        While something is read it has the room of the other names, and where that is too little the legend's.
        """
        reads = bool(wordings)
        self.values.set_texts(wordings if reads else ("",))
        self.values.setVisible(reads)  # its room is the others' while nothing is read
        self.stretch.setVisible(not reads)
        self.stretch_key.setVisible(not reads and bool(self.stretch.text()))
        for key in (self.aside, self.weighed):
            key.setVisible(not reads and bool(key.accessibleDescription()))
        self.recorded.setVisible(not reads and self._is_recorded)
        letters = QFontMetrics(small_font())
        needed = letters.horizontalAdvance(wordings[-1]) + 24 if reads else 0
        self.curves.setVisible(self.width() - self.curves.sizeHint().width() - MARGINS > needed)

    def name_stretch(self, text: str) -> None:
        """Name the tinted worst stretch; empty where none is tinted."""
        self._name(text, WORST)

    def name_place(self, text: str) -> None:
        """Name the place that the user chose, which is tinted."""
        self._name(text, CHOSEN)

    def name_aside(self, left: str, weighed: str) -> None:
        """What is hatched for it is left aside, and pale for it weighs less; each empty for nothing."""
        for key, text, words in (
            (self.aside, left, "Left aside of this run"),
            (self.weighed, weighed, "Weighed less in this run"),
        ):
            key.setVisible(bool(text))
            key.setToolTip(f"{words}: {text}." if text else "")
            key.setAccessibleDescription(text)

    def name_recorded(self, there: bool) -> None:
        """Say what the thin curve is, where it is there."""
        self._is_recorded = there
        self.recorded.setVisible(there and not self.values.text())

    def _name(self, text: str, keys: tuple[LegendKey, ...]) -> None:
        self.stretch.setText(text)
        self.stretch_key.set_keys(keys)
        self.stretch_key.setVisible(bool(text))


class ComparisonBar(QWidget):
    """Signal ``changed`` when the user takes another equation or run."""

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._comparisons: dict[tuple[str, str], Comparison] = {}
        self._sessions: dict[str, Session] = {}
        self._error = ("", "")
        self._group = QButtonGroup(self)
        self._buttons: dict[str, QPushButton] = {}
        for equation in EQUATIONS:
            text = equation_of(equation)
            button = described(QPushButton(text.button), f"equation_{equation}")
            button.setCheckable(True)
            button.setToolTip(text.help)
            button.setAccessibleName(text.title)
            button.clicked.connect(self._on_equation)
            button.hide()
            self._group.addButton(button)
            self._buttons[equation] = button
        self.runs = described(
            QComboBox(), "runs", accessible="Run shown", tip="Run shown (Alt+Up, Alt+Down for the next)."
        )
        self.runs.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.runs.setMinimumContentsLength(4)
        self.runs.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.runs.currentIndexChanged.connect(self._on_run)
        self.error = described(QLabel(), "equationError", tip=ERROR_HELP)
        bold = self.error.font()
        bold.setBold(True)
        self._letters = QFontMetrics(bold)
        self.error.setContentsMargins(8, 0, 0, 0)
        self.row = WrappedRow((*self._buttons.values(), (self.runs, 1), (self.error, 0)), spacing=4)
        vbox(self, self.row, margins=FLUSH)

    # what there is

    def show_comparisons(
        self, comparisons: Sequence[Comparison], sessions: Sequence[Session], wanted: tuple[str, str] | None
    ) -> None:
        """Offer the equations and runs of a diagnosis.

        ``wanted`` is the equation and run to start at; None keeps the present choice where it exists.
        """
        keep_equation, keep_run = self.equation(), self.runs.currentData()
        self._comparisons = joined(comparisons)
        self._sessions = {c.session: _session_of(c, sessions) for c in comparisons} if sessions else {}
        present = [e for e in EQUATIONS if any(key[0] == e for key in self._comparisons)]
        for equation, button in self._buttons.items():
            button.setVisible(equation in present)
        if not present:
            self.runs.clear()
            return
        first = wanted[0] if wanted is not None else keep_equation
        chosen = first if first in present else present[0]
        self._buttons[chosen].setChecked(True)
        self._fill_runs(chosen, keep_run if wanted is None else self._key_of(chosen, wanted[1]))
        self.changed.emit()

    def go_to(self, equation: str, run: str) -> None:
        """Show another equation and run."""
        if self._key_of(equation, run) is not None:
            self._buttons[equation].setChecked(True)
            self._fill_runs(equation, self._key_of(equation, run))
            self.changed.emit()

    def equation(self) -> str | None:
        """The equation shown."""
        return next((name for name, button in self._buttons.items() if button.isChecked()), None)

    def comparison(self) -> Comparison | None:
        """The equation and run shown."""
        equation, run = self.equation(), self.runs.currentData()
        return self._comparisons.get((equation, run)) if equation is not None and run is not None else None

    def run(self) -> Run | None:
        """The recording of the run shown."""
        shown = self.comparison()
        session = self._sessions.get(shown.session) if shown is not None else None
        if shown is None or session is None:
            return None
        return next((run for run in session.runs if run.name == shown.run), None)

    def show_error(
        self, before: EquationError | None, now: EquationError | None, what_if: bool = False
    ) -> None:
        """The error of the equation shown, with the nominal model and now, or as fitted and what if."""
        self.error.setToolTip(WHAT_IF_HELP if what_if else ERROR_HELP)
        self._error = ("", "")
        if before is not None and now is not None:
            was, is_now, floor, unit = error_texts(before, now)
            change = f"{was} → <b>{is_now}</b>" if before is not now else f"<b>{is_now}</b>"
            self._error = (f"error {change} {unit}", f", floor {floor}")
        self._fit_error()

    def _fit_error(self) -> None:
        """The floor is left out where room is short; the table below and the plot show it, too."""
        error, floor = self._error
        others = sum(
            button.sizeHint().width() + 4 for button in self._buttons.values() if button.isVisibleTo(self)
        )
        beside = self.runs.minimumSizeHint().width() + 24
        short, plain = (
            beside + self._letters.horizontalAdvance(re.sub("<[^>]*>", "", text))
            for text in (error, error + floor)
        )
        room = self.width() - (others if others + short <= self.width() else 0)  # in a second row all of it
        self.error.setText(error + floor if plain <= room else error)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_error()

    # choice

    def choose_equation(self, equation: str) -> None:
        """The same as a click on the equation's button."""
        if self._buttons[equation].isVisibleTo(self):
            self._buttons[equation].click()

    def _fill_runs(self, equation: str, key: str | None) -> None:
        many = len({comparison.session for comparison in self._comparisons.values()}) > 1
        with QSignalBlocker(self.runs):
            self.runs.clear()
            for (name, run), comparison in self._comparisons.items():
                if name == equation:
                    text = run_text(comparison, self._sessions.get(comparison.session), many)
                    self.runs.addItem(text, run)
                    self.runs.setItemData(
                        self.runs.count() - 1, as_written(text), Qt.ItemDataRole.ToolTipRole
                    )
            rows = [row for row in range(self.runs.count()) if self.runs.itemData(row) == key]
            self.runs.setCurrentIndex(rows[0] if rows else 0)

    def _key_of(self, equation: str, run: str) -> str | None:
        for (name, key), comparison in self._comparisons.items():
            if name == equation and comparison.run == run:
                return key
        return None

    def _on_equation(self) -> None:
        equation = self.equation()
        if equation is not None:
            self._fill_runs(equation, self.runs.currentData())
            self.changed.emit()

    def _on_run(self, row: int) -> None:
        if row >= 0:
            self.changed.emit()


def _session_of(comparison: Comparison, sessions: Sequence[Session]) -> Session:
    """The session that a comparison names by path, file name or title."""
    for session in sessions:
        if comparison.session in (str(session.path), session.path.name, session.path.stem, session.title):
            return session
    return sessions[0]
