"""Every session file below a folder, one after the other, without reading what has not changed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.library.facts import UNWRITTEN, SessionFacts, read_facts
from fingerlab.sessions.recording_place import SUFFIX, cut_recordings

ENDINGS = (".h5", ".hdf5")


def list_files(folder: Path) -> list[tuple[Path, str]]:
    """Session files below the folder with their relative names, by name; hidden folders are left out.

    Recordings that were cut and not yet made whole are named by the session that they will become.

    Raises:
        UserError: there is no such folder.
    """
    if not folder.is_dir():
        raise UserError(f"{folder} is not a folder; choose the folder that holds the sessions.")
    found: list[Path] = []
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(
            name for name in folders if not name.startswith(".") and not name.endswith(SUFFIX)
        )
        found += [Path(place) / name for name in names if Path(name).suffix.lower() in ENDINGS]
        found += cut_recordings(Path(place))
    return sorted(((path, path.relative_to(folder).as_posix()) for path in found), key=lambda item: item[1])


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
    files = list_files(folder)
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
    if not path.exists():
        return SessionFacts(
            path, name, 0, 0.0, problem=f"The recording is {UNWRITTEN}; opening it makes it whole."
        )
    if earlier is not None and earlier.name == name and not earlier.problem:
        stat = path.stat()
        if (earlier.size, earlier.modified) == (stat.st_size, stat.st_mtime):
            return earlier
    return read_facts(path, name)
