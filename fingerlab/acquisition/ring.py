"""One row a cycle of the control loop, in a ring of shared memory: its columns, its writer, its readers."""

from __future__ import annotations

import math
import struct
from collections import deque
from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import numpy as np

from fingerlab.acquisition.control.machine import Machine
from fingerlab.acquisition.control.safety import Reading
from fingerlab.acquisition.status import Block, Input, SharedStatus, Slot
from fingerlab.devices.protocol import LINES, NO_LINES, RAW_CHANNELS

COLUMNS = (
    "index",
    "motor_command",
    "motor_position",
    "motor_speed",
    "current_command",
    "motor_current",
    "motor_torque",
    "mcp_angle",
    "pip_angle",
    "endpoint_force",
    "lateness",
    "cycle_time",
    "mode",
    "flags",
    "run",
    *(f"raw/{name}" for name in (*RAW_CHANNELS, *LINES)),
)
"""Columns in their order."""

UNITS = {
    "index": "",
    "motor_command": "rad",
    "motor_position": "rad",
    "motor_speed": "rad/s",
    "current_command": "A",
    "motor_current": "A",
    "motor_torque": "N m",
    "mcp_angle": "rad",
    "pip_angle": "rad",
    "endpoint_force": "N",
    "lateness": "s",
    "cycle_time": "s",
    "mode": "",
    "flags": "",
    "run": "",
    **{f"raw/{name}": "count" if name.endswith("counts") else "V" for name in RAW_CHANNELS},
    **{f"raw/{name}": "" for name in LINES},
}
"""Unit of each column; the empty unit is a plain number."""

COLUMN = {name: number for number, name in enumerate(COLUMNS)}
"""Column name -> number."""


class RowFlag(IntFlag):
    """Bits of the column ``flags``."""

    ENABLED = 1
    LATCHED = 2
    LATE = 4
    LOST_BEFORE = 8


Array = np.ndarray[Any, np.dtype[np.float64]]

_MAGIC = 0x46524E47  # "FRNG"
_HEADER_BYTES = 64
_WRITTEN, _ROWS, _COLUMNS = 1, 2, 3


@dataclass(frozen=True)
class RingPiece:
    """Rows that a reader got.

    Attributes:
        first: sequence number of the first row. rows: shape (n, columns). lost: rows that were overwritten
            before this piece could be read.
    """

    first: int
    rows: Array
    lost: int


class Ring:
    """A ring of rows of doubles. ``make`` it in one process, ``attach`` to its name in others."""

    def __init__(self, block: Block, rows: int, columns: int) -> None:
        self._block = block
        self.rows, self.columns = rows, columns
        self._stride = 8 * (columns + 2)
        self._header = block.view[:_HEADER_BYTES].cast("q")
        self._body = block.view[_HEADER_BYTES : _HEADER_BYTES + rows * self._stride]
        self._pack = struct.Struct(f"{columns + 2}d").pack_into
        self._table = np.frombuffer(self._body, dtype=np.float64).reshape(rows, columns + 2)

    @classmethod
    def make(cls, rows: int, columns: int, shared: bool = True) -> Ring:
        """A new ring of ``rows`` rows of ``columns`` doubles."""
        block = Block.make(_HEADER_BYTES + rows * 8 * (columns + 2), shared)
        header = block.view[:_HEADER_BYTES].cast("q")
        header[_ROWS], header[_COLUMNS], header[0] = rows, columns, _MAGIC
        header.release()
        return cls(block, rows, columns)

    @classmethod
    def attach(cls, name: str) -> Ring:
        """The ring that another process made.

        Raises:
            FileNotFoundError: it is gone. ValueError: the memory of that name is no ring.
        """
        block = Block.attach(name)
        header = block.view[:_HEADER_BYTES].cast("q")
        magic, rows, columns = header[0], header[_ROWS], header[_COLUMNS]
        header.release()
        if magic != _MAGIC:
            block.close()
            raise ValueError(f"the shared memory {name} is no ring")
        return cls(block, rows, columns)

    @property
    def name(self) -> str | None:
        """Name for ``attach``; None for a private ring."""
        return self._block.name

    @property
    def written(self) -> int:
        """Rows written since the ring was made."""
        return int(self._header[_WRITTEN])

    def write(self, values: tuple[float, ...]) -> None:
        """Append a row. Only ever called by the one writer."""
        sequence = self._header[_WRITTEN]
        self._pack(self._body, (sequence % self.rows) * self._stride, sequence, *values, sequence)
        self._header[_WRITTEN] = sequence + 1

    def reader(self, behind: int = 0) -> RingReader:
        """A reader that starts ``behind`` rows before what is written now."""
        return RingReader(self, max(0, self.written - behind))

    def copy(self, first: int, stop: int) -> tuple[int, Array]:
        """Rows ``first`` to ``stop`` as far as they are whole: sequence number of the first, and the rows."""
        numbers = np.arange(first, stop)
        rows = self._table[numbers % self.rows]
        # The frames alone do not do: a copy may take the end of a row before its beginning. What the writer
        # can have touched by now is told by how far it is afterwards.
        untouched = numbers > self.written - self.rows
        whole = (rows[:, 0] == numbers) & (rows[:, -1] == numbers) & untouched
        if whole.all():
            return first, rows[:, 1:-1]
        start = int(np.argmax(whole)) if whole.any() else len(whole)
        bad = np.flatnonzero(~whole[start:])
        end = start + (int(bad[0]) if bad.size else len(whole) - start)
        return first + start, rows[start:end, 1:-1]

    def last(self, count: int) -> Array:
        """The newest rows, at most ``count``, shape (n, columns)."""
        written = self.written
        return self.copy(max(0, written - min(count, self.rows - 1)), written)[1]

    def close(self) -> None:
        """Let go of the memory; its maker removes it."""
        del self._table
        self._header.release()
        self._body.release()
        self._block.close()


