"""Session files: read, write, check, copy, import, export. Format: ``session-format.md``, version 1."""

from fingerlab.sessions.check import CheckReport, Finding, check_session
from fingerlab.sessions.copying import copy_session
from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.reading import content_hash, file_hash, open_session
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
]
