"""The commands of a page in order: which are run, and which are not and why."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass

from markdown_it import MarkdownIt
from markdown_it.token import Token

MARK = re.compile(r"<!-- not run: (.+?) -->")
STARTER = "python start.py"
OURS = re.compile(rf"^(?:fingerlab|{re.escape(STARTER)})(?= |$)")
PROGRAMS = ("fingerlab", "python", "mkdocs", "pip", "uv")
"""What a command in the middle of a sentence begins with; alone, such a word is a name."""
INSTALLS = "it installs what the tests run with"


@dataclass(frozen=True)
class Console:
    """A command of a page. ``reason`` is why it is not run; empty where it is."""

    line: str
    reason: str

    @property
    def words(self) -> list[str]:
        """The words behind the program's name."""
        return shlex.split(self.line)


def tokens(text: str) -> list[Token]:
    """The page as a Markdown parser reads it: code in a list, a quotation or a fence is code, too."""
    return MarkdownIt("commonmark").enable("table").parse(text)


def shell_lines(text: str) -> Iterator[Console]:
    """Every line of code in no named language, whole, without its comment, with the mark above its block."""
    reason = ""
    for token in tokens(text):
        mark = MARK.search(token.content) if token.type == "html_block" else None
        if mark:
            reason = mark[1]
        elif token.type in ("code_block", "fence"):
            if not token.info.strip() or token.info.strip() in ("console", "bash", "sh", "shell"):
                for line in token.content.splitlines():
                    command = re.sub(r"(^|\s)#.*$", "", line).strip()
                    if command:
                        yield Console(command, reason)
            reason = ""


def console_lines(text: str) -> Iterator[Console]:
    """Those that call FingerLab, without its name."""
    for one in shell_lines(text):
        command = OURS.sub("", one.line).strip()
        if OURS.match(one.line) and command:
            starts = one.line.startswith(STARTER)
            yield Console(command, one.reason or (INSTALLS if starts else ""))


def mentions(text: str) -> Iterator[str]:
    """Commands in the middle of a sentence, whole; they may leave out what they need."""
    for token in tokens(text):
        for code in token.children or ():
            words = code.content.split()
            if code.type == "code_inline" and len(words) > 1 and words[0] in PROGRAMS:
                yield " ".join(words)
