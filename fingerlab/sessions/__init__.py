"""Session files: read, write, check, copy, import, export. Format: ``session-format.md``, version 1."""

from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.reading import open_session

__all__ = ["Run", "Session", "open_session"]
