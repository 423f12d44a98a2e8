"""Live volts of one sensor, read beside Acquire from the bench that is connected there."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from fingerlab.acquisition.columns import COLUMN
from fingerlab.acquisition.ring import RingReader

from ..desk import Desk

TICK_MS = 50
COLUMNS = {"load-cell": "raw/force_volts", "mcp": "raw/mcp_volts", "pip": "raw/pip_volts"}
"""Sensor -> the bench's column of its volts."""

NO_RIG = "No rig is connected."
REPLAYED = "A replay is connected; nothing can be placed on it. Use From a recording instead."
AMPLIFIER_ON = "The amplifier is on: disable it on Acquire before you put a hand to the rig."


class VoltSource(QObject):
    """Signal ``arrived(time, volts)``: arrays in s and V, a few times a second while started."""

    arrived = Signal(object, object)

    def __init__(self, desk: Desk, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._desk = desk
        self._column = 0
        self._reader: RingReader | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(TICK_MS)
        self._timer.timeout.connect(self.tick)

    @property
    def refusal(self) -> str:
        """Why nothing can be calibrated now; empty where it can."""
        bench = self._desk.bench
        if bench is None:
            return NO_RIG
        if bench.calibrations is None:
            return REPLAYED
        return AMPLIFIER_ON if self._desk.rig_line.live else ""

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
        bench = self._desk.bench
        self._reader = bench.bench.ring.reader() if bench is not None else None

    def tick(self) -> None:
        """Hand on what has been read since the last time."""
        bench = self._desk.bench
        if bench is None or self._reader is None:
            return
        rows = self._reader.read().rows
        if len(rows):
            self.arrived.emit(rows[:, COLUMN["index"]] / bench.bench.rate_hz, np.array(rows[:, self._column]))
