"""Session files: read, write, check, copy, import, export. Format: ``docs/file-format.md``, version 1.

What is here is imported at its first use: the model of a session is needed everywhere, HDF5 only with a file.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fingerlab.sessions.disk_files import content_hash, file_hash, refuse_twice
    from fingerlab.sessions.exporting import copy_session
    from fingerlab.sessions.model import Run, Session
    from fingerlab.sessions.reading import CheckReport, Finding, check_session, open_session
    from fingerlab.sessions.writing import SessionWriter

__all__ = [
    "CheckReport",
    "Finding",
    "Run",
    "Session",
    "SessionWriter",
    "check_session",
    "content_hash",
    "copy_session",
    "file_hash",
    "open_session",
    "refuse_twice",
]

_HOMES = {
    "CheckReport": "reading",
    "Finding": "reading",
    "Run": "model",
    "Session": "model",
    "SessionWriter": "writing",
    "check_session": "reading",
    "content_hash": "disk_files",
    "copy_session": "exporting",
    "file_hash": "disk_files",
    "open_session": "reading",
    "refuse_twice": "disk_files",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
