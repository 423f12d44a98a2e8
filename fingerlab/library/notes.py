"""Tags and notes on sessions: kept in a side file of the library folder, never in the recordings.

A recording is evidence and stays as it was written: its hash is in models and tables. So what somebody
thinks of it afterwards stands in ``fingerlab-library.json`` at the top of the folder that is browsed, by
the session's path relative to it::

    {"format": "fingerlab-library", "version": 1,
     "sessions": {"may/finger.h5": {"created": "2026-05-04T10:00:00+02:00", "seconds": 312.0,
                                     "tags": ["good"], "notes": "cable changed after run 3"}}}

``created`` and ``seconds`` find a session again that was renamed or moved inside the folder. Tags and notes
that are to travel with the data go into a copy of the file (``fingerlab.sessions.copy_session``).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.library.facts import SessionFacts, text_list
from fingerlab.sessions.place import whole_file

FILE_NAME = "fingerlab-library.json"
FORMAT = "fingerlab-library"
VERSION = 1


@dataclass(frozen=True)
class Note:
    """What somebody noted of a session."""

    tags: tuple[str, ...] = ()
    notes: str = ""


class Notebook:
    """The notes of one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / FILE_NAME
        self._data: dict[str, Any] = {}

    def read(self) -> None:
        """Read the side file anew; without one there are no notes.

        Raises:
            UserError: the file is something else, or of a newer version.
        """
        try:
            data = json.loads(self.path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            self._data = {}
            return
        except (OSError, ValueError):
            data = None
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise UserError(
                f"{self.path} is not a file of notes of FingerLab and is not touched; move it elsewhere."
            )
        if not isinstance(data.get("version"), int) or data["version"] > VERSION:
            raise UserError(f"{self.path} is of a newer version; update FingerLab to read it.")
        if not isinstance(data.get("sessions"), dict):
            raise UserError(f"{self.path} is damaged (it has no 'sessions'); restore it from a copy.")
        self._data = data

    def note_of(self, facts: SessionFacts, present: Iterable[str] = ()) -> Note:
        """What was noted of a session.

        Args:
            present: names of all sessions that are in the folder now; an entry whose file is gone is taken
                for this one where ``created`` and ``seconds`` agree.
        """
        key = self._key(facts, present)
        entry = self._sessions().get(key) if key is not None else None
        if not isinstance(entry, Mapping):
            return Note()
        return Note(text_list(entry.get("tags")), str(entry.get("notes", "")))

    def write(self, facts: SessionFacts, note: Note, present: Iterable[str] = ()) -> None:
        """Keep what was noted of a session; an empty note takes the entry away.

        The file is read again first, so that two windows do not undo one another's notes.

        Raises:
            UserError: the file is not ours, or the folder cannot be written to.
        """
        self.read()
        sessions = dict(self._sessions())
        moved = self._key(facts, present)
        if moved is not None and moved != facts.name:
            sessions[facts.name] = sessions.pop(moved)
        if note == Note():
            sessions.pop(facts.name, None)
        else:
            old = sessions.get(facts.name)
            kept = dict(old) if isinstance(old, Mapping) else {}
            sessions[facts.name] = kept | {
                "created": facts.created,
                "seconds": facts.seconds,
                "tags": list(note.tags),
                "notes": note.notes,
            }
        self._data = self._data | {"format": FORMAT, "version": VERSION, "sessions": sessions}
        self._save()

    def _sessions(self) -> Mapping[str, Any]:
        found: Mapping[str, Any] = self._data.get("sessions", {})
        return found

    def _key(self, facts: SessionFacts, present: Iterable[str]) -> str | None:
        sessions = self._sessions()
        if facts.name in sessions:
            return facts.name
        there = set(present)
        wanted = (facts.created, facts.seconds)
        orphans = [
            name
            for name, entry in sessions.items()
            if there
            and name not in there
            and isinstance(entry, Mapping)
            and (entry.get("created"), entry.get("seconds")) == wanted
        ]
        return orphans[0] if len(orphans) == 1 else None

    def _save(self) -> None:
        with whole_file(self.path, "notes need write access to the folder.") as part:
            part.write_text(json.dumps(self._data, ensure_ascii=False, indent=1), encoding="utf-8")
