"""Before a calibration: which sensor, what counts now, whether a rig gives its volts, the way without one."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QLineEdit, QPushButton, QWidget

from fingerlab.acquisition.ring import COLUMN, RingReader
from fingerlab.calibration import SENSORS
from fingerlab.calibration.sensors import read_marks
from fingerlab.calibration.store import CalibrationRecord

from ..app.context import ApplicationContext
from ..widgets.fields import ActionButton, centred_column
from ..widgets.labels import heading, remark
from ..widgets.layout import described, hbox, vbox
from .calibration_words import SENSOR_NAMES, record_words

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
        self._timer = QTimer(self)
        self._timer.setInterval(TICK_MS)
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
        self.rig = QLabel()
        self.rig.setObjectName("calibrateRig")
        self.rig.setWordWrap(True)
        self.connect_rig = QPushButton("Connect a ri&g on Acquire")
        self.connect_rig.setObjectName("calibrateConnect")
        self.connect_rig.setProperty("primary", "true")
        self.connect_rig.clicked.connect(self.connect_asked)
        self.starts: dict[str, ActionButton] = {}
        self.files: dict[str, QPushButton] = {}
        self.own: dict[str, QLineEdit] = {}
        self.current: dict[str, QLabel] = {}
        self.again = QPushButton("Apply to an old &session…")
        self.again.setObjectName("applyAgain")
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
        for row, name in enumerate(SENSORS):
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
            grid.addLayout(words, row, 0)
            grid.addWidget(own, row, 1)
            grid.addWidget(start, row, 2)
            grid.addWidget(read, row, 3)
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
