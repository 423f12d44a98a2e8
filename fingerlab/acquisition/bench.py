"""One face for a bench, whether its loop and recorder run in processes of their own or on a virtual clock.

The window and the headless recorder both call this and nothing behind it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fingerlab.acquisition.board import Board, Input, Number, Slot, Text
from fingerlab.acquisition.commands import Command
from fingerlab.acquisition.machine import Mode
from fingerlab.acquisition.recording import RunInfo, SessionInfo
from fingerlab.acquisition.ring import Ring
from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress


@dataclass(frozen=True)
class Status:
    """What a window shows of the bench; a snapshot without waiting.

    Attributes:
        fault: why the bench is in fault; recorder: what the recorder could not do; each empty otherwise.
        recording: 0 no, 1 yes, 2 paused. recorded: samples of this run in the file. unread: samples that the
            recorder lost because the ring came round. free_bytes: room on the disk, 0 before it is known.
        run_start: index of the first sample of trajectory number ``run``.
        emergency_stop, amplifier_ready: what these inputs tell; lines_at: sample of their last change.
        dead_man: whether the device has one. pressed, unready: as the state machine has it.
        sleep: why the machine may fall asleep in spite of the motor being enabled; empty where it may not.
    """

    mode: Mode
    latched: bool
    enabled: bool
    index: int
    cycles: int
    late: int
    lost: int
    faults: int
    fault: str
    run: int
    run_start: int
    run_active: bool
    recording: int
    recorded: int
    recorded_runs: int
    unread: int
    free_bytes: int
    recorder: str
    device: str
    loop_ended: bool
    safe_confirmed: bool
    emergency_stop: Input = Input.NONE
    amplifier_ready: Input = Input.NONE
    dead_man: bool = False
    lines_at: int = 0
    pressed: bool = False
    unready: bool = False
    sleep: str = ""


class RecorderFace(ABC):
    """What may be asked of the recorder. Every method raises UserError with one sentence."""

    @abstractmethod
    def open(self, info: SessionInfo) -> None: ...

    @abstractmethod
    def begin(self, run: RunInfo) -> None: ...

    @abstractmethod
    def pause(self, on: bool) -> None: ...

    @abstractmethod
    def mark(self, note: str, index: int | None = None) -> None: ...

    @abstractmethod
    def end(self, stop: int | None = None) -> None: ...

    @abstractmethod
    def cut(self, note: str) -> None: ...

    @abstractmethod
    def close(self, progress: Progress | None = None) -> Path:
        """Write the session whole, verify it, and give it its name.

        Args:
            progress: called with the share done (0 to 1) and ``writing`` or ``verifying``. Raises it
                ``Cancelled``, the work is put off: the runs stay in the recording's folder, closed and whole,
                and become the session when its name is next opened.

        Returns:
            Its path.

        Raises:
            Cancelled: it was put off.
        """


class Bench(ABC):
    """A bench that can be driven and recorded.

    Attributes:
        ring: rows of :data:`fingerlab.acquisition.columns.COLUMNS`; take a ``reader`` of it to draw.
        board: counters and sentences; better ask :meth:`status`.
        recorder: begins and ends recordings.
    """

    ring: Ring
    board: Board
    recorder: RecorderFace
    rate_hz: float

    @abstractmethod
    def ask(self, command: Command) -> None:
        """Ask the loop for something and wait for its answer, a few cycles.

        Raises:
            UserError: it was refused; the sentence says why.
        """

    @abstractmethod
    def idle(self) -> None:
        """Let a little time pass on the bench, and show that the caller is alive."""

    @abstractmethod
    def close(self) -> None:
        """Stop the motor, end a recording, end the processes."""

    def beat(self) -> None:
        """Show that the caller is alive; a window calls this 30 times a second."""
        self.board[Slot.WINDOW_BEAT] += 1

    def stop(self) -> None:
        """The latched stop: zero output, enable low in the loop's next cycle. Never waits, never raises."""
        self.board[Slot.STOP_REQUESTS] += 1

    def status(self) -> Status:
        """A snapshot, without waiting."""
        b = self.board
        return Status(
            mode=Mode(b[Slot.MODE]),
            latched=bool(b[Slot.LATCHED]),
            enabled=bool(b[Slot.ENABLE_LINE]),
            index=b[Slot.INDEX],
            cycles=b[Slot.CYCLES],
            late=b[Slot.LATE],
            lost=b[Slot.LOST],
            faults=b[Slot.FAULTS],
            fault=b.text(Text.FAULT),
            run=b[Slot.RUN],
            run_start=b[Slot.RUN_START],
            run_active=bool(b[Slot.RUN_ACTIVE]),
            recording=b[Slot.RECORDING],
            recorded=b[Slot.RECORDED],
            recorded_runs=b[Slot.RECORDED_RUNS],
            unread=b[Slot.UNREAD],
            free_bytes=b[Slot.FREE_BYTES],
            recorder=b.text(Text.RECORDER),
            device=b.text(Text.DEVICE),
            loop_ended=bool(b[Slot.LOOP_ENDED]),
            safe_confirmed=bool(b[Slot.SAFE]),
            emergency_stop=Input(b[Slot.EMERGENCY_STOP]),
            amplifier_ready=Input(b[Slot.AMPLIFIER_READY]),
            dead_man=bool(b[Slot.DEAD_MAN]),
            lines_at=b[Slot.LINES_AT],
            pressed=bool(b[Slot.PRESSED]),
            unready=bool(b[Slot.UNREADY]),
            sleep=b.text(Text.SLEEP),
        )

    def approached(self) -> float | None:
        """Angle (rad) at which an approach reached its force; NaN where it did not; None while it goes on."""
        state = self.board[Slot.APPROACHED]
        if state == 0:
            return None
        return self.board.number(Number.APPROACH) if state > 0 else math.nan

    def wait(self, seconds: float) -> None:
        """Let ``seconds`` of the bench's time pass.

        Raises:
            UserError: the bench stopped meanwhile.
        """
        end = self.board[Slot.INDEX] + seconds * self.rate_hz
        self.wait_until(lambda: self.board[Slot.INDEX] >= end, math.inf, "")

    def wait_until(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        """Wait for a condition, at most ``seconds`` of the bench's time.

        Raises:
            UserError: the bench stopped, the recorder failed, or ``what`` took too long.
        """
        end = self.board[Slot.INDEX] + seconds * self.rate_hz
        faults, errors = self.board[Slot.FAULTS], self.board[Slot.RECORDER_ERRORS]
        stops = self.board[Slot.STOP_REQUESTS]
        while not condition():
            if self.board[Slot.RECORDER_ERRORS] != errors:
                raise UserError(self.board.text(Text.RECORDER))
            if self.board[Slot.FAULTS] != faults or self.board[Slot.LOOP_ENDED]:
                raise UserError(self.board.text(Text.FAULT) or "The control loop has ended.")
            if self.board[Slot.STOP_REQUESTS] != stops:
                raise UserError("The bench was stopped.")
            if self.board[Slot.INDEX] >= end:
                raise UserError(f"{what} took longer than {seconds:g} s; the run was given up.")
            self.idle()
