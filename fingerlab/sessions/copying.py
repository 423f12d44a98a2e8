"""Copying a session whole: groups, datasets and attributes that this version does not know included."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from fingerlab.core.files import new_file
from fingerlab.sessions.disk_files import TargetFile
from fingerlab.sessions.hdf5 import write_attributes, writing_to
from fingerlab.sessions.reading import open_session


def copy_session(source: str | Path, target: str | Path, attributes: Mapping[str, Any] | None = None) -> Path:
    """Copy a session file as it is, after checking its structure.

    Args:
        attributes: root attributes to set in the copy, such as ``title`` and ``tags``; the rest stays.

    Returns:
        The path of the copy.

    Raises:
        UserError: the source is no session, or the target exists, cannot be written to or is full.
    """
    source, target = Path(source), Path(target)
    open_session(source)
    if attributes:
        with edited_copy(source, target) as copy:
            write_attributes(copy, attributes)
    else:
        with new_file(target) as part, writing_to(target):
            shutil.copyfile(source, part)
    return target


@contextmanager
def edited_copy(source: Path, target: Path) -> Iterator[h5py.File]:
    """A copy of a session, open to be changed; it gets its name once it has been and is still a session.

    Raises:
        UserError: the target exists, cannot be written to or is full, or what was changed broke the session.
    """
    with new_file(target) as part:
        with writing_to(target):
            shutil.copyfile(source, part)
            file = TargetFile(part)
        with writing_to(target, file):
            try:
                with h5py.File(file, "r+") as session:
                    yield session
            finally:
                file.close()
        # An attribute such as a broken rig text must not turn a good session into a bad one.
        open_session(part)
