"""Between the widgets and the instrument: what is open, what was found, and the calls that change it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.diagnosis_words import effect_title, in_sentence
from fingerlab.sessions.model import Session

from ..tasks import IsCancelled, Progress, TaskRunner
from .history import History, Step

if TYPE_CHECKING:
    from fingerlab.diagnosis.gram.reduction import Reduction

DiagnoseCall = Callable[[Sequence[Session], tuple[str, ...], Progress, IsCancelled], Diagnosis]


class SessionDiagnosis:
    """The instrument's diagnosis. What it read of the open sessions is kept until others are diagnosed."""

    def __init__(self) -> None:
        self._kept: Reduction | None = None

    def __call__(
        self, sessions: Sequence[Session], added: tuple[str, ...], progress: Progress, cancelled: IsCancelled
    ) -> Diagnosis:
        """Called in the worker, where it is imported, so that the window opens without waiting for it."""
        from fingerlab.diagnosis import diagnose
        from fingerlab.diagnosis.gram.reduction import Reduction

        if self._kept is None or self._kept.sessions is not sessions:
            self._kept = None  # let go before the next is filled
            self._kept = Reduction(sessions)
        result: Diagnosis = diagnose(
            sessions, added=added, progress=progress, cancelled=cancelled, kept=self._kept
        )
        return result


class LabController(QObject):
    """Holds the open sessions and the history of models.

    Signals:
        sessions_changed: other sessions are open, or none.
        result_changed: another diagnosis is shown, or none any more.
        activity_changed: work started or ended.
    """

    sessions_changed = Signal()
    result_changed = Signal()
    activity_changed = Signal()

    def __init__(
        self,
        tasks: TaskRunner,
        diagnose: DiagnoseCall | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self.tasks = tasks
        self.sessions: tuple[Session, ...] = ()
        self.history: History | None = None
        self._diagnose = diagnose or SessionDiagnosis()
        tasks.started.connect(self.activity_changed)
        tasks.ended.connect(self.activity_changed)

    @property
    def diagnosis(self) -> Diagnosis | None:
        """The diagnosis shown now."""
        return self.history.now.diagnosis if self.history is not None else None

    def take(self, sessions: tuple[Session, ...]) -> None:
        """Hold other sessions, or none; what was found of the former is gone."""
        self.sessions = sessions
        self.history = None
        self.sessions_changed.emit()
        self.result_changed.emit()

    def compare(self) -> None:
        """Diagnose the open sessions with the nominal model."""

        def done(diagnosis: Diagnosis) -> None:
            self.history = History(diagnosis)
            self.result_changed.emit()

        self._run((), "Comparing model and measurement", done)

    def add(self, effect: str) -> None:
        """Refit with one more effect; the history moves on when the new diagnosis is there."""
        history = self.history
        if history is None or effect in history.now.added:
            return
        added = (*history.now.added, effect)

        def done(diagnosis: Diagnosis) -> None:
            history.push(Step(added, diagnosis))
            self.result_changed.emit()

        self._run(added, f"Refitting with {in_sentence(effect_title(effect))}", done)

    def undo(self) -> None:
        """Back to the model before; nothing is computed again."""
        self._move(History.undo)

    def redo(self) -> None:
        self._move(History.redo)

    def _move(self, step: Callable[[History], None]) -> None:
        if self.history is not None:
            self.tasks.cancel()
            step(self.history)
            self.result_changed.emit()

    def _run(self, added: tuple[str, ...], title: str, done: Callable[[Diagnosis], None]) -> None:
        sessions = self.sessions

        def work(progress: Progress, cancelled: IsCancelled) -> Diagnosis:
            return self._diagnose(sessions, added, progress, cancelled)

        def if_still_open(diagnosis: Diagnosis) -> None:
            if self.sessions is sessions:
                done(diagnosis)

        self.tasks.start(title, work, if_still_open)
