"""Ctrl-C, and being asked to end: what must come first is done at once, whatever becomes of the exception."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any


class Interrupts:
    """While it is entered, Ctrl-C and SIGTERM call ``first`` and then raise KeyboardInterrupt, once.

    Args:
        raises: whether they raise anything; else ``first`` alone has to see to it.

    Python drops an exception that is raised while it clears away an object, so that a KeyboardInterrupt may
    get lost; ``first`` has run by then, and ``asked`` tells.

    A program started in the background may find Ctrl-C switched off; here it listens all the same.
    """

    def __init__(self, first: Callable[[], None], raises: bool = True) -> None:
        self.first, self._raises = first, raises
        self.asked = False
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Interrupts:
        for which in (signal.SIGINT, signal.SIGTERM):
            self._before[which] = signal.signal(which, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for which, handler in self._before.items():
            signal.signal(which, handler)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.first()
        if not self.asked:  # who presses again must not break what is being saved
            self.asked = True
            if self._raises:
                raise KeyboardInterrupt
