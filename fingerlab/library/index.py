"""Every session file below a folder, what a browser tells of it, and new files: a part cut out, some merged.

Where files are cut or merged, the old ones stay as they are, and nothing is overwritten. What a new run was
taken from stands in its attribute ``taken_from`` (file name, SHA-256, run, and for a stretch its times), so
that a result can be followed back to the recording. Groups of a file that the session format does not know
do not come along.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.files import seen_as
from fingerlab.core.plain_data import parsed
from fingerlab.core.progress import Progress
from fingerlab.library.reviewing import PIECE, markers_of
from fingerlab.sessions.disk_files import content_hash, was_cut
from fingerlab.sessions.model import OWN_ROOT_ATTRIBUTES, Run, Session, as_stored
from fingerlab.sessions.reading import open_session
from fingerlab.sessions.recording_files import recording_folder, session_files
from fingerlab.sessions.writing import SessionWriter

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
    if session.rig.line_radius:
        bench = "axis, linear"
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


TAKEN_FROM = "taken_from"


@dataclass(frozen=True)
class RunStretch:
    """Part of a run by its own time, s; both ends None for the whole run."""

    run: Run
    start: float | None = None
    stop: float | None = None


def cut_session(
    session: Session, stretch: RunStretch, target: Path, progress: Progress | None = None
) -> Path:
    """Write a stretch of one run as a session of its own. Its time begins at 0 where the stretch begins.

    Raises:
        UserError: no sample lies in the stretch, or the target exists or cannot be written.
    """
    attributes = {key: value for key, value in session.attributes.items() if key not in OWN_ROOT_ATTRIBUTES}
    title = f"{session.title}, run {stretch.run.name} cut"
    with SessionWriter(
        target, str(session.attributes["rig"]), title, created=session.created, attributes=attributes
    ) as writer:
        _copy(writer, session, content_hash(session), stretch, {}, _scaled(progress, 0.0, 1.0))
    return target


def merge_sessions(
    sessions: Sequence[Session], target: Path, title: str, progress: Progress | None = None
) -> Path:
    """Write the runs of several sessions as one session, in the order in which they were taken.

    Where sessions differ in an attribute (calibration, operator, notes), each run gets that of its own.

    Raises:
        UserError: fewer than two sessions, benches that differ, or the target exists or cannot be written.
    """
    if len(sessions) < 2:
        raise UserError("One session cannot be merged; choose two or more.")
    differing = rig_differences(sessions)
    if differing:
        raise UserError(
            f"These sessions are of different benches ({', '.join(differing[:4])}); one session is all runs "
            "taken on one bench set-up."
        )
    ordered = sorted(sessions, key=_began)
    common, own = _shared_attributes(ordered)
    tags = dict.fromkeys(tag for session in ordered for tag in text_list(session.attributes.get("tags")))
    if tags:
        common["tags"] = list(tags)
    total, done = sum(run.length for session in ordered for run in session.runs), 0
    first = ordered[0]
    with SessionWriter(
        target, str(first.attributes["rig"]), title, created=first.created, attributes=common
    ) as writer:
        for session, inherited in zip(ordered, own, strict=True):
            sha256 = content_hash(session)
            for run in session.runs:
                share = _scaled(progress, done / total, (done + run.length) / total)
                _copy(writer, session, sha256, RunStretch(run), inherited, share)
                done += run.length
    return target


def rig_differences(sessions: Sequence[Session]) -> tuple[str, ...]:
    """Names of the constants in which the benches of the sessions differ, such as ``motor.gear_ratio``."""
    rigs = [_flat(json.loads(str(session.attributes["rig"]))) for session in sessions]
    names = sorted({name for rig in rigs for name in rig})
    return tuple(name for name in names if any(rig.get(name) != rigs[0].get(name) for rig in rigs))


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    if not isinstance(value, Mapping):
        return {name: value}
    found: dict[str, Any] = {}
    for key, item in value.items():
        found |= _flat(item, f"{name}.{key}" if name else str(key))
    return found


def _began(session: Session) -> tuple[bool, float, str]:
    when = time_of(session.created)
    return when is None, 0.0 if when is None else when.timestamp(), session.path.name


def _shared_attributes(sessions: Sequence[Session]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Root attributes that all sessions have alike, and those of each session alone, for its runs."""
    kept = [
        {key: value for key, value in s.attributes.items() if key not in (*OWN_ROOT_ATTRIBUTES, "tags")}
        for s in sessions
    ]
    common = {
        key: value for key, value in kept[0].items() if all(key in one and one[key] == value for one in kept)
    }
    own = [{key: value for key, value in one.items() if key not in common} for one in kept]
    return common, own


def _copy(
    writer: SessionWriter,
    session: Session,
    sha256: str,
    stretch: RunStretch,
    inherited: Mapping[str, Any],
    progress: Callable[[float], None],
) -> None:
    run = stretch.run
    first, last = _samples(run, stretch)
    whole = (first, last) == (0, run.length)
    offset = 0.0 if whole else float(run.channel("time", first, first + 1)[0])
    attributes = {**inherited, **run.attributes}
    origin: dict[str, Any] = {"session": session.path.name, "sha256": sha256, "run": run.name}
    if not whole:
        ends = float(run.channel("time", last - 1, last)[0])
        origin |= {"start_s": offset, "stop_s": ends}
        attributes |= _moved(session, run, offset, ends)
    writing = writer.begin_run(
        run.phase,
        run.cable,
        run.sample_rate_hz,
        run.trajectory,
        {**attributes, TAKEN_FROM: origin},
        units=run.units,
        length=last - first,
    )
    for start in range(first, last, PIECE):
        stop = min(start + PIECE, last)
        piece = run.load(None, start, stop)
        piece["time"] = piece["time"] - offset
        writing.append({name: as_stored(name, values) for name, values in piece.items()})
        progress((stop - first) / (last - first))
    writing.finish()


def _samples(run: Run, stretch: RunStretch) -> tuple[int, int]:
    """First sample of a stretch and the one after its last."""
    if stretch.start is None and stretch.stop is None:
        return 0, run.length
    start = -np.inf if stretch.start is None else stretch.start
    stop = np.inf if stretch.stop is None else stretch.stop
    first = last = 0
    for begin in range(0, run.length, PIECE):
        time = run.channel("time", begin, begin + PIECE)
        first += int(np.searchsorted(time, start, side="left"))
        last += int(np.searchsorted(time, stop, side="right"))
    if last - first < 2:
        raise UserError(
            f"Between {stretch.start} s and {stretch.stop} s run {run.name} has no two samples; put the "
            "cursors further apart."
        )
    return first, last


def _moved(session: Session, run: Run, offset: float, ends: float) -> dict[str, Any]:
    """Attributes that tell of moments, for a run that begins ``offset`` seconds later."""
    inside = [m for m in markers_of(run) if offset <= m.time <= ends]
    markers = [{"time": marker.time - offset, "note": marker.note} for marker in inside]
    began: datetime | None = started_at(session, run)
    started = None if began is None else (began + timedelta(seconds=offset)).isoformat()
    # None leaves an attribute out: without a clock the old one would be wrong.
    return {"started": started, "markers": markers or None}


def _scaled(progress: Progress | None, low: float, high: float) -> Callable[[float], None]:
    def tell(share: float) -> None:
        if progress is not None:
            progress(low + (high - low) * share, "writing")

    return tell
