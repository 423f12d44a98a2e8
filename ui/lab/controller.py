"""What is open, which models were tried, and the calls that change it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.project import (
    Project,
    TriedModel,
    load_project,
    project_path,
    save_project,
    with_model,
)
from fingerlab.report.diagnosis_words import effect_title, in_sentence, listed
from fingerlab.report.story import story
from fingerlab.sessions.model import Session

from ..app.context import part_of
from ..app.worker import IsCancelled, Progress, Work, Worker

if TYPE_CHECKING:
    from fingerlab.diagnosis.gram.reduction import Reduction


@dataclass(frozen=True)
class ModelStep:
    """A model that was fitted: the effects added to the nominal equations, and what came out."""

    added: tuple[str, ...]
    diagnosis: Diagnosis

    @property
    def last_added(self) -> str | None:
        return self.added[-1] if self.added else None

    def change_from(self, before: ModelStep) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The effects that came in after another step, and those that went out."""
        came = tuple(name for name in self.added if name not in before.added)
        return came, tuple(name for name in before.added if name not in self.added)


def _named(effects: Sequence[str]) -> str:
    return listed([in_sentence(effect_title(effect)) for effect in effects])


class ModelHistory:
    """Steps from the nominal model onwards; a new step after an undo replaces what was undone."""

    def __init__(self, steps: Sequence[ModelStep], now: int = 0) -> None:
        """``now``: place of the present one among the ``steps``, of which there is one at least."""
        self._steps = list(steps)
        self._index = min(max(now, 0), len(self._steps) - 1)

    @property
    def steps(self) -> tuple[ModelStep, ...]:
        """All that undo and redo reach."""
        return tuple(self._steps)

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

    @property
    def before(self) -> ModelStep | None:
        """The step that undo goes back to."""
        return self._steps[self._index - 1] if self.can_undo else None

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
    """Holds the open sessions, the history of models, and the project in which all of it is kept.

    Attributes:
        wanted: effects of a saved model that the next comparison is to begin with.
        known: diagnoses of every model that was fitted to the open sessions, branches and all.

    Signals:
        sessions_changed: other sessions are open, or none.
        result_changed: another diagnosis is shown, or none any more.
        activity_changed: work started or ended.
        restored: what was done with the open sessions before is there again.
        kept_badly(sentence): the project could not be read or written.
    """

    sessions_changed = Signal()
    result_changed = Signal()
    activity_changed = Signal()
    restored = Signal()
    kept_badly = Signal(str)

    def __init__(
        self, tasks: Worker, diagnose: DiagnoseCall | None = None, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self.tasks = tasks
        self.sessions: tuple[Session, ...] = ()
        self.history: ModelHistory | None = None
        self.project: Project | None = None
        self.wanted: tuple[str, ...] = ()
        self.known: dict[tuple[str, ...], Diagnosis] = {}
        self._diagnose = diagnose or SessionDiagnosis()
        tasks.started.connect(self.activity_changed)
        tasks.ended.connect(self.activity_changed)

    @property
    def diagnosis(self) -> Diagnosis | None:
        """The diagnosis shown now."""
        return self.history.now.diagnosis if self.history is not None else None

    @property
    def project_path(self) -> Path:
        """Where the project of the open sessions is kept."""
        return project_path([session.path for session in self.sessions])

    def take(self, sessions: tuple[Session, ...]) -> None:
        """Hold other sessions, or none; what was found of the former is in its project."""
        self.sessions = sessions
        self.history = self.project = None
        self.known = {}
        self.sessions_changed.emit()
        self.result_changed.emit()

    def compare(self) -> None:
        """Diagnose the open sessions with the nominal model, and with what was tried on them before."""
        sessions, wanted = self.sessions, self.wanted
        self.wanted = ()

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[Project, list[ModelStep], str]:
            problem, project = "", None
            try:
                project = load_project(sessions)
            except UserError as error:
                problem = str(error)
            project = project or Project(tuple(session.path.name for session in sessions))
            paths = [wanted[:n] for n in range(len(wanted) + 1)] or [()]
            if not wanted and project.path:
                paths = [model.added for model in project.path]
            steps: list[ModelStep] = []
            for number, added in enumerate(paths):
                part = part_of(progress, number, len(paths))
                try:
                    steps.append(ModelStep(added, self._diagnose(sessions, added, part, cancelled)))
                except UserError as error:
                    if not steps:  # the sessions themselves
                        raise
                    problem = problem or str(error)
                    break
            return project, steps, problem

        def done(found: tuple[Project, list[ModelStep], str]) -> None:
            project, steps, problem = found
            self.project = project
            self.history = ModelHistory(steps, len(steps) if wanted else project.now)
            self.known |= {step.added: step.diagnosis for step in steps}
            self.keep()
            self.result_changed.emit()
            if project.worth_keeping:
                self.restored.emit()
            if problem:
                self.kept_badly.emit(problem)

        self._start("Comparing model and measurement", work, done)

    def go_to(self, added: tuple[str, ...]) -> None:
        """Refit a model that was tried before; it becomes the next step of the history."""
        history = self.history
        if history is None or history.now.added == added:
            return
        if added in self.known:  # nothing is computed again
            self._push(history, added, self.known[added])
            return
        self._run(added, "Refitting a model that was tried", partial(self._push, history, added))

    def keep(self) -> None:
        """Write the project, as far as there is anything to keep."""
        history, project = self.history, self.project
        if history is None or project is None:
            return
        steps = story([step.diagnosis for step in history.steps])
        told = ("", *(f"{step.title}: {step.evidence}" if step.evidence else "" for step in steps))
        path = tuple(
            TriedModel(step.added, step.diagnosis.score, evidence)
            for step, evidence in zip(history.steps, told, strict=True)
        )
        for model in path:
            if model not in project.tried:
                project = with_model(project, model)
        self.project = replace(project, path=path, now=len(history.done) - 1)
        self.keep_project(self.project)

    def keep_project(self, project: Project) -> None:
        """Take another state of the project, and write it."""
        self.project = project
        if project.worth_keeping and self.sessions:
            try:
                save_project(project, self.project_path)
            except UserError as error:
                self.kept_badly.emit(str(error))

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
        added = (*history.now.added, effect)
        title = f"Refitting with {in_sentence(effect_title(effect))}"
        self._run(added, title, partial(self._push, history, added))

    def exchange(self) -> None:
        """Refit with the better model of the same recordings, where the diagnosis knows one."""
        better = self.diagnosis.better if self.diagnosis is not None else None
        if better is not None:
            self._exchange(better.added, better.removed, better.effects)

    def _exchange(self, came: tuple[str, ...], gone: tuple[str, ...], added: tuple[str, ...]) -> None:
        history = self.history
        if history is not None:
            title = f"Refitting with {_named(came)} in place of {_named(gone)}"
            self._run(added, title, partial(self._push, history, added))

    def _push(self, history: ModelHistory, added: tuple[str, ...], diagnosis: Diagnosis) -> None:
        history.push(ModelStep(added, diagnosis))
        self.known[added] = diagnosis
        self.keep()
        self.result_changed.emit()

    def undo(self) -> None:
        """Back to the model before; nothing is computed again."""
        self._move(ModelHistory.undo)

    def redo(self) -> None:
        self._move(ModelHistory.redo)

    def _move(self, step: Callable[[ModelHistory], None]) -> None:
        if self.history is not None:
            self.tasks.cancel()
            step(self.history)
            self.keep()
            self.result_changed.emit()

    def _run(self, added: tuple[str, ...], title: str, done: Callable[[Diagnosis], None]) -> None:
        sessions = self.sessions
        self._start(
            title, lambda progress, cancelled: self._diagnose(sessions, added, progress, cancelled), done
        )

    def _start(self, title: str, work: Work, done: Callable[[Any], None]) -> None:
        sessions = self.sessions

        def if_still_open(found: Any) -> None:
            if self.sessions is sessions:
                done(found)

        self.tasks.start(title, work, if_still_open)
