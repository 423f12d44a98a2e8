"""Long work off the GUI thread: one task at a time, with progress and cancel.

The work is a plain function that knows nothing of Qt. It is called with two functions,
``progress(share, what)`` and ``cancelled()``, and stops by raising ``fingerlab.core.errors.Cancelled``.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, QThread, Signal

from fingerlab.core.errors import Cancelled, UserError

Progress = Callable[[float, str], None]
IsCancelled = Callable[[], bool]
Work = Callable[[Progress, IsCancelled], Any]


@dataclass(frozen=True)
class Failed:
    """Why a task failed: a sentence for the user and details to copy."""

    sentence: str
    details: str


@dataclass(frozen=True)
class Request:
    """A task to do, and what to call in the GUI thread with its result."""

    title: str
    work: Work
    done: Callable[[Any], None]
    owner: str = ""


class _Thread(QThread):
    """Runs one request. Keeps the outcome as attributes, read after ``finished``."""

    progressed = Signal(float, str)

    def __init__(self, request: Request, parent: QObject) -> None:
        super().__init__(parent)
        self.request = request
        self.result: Any = None
        self.failed: Failed | None = None
        self._stop = threading.Event()

    def stop(self) -> None:
        self._stop.set()

    @property
    def stopped(self) -> bool:
        return self._stop.is_set()

    def run(self) -> None:
        try:
            self.result = self.request.work(self._report, self._stop.is_set)
        except Cancelled:
            self._stop.set()
        except UserError as error:
            self.failed = Failed(str(error), traceback.format_exc())
        except Exception as error:
            sentence = (
                f"{self.request.title} failed by a mistake of FingerLab itself "
                f"({type(error).__name__}: {error}); the session file is unchanged."
            )
            self.failed = Failed(" ".join(sentence.split()), traceback.format_exc())

    def _report(self, share: float, what: str) -> None:
        if self._stop.is_set():
            raise Cancelled
        self.progressed.emit(min(max(share, 0.0), 1.0), what)


class TaskRunner(QObject):
    """Runs one task at a time; the newest takes the place of those that it makes pointless.

    Signals:
        started(title), progressed(share, what), ended(how): ``how`` is ``done``, ``failed`` or ``stopped``.
        failed(Failed): before ``ended``.
    """

    started = Signal(str)
    progressed = Signal(float, str)
    failed = Signal(object)
    ended = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._thread: _Thread | None = None
        self._waiting: list[Request] = []

    @property
    def busy(self) -> bool:
        return self._thread is not None

    def start(self, title: str, work: Work, done: Callable[[Any], None], owner: str = "") -> None:
        """Run ``work`` in its thread and call ``done(result)`` in this one.

        Args:
            owner: with a name, the new task replaces only what the same owner has running or waiting, and
                waits for what others run; without one it takes the place of everything.
        """
        request = Request(title, work, done, owner)
        self._waiting = [one for one in self._waiting if owner and one.owner != owner]
        if self._thread is None:
            self._launch(request)
            return
        self._waiting.append(request)
        if not owner or self._thread.request.owner == owner:
            self._thread.stop()

    def cancel(self) -> None:
        """Ask the running task to stop, and forget those that wait."""
        self._waiting = []
        if self._thread is not None:
            self._thread.stop()

    def shut_down(self) -> None:
        """Stop whatever runs and wait until its thread has ended; nothing is reported any more."""
        self._waiting = []
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.stop()
            thread.progressed.disconnect(self._on_progress)
            thread.finished.disconnect(self._on_finished)
            thread.wait()
            thread.deleteLater()

    def _launch(self, request: Request) -> None:
        thread = _Thread(request, self)
        self._thread = thread
        thread.progressed.connect(self._on_progress)
        thread.finished.connect(self._on_finished)
        self.started.emit(request.title)
        thread.start()

    def _on_progress(self, share: float, what: str) -> None:
        if self._thread is not None and self.sender() is self._thread and not self._thread.stopped:
            self.progressed.emit(share, what)

    def _on_finished(self) -> None:
        thread, self._thread = self._thread, None
        if thread is None:
            return
        thread.wait()
        thread.deleteLater()
        if thread.stopped and self._waiting:
            self._launch(self._waiting.pop(0))
            return
        if thread.stopped:
            self.ended.emit("stopped")
        elif thread.failed is not None:
            self.failed.emit(thread.failed)
            self.ended.emit("failed")
        else:
            # "done" first: what the result starts (the next task) must come after the end of this one.
            self.ended.emit("done")
            thread.request.done(thread.result)
        if self._thread is None and self._waiting:
            self._launch(self._waiting.pop(0))
