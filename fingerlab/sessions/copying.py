"""Copying a session whole: groups, datasets and attributes that this version does not know included."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py

from fingerlab.core.files import claim, move_into_place
from fingerlab.sessions.hdf5 import TargetFile, write_attributes, writing_to
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
    part = claim(target)
    try:
        with writing_to(target):
            shutil.copyfile(source, part)
        if attributes:
            _set_attributes(target, part, attributes)
        # An attribute such as a broken rig text must not turn a good session into a bad one.
        open_session(part)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    move_into_place(part, target)
    return target


def _set_attributes(target: Path, part: Path, attributes: Mapping[str, Any]) -> None:
    with writing_to(target):
        file = TargetFile(part)
    with writing_to(target, file):
        try:
            with h5py.File(file, "r+") as session:
                write_attributes(session, attributes)
        finally:
            file.close()
