"""The files of sessions on disk: what HDF5 would crash at is kept from it; hashes tell recordings apart.

A stranger's file is looked at while HDF5 reads it, a recording whose writer was killed is shown to it as if
it had been closed, and a file that is written may lie on a disk that fills up. What was recorded once is
evidence once.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Session

WRITE_FLAGS = 0x05
"""Superblock version 3: open for writing, open in single-writer mode."""
_SUPERBLOCK = 48


def was_cut(path: Path) -> bool:
    """Whether an HDF5 file still says that a writer has it open."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            head = file.read(_SUPERBLOCK)
    except OSError:
        return False
    return (
        head.startswith(b"\x89HDF\r\n\x1a\n")
        and len(head) == _SUPERBLOCK
        and head[8:11] == bytes((3, 8, 8))
        and bool(head[11] & WRITE_FLAGS)
    )


class ReadFile(io.FileIO):
    """A file for ``h5py.File(file, "r")`` that HDF5 always comes back from.

    HDF5 1.14 and 2.0 walk through a damaged heap of texts (global heap, HDF5 file format III.E) by the sizes
    that stand in it: at a free object of size zero they go round for ever, holding every lock of Python's, so
    that nothing can interrupt them. A heap is read from its first byte on and looked through before.

    A file whose writer was killed is read as if it had been closed: no flag, and it ends where it ends. HDF5
    itself opens it only in single-writer mode, in which it waits for hours at a damaged place, for a writer
    that might be about to mend it.
    """

    def __init__(self, path: Path, cut: bool = False) -> None:
        """Open it.

        Args:
            cut: whether its writer was killed (``was_cut``).

        Raises:
            OSError: it cannot be opened.
        """
        super().__init__(path, "rb")
        self._head = b""
        if cut:
            head = bytearray(self.read(_SUPERBLOCK))
            head[11] = 0
            head[28:36] = path.stat().st_size.to_bytes(8, "little")
            head[44:48] = _checksum(bytes(head[:44])).to_bytes(4, "little")
            self._head = bytes(head)

    def __del__(self) -> None:
        """Closed with the HDF5 file that reads from it, which holds it alone."""
        self.close()

    def readinto(self, buffer: Any) -> int:
        """As for any file.

        Raises:
            OSError: a damaged heap of texts begins here.
        """
        start = self.tell()
        count = super().readinto(buffer) or 0
        view = memoryview(buffer).cast("B")
        if start < len(self._head):
            inside = min(count, len(self._head) - start)
            view[:inside] = self._head[start : start + inside]
        if view[: len(_HEAP)] == _HEAP and not self._is_good_heap(start):
            raise OSError(f"the texts at byte {start} are damaged")
        return count

    def _is_good_heap(self, start: int) -> bool:
        """Whether the sizes of a heap's objects add up, each step going on."""
        self.seek(start + _HEAP_SIZE_AT)
        size = int.from_bytes(self.read(8), "little")
        if not _LEAST_HEAP <= size <= os.fstat(self.fileno()).st_size - start:
            return False
        self.seek(start)
        heap = self.read(size)
        place = _HEAP_HEAD
        while place + _HEAP_HEAD <= size:
            number = int.from_bytes(heap[place : place + 2], "little")
            length = int.from_bytes(heap[place + 8 : place + 16], "little")
            place += _HEAP_HEAD + -(-length // 8) * 8 if number else length
            if place > size or not (number or length >= _HEAP_HEAD):
                return False
        return True


_HEAP, _HEAP_SIZE_AT = b"GCOL", 8
_LEAST_HEAP = 4096
"""Bytes: HDF5 makes none smaller, and reads as many at first."""
_HEAP_HEAD = 16
"""Bytes of the head of a heap and of each object of it, where lengths have 8 bytes."""


def _checksum(data: bytes) -> int:
    """HDF5's own of its metadata: Bob Jenkins' lookup3 (2006), for whole words of less than four blocks."""
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    words = [int.from_bytes(data[k : k + 4], "little") for k in range(0, len(data), 4)]
    while len(words) > 3:
        a, b, c = ((x + word) & _WORD for x, word in zip((a, b, c), words[:3], strict=True))
        words = words[3:]
        for turn in (4, 6, 8, 16, 19, 4):
            a = ((a - c) & _WORD) ^ _turned(c, turn)
            a, b, c = b, (c + b) & _WORD, a
    a, b, c = ((x + word) & _WORD for x, word in zip((a, b, c), [*words, 0, 0], strict=False))
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _turned(b, turn)) & _WORD
        a, b, c = b, c, a
    return b


