"""Calls that wait for the bench, off the GUI thread and one after the other."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

from PySide6.QtCore import QObject, QThread, Signal

from fingerlab.core.errors import UserError

from ..app.worker import Failed

Done = Callable[[Any], None]


def _nothing(_result: Any) -> None:
    pass


@dataclass(frozen=True)
class Call:
    """Something to do, and what to call in the GUI thread with its result, or when it failed."""

    title: str
    work: Callable[[], Any]
    done: Done = _nothing
    failed: Callable[[Failed], None] | None = None


class _Worker(QThread):
    finished_call = Signal(object, object, object)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.calls: SimpleQueue[Call | None] = SimpleQueue()

    def run(self) -> None:
        while (call := self.calls.get()) is not None:
            self.finished_call.emit(call, *attempt(call))


def attempt(call: Call) -> tuple[Any, Failed | None]:
    """Do it: its result, or why it failed."""
    try:
        return call.work(), None
    except UserError as error:
        return None, Failed(str(error), traceback.format_exc())
    except Exception as error:
        sentence = f"{call.title} failed by a mistake of FingerLab itself ({type(error).__name__}: {error})."
        return None, Failed(" ".join(sentence.split()), traceback.format_exc())


class Caller(QObject):
    """Signals: busy_changed; failed(Failed) for a call that does not take its failure itself."""

    busy_changed = Signal()
    failed = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._worker: _Worker | None = None
        self._pending = 0
        self.title = ""
        """What is being done, empty when nothing is."""

    @property
    def busy(self) -> bool:
        return self._pending > 0

    def call(self, call: Call) -> None:
        """Do it after what was asked before."""
        if self._worker is None:
            self._worker = _Worker(self)
            self._worker.finished_call.connect(self._on_finished)
            self._worker.start()
        self._pending += 1
        self.title = call.title
        self.busy_changed.emit()
        self._worker.calls.put(call)

    def shut_down(self) -> None:
        """Wait for what runs; nothing is reported any more."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.finished_call.disconnect(self._on_finished)
            worker.calls.put(None)
            worker.wait()
            worker.deleteLater()
        self._pending = 0

    def _on_finished(self, call: Call, result: Any, failed: Failed | None) -> None:
        self._pending -= 1
        if not self._pending:
            self.title = ""
        if failed is None:
            call.done(result)
        elif call.failed is not None:
            call.failed(failed)
        else:
            self.failed.emit(failed)
        self.busy_changed.emit()
