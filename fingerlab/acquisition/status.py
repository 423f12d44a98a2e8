"""What all processes of a bench share: counters, a few numbers and sentences, each with one writer.

Nobody ever waits for it, so that a frozen window cannot hold up the control loop.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from enum import IntEnum
from multiprocessing import shared_memory


class Block:
    """Bytes that are shared by name, or private where the name is None.

    Whoever made a block removes it with ``close``; those who attached to it only let go.
    """

    def __init__(self, memory: shared_memory.SharedMemory | None, view: memoryview, owner: bool) -> None:
        self._memory = memory
        self._owner = owner
        self.view = view

    @classmethod
    def make(cls, size: int, shared: bool) -> Block:
        """A new block of ``size`` bytes, all zero."""
        if not shared:
            return cls(None, memoryview(bytearray(size)), True)
        memory = shared_memory.SharedMemory(create=True, size=size)
        assert memory.buf is not None
        return cls(memory, memory.buf[:size], True)

    @classmethod
    def attach(cls, name: str) -> Block:
        """The block that another process made.

        Raises:
            FileNotFoundError: it is gone.
        """
        memory = shared_memory.SharedMemory(name=name)
        assert memory.buf is not None
        return cls(memory, memory.buf[:], False)

    @property
    def name(self) -> str | None:
        """Name to attach by; None for a private block."""
        return self._memory.name if self._memory else None

    def close(self) -> None:
        """Let go of the memory. Views that others took of it must be gone before."""
        self.view.release()
        if self._memory is None:
            return
        with suppress(BufferError):
            self._memory.close()
        if self._owner:
            with suppress(FileNotFoundError):
                self._memory.unlink()


class Slot(IntEnum):
    """Counters and states (64-bit integers); the process that writes each is named at the right."""

    STOP_REQUESTS = 0  # window: raised by one a press, seen by the loop in its next cycle
    WINDOW_BEAT = 1  # window
    RECORDER_BEAT = 2  # recorder
    RECORDER_ERRORS = 3  # recorder: raised when it cannot go on
    INDEX = 4  # loop: sample clock of the last cycle
    CYCLES = 5  # loop: cycles done
    MODE = 6  # loop: machine.Mode
    LATCHED = 7  # loop
    ENABLE_LINE = 8  # loop: what the device was last told
    LATE = 9  # loop: cycles that came late
    LOST = 10  # loop: cycles that never came
    FAULTS = 11  # loop
    ACK = 12  # loop: number of the last command that was answered
    RUN = 13  # loop: number of the trajectory, 0 before the first
    RUN_START = 14  # loop: index of its first sample
    RUN_ACTIVE = 15  # loop: 1 while it is under way
    SAFE = 16  # loop, guardian: 1 when zero output and enable low were confirmed at the last stop
    LOOP_ENDED = 17  # loop: 1 when it has left in order
    LOOP_PID = 18
    RECORDER_PID = 19
    RECORDING = 20  # recorder: 0 no, 1 yes, 2 paused
    RECORDED = 21  # recorder: samples of this run in the file
    UNREAD = 22  # recorder: rows that it lost because the ring came round
    FREE_BYTES = 23  # recorder: room on the disk
    RECORDED_RUNS = 24  # recorder
    LOOP_READY = 25  # loop
    GUARDIAN_ACTED = 26  # guardian: 1 when it had to make the bench safe in the loop's place
    APPROACHED = 27  # loop: 1 reached, -1 not reached
    FLUSHED = 28  # recorder: samples of this run that survive its own death
    SET_AT = 29  # loop: first sample with the references and the set-up that hold now
    VERIFYING = 30  # recorder: 1 while what was written is read back
    PUT_OFF = 31  # window: 1 asks that the session being written is left for later
    GUARDIAN_READY = 32  # guardian: 1 when its own stop was tried and works, -1 when it does not
    HOLD = 33  # loop: samples for which the device holds a set value
    GAPS = 34  # recorder: gaps in the run that it writes or wrote last
    DROPPED = 35  # recorder: samples that are missing in them
    UNUSABLE = 36  # recorder: 1 where the run written last has no piece that is long enough to be used
    EMERGENCY_STOP = 40  # loop: Input
    AMPLIFIER_READY = 41  # loop: Input
    DEAD_MAN = 42  # loop: 1 where the device has one
    LINES_AT = 43  # loop: sample at which an input last changed
    PRESSED = 44  # loop: Machine.pressed
    UNREADY = 45  # loop: Machine.unready
    AWAKE = 46  # recorder's process: 1 while the system's sleep is held off


class Input(IntEnum):
    """What a digital input tells."""

    NONE = 0  # the bench has none
    NO = 1
    YES = 2


class Text(IntEnum):
    """Sentences."""

    FAULT = 0  # loop: why it is in fault
    ANSWER = 1  # loop: why the last command was refused; empty where it was not
    RECORDER = 2  # recorder: what it cannot do
    DEVICE = 3  # loop: what it drives
    GUARDIAN = 4  # guardian: why it could not stop the motor
    SLEEP = 5  # recorder's process: why sleep could not be held off
    SENSORS = 6  # loop: which sensor of the set-up gives volts that are no measurement
    RUN = 7  # recorder: what the run that it wrote last is worth


class Number(IntEnum):
    """Doubles, SI."""

    APPROACH = 0  # loop: motor angle at which the wanted force was reached, rad
    WRITTEN = 1  # recorder: share of writing and verifying a session that is done, 0 to 1
    LEFT = 2  # loop: V at the output after its clock was stopped; NaN where the device cannot tell
    CLEARED = 3  # loop: V at the output after the stop that followed
    PROPORTIONAL = 4  # loop: A/rad
    INTEGRAL = 5  # loop: A/(rad s)
    DERIVATIVE = 6  # loop: A s/rad
    FEED_FORWARD = 7  # loop: learned slope of current over angle, A/rad; 0 where none is in use


_SLOTS = 64
_TEXT_BYTES = 512
_TEXT_HEAD = 16


class SharedStatus:
    """Counters by :class:`Slot`, sentences by :class:`Text`, doubles by :class:`Number`."""

    def __init__(self, block: Block) -> None:
        self._block = block
        self._slots = block.view[: 8 * _SLOTS].cast("q")
        self._numbers = block.view[8 * _SLOTS : 16 * _SLOTS].cast("d")
        self._texts = block.view[16 * _SLOTS : 16 * _SLOTS + len(Text) * (_TEXT_HEAD + _TEXT_BYTES)]

    @classmethod
    def make(cls, shared: bool = True) -> SharedStatus:
        """A new board, all zero."""
        return cls(Block.make(16 * _SLOTS + len(Text) * (_TEXT_HEAD + _TEXT_BYTES), shared))

    @classmethod
    def attach(cls, name: str) -> SharedStatus:
        """The board that another process made.

        Raises:
            FileNotFoundError: it is gone.
        """
        return cls(Block.attach(name))

    @property
    def counters(self) -> memoryview:
        """All counters by plain number, for those that count every cycle."""
        return self._slots

    @property
    def name(self) -> str | None:
        """Name for ``attach``; None for a private board."""
        return self._block.name

    def __getitem__(self, slot: Slot) -> int:
        return self._slots[slot]

    def __setitem__(self, slot: Slot, value: int) -> None:
        self._slots[slot] = value

    def number(self, which: Number) -> float:
        """One of the doubles."""
        return self._numbers[which]

    def set_number(self, which: Number, value: float) -> None:
        """Set one of the doubles."""
        self._numbers[which] = value

    def set_text(self, which: Text, sentence: str) -> None:
        """Publish a sentence; what exceeds 512 bytes is cut off."""
        data = sentence.encode("utf-8")[:_TEXT_BYTES]
        start = which * (_TEXT_HEAD + _TEXT_BYTES)
        sequence = struct.unpack_from("q", self._texts, start)[0]
        struct.pack_into("q", self._texts, start, sequence + 1)  # odd: being written
        self._texts[start + _TEXT_HEAD : start + _TEXT_HEAD + len(data)] = data
        struct.pack_into("q", self._texts, start + 8, len(data))
        struct.pack_into("q", self._texts, start, sequence + 2)

    def text(self, which: Text) -> str:
        """The sentence, never half of one."""
        start = which * (_TEXT_HEAD + _TEXT_BYTES)
        for _ in range(1000):
            before, length = struct.unpack_from("qq", self._texts, start)
            data = bytes(self._texts[start + _TEXT_HEAD : start + _TEXT_HEAD + length])
            if before % 2 == 0 and struct.unpack_from("q", self._texts, start)[0] == before:
                return data.decode("utf-8", errors="ignore")
        return ""  # its writer died in the middle of it

    def close(self) -> None:
        """Let go of the memory; its maker removes it."""
        for view in (self._slots, self._numbers, self._texts):
            view.release()
        self._block.close()
