"""Loop and recorder in the caller's own process, on the device's virtual clock: faster than real time.

The same objects as in ``processes.py``, without processes; nothing watches from outside, so this is for
devices that are simulated or replayed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from fingerlab.acquisition.bench.bench import Bench, RecorderClient
from fingerlab.acquisition.bench.loop import ControlLoop
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.commands import Command
from fingerlab.acquisition.record.recorder import Recorder
from fingerlab.acquisition.record.recording import RunInfo, SessionInfo
from fingerlab.acquisition.ring import COLUMNS, Ring
from fingerlab.acquisition.status import SharedStatus, Slot, Text
from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost

RING_S = 30.0
"""Length of the ring; the recorder is polled far more often."""

POLL_CYCLES = 200
"""Rows taken at a time: with fewer, HDF5 would cost more than the bench."""

IDLE_CYCLES = 10


class InlineBench(Bench):
    """A bench stepped by hand; see :class:`Bench`."""

    def __init__(
        self,
        device: Device,
        settings: LoopSettings,
        rescue: Path,
        clock: Callable[[], float] | None = None,
    ) -> None:
        """Open the device.

        Args:
            clock: seconds, to measure cycles; without one each lasts its period.

        Raises:
            UserError: the device cannot be opened.
        """
        self.rate_hz = device.rate_hz
        self.ring = Ring.make(round(RING_S * self.rate_hz), len(COLUMNS), shared=False)
        self.board = SharedStatus.make(shared=False)
        self.device = device
        settings = replace(settings, watch_window=False, watch_recorder=False, watch_guardian=False)
        self.loop = ControlLoop(device, settings, self.ring, self.board, clock)
        self._recorder = Recorder(self.ring, self.board, rescue)
        self.recorder = LocalRecorder(self._recorder)
        self._number = self._cycles = 0
        try:
            self.loop.open()
        except (DeviceLost, DeviceFault) as error:
            self.loop.close()
            raise UserError(str(error)) from None

    def step(self, cycles: int) -> None:
        """Let the loop do ``cycles`` cycles, and the recorder its part."""
        for _ in range(cycles):
            if self.loop.ended:
                break
            self.loop.cycle()
            self._cycles += 1
            if self._cycles % POLL_CYCLES == 0:
                self._recorder.poll()

    def stop(self) -> None:
        """The latched stop; nobody else lets the loop's next cycle come, so it is done here."""
        super().stop()
        self.step(1)

    def idle(self) -> None:
        self.step(IDLE_CYCLES)

    def ask(self, command: Command) -> None:
        self._number += 1
        self.loop.submit(self._number, command)
        while self.board[Slot.ACK] != self._number and not self.loop.ended:
            self.step(1)
        refusal = self.board.text(Text.ANSWER) if self.board[Slot.ACK] == self._number else ""
        if self.board[Slot.ACK] != self._number:
            refusal = self.board.text(Text.FAULT) or "The control loop has ended."
        if refusal:
            raise UserError(refusal)

    def close(self) -> None:
        if not self.loop.ended or not self.board[Slot.LOOP_ENDED]:
            self.loop.close()
        if self._recorder.recording:
            self._recorder.cut("The bench was closed while it recorded.")


class LocalRecorder(RecorderClient):
    """The recorder of the same process."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def open(self, info: SessionInfo) -> None:
        self._recorder.open(info)

    def begin(self, run: RunInfo) -> None:
        self._recorder.begin(run)

    def pause(self, on: bool) -> None:
        self._recorder.pause(on)

    def mark(self, note: str, index: int | None = None) -> None:
        self._recorder.mark(note, index)

    def end(self, stop: int | None = None) -> None:
        self._recorder.end(stop)

    def cut(self, note: str) -> None:
        self._recorder.cut(note)

    def close(self, progress: Progress | None = None) -> Path:
        return self._recorder.close(progress)
