"""Driving a loop by hand in tests: commands answered, cycles counted, outputs looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from fingerlab.acquisition.bench.loop import ControlLoop
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Command, Enable, Initialise, Start
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.ring import COLUMN, COLUMNS, Ring
from fingerlab.acquisition.status import SharedStatus, Slot, Text
from fingerlab.rig.file import default_rig
from fingerlab.rig.limits import Limits

SINE = {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0, "offset_deg": 22.0, "duration_s": 4.0}


class Driven:
    """A loop on a device, stepped by hand; ``alive`` lets window and recorder answer."""

    def __init__(self, device: Any, limits: Limits | None = None, rows: int = 1 << 15) -> None:
        self.device = device
        self.ring = Ring.make(rows, len(COLUMNS), shared=False)
        self.board = SharedStatus.make(shared=False)
        self.board[Slot.GUARDIAN_READY] = 1
        settings = LoopSettings(BenchUnits.from_rig(default_rig()), limits or Limits())
        self.loop = ControlLoop(device, replace(settings), self.ring, self.board)
        self.window = self.recorder = True
        self._number = 0
        self.loop.open()

    def cycles(self, count: int, until: Callable[[], bool] = lambda: False) -> None:
        for _ in range(count):
            if self.loop.ended or until():
                return
            self.board[Slot.WINDOW_BEAT] += self.window
            self.board[Slot.RECORDER_BEAT] += self.recorder
            self.loop.cycle()

    def ask(self, command: Command) -> str:
        """Submit a command and cycle until it is answered; the refusal, or an empty text."""
        self._number += 1
        self.loop.submit(self._number, command)
        self.cycles(6000, lambda: self.board[Slot.ACK] == self._number)
        assert self.board[Slot.ACK] == self._number
        return self.board.text(Text.ANSWER)

    def run(self, trajectory: dict[str, Any] | None = None, endless: bool = False) -> None:
        for command in (Initialise(), Enable(), Start(trajectory or SINE, endless)):
            assert self.ask(command) == ""

    def column(self, name: str) -> np.ndarray:
        """All rows of a column that are still in the ring."""
        return self.ring.last(self.ring.rows)[:, COLUMN[name]]

    @property
    def fault(self) -> str:
        return self.board.text(Text.FAULT)
