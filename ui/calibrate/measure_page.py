"""The wizard at work: what to do now, the reading and its light, the hold, and the steps so far."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QProgressBar,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from fingerlab.calibration.sensors import mark_text
from fingerlab.calibration.wizard import Phase, Wizard

from ..widgets.fields import ActionButton, row
from ..widgets.labels import heading, remark
from ..widgets.layout import FLUSH, Spacer, described, hbox, vbox
from ..widgets.tables import copies
from ..widgets.theme import large_font, small_font
from .calibration_pictures import LivePlot, Picture, StabilityLight
from .calibration_words import held_together

PANEL_WIDTH = 304
NUMBERS = (0, 2)
"""Columns of numbers in the table of steps."""


class MeasurePage(QWidget):
    """Shows a wizard; its buttons call what the tab gives.

    Args:
        undo, redo, take: of the wizard. leave: give the calibration up. rehearse: let the simulated rig do
            what is asked for.
    """

    def __init__(
        self,
        undo: Callable[[], None],
        redo: Callable[[], None],
        take: Callable[[], None],
        leave: Callable[[], None],
        rehearse: Callable[[], None],
    ) -> None:
        super().__init__()
        self.picture = Picture()
        self.step = remark()
        self.step.setObjectName("calibrationStep")
        self.words = heading(large=True)
        self.words.setObjectName("calibrationWords")
        self.words.setWordWrap(True)
        self.state = QLabel()
        self.state.setObjectName("calibrationState")
        self.state.setWordWrap(True)
        self.progress = QProgressBar()
        self.progress.setRange(0, 1000)
        self.progress.setTextVisible(False)
        self.progress.setAccessibleName("Hold of this step")
        self.light = StabilityLight()
        self.volts = described(
            QLabel("– V"), "calibrationVolts", accessible="Reading in volts", font=large_font()
        )
        self.doubt = heading()
        self.doubt.setObjectName("calibrationDoubt")
        self.doubt.setWordWrap(True)
        self.plot = LivePlot()
        self.table = _steps_table()
        self.undo = ActionButton(
            "&Undo step", "undoStep", "Take the last captured step back and do it again.", undo
        )
        self.redo = ActionButton("&Redo", "redoStep", "Put the step back.", redo)
        help_text = "For a step at which the reading does not change: capture it once it stands still."
        self.take = ActionButton("It is as asked", "takeStep", help_text, take)
        self.rehearse = ActionButton(
            "&Do it (rehearsal)",
            "rehearseStep",
            "The simulated rig's operator does what is asked for.",
            rehearse,
        )
        self.leave = ActionButton("Give up", "leaveCalibration", "Leave; nothing is stored.", leave)
        self._build()

    def _build(self) -> None:
        words = vbox(None, self.step, self.words, self.doubt, Spacer(1), spacing=8)
        reading = hbox(None, self.light, self.volts, Spacer(1), spacing=16)
        words.addLayout(reading)
        words.addWidget(self.state)
        words.addWidget(self.progress)
        top = hbox(None, self.picture, (words, 1), spacing=16)
        left = vbox(None, top, (self.plot, 1), margins=(16, 16, 8, 8), spacing=8)
        panel = QWidget()
        panel.setObjectName("acquirePanel")
        panel.setFixedWidth(PANEL_WIDTH)
        side = QVBoxLayout(panel)
        side.setContentsMargins(16, 16, 16, 16)
        side.setSpacing(8)
        side.addWidget(heading("Steps"))
        side.addWidget(self.table, 1)
        side.addLayout(row(self.undo, self.redo))
        side.addWidget(self.rehearse)
        side.addWidget(self.take)
        side.addWidget(self.leave)
        hbox(self, (left, 1), panel, margins=FLUSH, spacing=0)

    def show_steps(self, wizard: Wizard) -> None:
        """What changes only when a step is captured or taken back."""
        plan, number = wizard.plan, wizard.number
        doubts = wizard.doubts()
        doubtful = {one.number for one in doubts}
        rows = [
            (
                mark_text(plan.sensor, move.mark),
                move.sweep,
                f"{wizard.captures[index].step.volts:.4f}" if index < number else "",
                "doubtful" if index in doubtful else "now" if index == number else "",
            )
            for index, move in enumerate(plan.moves)
        ]
        _fill(self.table, rows)
        self.table.selectRow(min(number, len(plan.moves) - 1))
        item = self.table.item(number, 0)
        if item is not None:
            self.table.scrollToItem(item)
        said = wizard.early() or (f"Doubtful: {doubts[-1].words} Undo the step if so." if doubts else "")
        self.doubt.setText(held_together(said))
        self.doubt.setVisible(bool(said))
        self.picture.show_step(plan, number)
        self.undo.refuse("" if wizard.can_undo else "No step has been captured yet.")
        self.redo.refuse("" if wizard.can_redo else "No step has been taken back.")
        move_now = wizard.move
        if move_now is not None:
            self.step.setText(f"Step {number + 1} of {len(plan.moves)} – {move_now.sweep}")
            self.words.setText(move_now.words)

    def show_reading(self, wizard: Wizard, refusal: str) -> None:
        """What changes with each look at the reading."""
        reading = wizard.reading
        self.volts.setText(f"{reading:.4f} V" if reading == reading else "– V")
        self.light.show_light("none" if refusal else wizard.light)
        self.state.setText(refusal or state_words(wizard))
        self.progress.setValue(round(1000 * wizard.held))
        self.take.refuse(
            "" if wizard.phase is Phase.CHANGE else "The reading has changed; it is captured by itself."
        )
        self.plot.show_wizard(wizard)


def state_words(wizard: Wizard) -> str:
    """What the wizard waits for."""
    if wizard.light == "none":
        return "Nothing is read from this sensor; check its cable and terminal."
    if wizard.phase is Phase.CHANGE:
        return "Waiting: the reading is still that of the last step."
    if wizard.phase is Phase.HOLD:
        centre = wizard.timing.centre
        return f"Leave it: {wizard.seconds_left:.0f} s to go, the central {centre:g} s are captured."
    return "Waiting until the reading stands still."


def _fill(table: QTableWidget, rows: list[tuple[str, str, str, str]]) -> None:
    """Put texts into the table; its cells are made anew only where there are more or fewer rows."""
    if table.rowCount() != len(rows):
        table.setRowCount(len(rows))
        for index in range(len(rows)):
            for column in range(4):
                cell = QTableWidgetItem()
                if column in NUMBERS:
                    cell.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                table.setItem(index, column, cell)
    for index, texts in enumerate(rows):
        for column, text in enumerate(texts):
            shown = table.item(index, column)
            if shown is not None and shown.text() != text:
                shown.setText(text)


def _steps_table() -> QTableWidget:
    table = described(QTableWidget(0, 4), "calibrationSteps", accessible="Steps and their readings")
    table.setHorizontalHeaderLabels(["mark", "pass", "read (V)", ""])
    for column in range(4):
        title = table.horizontalHeaderItem(column)
        assert title is not None
        side = Qt.AlignmentFlag.AlignRight if column in NUMBERS else Qt.AlignmentFlag.AlignLeft
        title.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
    copies(table)
    table.verticalHeader().hide()
    table.verticalHeader().setDefaultSectionSize(20)
    table.verticalHeader().setMinimumSectionSize(16)
    table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
    table.setFont(small_font())
    letter = table.fontMetrics().horizontalAdvance("0")
    for column, letters in enumerate((8, 11, 9)):
        table.horizontalHeader().resizeSection(column, letters * letter)
    table.horizontalHeader().setStretchLastSection(True)
    table.horizontalHeader().setFont(small_font())
    table.setShowGrid(False)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    table.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    return table