_WORD = 0xFFFFFFFF


def _turned(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & _WORD


class TargetFile:
    """The file under a session that is being written, for ``h5py.File(target, mode)``.

    HDF5 1.14 and 2.0 crash the process (segmentation fault) when the disk fills up while compressed chunks
    wait in its cache: the failure comes when objects are closed, where nobody can catch it. So HDF5 is given
    this object in place of a path: it notes the first failure, keeps what could not be written in memory for
    the few moments until the file is thrown away, and the writer asks it after each step.
    """

    def __init__(self, path: Path) -> None:
        """Open an existing file for reading and writing.

        Raises:
            OSError: it cannot be opened.
        """
        self.failure: OSError | None = None
        self._file = path.open("r+b", buffering=0)
        self._lost: dict[int, bytes] = {}

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As for any file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As for any file."""
        return self._file.tell()

    def read(self, size: int = -1) -> bytes:
        """As for any file; h5py takes an object with ``read`` and ``seek`` for a file."""
        buffer = bytearray(size if size >= 0 else 0)
        self.readinto(memoryview(buffer))
        return bytes(buffer)

    def readinto(self, buffer: memoryview) -> int:
        """Read what HDF5 wrote before, what the disk did not take included."""
        start, size = self._file.tell(), len(buffer)
        view = memoryview(buffer).cast("B")
        done = 0
        while done < size and (count := self._file.readinto(view[done:])):
            done += count
        view[done:] = bytes(size - done)
        for offset, lost in self._lost.items():
            first, last = max(offset, start), min(offset + len(lost), start + size)
            if first < last:
                view[first - start : last - start] = lost[first - offset : last - offset]
        return size

    def write(self, data: memoryview) -> int:
        """Write all of the data, or note why not and keep it in memory."""
        view = memoryview(data).cast("B")
        start = self._file.tell()
        try:
            done = 0
            while self.failure is None and done < len(view):
                done += self._file.write(view[done:]) or 0
        except OSError as error:
            self.failure = error
        if self.failure is not None:
            self._lost[start] = bytes(view)
        return len(view)

    def truncate(self, size: int) -> int:
        """As for any file; a failure is noted."""
        try:
            if self.failure is None:
                self._file.truncate(size)
        except OSError as error:
            self.failure = error
        return size

    def flush(self) -> None:
        """Nothing waits: the file is unbuffered."""

    def close(self) -> None:
        """Close the file; some systems tell only now that it did not fit."""
        try:
            self._file.close()
        except OSError as error:
            self.failure = self.failure or error

    def raise_failure(self) -> None:
        """Raise the first failure, or do nothing.

        Raises:
            OSError: something could not be written.
        """
        if self.failure is not None:
            raise self.failure


def content_hash(session: Session) -> str:
    """SHA-256 of the session's file in hexadecimal, for the files of fitted models.

    Raises:
        UserError: the file can no longer be read.
    """
    return file_hash(session.path)


def file_hash(path: Path) -> str:
    """SHA-256 of a file in hexadecimal, whatever it holds.

    Raises:
        UserError: the file can no longer be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}); put it back.") from None


def refuse_twice(sessions: Sequence[Session]) -> None:
    """Refuse files that are one, by name or by what they hold; files that differ in size are not read.

    Raises:
        UserError: so it is, or a file can no longer be read.
    """
    for before, path in repeated_files([session.path for session in sessions]):
        if before.resolve() == path.resolve():
            raise UserError(f"{path} is given twice; give each session once.")
        raise UserError(f"{before} and {path} hold the same recording; give one of them.")


def repeated_files(paths: Sequence[Path]) -> Iterator[tuple[Path, Path]]:
    """Files that hold the same as one before them, behind that one; those that differ in size are not read.

    Raises:
        UserError: a file can no longer be read.
    """
    if len(paths) < 2:
        return
    sizes = [_size(path) for path in paths]
    known: dict[str, Path] = {}
    for path, size in zip(paths, sizes, strict=True):
        content = file_hash(path) if sizes.count(size) > 1 else ""
        if content and content in known:
            yield known[content], path
        known[content] = path


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}); put it back.") from None
