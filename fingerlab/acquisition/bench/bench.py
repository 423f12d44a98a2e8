"""One face for a bench, whether its loop and recorder run in processes of their own or on a virtual clock.

The window and the headless recorder both call this and nothing behind it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Protocol

from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Command, Mode
from fingerlab.acquisition.recording import RunInfo, SessionInfo, seconds_of_room
from fingerlab.acquisition.ring import Ring
from fingerlab.acquisition.status import Input, Number, SharedStatus, Slot, Text
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
        sensors: which sensor of the set-up cannot be believed, as seen with the amplifier off.
        gaps, dropped: of the run that is being written or was last, and the samples missing in them.
        verdict: what the run that was written last is worth.
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
    sensors: str = ""
    gaps: int = 0
    dropped: int = 0
    verdict: str = ""
    usable: bool = True


class RecorderClient(Protocol):
    """What may be asked of the recorder. Every method raises UserError with one sentence."""

    def open(self, info: SessionInfo) -> None: ...

    def begin(self, run: RunInfo) -> None: ...

    def pause(self, on: bool) -> None: ...

    def mark(self, note: str, index: int | None = None) -> None: ...

    def end(self, stop: int | None = None) -> None: ...

    def cut(self, note: str) -> None: ...

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
        ring: rows of :data:`fingerlab.acquisition.ring.COLUMNS`; take a ``reader`` of it to draw.
        board: counters and sentences; better ask :meth:`status`.
        recorder: begins and ends recordings.
        settings: what its loop knows of the bench, its limits above all.
    """

    ring: Ring
    board: SharedStatus
    recorder: RecorderClient
    rate_hz: float
    settings: LoopSettings

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
            sensors=b.text(Text.SENSORS),
            gaps=b[Slot.GAPS],
            dropped=b[Slot.DROPPED],
            verdict=b.text(Text.RUN),
            usable=not b[Slot.UNUSABLE],
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

    def wait_until(
        self,
        condition: Callable[[], bool],
        seconds: float,
        what: str,
        begin: Callable[[], None] = lambda: None,
    ) -> None:
        """Wait for a condition, at most ``seconds`` of the bench's time.

        Args:
            begin: is called once STOP and faults are listened for: who is asked something by it may press
                STOP at once.

        Raises:
            UserError: the bench stopped, the recorder failed, or ``what`` took too long.
        """
        end = self.board[Slot.INDEX] + seconds * self.rate_hz
        faults, errors = self.board[Slot.FAULTS], self.board[Slot.RECORDER_ERRORS]
        stops = self.board[Slot.STOP_REQUESTS]
        begin()
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


LITTLE_ROOM_S = 1800.0
"""Half an hour of recording, a protocol of the thesis and more (assumed)."""


class Kind(Enum):
    """What a notice is about."""

    STOPPED = "stopped"
    RECORDER = "recorder"
    LOST = "lost"
    ROOM = "room"
    UNREAD = "unread"
    LINE = "line"
    SLEEP = "sleep"
    SENSOR = "sensor"
    RUN = "run"
    PACE = "pace"


@dataclass(frozen=True)
class Notice:
    """One sentence for the operator; ``grave`` where something is to be done."""

    kind: Kind
    sentence: str
    grave: bool = False


def endangered(status: Status, rate_hz: float) -> str:
    """What endangers the recording now, in few words; empty for nothing."""
    parts = []
    if status.unread:
        parts.append(f"{status.unread} samples lost")
    if status.lost:
        parts.append(f"{status.lost} cycles lost")
    room = seconds_of_room(status.free_bytes, rate_hz) if status.free_bytes else math.inf
    if room < LITTLE_ROOM_S:
        parts.append(f"room for {room / 60.0:.0f} min of recording")
    return ", ".join(parts)


LOOP_ENDED = "The control loop has ended; connect the device again."


