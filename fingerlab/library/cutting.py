"""New sessions from parts of old ones: a stretch of a run cut out, several sessions merged.

The old files stay as they are, and nothing is overwritten. What a new run was taken from stands in its
attribute ``taken_from`` (file name, SHA-256, run, and for a stretch its times), so that a result can be
followed back to the recording. Groups of a file that the session format does not know do not come along.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.library.index import started_at, text_list, time_of
from fingerlab.library.reviewing import PIECE, markers_of
from fingerlab.sessions.hashes import content_hash
from fingerlab.sessions.model import OWN_ROOT_ATTRIBUTES, Run, Session, as_stored
from fingerlab.sessions.writing import SessionWriter

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
    _check_same_rig(sessions)
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


def _check_same_rig(sessions: Sequence[Session]) -> None:
    differing = rig_differences(sessions)
    if differing:
        raise UserError(
            f"These sessions are of different benches ({', '.join(differing[:4])}); one session is all runs "
            "taken on one bench set-up."
        )


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