class RingReader:
    """Reads a ring once through, in pieces, and says what it was too slow for."""

    def __init__(self, ring: Ring, position: int) -> None:
        self._ring = ring
        self.position = position

    def read(self, most: int = 1 << 16) -> RingPiece:
        """The next rows, none to ``most`` of them."""
        ring, wanted = self._ring, self.position
        written = ring.written
        # The oldest sixteenth may be overwritten while it is copied: leave it out beforehand.
        oldest = written - ring.rows + max(1, ring.rows // 16) if written > ring.rows else 0
        first = max(wanted, oldest)
        stop = min(written, first + most)
        if stop <= first:
            return RingPiece(first, np.empty((0, ring.columns)), 0)
        first, rows = ring.copy(first, stop)
        if not len(rows):  # all torn: overwritten while we looked, or not yet visible; look again later
            return RingPiece(wanted, rows, 0)
        self.position = first + len(rows)
        return RingPiece(first, rows, first - wanted)


LATE_SHARE = 0.5
"""A cycle is counted as late from this share of a period on (assumed)."""


class Publisher:
    """Writes rows and counts late and lost cycles."""

    def __init__(self, ring: Ring, board: SharedStatus, period: float) -> None:
        self._write, self._board, self._counters = ring.write, board, board.counters
        self._late_from = LATE_SHARE * period
        self._late = self._lost = self._cycles = 0
        self._lines = [Input.NONE, Input.NONE]

    def publish_lines(self, reading: Reading) -> None:
        """Publish the digital inputs where one has changed."""
        if reading.lines is NO_LINES:
            return
        lines = [Input.NONE if v != v else Input.YES if v else Input.NO for v in reading.lines]
        if lines != self._lines:
            self._lines = lines
            self._board[Slot.EMERGENCY_STOP], self._board[Slot.AMPLIFIER_READY] = lines
            self._board[Slot.LINES_AT] = reading.index

    def publish(self, r: Reading, machine: Machine, reference: float, amps: float, run: int) -> None:
        """Publish a cycle: ``reference`` in rad, ``amps`` the current command, ``run`` 0 without motion."""
        flags = 0
        if machine.enable_allowed:
            flags |= _ENABLED
        if machine.latched:
            flags |= _LATCHED
        if r.lateness > self._late_from:
            flags |= _LATE
            self._late += 1
            self._board[Slot.LATE] = self._late
        if r.lost:
            flags |= _LOST
            self._lost += r.lost
            self._board[Slot.LOST] = self._lost
        self._write(
            (
                r.index,
                reference,
                r.position,
                r.speed,
                amps,
                r.current,
                r.torque,
                r.mcp,
                r.pip,
                r.force,
                r.lateness,
                r.cycle_time,
                machine.mode,
                flags,
                run,
                *r.raw,
                *r.lines,
            )
        )
        self._cycles += 1
        self._counters[_INDEX] = r.index
        self._counters[_CYCLES] = self._cycles


# Plain numbers: arithmetic on an enum costs more than the rest of the cycle.
_ENABLED, _LATCHED = int(RowFlag.ENABLED), int(RowFlag.LATCHED)
_INDEX, _CYCLES = int(Slot.INDEX), int(Slot.CYCLES)
_LATE, _LOST = int(RowFlag.LATE), int(RowFlag.LOST_BEFORE)


WINDOW_S = 10.0
"""Long enough to read a single long cycle, short enough to be about the present (assumed)."""


class CycleTimes:
    """Follows the measured cycle times in the rows of the ring.

    The first cycle, and the first after the device was started anew, last as long as the start takes: they
    are no cycles of the loop and are left out. Cycles that were lost make the one after them longer.
    """

    def __init__(self, rate_hz: float, seconds: float = WINDOW_S) -> None:
        self._samples = round(seconds * rate_hz)
        self._pieces: deque[tuple[int, float, int, float]] = (
            deque()
        )  # last index, sum (s), count, longest (s)
        self._before = -2

    def take(self, rows: Array) -> None:
        """Rows of the ring in their order, shape (n, columns)."""
        if not len(rows):
            return
        index = rows[:, COLUMN["index"]]
        follows = np.diff(index, prepend=self._before) == 1
        lost = (rows[:, COLUMN["flags"]].astype(np.int64) & RowFlag.LOST_BEFORE) != 0
        cycle = rows[:, COLUMN["cycle_time"]]
        good = cycle[(follows | lost) & np.isfinite(cycle)]
        self._before = int(index[-1])
        if len(good):
            self._pieces.append((self._before, float(good.sum()), len(good), float(good.max())))
        while self._pieces and self._pieces[0][0] <= self._before - self._samples:
            self._pieces.popleft()

    @property
    def mean(self) -> float:
        """Mean, s; NaN before the first cycle."""
        count = sum(piece[2] for piece in self._pieces)
        return sum(piece[1] for piece in self._pieces) / count if count else math.nan

    @property
    def longest(self) -> float:
        """Longest, s; NaN before the first cycle."""
        return max((piece[3] for piece in self._pieces), default=math.nan)
