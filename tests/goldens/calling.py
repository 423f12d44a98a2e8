"""The command line as a user would call it, in this process, and what changes in its words by itself."""

from __future__ import annotations

import contextlib
import io
import re
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

UNTOLD_KEYS = frozenset({"seconds", "created", "software"})
"""Keys of JSON that hold wall-clock times, dates and versions."""
UNTOLD_WORDS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?"), "<date>"),
    (re.compile(r"\d{4}-\d\d-\d\d( \d\d:\d\d(:\d\d)?)?"), "<date>"),
    (re.compile(r"\b[0-9a-f]{64}\b"), "<sha256>"),
    (re.compile(r"took [\d.,]+ (ms|s|min)\b"), "took <time>"),
    (re.compile(r"^[\d.,]+ (ms|s|min)$", re.MULTILINE), "<time>"),
    (re.compile(r"\b[Ff]inger[Ll]ab \d+\.\d+[\w.]*"), "FingerLab <version>"),
    (re.compile(r"Python \d+\.\d+.*?(?=</p>|What SHA-256|$)", re.DOTALL), "<versions>"),
)
"""The same in sentences, tables and pages."""


@dataclass(frozen=True)
class Done:
    """What a command gave: its exit code, and what it printed on standard output and standard error."""

    code: int
    printed: str
    errors: str


def call(*arguments: str | Path) -> Done:
    """``fingerlab`` with these words. A crash is a result, too: code 1, and the exception as its errors."""
    from fingerlab.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(word) for word in arguments])
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
        except Exception as error:
            code = 1
            err.write("".join(traceback.format_exception_only(error)))
    return Done(code, out.getvalue(), err.getvalue())


def words(text: str, folders: list[Path]) -> str:
    """A text without dates, times, versions, hashes of files, and places below ``folders``."""
    for folder in folders:
        for spelled in (str(folder), folder.as_posix(), str(folder).replace("\\", "\\\\")):
            text = text.replace(spelled, "<folder>")
    for pattern, instead in UNTOLD_WORDS:
        text = pattern.sub(instead, text)
    return text


def lasting(thing: Any, folders: list[Path]) -> Any:
    """JSON without what changes from call to call."""
    if isinstance(thing, dict):
        return {k: lasting(v, folders) for k, v in thing.items() if k not in UNTOLD_KEYS}
    if isinstance(thing, list):
        return [lasting(v, folders) for v in thing]
    return words(thing, folders) if isinstance(thing, str) else thing
