"""The report page, written by the instrument. No Qt."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fingerlab.core.files import put_in_place
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.sessions.model import Session

from .tasks import IsCancelled, Progress


def write_page(
    sessions: Sequence[Session],
    path: Path,
    diagnosis: Diagnosis,
    progress: Progress,
    cancelled: IsCancelled,
) -> Path:
    """Write the report of what the window shows; returns the path.

    A page that is there already is replaced: the save dialog has asked. It is replaced only when the new
    one is whole.

    Raises:
        UserError: the place cannot be written to.
        Cancelled: the user stopped it; what was there stays.
    """
    progress(0.0, "preparing")
    from fingerlab.report.page import write_report

    if not path.exists():
        return write_report(sessions, path, diagnosis.model, diagnosis, progress, cancelled)
    fresh = path.with_name(f"{path.stem}.new{path.suffix}")
    fresh.unlink(missing_ok=True)
    write_report(sessions, fresh, diagnosis.model, diagnosis, progress, cancelled)
    put_in_place(fresh, path, "close it elsewhere or choose another name.", "replaced")
    return path
