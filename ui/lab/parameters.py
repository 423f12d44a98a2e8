"""Parameters at hand: every number of the present model in a table; moved, held and let free by hand.

Moving a value reads nothing and fits nothing but, if wanted, the other values: curves and errors follow while
the slider moves. What is held or let free counts from the next refit on, which is a step of the history.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QCheckBox, QHeaderView, QPushButton, QSlider, QTableWidgetItem, QWidget

from fingerlab.core.text import ScreenUnit, fixed, largest_of, score_text
from fingerlab.diagnosis.answer.error_parts import Comparison, EquationError
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.file import Held
from fingerlab.report.diagnosis_words import FAMILY_TITLES
from fingerlab.report.line_units import LineUnits
from fingerlab.report.parameter_words import cells, known_by, parameter_title, places_of, room_of, shown_unit

from ..app.undo import UndoSteps
from ..widgets.fields import NumberField, set_usable
from ..widgets.layout import FLUSH, Spacer, described, hbox, vbox
from ..widgets.tables import ElidedLabel, NumberTable, WholeLabel, heading
from ..widgets.theme import small_font
from .comparison_curves import joined, run_key
from .result_words import error_texts

if TYPE_CHECKING:
    from fingerlab.diagnosis.answer.parameter_explorer import FittedParameter, ParameterExplorer, WhatIf

STEPS = 1000
"""Places of the slider."""
FAR = 400.0
"""A slider goes no further than so many half intervals from the value fitted, where bounds lie beyond."""
ROOM = 6
"""About the words of a row, px."""
COLUMNS = (
    ("Parameter", "What it is called; bounds and interval are in the unit of its row."),
    ("Fitted", "As fitted to all runs."),
    ("What if", "Where it is moved to now, or follows to."),
    ("90 % interval", "Where it lies nine times out of ten, as far as these runs tell."),
    ("Bounds", "No fit goes beyond."),
    ("Unit", "Of all numbers of the row."),
    ("From", "Where the value comes from: these runs, the rig file, an assumption, your hand."),
)
WHAT_IF, FROM = 2, 6
LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


@dataclass(frozen=True)
class ParameterChange:
    """What was done by hand: values moved, by key, SI, and keys that are to be held."""

    moved: Mapping[str, float]
    hold: frozenset[str]


class ParametersPanel(QWidget):
    """Signals: moved(): another what-if is shown; refit_asked(held); closed(); kept(moved): remember it."""

    moved = Signal()
    refit_asked = Signal(object)
    closed = Signal()
    kept = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("parametersPanel")
        self.history: UndoSteps[ParameterChange] = UndoSteps(self)
        self.what_if: WhatIf | None = None
        self._at_hand: ParameterExplorer | None = None
        self._held: Mapping[str, float] = {}
        self._line = LineUnits()
        self._now = ParameterChange({}, frozenset())
        self._moving = ""  # the parameter whose moves are one step until it is let go
        self._busy = False
        self._make()
        top = hbox(None, self.title, (self.words, 1), self.back, spacing=16)
        value = hbox(None, (self.name, 2), (self.slider, 3), self.field, spacing=8)
        row = hbox(None, self.follow, Spacer(1), self.hold, self.reset, self.refit, spacing=8)
        vbox(self, top, (self.table, 1), value, row, margins=FLUSH, spacing=4)
        self.table.currentCellChanged.connect(lambda *_: self._show_chosen())
        self.slider.valueChanged.connect(self._on_slider)
        self.slider.sliderReleased.connect(self._let_go)
        self.field.valueChanged.connect(self._on_field)
        self.follow.toggled.connect(lambda _on: self._recompute())
        self.hold.clicked.connect(self._toggle_hold)
        self.reset.clicked.connect(lambda: self._do(ParameterChange({}, self._now.hold)))
        self.refit.clicked.connect(self._ask_refit)
        self.back.clicked.connect(self.closed)

    def _make(self) -> None:
        self.title = heading("Parameters")
        self.words = described(WholeLabel(), "whatIfWords", font=small_font())
        self.table = NumberTable("parametersTable", "Parameters of the present model", COLUMNS)
        self.table.setWordWrap(False)
        self.table.verticalHeader().setDefaultSectionSize(QFontMetrics(small_font()).height() + ROOM)
        self.table.setMinimumHeight(4 * (QFontMetrics(small_font()).height() + ROOM))
        of_source = self.table.horizontalHeaderItem(FROM)
        if of_source is not None:
            of_source.setTextAlignment(LEFT)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(FROM, QHeaderView.ResizeMode.Stretch)
        self.name = described(ElidedLabel(), "parameterName")
        self.slider = described(QSlider(Qt.Orientation.Horizontal), "parameterSlider")
        self.slider.setRange(0, STEPS)
        self.slider.setAccessibleName("Value of the chosen parameter")
        self.slider.setToolTip("Move the value: curves and error follow at once (arrows, Page Up and Down).")
        self.field = described(NumberField(), "parameterValue", accessible="Value of the chosen parameter")
        self.field.setToolTip("The value as a number; Enter takes it.")
        self.follow = described(QCheckBox("&Others follow"), "othersFollow")
        self.follow.setToolTip(
            "Whether the other values go where they fit best beside what is moved, or stay as fitted."
        )
        self.hold = described(QPushButton("H&old"), "holdParameter")
        self.reset = described(QPushButton("As f&itted"), "asFitted", tip="Every value back to where it was.")
        self.refit = described(QPushButton("&Refit"), "refitHeld", primary="true")
        self.back = described(QPushButton("Back to the &candidates"), "closeParameters")

    # what is shown

    def show_model(
        self, at_hand: ParameterExplorer | None, diagnosis: Diagnosis | None, moved: Held = ()
    ) -> None:
        """The parameters of another model, those moved that were; None: they are not there (yet)."""
        self._at_hand, self._held = at_hand, dict(diagnosis.held) if diagnosis is not None else {}
        self._line = LineUnits(diagnosis.line_radius if diagnosis is not None else 0.0)
        self.what_if, self._moving = None, ""
        self.history.forget()
        if at_hand is None:
            pending = diagnosis is None or diagnosis.fitted is not None
            self.words.setText("Laying out …" if pending else "This comparison kept no fit to move.")
            self.table.setRowCount(0)
            self._now = ParameterChange({}, frozenset())
            self._show_chosen()
            return
        known = {one.key for one in at_hand.parameters}
        self._now = ParameterChange({k: v for k, v in moved if k in known}, frozenset(self._held))
        keys = [one.key for one in at_hand.parameters]
        with QSignalBlocker(self.table):
            self.table.setRowCount(len(keys))
            for row, one in enumerate(self._ordered()):
                title, value, *rest = cells(one, keys, self._line)
                for column, text in enumerate((title, value, "", *rest)):
                    item = QTableWidgetItem(text)
                    item.setTextAlignment(LEFT if column in (0, FROM) else RIGHT)
                    item.setToolTip(text if column in (0, FROM) else "")
                    item.setData(Qt.ItemDataRole.UserRole, one.key)
                    self.table.setItem(row, column, item)
            self.table.setCurrentCell(0, 0)
        self._recompute()

    def comparison(self, shown: Comparison | None) -> Comparison | None:
        """The same equation and run with the values moved; None where nothing is."""
        if shown is None or self.what_if is None or self._at_hand is None:
            return None
        drawn = self._at_hand.comparisons(self.what_if, shown.session, shown.run)
        found = map(self._line.comparison, drawn)
        one = joined(found).get((shown.equation, run_key(shown)))
        return None if one is None else replace(one, aside=shown.aside)

    def set_busy(self, busy: bool) -> None:
        """While something is computed no value can be moved."""
        self._busy = busy
        self._show_chosen()

    def _ordered(self) -> list[FittedParameter]:
        """Those of effects first: they are what a person moves."""
        if self._at_hand is None:
            return []
        return sorted(self._at_hand.parameters, key=lambda one: (not one.effect, not one.identified))

    def _chosen(self) -> FittedParameter | None:
        rows = self._ordered()
        row = self.table.currentRow()
        return rows[row] if 0 <= row < len(rows) else None

    def _value(self, one: FittedParameter) -> float:
        """Where it is now, SI."""
        return self.what_if.values[one.key] if self.what_if is not None else one.estimate.value

    def _unit(self, one: FittedParameter) -> ScreenUnit:
        found = one.estimate
        return shown_unit(one.key, found.unit, largest_of((found.value, found.low, found.high)), self._line)

    def _show_chosen(self) -> None:
        one = self._chosen()
        for widget in (self.slider, self.field, self.hold, self.follow):
            set_usable(widget, one is not None and not self._busy)
        set_usable(self.reset, bool(self._now.moved) and not self._busy)
        wanted = self.wanted()
        why = (
            "Work is running; wait for it or cancel it below."
            if self._busy
            else "Hold a value first, or let one free."
            if wanted == dict(self._held)
            else ""
        )
        set_usable(self.refit, not why and self._at_hand is not None)
        self.refit.setToolTip(why or "Fit again with what is held; Ctrl+Z takes it back.")
        self.name.setText("")
        if one is None or self._at_hand is None:
            return
        unit, (low, high) = self._unit(one), reach(one)
        keys = [other.key for other in self._at_hand.parameters]
        self.name.setText(self._line.title(parameter_title(one.key, keys)))
        held = one.key in self._now.hold
        self.hold.setText("Let &free" if held else "H&old")
        self.hold.setToolTip(
            "Let the next fit find it again."
            if held
            else "Keep it where it is now in the next fit, and in all that is told of that model."
        )
        with QSignalBlocker(self.field), QSignalBlocker(self.slider):
            self.field.setDecimals(places_of(one, unit))
            self.field.setRange(one.low * unit.factor, one.high * unit.factor)
            self.field.setSingleStep(unit.factor * (high - low) / STEPS)
            self.field.setSuffix(f" {unit.symbol}" if unit.symbol else "")
            self.field.setValue(min(max(self._value(one), one.low), one.high) * unit.factor)
            self.slider.setValue(round(STEPS * (self._value(one) - low) / (high - low)))

    def wanted(self) -> dict[str, float]:
        """What the next fit is to hold, by key, SI."""
        if self._at_hand is None:
            return dict(self._held)
        places = {one.key: self._value(one) for one in self._at_hand.parameters}
        limits = {one.key: (one.low, one.high) for one in self._at_hand.parameters}
        return {
            key: self._held[key]
            if key in self._held and key not in self._now.moved
            else min(max(places[key], limits[key][0]), limits[key][1])
            for key in sorted(self._now.hold)
        }

    # hand

    def _on_slider(self, place: int) -> None:
        one = self._chosen()
        if one is not None:
            low, high = reach(one)
            self._move(one, low + (high - low) * place / STEPS)
            if not self.slider.isSliderDown():
                self._let_go()

    def _on_field(self, value: float) -> None:
        one = self._chosen()
        if one is not None:
            self._move(one, value / self._unit(one).factor)
            self._let_go()

    def _move(self, one: FittedParameter, value: float) -> None:
        change = ParameterChange({**self._now.moved, one.key: value}, self._now.hold)
        if self._moving == one.key:
            self._now = change
            self._recompute()
        else:
            self._moving = one.key
            self._do(change)

    def _let_go(self) -> None:
        self._moving = ""
        self.kept.emit(tuple(sorted(self._now.moved.items())))

    def _toggle_hold(self) -> None:
        one = self._chosen()
        if one is not None:
            self._do(ParameterChange(self._now.moved, self._now.hold ^ {one.key}))

    def _ask_refit(self) -> None:
        self.refit_asked.emit(self.wanted())

    def _do(self, change: ParameterChange) -> None:
        self.history.add(self._now)
        self._show(change)

    def undo(self) -> None:
        """What was moved or marked last, as it was before."""
        self._show(self.history.back(self._now))

    def redo(self) -> None:
        """What was taken back, again."""
        self._show(self.history.forth(self._now))

    def _show(self, change: ParameterChange) -> None:
        self._now = change
        self._recompute()
        if not self._moving:
            self.kept.emit(tuple(sorted(change.moved.items())))

    def _recompute(self) -> None:
        """Errors and values for what is moved now; the plot asks for its curves."""
        if self._at_hand is None:
            return
        if self._now.moved:
            self.what_if = self._at_hand.what_if(self._now.moved, self.follow.isChecked())
        else:
            self.what_if = None
        self._tell(self._at_hand)
        self._show_chosen()
        self.moved.emit()

    def _tell(self, at_hand: ParameterExplorer) -> None:
        first, now = at_hand.as_fitted, self.what_if or at_hand.as_fitted
        for row, one in enumerate(self._ordered()):
            unit, moved, places = self._unit(one), self._value(one), places_of(one, self._unit(one))
            changed = fixed(moved * unit.factor, places) != fixed(one.estimate.value * unit.factor, places)
            was, hold = one.key in self._held, one.key in self._now.hold
            marks = {(False, True): "to be held", (True, False): "to be let free"}
            source = marks.get((was, hold), known_by(one))
            for column, text in (
                (WHAT_IF, fixed(moved * unit.factor, places) if changed else ""),
                (FROM, source),
            ):
                item = self.table.item(row, column)
                assert item is not None
                item.setText(text)
        change = " → ".join(dict.fromkeys((score_text(first.score), score_text(now.score))))
        said = [f"Error on all runs {change} floors"]
        before = self._line.errors(first.errors)
        for family, error in self._line.errors(now.errors).items():
            before_, after, _, unit_ = error_texts(before[family], error)
            if self.what_if is not None:
                said.append(f"{FAMILY_TITLES.get(family, family).lower()} {before_} → {after} {unit_}")
        hint = "" if self.what_if is not None else ". Move a value: curves and error follow at once."
        self.words.setText(", ".join(said) + hint)

    def errors_of(self, family: str) -> tuple[EquationError | None, EquationError | None] | None:
        """The error of a family as fitted and with the values moved; None: nothing is moved."""
        if self.what_if is None or self._at_hand is None:
            return None
        as_fitted, moved = (self._line.errors(one.errors) for one in (self._at_hand.as_fitted, self.what_if))
        return as_fitted.get(family), moved.get(family)


def reach(one: FittedParameter) -> tuple[float, float]:
    """From where to where the slider goes, SI: from bound to bound, or as far as tells something."""
    half = max(0.5 * (one.estimate.high - one.estimate.low), 1e-4 * room_of(one))
    if one.held or one.high - one.low <= FAR * half:
        return one.low, one.high
    value = min(max(one.estimate.value, one.low), one.high)
    return max(one.low, value - 0.5 * FAR * half), min(one.high, value + 0.5 * FAR * half)
