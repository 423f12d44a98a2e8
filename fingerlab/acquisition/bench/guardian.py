"""The guardian: a thread of the recorder's process that stops the motor in a dead loop's place.

It has a device of its own. Before the loop opens the bench, the guardian's device is built, its driver
imported and its stop tried, so that nothing is done for the first time when it counts; until that stands in
the board as done, the loop does not enable the amplifier.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection

from fingerlab.acquisition.bench.loop import SAFE_TRIES
from fingerlab.acquisition.status import SharedStatus, Slot, Text
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost, StopRehearsal

LOOK_CYCLES = 5
"""The loop looks once in so many cycles: 9 us each time."""

_EXITING = 0x4  # PF_EXITING of the kernel's linux/sched.h
_KILLED = 1 << 8  # SIGKILL, number 9, among the signals that wait to be delivered
_STATE, _FLAGS, _PENDING = 0, 6, 28  # fields 3, 9 and 31 of /proc/PID/stat (proc_pid_stat(5)), from the third


class ProcessWatch:
    """Tells whether the process ``pid`` is on its way out; never wrongly, and nothing where it cannot."""

    def __init__(self, pid: int) -> None:
        self._file: int | None = None
        with suppress(OSError, AttributeError):
            self._file = os.open(f"/proc/{pid}/stat", os.O_RDONLY)

    def dying(self) -> bool:
        """Whether the process has been killed, is ending, or is gone."""
        if self._file is None:
            return False
        try:
            text = os.pread(self._file, 1024, 0)
        except ProcessLookupError:
            return True
        except OSError:
            return False
        fields = text[text.rfind(b")") + 2 :].split()
        if len(fields) <= _PENDING:
            return False
        ending = int(fields[_FLAGS]) & _EXITING or int(fields[_PENDING]) & _KILLED
        return bool(ending) or fields[_STATE] in (b"Z", b"X")

    def close(self) -> None:
        """Let go of the process' entry."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


STANDSTILL = 10.0
"""For so many times the lateness at which it stops by itself a loop may stand still: twice as long as it
waits for a card whose clock has stopped, which it tells best itself (assumed)."""

FEWEST_LOOKS = 5
"""Whoever was held up as well, as by a machine that slept, looks so often before it judges (assumed)."""


class StallWatch:
    """Tells whether the loop makes no cycles any more while the amplifier is on: it hangs in a driver, say.

    Args:
        late_time: s, lateness at which the loop stops by itself, where it can.
    """

    def __init__(self, board: SharedStatus, late_time: float) -> None:
        self._board, self._seconds = board, STANDSTILL * late_time
        self._cycles, self._since, self._looks = -1, 0.0, 0

    def seen(self) -> bool:
        """To be called every few milliseconds."""
        cycles, now = self._board[Slot.CYCLES], time.monotonic()
        # A set value may stand without the enable line, where a rig is checked for one that does nothing.
        driven = self._board[Slot.ENABLE_LINE] or self._board[Slot.RUN_ACTIVE]
        if cycles != self._cycles or not driven:
            self._cycles, self._since, self._looks = cycles, now, 0
            return False
        self._looks += 1
        return self._looks >= FEWEST_LOOKS and now - self._since > self._seconds


class PeerWatch:
    """The processes without which the loop may not drive, looked at between its cycles.

    Args:
        window: number of the window's process; the recorder's stands in the board once it has one.
        lost: called once with the sentence of each that is lost, whoever noticed it first.
        sentences: of window and recorder.
    """

    def __init__(
        self, window: int, board: SharedStatus, lost: Callable[[str], None], sentences: Sequence[str]
    ) -> None:
        self._board, self._lost = board, lost
        self._window, self._recorder = sentences
        self._pulses = {self._window: ProcessWatch(window)}
        self._reported: set[str] = set()
        self._cycles = 0

    def look(self) -> None:
        """To be called once a cycle."""
        self._cycles += 1
        if self._cycles % LOOK_CYCLES:
            return
        if self._recorder not in self._pulses and self._board[Slot.RECORDER_PID]:
            self._pulses[self._recorder] = ProcessWatch(self._board[Slot.RECORDER_PID])
        for sentence, pulse in self._pulses.items():
            if pulse.dying():
                self.tell(sentence)

    def tell(self, sentence: str) -> None:
        """Whose sentence this is, is lost. May be called from another thread."""
        if sentence not in self._reported:
            self._reported.add(sentence)
            self._lost(sentence)


