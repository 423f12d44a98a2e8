"""Undo in the Sessions tab: tags and notes as they were before, and new files to the trash and back."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import QFile, QStandardPaths

from fingerlab.core.errors import UserError
from fingerlab.library.index import SessionFacts
from fingerlab.library.notes import Note

from ..app.undo import UndoSteps


class Gone(UserError):
    """What was done can never be taken back any more, or never be done again."""


class Edit(Protocol):
    """Something that was done and can be taken back; ``words`` name it in the status line."""

    @property
    def words(self) -> str: ...

    def undo(self) -> None: ...

    def redo(self) -> None: ...


@dataclass(frozen=True)
class NoteEdit:
    """Other tags and notes of a session. ``write`` puts a note down and shows it."""

    facts: SessionFacts
    before: Note
    after: Note
    write: Callable[[SessionFacts, Note], None]

    @property
    def words(self) -> str:
        return f"tags and notes of {self.facts.name}"

    def undo(self) -> None:
        self.write(self.facts, self.before)

    def redo(self) -> None:
        self.write(self.facts, self.after)


class FileEdit:
    """A new session file. To undo it is to move it to the desktop's trash, from where it comes back.

    Args:
        in_use: whether a file is open in the window now.
    """

    def __init__(self, path: Path, in_use: Callable[[Path], bool]) -> None:
        self.path = path
        self._in_use = in_use
        self._stamp = _stamp(path)
        self._in_trash: Path | None = None

    @property
    def words(self) -> str:
        return f"new file {self.path.name}"

    def undo(self) -> None:
        if self._in_use(self.path):
            raise UserError(f"{self.path} is open; close it before its making is undone.")
        if _stamp(self.path) != self._stamp:
            raise Gone(f"{self.path} was changed or moved since it was written; nothing was undone.")
        _make_room_for_trash()
        file = QFile(str(self.path))
        if not file.moveToTrash():
            # Gone: a disk without a trash has none later either, and would bar the way to older steps.
            raise Gone(
                f"{self.path} stays, for there is no trash that it can be moved to (a network folder or a "
                "memory card may have none); delete it in the file manager if it is not wanted."
            )
        self._in_trash = Path(file.fileName()) if file.fileName() else None

    def redo(self) -> None:
        kept = self._in_trash
        if kept is None or not kept.is_file():
            raise Gone(f"{self.path.name} is not in the trash any more; make it again.")
        if self.path.exists():
            raise UserError(f"{self.path} is there already; nothing was brought back over it.")
        try:
            shutil.move(kept, self.path)
        except OSError as error:
            raise UserError(
                f"{self.path} cannot be brought back from the trash ({error.strerror})."
            ) from None
        # On Linux the trash keeps a line beside each file on where it came from.
        (kept.parent.parent / "info" / f"{kept.name}.trashinfo").unlink(missing_ok=True)
        self._stamp = _stamp(self.path)


class EditHistory(UndoSteps[Edit]):
    """Steps are edits, which undo and redo themselves."""

    def undo(self) -> str:
        """Take the last thing back; returns its words.

        Raises:
            UserError: why it cannot be taken back now; it may be tried again, unless it is :class:`Gone`.
        """
        return self._step(self._done, self._undone, lambda edit: edit.undo())

    def redo(self) -> str:
        """The opposite of :meth:`undo`, with the same errors."""
        return self._step(self._undone, self._done, lambda edit: edit.redo())

    def _step(self, source: list[Edit], target: list[Edit], do: Callable[[Edit], None]) -> str:
        edit = source[-1]
        try:
            do(edit)
            target.append(edit)
        except Gone:
            source.remove(edit)
            raise
        else:
            source.remove(edit)
        finally:
            self.changed.emit()
        return edit.words


def _make_room_for_trash() -> None:
    """The folder in which Linux keeps the trash; where it is missing, as for a new user, Qt makes none."""
    place = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.GenericDataLocation)
    with suppress(OSError):
        Path(place).mkdir(parents=True, exist_ok=True)


def _stamp(path: Path) -> tuple[int, int] | None:
    """Size and time of a file; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_size, found.st_mtime_ns
