"""Work off the GUI thread: one job after the other in one thread, with progress, cancel, and errors in words.

The work is a plain function that knows nothing of Qt. It is called with two functions,
``progress(share, what)`` and ``cancelled()``, and stops by raising ``fingerlab.core.errors.Cancelled``.
"""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any

from PySide6.QtCore import QObject, QThread, Signal

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.progress import ABOVE_NORMAL_CLASS, NORMAL_CLASS, ask_for, own_niceness

Progress = Callable[[float, str], None]
IsCancelled = Callable[[], bool]
Work = Callable[[Progress, IsCancelled], Any]


AHEAD = 5
"""By how much less nice the window's thread is than others: it comes after loop and recorder."""


class Precedence:
    """Lets the window's thread come before ordinary programs while STOP may be needed.

    A press of STOP goes through that thread, which on a busy machine waits for a core: 211 ms were seen
    beside ten other programs. On Linux what it hands to workers comes as before; on Windows the whole program
    comes first, and elsewhere nothing does.
    """

    usual: int | None = None
    """The thread's niceness before; None: it comes as others do."""

    @classmethod
    def take(cls, on: bool) -> None:
        """Come first from now on, or as others do. From the window's thread."""
        if on == (cls.usual is not None) or sys.platform not in ("linux", "win32"):
            return
        if cls.usual is not None:
            ask_for(cls.usual, NORMAL_CLASS)
            cls.usual = None
        elif ask_for((usual := own_niceness()) - AHEAD, ABOVE_NORMAL_CLASS):
            cls.usual = usual

    @classmethod
    def leave_to_the_window(cls) -> None:
        """In a worker's thread: it inherited what the window's has."""
        if cls.usual is not None and sys.platform == "linux":
            ask_for(cls.usual, NORMAL_CLASS)


@dataclass(frozen=True)
class Failed:
    """Why a job failed: a sentence for the user and details to copy."""

    sentence: str
    details: str


def attempt(title: str, work: Callable[[], Any], assurance: str = "") -> tuple[Any, Failed | None]:
    """Do it: its result, or why it failed; ``assurance`` ends the sentence on a mistake of the program.

    Raises:
        Cancelled: the work was stopped.
    """
    try:
        return work(), None
    except Cancelled:
        raise
    except UserError as error:
        return None, Failed(str(error), traceback.format_exc())
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        sentence = f"{title} failed by a mistake of FingerLab itself ({what}){assurance}."
        return None, Failed(" ".join(sentence.split()), traceback.format_exc())


@dataclass(eq=False)
class _Job:
    """What :meth:`Worker.start` was given, and what came of it."""

    title: str
    work: Work
    done: Callable[[Any], None]
    owner: Hashable
    on_progress: Callable[[float, str], None] | None
    failed: Callable[[Failed], None] | None
    stop: threading.Event = field(default_factory=threading.Event)
    result: Any = None
    failure: Failed | None = None


class _Thread(QThread):
    """Does what it is handed until that is None."""

    progressed = Signal(object, float, str)
    ended = Signal(object)

    def __init__(self, assurance: str, parent: QObject) -> None:
        super().__init__(parent)
        self.jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._assurance = assurance

    def run(self) -> None:
        Precedence.leave_to_the_window()
        while self._do_next():
            pass

    def _do_next(self) -> bool:
        job = self.jobs.get()
        if job is None:
            return False

        def progress(share: float, what: str) -> None:
            if job.stop.is_set():
                raise Cancelled
            self.progressed.emit(job, min(max(share, 0.0), 1.0), what)

        try:
            job.result, job.failure = attempt(
                job.title, lambda: job.work(progress, job.stop.is_set), self._assurance
            )
        except Cancelled:
            job.stop.set()
        self.ended.emit(job)
        return True


def _nothing(_result: Any) -> None:
    pass


