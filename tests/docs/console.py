"""The commands of a page in order: which are run, and which are not and why."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass

MARK = re.compile(r"<!-- not run: (.+?) -->")
CALL = re.compile(r"^(?: {4}|)(fingerlab|python start\.py)( +[^\s#].*)?$")


@dataclass(frozen=True)
class Console:
    """A command of a page. ``reason`` is why it is not run; empty where it is."""

    line: str
    reason: str

    @property
    def words(self) -> list[str]:
        """The words behind the program's name."""
        return shlex.split(self.line)


def console_lines(text: str) -> Iterator[Console]:
    """Every whole line of code that calls FingerLab, with the mark above its block."""
    reason, inside = "", False
    for line in text.splitlines():
        mark = MARK.match(line)
        if mark:
            reason, inside = mark[1], False
            continue
        code = line.startswith("    ") or line.startswith("fingerlab ")
        found = CALL.match(line)
        if found and code and ("|" not in line or line.startswith("    ")):
            inside = True
            command = re.sub(r"\s#.*$", "", found[2] or "").strip()
            why = reason or ("it installs what the tests run with" if "start.py" in found[1] else "")
            if command:
                yield Console(command, why)
        elif inside and not code and line.strip():
            reason, inside = "", False  # the block is over, and its mark with it
