"""From the choice of a sensor through its steps: what counts now, what to do, the reading and its light."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QGridLayout,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from fingerlab.acquisition.ring import COLUMN, RingReader
from fingerlab.calibration import SENSORS
from fingerlab.calibration.sensors import mark_text, read_marks
from fingerlab.calibration.store import CalibrationRecord
from fingerlab.calibration.wizard import Phase, Wizard
from fingerlab.core.text import held_together

from ..app.context import ApplicationContext
from ..widgets.fields import ActionButton, centred_column, row
from ..widgets.layout import FLUSH, Spacer, described, hbox, vbox
from ..widgets.tables import copies, heading, remark
from ..widgets.theme import large_font, small_font
from .calibration_pictures import LivePlot, Picture, StabilityLight
from .result_page import SENSOR_NAMES, record_words

TICK_MS = 50
COLUMNS = {"load-cell": "raw/force_volts", "mcp": "raw/mcp_volts", "pip": "raw/pip_volts"}
"""Sensor -> the bench's column of its volts."""

NO_RIG = "No rig is connected."
REPLAYED = "A replay is connected; nothing can be placed on it. Use From a recording instead."
AMPLIFIER_ON = "The amplifier is on: disable it on Acquire before you put a hand to the rig."


class VoltSource(QObject):
    """Signal ``arrived(time, volts)``: arrays in s and V, a few times a second while started."""

    arrived = Signal(object, object)

    def __init__(self, context: ApplicationContext, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._context = context
        self._column = 0
        self._reader: RingReader | None = None
        self._timer = QTimer(self, interval=TICK_MS)
        self._timer.timeout.connect(self.tick)

    @property
    def refusal(self) -> str:
        """Why nothing can be calibrated now; empty where it can."""
        bench = self._context.bench
        if bench is None:
            return NO_RIG
        if bench.calibrations is None:
            return REPLAYED
        return AMPLIFIER_ON if self._context.rig_line.live else ""

    def start(self, sensor: str) -> None:
        """Read this sensor from now on."""
        self._column = COLUMN[COLUMNS[sensor]]
        self.attach()
        self._timer.start()

    def stop(self) -> None:
        """Read nothing more."""
        self._timer.stop()
        self._reader = None

    def attach(self) -> None:
        """Look at the bench that is connected now, if any."""
        bench = self._context.bench
        self._reader = bench.bench.ring.reader() if bench is not None else None

    def tick(self) -> None:
        """Hand on what has been read since the last time."""
        bench = self._context.bench
        if bench is None or self._reader is None:
            return
        rows = self._reader.read().rows
        if len(rows):
            self.arrived.emit(rows[:, COLUMN["index"]] / bench.bench.rate_hz, np.array(rows[:, self._column]))


PAGE_WIDTH = 760
MARKS_WIDTH = 144
MARKS_HELP = "Your own weights or marks, such as 0 50 200 500; empty: the usual ones."
SENSOR_HELP = {
    "load-cell": "0 to 1 kg in steps of 100 g, and back; about eight minutes.",
    "mcp": "Marks from 0° to 90°, twice; about five minutes.",
    "pip": "Marks from 0° to 90°, twice; about five minutes.",
}
AGAIN_HELP = "Writes a copy of a session whose forces and angles are calculated anew from its raw volts."


class StartPage(QWidget):
    """Signals: start_asked(sensor), file_asked(sensor), connect_asked, again_asked."""

    start_asked = Signal(str)
    file_asked = Signal(str)
    connect_asked = Signal()
    again_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.rig = described(QLabel(wordWrap=True), "calibrateRig")
        self.connect_rig = QPushButton("Connect a ri&g on Acquire")
        self.connect_rig.setObjectName("calibrateConnect")
        self.connect_rig.setProperty("primary", "true")
        self.connect_rig.clicked.connect(self.connect_asked)
        self.starts: dict[str, ActionButton] = {}
        self.files: dict[str, QPushButton] = {}
        self.own: dict[str, QLineEdit] = {}
        self.current: dict[str, QLabel] = {}
        self.again = described(QPushButton("Apply to an old &session…"), "applyAgain")
        self.again.clicked.connect(self.again_asked)
        self.folder = remark()
        self._build()

    def _build(self) -> None:
        inner = centred_column(self, PAGE_WIDTH)
        inner.addWidget(heading("Calibrate a sensor", large=True))
        inner.addWidget(
            remark(
                "Step by step: you place a weight or turn a joint, the reading is captured by itself once it "
                "stands still. The result is compared with the data sheet and the calibration before."
            )
        )
        across = hbox(None, (self.rig, 1), self.connect_rig, spacing=16)
        inner.addLayout(across)
        inner.addLayout(self._sensors())
        inner.addWidget(self.folder)
        across = QHBoxLayout()
        across.setSpacing(16)
        across.addWidget(self.again)
        across.addWidget(remark("With the calibrations that count now, from the volts as read."), 1)
        inner.addLayout(across)

    def _sensors(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setHorizontalSpacing(16)
        grid.setVerticalSpacing(16)
        grid.setColumnStretch(0, 1)
        for place, name in enumerate(SENSORS):
            words = vbox(None, heading(SENSOR_NAMES[name]), spacing=0)
            self.current[name] = remark()
            self.current[name].setObjectName(f"current-{name}")
            words.addWidget(self.current[name])
            words.addWidget(remark(SENSOR_HELP[name]))
            asked = partial(self.start_asked.emit, name)
            start = ActionButton("Start", f"start-{name}", SENSOR_HELP[name], asked)
            start.setAccessibleName(f"Calibrate the {SENSOR_NAMES[name]}")
            read = QPushButton("From a recording…")
            read.setObjectName(f"file-{name}")
            read.setToolTip("One or two recordings, 15 s a step: text of time and volts, or sessions.")
            read.setAccessibleName(f"{SENSOR_NAMES[name]} from a recording")
            read.clicked.connect(lambda _checked=False, n=name: self.file_asked.emit(n))
            own = described(QLineEdit(), f"marks-{name}", tip=MARKS_HELP)
            own.setAccessibleName(f"Own known values of the {SENSOR_NAMES[name]}")
            own.setPlaceholderText("own weights (g)" if name == "load-cell" else "own marks (°)")
            own.setFixedWidth(MARKS_WIDTH)
            self.starts[name], self.files[name], self.own[name] = start, read, own
            grid.addLayout(words, place, 0)
            grid.addWidget(own, place, 1)
            grid.addWidget(start, place, 2)
            grid.addWidget(read, place, 3)
        return grid

    def marks(self, name: str) -> tuple[float, ...] | None:
        """The operator's own known values, in the sensor's ``mark_unit``; None where none are given.

        Raises:
            UserError: what was typed is no list of numbers.
        """
        text = self.own[name].text().strip()
        return read_marks(SENSORS[name], text) if text else None

    def show_rig(self, sentence: str, refusal: str, connected: bool) -> None:
        """Say which rig it is, or why nothing can be measured now."""
        self.rig.setText(sentence)
        self.connect_rig.setVisible(not connected)
        for button in self.starts.values():
            button.refuse(refusal)

    def show_current(self, records: Mapping[str, CalibrationRecord], folder: str) -> None:
        """What counts now, and where it is kept."""
        for name, label in self.current.items():
            label.setText(f"Now: {record_words(SENSORS[name], records.get(name))}")
        self.folder.setText(f"Calibrations are kept in {folder}")
        self.again.setEnabled(bool(records))
        self.again.setToolTip(AGAIN_HELP if records else "No sensor has been calibrated on this rig yet.")


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
        self.step = described(remark(), "calibrationStep")
        self.words = described(heading(large=True), "calibrationWords")
        self.words.setWordWrap(True)
        self.state = described(QLabel(wordWrap=True), "calibrationState")
        self.progress = described(QProgressBar(), accessible="Hold of this step")
        self.progress.setRange(0, 1000)
        self.progress.setTextVisible(False)
        self.light = StabilityLight()
        self.volts = described(
            QLabel("– V"), "calibrationVolts", accessible="Reading in volts", font=large_font()
        )
        self.doubt = described(heading(), "calibrationDoubt")
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
        panel = described(QWidget(), "acquirePanel")
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
        still = "that of the last step" if wizard.number else "where it stood; if it is as asked, say so"
        return f"Waiting: the reading is still {still}."
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
    table.setHorizontalHeaderLabels(["Mark", "Pass", "Read (V)", ""])
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
    letter, header = table.fontMetrics().horizontalAdvance("0"), table.horizontalHeader()
    header.setFont(small_font())
    header.setHighlightSections(False)
    for column, letters in enumerate((8, 11, 9)):
        header.resizeSection(column, max(letters * letter, header.sectionSizeHint(column)))
    header.setStretchLastSection(True)
    table.setShowGrid(False)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    table.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    return table
