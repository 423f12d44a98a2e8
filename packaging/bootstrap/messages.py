"""How the starter speaks: one sentence a step, one sentence an obstacle."""

from __future__ import annotations

import sys
from pathlib import Path


class SetupError(Exception):
    """An obstacle that the user can remove; the message is one sentence that says how."""


def say(sentence: str) -> None:
    """Tell what is about to happen, on standard error: standard output belongs to the command started."""
    print(f"FingerLab: {sentence}", file=sys.stderr, flush=True)


class Log:
    """The record of what installers printed, so that the screen can stay short.

    Args:
        path: the file to write; it is begun anew.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("", encoding="utf-8")

    def add(self, text: str) -> None:
        """Append ``text`` as it is."""
        with self.path.open("a", encoding="utf-8") as stream:
            stream.write(text)