class Worker(QObject):
    """Does one job at a time; there is a thread only as long as there is something to do.

    Args:
        newest_first: of those that wait, the one asked for last is next.
        assurance: how the sentence on a mistake of the program ends.

    Signals:
        started(title), progressed(share, what), ended(how): ``how`` is ``done``, ``failed`` or ``stopped``.
        failed(Failed): before ``ended``, of a job that does not take its failure itself.
        busy_changed: another job was asked for, or one has ended.
    """

    started = Signal(str)
    progressed = Signal(float, str)
    failed = Signal(object)
    ended = Signal(str)
    busy_changed = Signal()

    def __init__(
        self, parent: QObject | None = None, newest_first: bool = False, assurance: str = ""
    ) -> None:
        super().__init__(parent)
        self._next_place = -1 if newest_first else 0
        self._assurance = assurance
        self._thread: _Thread | None = None
        self._now: _Job | None = None
        self._last: _Job | None = None  # what it refers to ends in this thread, not in the worker's
        self._waiting: list[_Job] = []
        self._title = ""
        self._over = False

    @property
    def busy(self) -> bool:
        """Whether something runs or waits."""
        return self._now is not None or bool(self._waiting)

    @property
    def title(self) -> str:
        """What was asked for last, empty when nothing is being done."""
        return self._title if self.busy else ""

    def start(
        self,
        title: str,
        work: Work,
        done: Callable[[Any], None] = _nothing,
        owner: Hashable = "",
        *,
        on_progress: Callable[[float, str], None] | None = None,
        failed: Callable[[Failed], None] | None = None,
        replace: bool = True,
    ) -> None:
        """Run ``work`` in the thread; call ``done(result)``, ``on_progress(share, what)``, ``failed`` here.

        Args:
            owner: with a name, the new job replaces only what the same owner has running or waiting, and
                waits for what others run; without one it takes the place of everything.
            replace: without it, the job waits for all that was asked before.
        """
        if self._over:
            return
        if replace:
            self._waiting = [one for one in self._waiting if owner and one.owner != owner]
        self._title = title
        self._waiting.append(_Job(title, work, done, owner, on_progress, failed))
        if self._now is None:
            self._launch()
        elif replace and (not owner or self._now.owner == owner):
            self._now.stop.set()
        self.busy_changed.emit()

    def cancel(self) -> None:
        """Ask the running job to stop, and forget those that wait."""
        self._waiting = []
        if self._now is not None:
            self._now.stop.set()

    def shut_down(self, finish: bool = False) -> None:
        """Wait until the thread has ended, for good; nothing is reported any more.

        Args:
            finish: all that was asked for is done first; else what runs is asked to stop.
        """
        self._over = True
        waiting, self._waiting = self._waiting, []
        now, self._now = self._now, None
        thread, self._thread = self._thread, None
        if thread is None:
            return
        thread.progressed.disconnect(self._on_progress)
        thread.ended.disconnect(self._on_ended)
        if finish:
            for job in waiting:
                thread.jobs.put(job)
        elif now is not None:
            now.stop.set()
        self._end(thread)

    def _launch(self) -> None:
        job = self._now = self._waiting.pop(self._next_place)
        if self._thread is None:
            self._thread = _Thread(self._assurance, self)
            self._thread.progressed.connect(self._on_progress)
            self._thread.ended.connect(self._on_ended)
            self._thread.start()
        self.started.emit(job.title)
        self._thread.jobs.put(job)

    def _end(self, thread: _Thread) -> None:
        thread.jobs.put(None)
        thread.wait()
        thread.deleteLater()

    def _on_progress(self, job: _Job, share: float, what: str) -> None:
        if job is self._now and not job.stop.is_set():
            self.progressed.emit(share, what)
            if job.on_progress is not None:
                job.on_progress(share, what)

    def _on_ended(self, job: _Job) -> None:
        if job is not self._now:
            return
        self._now, self._last = None, job
        if not job.stop.is_set():
            if job.failure is not None:
                (job.failed or self.failed.emit)(job.failure)
                self.ended.emit("failed")
            else:
                # "done" first: what the result starts (the next job) must come after the end of this one.
                self.ended.emit("done")
                job.done(job.result)
        elif not self._waiting:
            self.ended.emit("stopped")
        if self._now is None and self._waiting:
            self._launch()
        elif self._now is None and self._thread is not None:
            thread, self._thread = self._thread, None
            self._end(thread)
        self.busy_changed.emit()
