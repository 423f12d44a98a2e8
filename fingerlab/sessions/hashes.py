"""Hashes of files, by which recordings are told apart: what was recorded once is evidence once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Session


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
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}); put it back.") from None
    return digest.hexdigest()


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