LOOK_S = 0.005
"""How often the guardian looks whether the loop lives, where it is not told at once."""

TRIAL_S = 30.0
"""So long the loop waits for the trial; without it, the bench can be looked at and not driven (assumed)."""


def try_stop(device: Device | None, board: SharedStatus) -> None:
    """Let the guardian's device stop a bench that stands still, and put into the board whether it could.

    Args:
        device: not open; None where the device lives and dies with the loop's process.
    """
    why = _trial(device) if device is not None else ""
    if why:
        board.set_text(Text.GUARDIAN, why)
    board[Slot.GUARDIAN_READY] = -1 if why else 1


def await_trial(board: SharedStatus, recorder_lives: Connection) -> None:
    """Until the guardian has tried its stop, which must not fall into what the loop does; or is gone."""
    end = time.monotonic() + TRIAL_S
    while not board[Slot.GUARDIAN_READY] and time.monotonic() < end:
        if recorder_lives.poll(LOOK_S):  # nothing is ever sent: it has ended
            return


def guard(
    device: Device | None, board: SharedStatus, loop_lives: Connection, standstill: StallWatch | None
) -> None:
    """Wait for the loop's end; where it was no proper one, make the bench safe in its place.

    Args:
        device: as of :func:`try_stop`. standstill: tells whether the loop hangs, where that can be seen.
    """
    _wait_until_lost(board, loop_lives, standstill)
    if board[Slot.LOOP_ENDED]:
        return
    confirmed = device is None or _make_safe(device)
    board[Slot.SAFE] = int(confirmed)
    board[Slot.ENABLE_LINE] = 0
    board[Slot.GUARDIAN_ACTED] = 1
    if device is None:
        return
    with suppress(EOFError, OSError):
        loop_lives.recv()
    # What the loop had handed to the driver may have come after the zero: write it once more.
    confirmed = any(_make_safe(device) for _ in range(SAFE_TRIES))
    board[Slot.SAFE] = int(confirmed)


def _trial(device: Device) -> str:
    """Why the device could not stop the motor; empty where it can."""
    try:
        if isinstance(device, StopRehearsal):
            device.try_stop()
            return ""
        confirmed = device.make_safe()
        device.close()  # the loop's own is to have the hardware
    except (DeviceLost, DeviceFault) as error:
        return f"{UNGUARDED} {error}"
    except Exception as error:
        return f"{UNGUARDED} {' '.join(f'{type(error).__name__}: {error}'.split())}"
    return (
        "" if confirmed else f"{UNGUARDED} {device.name} does not confirm zero output and a low enable line."
    )


UNGUARDED = "The motor cannot be enabled, for the process that stops it when the control loop dies could not:"


def _make_safe(device: Device) -> bool:
    """Whether zero output and a low enable line were confirmed. A user's own device may break its word."""
    try:
        return device.make_safe()
    except Exception:
        return False


def _wait_until_lost(board: SharedStatus, loop_lives: Connection, standstill: StallWatch | None) -> None:
    """Until the loop's process is gone, or the system says that it is going, or it stands still."""
    pulse: ProcessWatch | None = None
    with suppress(EOFError, OSError):
        while not loop_lives.poll(LOOK_S):
            if pulse is None and board[Slot.LOOP_PID]:
                pulse = ProcessWatch(board[Slot.LOOP_PID])
            if pulse is not None and pulse.dying():
                return
            if standstill is not None and standstill.seen():
                return
