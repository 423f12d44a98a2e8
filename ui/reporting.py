"""The report page, written by the instrument. No Qt."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fingerlab.sessions.model import Session

from .tasks import IsCancelled, Progress


def write_page(
    sessions: Sequence[Session], path: Path, added: Sequence[str], progress: Progress, cancelled: IsCancelled
) -> Path:
    """Write the report of ``sessions`` with the effects ``added`` in the model; returns the path."""
    from fingerlab.report.page import write_report

    write_report(sessions, path, added=added, progress=progress, cancelled=cancelled)
    return path
