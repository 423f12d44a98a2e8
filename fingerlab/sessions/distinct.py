"""Sessions that are given together have to differ: what was recorded once is evidence once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Session
from fingerlab.sessions.reading import content_hash


def refuse_twice(sessions: Sequence[Session]) -> None:
    """Refuse files that are one, by name or by what they hold; files that differ in size are not read.

    Raises:
        UserError: so it is, or a file can no longer be read.
    """
    if len(sessions) < 2:
        return
    sizes = [_size(session.path) for session in sessions]
    known: dict[str, Path] = {}
    for session, size in zip(sessions, sizes, strict=True):
        if sizes.count(size) == 1:
            continue
        content = content_hash(session)
        before = known.get(content)
        if before is None:
            known[content] = session.path
            continue
        if before.resolve() == session.path.resolve():
            raise UserError(f"{session.path} is given twice; give each session once.")
        raise UserError(f"{before} and {session.path} hold the same recording; give one of them.")


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}); put it back.") from None
