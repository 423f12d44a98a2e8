"""A block of memory that several processes share, or one process keeps to itself, behind one face."""

from __future__ import annotations

from contextlib import suppress
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
