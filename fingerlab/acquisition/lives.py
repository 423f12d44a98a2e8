"""Whether another process still lives, sooner than the end of its pipe tells.

A killed process gives back its memory before it closes its pipes. With the ring in it that takes 5 to 20 ms
on an idle machine and was seen to take 200 ms on a busy one: longer than the motor may run. Linux marks the
process at once; other systems have the pipe alone.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from fingerlab.acquisition.board import Board, Slot

LOOK_CYCLES = 5
"""The loop looks once in so many cycles: 9 us each time."""

_EXITING = 0x4  # PF_EXITING of the kernel's linux/sched.h
_KILLED = 1 << 8  # SIGKILL, number 9, among the signals that wait to be delivered
_STATE, _FLAGS, _PENDING = 0, 6, 28  # fields 3, 9 and 31 of /proc/PID/stat (proc_pid_stat(5)), from the third


class Pulse:
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


class Standstill:
    """Tells whether the loop makes no cycles any more while the amplifier is on: it hangs in a driver, say.

    Args:
        late_time: s, lateness at which the loop stops by itself, where it can.
    """

    def __init__(self, board: Board, late_time: float) -> None:
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


class Lives:
    """The processes without which the loop may not drive, looked at between its cycles.

    Args:
        window: number of the window's process; the recorder's stands in the board once it has one.
        lost: called once with the sentence of each that is lost, whoever noticed it first.
        sentences: of window and recorder.
    """

    def __init__(
        self, window: int, board: Board, lost: Callable[[str], None], sentences: Sequence[str]
    ) -> None:
        self._board, self._lost = board, lost
        self._window, self._recorder = sentences
        self._pulses = {self._window: Pulse(window)}
        self._told: set[str] = set()
        self._cycles = 0

    def look(self) -> None:
        """To be called once a cycle."""
        self._cycles += 1
        if self._cycles % LOOK_CYCLES:
            return
        if self._recorder not in self._pulses and self._board[Slot.RECORDER_PID]:
            self._pulses[self._recorder] = Pulse(self._board[Slot.RECORDER_PID])
        for sentence, pulse in self._pulses.items():
            if pulse.dying():
                self.tell(sentence)

    def tell(self, sentence: str) -> None:
        """Whose sentence this is, is lost. May be called from another thread."""
        if sentence not in self._told:
            self._told.add(sentence)
            self._lost(sentence)
