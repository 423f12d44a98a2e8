"""The ring between the control loop and all who read it: one writer, many readers, nobody waits.

Each row is framed by its sequence number, before and after. The writer publishes a row by raising the
count of written rows afterwards. A reader copies and then looks how far the writer is, and whether what it
copied carries the numbers that it should: a row that was overwritten meanwhile (overrun) or is not wholly
there yet (torn) is never handed out.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.acquisition.memory import Block

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
