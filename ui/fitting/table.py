"""Fitted parameters beside nominal values and the moment arms that the wound cable gives."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableWidgetItem, QWidget

from fingerlab.core.text import in_words, r2_text, with_minus
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.fitting import delay_estimate
from fingerlab.thesis.inspection import Inspection
from fingerlab.thesis.onair import RegionResult
from fingerlab.thesis.traces import JOINT_TITLES, Joint

from ..widgets.number_table import NumberTable

COLUMNS = (
    ("Cable", "The cable with which the runs on air were moved."),
    ("Joint", "Its equation: LHS = s a T + L, thesis (3.16) and (3.17)."),
    ("Region", "Part of the period: flexion, extension and the standstills after each."),
    (
        "Moment arm\n(mm)",
        "a or b: s times the slope of joint torque on cable tension, with its 90 % interval.",
    ),
    (
        "Kinematic\narm (mm)",
        "Kinematic moment arm: a, b of x_m = x0 + s (a θ1 + b θ2), with its 90 % interval.",
    ),
    ("Friction loss\n(mN m)", "L: the line's torque at no tension, with its 90 % interval. Nominal: 0."),
    ("Nominal loss\n(mN m)", "The nominal equations hold no friction loss."),
    ("R²", "Of the line through all runs."),
    ("Delay\n(ms)", "By which the tension was shifted before the fit, mean over runs. Nominal: 0."),
)
LEAST_CHARACTERS = 16
"""Width that each column keeps, in characters: room for the longest word of a heading."""
RowKey = tuple[str, Joint, str]


class ParameterTable(NumberTable):
    """One row a cable, joint and region. Signal ``chosen`` (cable, joint, region): another row is current."""

    chosen = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("parameters", "Fitted parameters with 90 % intervals", COLUMNS, 3, parent)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        # A narrower window scrolls before it cuts words.
        self.horizontalHeader().setMinimumSectionSize(
            LEAST_CHARACTERS * self.fontMetrics().averageCharWidth()
        )
        self.verticalHeader().setDefaultSectionSize(round(1.7 * self.fontMetrics().height()))
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.keys: list[RowKey] = []
        self.currentCellChanged.connect(self._on_row)

    def show_inspection(self, found: Inspection) -> None:
        """Fill in another fit; the row that was chosen stays if it is there."""
        before = self.key()
        self.blockSignals(True)
        self.keys = [(c, j, r) for c, results in found.fit.cables.items() for j, r in results]
        self.setRowCount(len(self.keys))
        for row, (cable, joint, region) in enumerate(self.keys):
            result = found.fit.cables[cable][joint, region]
            arms = found.kinematic.get(cable, {})
            kinematic = with_minus(in_words(arms[joint], with_unit=False)) if joint in arms else "–"
            texts = [cable, JOINT_TITLES[joint], REGION_TITLES[region], *_cells(result, kinematic, found)]
            for column, text in enumerate(texts):
                item = QTableWidgetItem(text)
                if column > 2:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                self.setItem(row, column, item)
        self.blockSignals(False)
        self.choose(before if before in self.keys else _first(self.keys))

    def choose(self, key: RowKey | None) -> None:
        """Make a row the current one."""
        row = self.keys.index(key) if key in self.keys else -1
        self.setCurrentCell(row, 3)
        self.chosen.emit(self.key())

    def key(self) -> RowKey | None:
        """Cable, joint and region of the current row."""
        row = self.currentRow()
        return self.keys[row] if 0 <= row < len(self.keys) else None

    def _on_row(self, row: int, _column: int, before: int, _before_column: int) -> None:
        if row != before:
            self.chosen.emit(self.key())


def _cells(result: RegionResult, kinematic: str, found: Inspection) -> tuple[str, ...]:
    fitted = result.pooled
    if fitted is None:
        return ("not found", kinematic, "–", "0", "–", "–")
    delay = "0, not fitted"
    if found.fit.spec.delay != "none":
        delay = with_minus(in_words(delay_estimate(fitted.delay_s, result.delays_s), with_unit=False))
    return (
        with_minus(in_words(fitted.moment_arm, with_unit=False)),
        kinematic,
        with_minus(in_words(fitted.loss, with_unit=False)),
        "0",
        r2_text(fitted.r2),
        delay,
    )


def _first(keys: list[RowKey]) -> RowKey | None:
    """The extension of the PIP joint: the region that the thesis ended with."""
    return next((k for k in keys if k[1:] == ("pip", "extension")), keys[0] if keys else None)
