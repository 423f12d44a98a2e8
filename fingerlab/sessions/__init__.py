"""Session files: read, write, check, copy, import, export. Format: ``session-format.md``, version 1."""

from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.reading import content_hash, open_session
from fingerlab.sessions.writing import SessionWriter

__all__ = ["Run", "Session", "SessionWriter", "content_hash", "open_session"]
