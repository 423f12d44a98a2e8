"""The file under a session that is being written. It keeps a full disk away from HDF5.

HDF5 1.14 and 2.0 crash the process (segmentation fault) when the disk fills up while compressed chunks wait
in its cache: the failure comes when objects are closed, where nobody can catch it. So HDF5 is given this
object in place of a path: it notes the first failure, keeps what could not be written in memory for the
few moments until the file is thrown away, and the writer asks it after each step.
"""

from __future__ import annotations

import os
from pathlib import Path


class TargetFile:
    """A file for ``h5py.File(target, mode)`` whose failures are asked for, not raised into HDF5."""

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
