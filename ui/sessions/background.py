"""A thread beside the window's own worker: what browsing needs must not wait for a diagnosis."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import QObject, QThread, Signal

from fingerlab.core.errors import Cancelled, UserError

Tell = Callable[[Any], None]
IsCancelled = Callable[[], bool]
Work = Callable[[Tell, IsCancelled], Any]


@dataclass
class _Job:
    key: Hashable
    work: Work
    stop: threading.Event = field(default_factory=threading.Event)


class Background(QThread):
    """Does one job after the other, the one asked for last first. A job replaces the one of the same key.

    A job is a function of ``tell(part)`` and ``cancelled()``; nothing is reported of one that was replaced.

    Signals:
        told(key, part): something that a running job has ready. done(key, result).
        failed(key, sentence, details).
    """

    told = Signal(object, object)
    done = Signal(object, object)
    failed = Signal(object, str, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._wake = threading.Condition()
        self._waiting: list[_Job] = []
        self._running: _Job | None = None
        self._over = False

    def ask(self, key: Hashable, work: Work) -> None:
        """Do this soon; whatever has the same key is dropped or stopped."""
        with self._wake:
            self._drop(lambda job: job.key == key)
            self._waiting.append(_Job(key, work))
            self._wake.notify()
        if not self.isRunning() and not self._over:
            self.start()

    def clear(self) -> None:
        """Forget everything that waits and stop what runs."""
        with self._wake:
            self._drop(lambda _: True)

    @property
    def busy(self) -> bool:
        """Whether something waits or runs."""
        with self._wake:
            return bool(self._waiting) or self._running is not None

    def shut_down(self) -> None:
        """Stop and wait for the end of the thread; for good."""
        with self._wake:
            self._over = True
            self._drop(lambda _: True)
            self._wake.notify()
        self.wait()

    def run(self) -> None:
        """The thread's own part."""
        while True:
            with self._wake:
                self._running = None
                while not self._waiting and not self._over:
                    self._wake.wait()
                if self._over:
                    return
                job = self._running = self._waiting.pop()
            self._do(job)

    def _drop(self, condition: Callable[[_Job], bool]) -> None:
        self._waiting = [job for job in self._waiting if not condition(job)]
        if self._running is not None and condition(self._running):
            self._running.stop.set()

    def _do(self, job: _Job) -> None:
        def tell(part: Any) -> None:
            if not job.stop.is_set():
                self.told.emit(job.key, part)

        try:
            result = job.work(tell, job.stop.is_set)
        except Cancelled:
            return
        except UserError as error:
            if not job.stop.is_set():
                self.failed.emit(job.key, str(error), traceback.format_exc())
        except Exception as error:
            if not job.stop.is_set():
                sentence = f"Browsing failed by a mistake of FingerLab ({type(error).__name__}: {error})."
                self.failed.emit(job.key, " ".join(sentence.split()), traceback.format_exc())
        else:
            if not job.stop.is_set():
                self.done.emit(job.key, result)
