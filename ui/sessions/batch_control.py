"""Diagnosing all of a folder in the background: rows as they come, and a stop that is heard at once."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from ..app.bars import time_left
from ..app.worker import Failed, IsCancelled, Progress, Worker

if TYPE_CHECKING:
    from fingerlab.batch.run import BatchResult

Row = dict[str, Any]
BatchCall = Callable[[Path, Callable[[Row], None], int, Progress, IsCancelled], "tuple[BatchResult, Path]"]


def diagnose_all(
    folder: Path, found: Callable[[Row], None], processes: int, progress: Progress, cancelled: IsCancelled
) -> tuple[BatchResult, Path]:
    """What ``fingerlab batch`` does, with a table beside the sessions; in the background.

    Raises:
        UserError: there is no session, or the table cannot be written. Cancelled: it was stopped.
    """
    from fingerlab.batch.run import locally, run_batch, table_beside
    from fingerlab.batch.table import Options
    from fingerlab.effects import CATALOGUE, own

    table = table_beside(folder)
    options = Options((), own.trusted_sources(CATALOGUE))
    runner = locally(processes, cancelled)
    return run_batch(folder, table, options, runner, False, progress, cancelled, found), table


class BatchControl(QObject):
    """One batch at a time.

    Signals:
        found(row): one more session was diagnosed, or could not be.
        told(words): how far it is; empty when it is over.
        ended(BatchResult, Path): all were done; the table holds them. stopped(): it was stopped.
        failed(Failed).
    """

    found = Signal(object)
    told = Signal(str)
    ended = Signal(object, object)
    stopped = Signal()
    failed = Signal(object)

    def __init__(self, parent: QObject | None = None, call: BatchCall = diagnose_all) -> None:
        super().__init__(parent)
        self.call = call
        self.folder = Path()
        self.clock: Callable[[], float] = time.monotonic
        self._worker = Worker(self)
        self._began = 0.0
        self._worker.progressed.connect(self._on_progress)
        self._worker.failed.connect(self._on_failed)
        self._worker.ended.connect(self._on_ended)

    @property
    def busy(self) -> bool:
        """Whether a folder is being diagnosed."""
        return self._worker.busy

    def start(self, folder: Path, beside_rig: bool) -> None:
        """Diagnose all that no table of this folder holds yet.

        Args:
            beside_rig: a rig is connected; then one diagnosis at a time, and every one gives way to its loop.
        """
        self.folder, self._began = folder, self.clock()
        processes = 1 if beside_rig else max((os.cpu_count() or 1) - 1, 1)

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[BatchResult, Path]:
            return self.call(folder, self.found.emit, processes, progress, cancelled)

        self._worker.start("Diagnosing", work, lambda done: self.ended.emit(*done))
        self.told.emit("Diagnosing …")

    def stop(self) -> None:
        """End it; what is done is kept, and the next one goes on there."""
        self._worker.cancel()

    def shut_down(self) -> None:
        self._worker.shut_down()

    def _on_progress(self, share: float, what: str) -> None:
        left = time_left(share, self.clock() - self._began)
        self.told.emit(f"Diagnosing: {what}{f', {left}' if left else ''}")

    def _on_failed(self, failed: Failed) -> None:
        self.failed.emit(failed)

    def _on_ended(self, how: str) -> None:
        self.told.emit("")
        if how == "stopped":
            self.stopped.emit()
