"""What is open, which models were tried, and the calls that change it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.diagnosis_words import effect_title, in_sentence, listed
from fingerlab.sessions.model import Session

from ..app.worker import IsCancelled, Progress, Worker

if TYPE_CHECKING:
    from fingerlab.diagnosis.gram.reduction import Reduction


@dataclass(frozen=True)
class ModelStep:
    """A model that was fitted: the effects added to the nominal equations, and what came out.

    ``exchanged``: the effects that came in with the step, and those that went out, if any did.
    """

    added: tuple[str, ...]
    diagnosis: Diagnosis
    exchanged: tuple[tuple[str, ...], tuple[str, ...]] | None = None

    @property
    def last_added(self) -> str | None:
        return self.added[-1] if self.added else None

    @property
    def title(self) -> str:
        """What the step did, as it stands under its bar."""
        if self.exchanged is not None:
            came, gone = (" + ".join(map(effect_title, names)) for names in self.exchanged)
            return f"{came} for {in_sentence(gone)}"
        return f"+ {effect_title(self.last_added)}" if self.last_added else "Nominal"


class ModelHistory:
    """Steps from the nominal model onwards; a new step after an undo replaces what was undone."""

    def __init__(self, nominal: Diagnosis, added: tuple[str, ...] = ()) -> None:
        self._steps = [ModelStep(added, nominal)]
        self._index = 0

    @property
    def now(self) -> ModelStep:
        return self._steps[self._index]

    @property
    def first(self) -> ModelStep:
        return self._steps[0]

    @property
    def done(self) -> tuple[ModelStep, ...]:
        """Steps up to the present one, the nominal model first."""
        return tuple(self._steps[: self._index + 1])

    @property
    def can_undo(self) -> bool:
        return self._index > 0

    @property
    def can_redo(self) -> bool:
        return self._index < len(self._steps) - 1

    def push(self, step: ModelStep) -> None:
        self._steps[self._index + 1 :] = [step]
        self._index += 1

    def undo(self) -> None:
        self._index = max(self._index - 1, 0)

    def redo(self) -> None:
        self._index = min(self._index + 1, len(self._steps) - 1)

    def undone(self) -> ModelStep | None:
        """The step that redo would take again."""
        return self._steps[self._index + 1] if self.can_redo else None


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
        self, tasks: Worker, diagnose: DiagnoseCall | None = None, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self.tasks = tasks
        self.sessions: tuple[Session, ...] = ()
        self.history: ModelHistory | None = None
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
            self.history = ModelHistory(diagnosis)
            self.result_changed.emit()

        self._run((), "Comparing model and measurement", done)

    def add(self, effect: str) -> None:
        """Refit with one more effect, or with it in place of those that it is judged to replace.

        The history moves on when the new diagnosis is there.
        """
        history = self.history
        if history is None or effect in history.now.added:
            return
        judged = {c.effect: c for c in history.now.diagnosis.candidates}
        gone = judged[effect].replaces if effect in judged else ()
        if gone:
            first, *others = gone
            kept = [effect if name == first else name for name in history.now.added if name not in others]
            self._exchange((effect,), gone, tuple(kept))
            return
        self._refit((*history.now.added, effect), in_sentence(effect_title(effect)), None)

    def exchange(self) -> None:
        """Refit with the better model of the same recordings, where the diagnosis knows one."""
        better = self.diagnosis.better if self.diagnosis is not None else None
        if better is not None:
            self._exchange(better.added, better.removed, better.effects)

    def _exchange(self, came: tuple[str, ...], gone: tuple[str, ...], added: tuple[str, ...]) -> None:
        new, old = (listed([in_sentence(effect_title(one)) for one in names]) for names in (came, gone))
        self._refit(added, f"{new} in place of {old}", (came, gone))

    def _refit(
        self, added: tuple[str, ...], words: str, exchanged: tuple[tuple[str, ...], tuple[str, ...]] | None
    ) -> None:
        history = self.history
        if history is None:
            return

        def done(diagnosis: Diagnosis) -> None:
            history.push(ModelStep(added, diagnosis, exchanged))
            self.result_changed.emit()

        self._run(added, f"Refitting with {words}", done)

    def undo(self) -> None:
        """Back to the model before; nothing is computed again."""
        self._move(ModelHistory.undo)

    def redo(self) -> None:
        self._move(ModelHistory.redo)

    def _move(self, step: Callable[[ModelHistory], None]) -> None:
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
