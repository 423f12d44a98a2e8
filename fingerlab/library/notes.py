"""What is known of a session besides its file: tags and notes, verdicts of batches; and the search in it all.

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
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text, whole_file
from fingerlab.core.plain_data import parsed
from fingerlab.library.index import SessionFacts, text_list

if TYPE_CHECKING:
    from fingerlab.batch.table import Row

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
        if not self.path.exists():
            self._data = {}
            return
        try:
            data = parsed(read_text(self.path, "the file of notes back"))
        except (UserError, ValueError):
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
        with whole_file(self.path, "notes need write access to the folder.") as part:
            part.write_text(json.dumps(self._data, ensure_ascii=False, indent=1), encoding="utf-8")

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


@dataclass(frozen=True)
class StoredVerdict:
    """A session's diagnosis as a table of ``fingerlab batch`` holds it.

    Attributes:
        verdict: ``missing_effect``, ``nothing_missing`` or ``not_in_catalogue``, as in the table.
        effects: one of which is missing; where nothing is, those that the session could not have shown.
        probability: of the verdict. score: final error over its floor, None where there is none.
        first: probability of the first of the effects, the likeliest; None where the table does not say.
        table: the file it stands in. outdated: whether the session was written after the table.
    """

    verdict: str
    effects: tuple[str, ...]
    probability: float | None
    score: float | None
    table: Path
    outdated: bool
    first: float | None = None
    titles: tuple[str, ...] = ()


def find_verdicts(folder: Path, facts: Sequence[SessionFacts]) -> dict[Path, StoredVerdict]:
    """The newest verdict on each session, from every batch table in the folder itself.

    A table names its sessions relative to the folder it was made of. That folder is looked for where it
    was and, for a tree that has moved as a whole, beside the table.
    """
    by_place = {_place(one.path): one for one in facts if not one.problem}
    tables = sorted(
        (p for p in folder.glob("*.parquet*") if p.suffix == (".parts" if p.is_dir() else ".parquet")),
        key=lambda p: p.stat().st_mtime,
    )
    found: dict[Path, StoredVerdict] = {}
    if not tables:
        return {}
    from fingerlab.batch.table import Parts, read_table  # slow to import, and most folders hold no table

    for table in tables:
        if table.is_dir():  # of a batch that was stopped
            rows, roots = [part.row for part in Parts(table).read()], [folder]
        else:
            try:
                contents = read_table(table)
            except UserError:
                continue  # somebody else's table
            if contents is None:
                continue
            rows, roots = list(contents.rows), [Path(contents.folder), folder]
        written = table.stat().st_mtime
        for row in rows:
            places = (by_place.get(_place(root / str(row["session"]))) for root in roots)
            one = next((place for place in places if place is not None), None)
            verdict = None if one is None else verdict_of(row, table, one.modified > written)
            if one is not None and verdict is not None:
                found[one.path] = verdict
    return found


def _place(path: Path) -> str:
    return str(path.resolve())


def verdict_of(row: Row, table: Path, outdated: bool = False) -> StoredVerdict | None:
    """What a row of a batch's table says; None where the session could not be diagnosed."""
    if not row.get("verdict"):
        return None  # it could not be diagnosed; the table says why
    return StoredVerdict(
        str(row["verdict"]),
        tuple(str(effect) for effect in row.get("set") or ()),
        row.get("probability"),
        row.get("final_score"),
        table,
        outdated,
        _likeliest(row),
        tuple(str(title) for title in row.get("set_titles") or ()),
    )


def _likeliest(row: Row) -> float | None:
    """Probability of the first effect of the row's set; None where it is not the one that is told of."""
    effects, chance = row.get("set") or (), row.get("first_probability")
    return chance if effects and effects[0] == row.get("first_effect") else None


HELP = (
    "Words must all occur in name, title, operator, phase, rig, tags, notes, flags or verdict. A minus in "
    "front excludes. Keys: phase:contact, cable:flexion, tag:good, flag:late, verdict:coulomb, "
    "operator:name, after:2026-05-01, before:2026-06, longer:60 and shorter:60 (seconds), is:clean, is:bad."
)


@dataclass(frozen=True)
class LibraryEntry:
    """A session with what is known of it besides its file: tags, notes and verdict in words."""

    facts: SessionFacts
    tags: tuple[str, ...] = ()
    notes: str = ""
    verdict: str = ""


Test = Callable[[LibraryEntry], bool]


def matches(query: str) -> Test:
    """The test that a query stands for; an empty one takes every session.

    Raises:
        UserError: a key or its value is not understood.
    """
    tests = [_negated(word) for word in _words(query)]
    return lambda entry: all(test(entry) for test in tests)


def _words(query: str) -> list[str]:
    try:
        return shlex.split(query.casefold().replace("\\", "\\\\"), posix=True)
    except ValueError:
        return query.casefold().replace('"', " ").split()  # a quotation that is still being typed


def _negated(word: str) -> Test:
    if word.startswith("-") and len(word) > 1:
        test = _test(word[1:])
        return lambda entry: not test(entry)
    return _test(word)


def _test(word: str) -> Test:
    key, colon, value = word.partition(":")
    if not colon or key not in (*_TEXTS, *_MEASURES, "is"):
        return lambda entry: any(word in text for text in _all_texts(entry))
    if key in _TEXTS:
        texts = _TEXTS[key]
        return lambda entry: any(value in text.casefold() for text in texts(entry))
    if key == "is":
        if value not in ("clean", "bad"):
            raise UserError(f"is:{value} is not understood; write is:clean or is:bad.")
        return lambda entry: bool(entry.facts.flags or entry.facts.problem) == (value == "bad")
    return _measure(key, value)


def _measure(key: str, value: str) -> Test:
    if key in ("longer", "shorter"):
        try:
            limit = float(value)
        except ValueError:
            raise UserError(f"{key}:{value} is not understood; write seconds, such as {key}:60.") from None
        if key == "longer":
            return lambda entry: entry.facts.seconds > limit
        return lambda entry: entry.facts.seconds < limit
    if not (value and value[0].isdigit()):
        raise UserError(f"{key}:{value} is not understood; write a date, such as {key}:2026-05-01.")
    # ISO 8601 text sorts as time does, and a part of a date stands for its beginning.
    if key == "after":
        return lambda entry: entry.facts.created[: len(value)].casefold() >= value
    return lambda entry: bool(entry.facts.created) and entry.facts.created[: len(value)].casefold() < value


def _all_texts(entry: LibraryEntry) -> Iterable[str]:
    facts = entry.facts
    texts = (facts.name, facts.title, facts.operator, facts.rig, facts.created, facts.problem, facts.notes)
    more = (entry.notes, entry.verdict, *facts.phases, *facts.cables, *facts.tags, *entry.tags, *facts.flags)
    return (text.casefold().replace("_", " ") for text in (*texts, *more))


_TEXTS: Mapping[str, Callable[[LibraryEntry], Iterable[str]]] = {
    "phase": lambda entry: (text for p in entry.facts.phases for text in (p, p.replace("_", " "))),
    "cable": lambda entry: entry.facts.cables,
    "tag": lambda entry: (*entry.facts.tags, *entry.tags),
    "flag": lambda entry: entry.facts.flags,
    "verdict": lambda entry: (entry.verdict,),
    "operator": lambda entry: (entry.facts.operator,),
    "name": lambda entry: (entry.facts.name,),
}
_MEASURES = ("after", "before", "longer", "shorter")
