"""The run that is being written: which samples belong to it, and where it ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.acquisition.board import Board, Text
from fingerlab.acquisition.columns import COLUMN, RowFlag
from fingerlab.acquisition.machine import Mode
from fingerlab.acquisition.recording import RunInfo
from fingerlab.acquisition.ring import Array, RingReader
from fingerlab.sessions.recording_files import PartWriter


@dataclass
class OpenRun:
    """One run, its file, and how far it is.

    Attributes:
        stop: index after the last sample; None until that is known. next: index of the next one.
        late: cycles that were late. dropped: samples that are missing in between; not_numbers: those of them
            that were left out because a channel was none. waiting: samples since the last flush.
    """

    info: RunInfo
    writer: PartWriter
    reader: RingReader
    stop: int | None
    next: int
    paused: bool = False
    late: int = 0
    dropped: int = 0
    waiting: int = 0
    not_numbers: int = 0

    def inside(self, index: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Which samples belong to the run and are not yet written."""
        inside = index >= self.next
        return inside if self.stop is None else inside & (index < self.stop)

    def end_with_motion(self, rows: Array, board: Board) -> str:
        """End a run against a known load with its motion: afterwards the load hangs on its support again.

        Args:
            rows: of the ring, those of the run. board: says why the bench stopped.

        Returns:
            Why the run was cut, empty where its motion ended in order or goes on.
        """
        modes = rows[:, COLUMN["mode"]]
        ended = np.flatnonzero(modes != Mode.RUNNING)
        if not len(ended):
            return ""
        first, mode = ended[0], Mode(int(modes[ended[0]]))
        # The row that begins a soft stop still holds the last sample of the motion.
        stop = int(rows[first, COLUMN["index"]]) + (mode is Mode.STOPPING)
        self.stop = stop if self.stop is None else min(self.stop, stop)
        if mode is Mode.FAULT:
            return board.text(Text.FAULT)
        latched = int(rows[first, COLUMN["flags"]]) & RowFlag.LATCHED
        return "The bench was stopped by the operator." if latched else ""

    @property
    def lossy_note(self) -> str:
        """What is missing in between; empty where nothing is."""
        if not self.dropped:
            return ""
        why = f", {self.not_numbers} of them were no numbers" if self.not_numbers else ""
        return f"{self.dropped} samples were lost in gaps{why}."
