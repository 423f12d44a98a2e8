"""Every session file below a folder, and what a browser tells of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.files import seen_as
from fingerlab.core.plain_data import parsed
from fingerlab.sessions.disk_files import was_cut
from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.reading import open_session
from fingerlab.sessions.recording_files import recording_folder, session_files

UNWRITTEN = "not yet written"
"""Of a recording whose runs still stand in its folder, because it was cut or because that was put off."""


@dataclass(frozen=True)
class SessionFacts:
    """One row of the browser.

    Attributes:
        path: the file. name: its path relative to the folder that was searched, with forward slashes.
        size: bytes. modified: the file's own time, s since 1970.
        title, operator, notes: as stored. created: as stored, ISO 8601. when: the same as a time, or None.
        phases, cables: those of its runs, each once, in the order taken.
        runs: how many. seconds: recorded, all runs together.
        rig: the device that the file names, or what stands on the bench.
        tags: those written in the file.
        flags: what is wrong with the recording, in words; empty for a clean one.
        problem: why the file cannot be read as a session; empty where it can.
    """

    path: Path
    name: str
    size: int
    modified: float
    title: str = ""
    created: str = ""
    when: datetime | None = None
    operator: str = ""
    notes: str = ""
    phases: tuple[str, ...] = ()
    cables: tuple[str, ...] = ()
    runs: int = 0
    seconds: float = 0.0
    rig: str = ""
    tags: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    problem: str = ""


def read_facts(path: Path, name: str) -> SessionFacts:
    """Facts of a file; one that is no good session has a ``problem`` in place of an exception.

    A recording that was cut is only named so: making it whole is left to whoever opens it.
    """
    try:
        stat = path.stat()
        bare = SessionFacts(path, name, stat.st_size, stat.st_mtime)
    except OSError as error:
        return SessionFacts(path, name, 0, 0.0, problem=f"{path} cannot be read ({error.strerror}).")
    if was_cut(path):
        return replace(bare, problem="The recording was cut off; opening it makes it whole.")
    try:
        session = open_session(path)
    except UserError as error:
        return replace(bare, problem=str(error))
    return facts_of(session, bare)


def facts_of(session: Session, bare: SessionFacts) -> SessionFacts:
    """Facts of a session that is open; ``bare`` brings path, name, size and time."""
    attributes = session.attributes
    tags = text_list(attributes.get("tags"))
    return replace(
        bare,
        title=session.title,
        created=session.created,
        when=time_of(session.created),
        operator=_text(attributes.get("operator")),
        notes=_text(attributes.get("notes")),
        phases=tuple(dict.fromkeys(run.phase for run in session.runs)),
        cables=tuple(dict.fromkeys(run.cable for run in session.runs)),
        runs=len(session.runs),
        seconds=sum(run.seconds for run in session.runs),
        rig=_rig_words(session, tags),
        tags=tags,
        flags=quality_flags(session),
    )


def quality_flags(session: Session) -> tuple[str, ...]:
    """What the file itself says against the recording, in words, the gravest first.

    Only what stands in attributes: gaps in time and samples that break the format are found by
    ``fingerlab.sessions.check_session``, which reads every sample.
    """
    runs, found = session.runs, []
    if str(session.attributes.get("ended", "clean")) == "truncated":
        found.append("cut off")
    broken = sum(not run.complete for run in runs)
    if broken:
        found.append(f"{broken} of {len(runs)} runs not complete")
    for key, words in (("dropped_samples", "dropped samples"), ("late_cycles", "late cycles")):
        count = sum(int(run.counted(key)) for run in runs)
        if count:
            found.append(f"{count} {words}")
    blind = sum(run.phase == "contact" and not run.has("endpoint_force") for run in runs)
    if blind:
        found.append(f"{blind} contact runs without force")
    return tuple(found)


def time_of(text: object) -> datetime | None:
    """A time with its own offset from ISO 8601 text; None where it is none."""
    try:
        return datetime.fromisoformat(str(text))
    except ValueError:
        return None


def started_at(session: Session, run: Run) -> datetime | None:
    """When a run began, by the clock of whoever recorded it.

    The first run of a file that does not say so began when the file was created; of later ones nothing is
    known then.
    """
    when = time_of(run.attributes.get("started", ""))
    if when is None and run is session.runs[0]:
        when = time_of(session.created)
    return when


def text_list(value: object) -> tuple[str, ...]:
    """Tags as a file stores them: JSON text of a list, or words separated by commas."""
    if value is None:
        return ()
    if not isinstance(value, (list, tuple)):
        try:
            value = parsed(str(value))
        except ValueError:
            value = str(value).split(",")
    items = value if isinstance(value, (list, tuple)) else [value]
    return tuple(dict.fromkeys(text for item in items if (text := str(item).strip())))


def _rig_words(session: Session, tags: tuple[str, ...]) -> str:
    device = _text(session.attributes.get("device"))
    if device:
        return device
    bench = "motor only" if session.rig.finger is None else "finger"
    return f"{bench}, simulated" if "simulated" in tags else bench


def _text(value: object) -> str:
    return "" if value is None else str(value).strip()


def scan(
    folder: Path,
    known: Iterable[SessionFacts] = (),
    found: Callable[[SessionFacts, float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> tuple[SessionFacts, ...]:
    """Facts of every session file below the folder.

    Args:
        known: facts of an earlier scan; a file of the same name, size and time is not opened again.
        found: called with each file's facts and the share done (0 to 1).
        cancelled: asked before each file.

    Raises:
        UserError: there is no such folder.
        Cancelled: ``cancelled`` answered True.
    """
    before: Mapping[Path, SessionFacts] = {one.path: one for one in known}
    files = session_files(folder, unfinished=True)
    result = []
    for number, (path, name) in enumerate(files, start=1):
        if cancelled is not None and cancelled():
            raise Cancelled
        facts = _fresh(path, name, before.get(path))
        result.append(facts)
        if found is not None:
            found(facts, number / len(files))
    return tuple(result)


def _fresh(path: Path, name: str, earlier: SessionFacts | None) -> SessionFacts:
    if not seen_as(path) and seen_as(recording_folder(path)) == "folder":
        return SessionFacts(
            path, name, 0, 0.0, problem=f"The recording is {UNWRITTEN}; opening it makes it whole."
        )
    if seen_as(path) and earlier is not None and earlier.name == name and not earlier.problem:
        stat = path.stat()
        if (earlier.size, earlier.modified) == (stat.st_size, stat.st_mtime):
            return earlier
    return read_facts(path, name)