def notices(before: Status, now: Status, rate_hz: float) -> tuple[Notice, ...]:
    """What is new since the last look."""
    new = []
    fault = now.fault or (LOOP_ENDED if now.loop_ended else "")
    if now.faults != before.faults or (now.loop_ended and not before.loop_ended):
        new.append(Notice(Kind.STOPPED, fault or LOOP_ENDED, grave=True))
    elif now.latched and not before.latched:
        new.append(Notice(Kind.STOPPED, "The bench was stopped by the operator."))
    if now.recorder and now.recorder != before.recorder:
        new.append(Notice(Kind.RECORDER, now.recorder))
    if now.recording and now.gaps > before.gaps:
        gaps = "its first gap" if now.gaps == 1 else f"{now.gaps} gaps"
        lost = now.dropped - before.dropped
        sentence = f"{lost} {'sample' if lost == 1 else 'samples'} lost; the run has {gaps} and goes on"
        new.append(Notice(Kind.LOST, sentence))
    if now.recorded_runs > before.recorded_runs:
        # In the same place as the fault that ended it, which must not be lost for it.
        sentence = now.verdict if now.usable else f"{fault} {now.verdict}".strip()
        new.append(Notice(Kind.RUN, sentence, grave=not now.usable))
    if now.sensors and now.sensors != before.sensors:
        new.append(Notice(Kind.SENSOR, now.sensors))
    new.extend(_of_lines(before, now, rate_hz))
    if now.enabled and not before.enabled and now.lost > TOO_MANY_LOST * now.index:
        sentence = (
            f"The machine does not hold {rate_hz:g} Hz: {now.lost} of {now.index + 1} cycles were lost since "
            "connecting; close other programs, or expect gaps."
        )
        new.append(Notice(Kind.PACE, sentence))
    if now.sleep and now.sleep != before.sleep:
        new.append(Notice(Kind.SLEEP, now.sleep))
    new.extend(_of_room(before, now, rate_hz))
    if now.unread > before.unread:
        sentence = (
            f"The recorder was too slow: {now.unread} samples are lost and stored as a gap; close other "
            "programs or record to a faster disk."
        )
        new.append(Notice(Kind.UNREAD, sentence))
    return tuple(new)


TOO_MANY_LOST = 1e-3
"""Share of the cycles (assumed): so few leave every run usable. It is told where the amplifier is enabled."""

STOP_WORDS = {Input.NONE: "not wired", Input.NO: "released", Input.YES: "pressed"}
READY_WORDS = {Input.NONE: "not wired", Input.NO: "not ready", Input.YES: "ready"}
DEAD_MAN_WORDS = {False: "not wired", True: "wired"}
"""The digital lines of a bench as they are shown."""


def line_words(status: Status) -> dict[str, str]:
    """State of the emergency stop, of the amplifier and of the dead-man, in words."""
    beating = status.dead_man and status.enabled
    return {
        "emergency stop": STOP_WORDS[status.emergency_stop],
        "amplifier": READY_WORDS[status.amplifier_ready],
        "dead-man": "beating" if beating else DEAD_MAN_WORDS[status.dead_man],
    }


def _of_lines(before: Status, now: Status, rate_hz: float) -> tuple[Notice, ...]:
    """An input that changed, with the bench's time; not what it is when it is first seen."""
    changes = (
        ("The emergency stop was", before.emergency_stop, now.emergency_stop, STOP_WORDS, Input.YES),
        ("The amplifier is", before.amplifier_ready, now.amplifier_ready, READY_WORDS, Input.NO),
    )
    at = f"at {now.lines_at / rate_hz:.3f} s of the bench's time"
    return tuple(
        Notice(Kind.LINE, f"{begins} {words[is_now]} {at}.", grave=is_now is hinders)
        for begins, was, is_now, words, hinders in changes
        if was is not is_now and was is not Input.NONE
    )


def _of_room(before: Status, now: Status, rate_hz: float) -> tuple[Notice, ...]:
    """Once, when the room becomes little, or is when it is first known."""
    if not now.free_bytes:
        return ()
    room = seconds_of_room(now.free_bytes, rate_hz)
    known = seconds_of_room(before.free_bytes, rate_hz) if before.free_bytes else math.inf
    if not room < LITTLE_ROOM_S <= known:
        return ()
    sentence = (
        f"The disk has room for {room / 60:.0f} more minutes of recording; make room, or choose another "
        "folder."
    )
    return (Notice(Kind.ROOM, sentence),)
