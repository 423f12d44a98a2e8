"""What is open, which models were tried, and the calls that change it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.answer.results import Diagnosis, FirstLook
from fingerlab.models.file import (
    Held,
    ModelKey,
    Project,
    TriedModel,
    load_project,
    project_path,
    save_project,
    with_model,
)
from fingerlab.report.diagnosis_words import (
    called,
    called_in_sentence,
    in_sentence,
    needless_title,
    on_the_path,
)
from fingerlab.report.line_units import line_units
from fingerlab.report.score_words import story
from fingerlab.sessions.model import Session

from ..app.context import part_of
from ..app.worker import IsCancelled, Progress, Work, Worker

if TYPE_CHECKING:
    from fingerlab.diagnosis.answer.parameter_explorer import ParameterExplorer
    from fingerlab.diagnosis.draft.laws import DraftLaw
    from fingerlab.diagnosis.gram.reduction import Reduction


@dataclass(frozen=True)
class ModelStep:
    """A model that was fitted: effects added to the nominal equations, what is held, what came out."""

    added: tuple[str, ...]
    diagnosis: Diagnosis
    held: Held = ()

    @property
    def key(self) -> ModelKey:
        """What tells it from the other models."""
        return self.added, self.held

    def change_from(self, before: ModelStep) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The effects that came in after another step, and those that went out."""
        came = tuple(name for name in self.added if name not in before.added)
        return came, tuple(name for name in before.added if name not in self.added)


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


DiagnoseCall = Callable[..., Diagnosis]
"""Of sessions, effects added, progress and whether to stop; with ``held``, where something is, and ``first``
of an instrument's own, which tells the error of the model while the rest is worked out."""


class SessionDiagnosis:
    """The instrument's diagnosis. What it read of the open sessions, and its last answer on them, are kept
    until others are diagnosed."""

    def __init__(self) -> None:
        self._kept: Reduction | None = None
        self._last: Diagnosis | None = None

    def __call__(
        self,
        sessions: Sequence[Session],
        added: tuple[str, ...],
        progress: Progress,
        cancelled: IsCancelled,
        held: Held = (),
        first: Callable[[FirstLook], None] | None = None,
    ) -> Diagnosis:
        """Called in the worker, where it is imported, so that the window opens without waiting for it."""
        from fingerlab.diagnosis import DiagnosisOptions, diagnose

        options = DiagnosisOptions(
            held=dict(held), kept=self._reduction(sessions), first=first, before=self._last
        )
        self._last = diagnose(sessions, added, progress, cancelled, options=options)
        return self._last

    def at_hand(
        self, sessions: Sequence[Session], diagnosis: Diagnosis, progress: Progress, cancelled: IsCancelled
    ) -> ParameterExplorer:
        """The parameters of a diagnosed model, to be moved; called in the worker, too."""
        from fingerlab.core.progress import Watch
        from fingerlab.diagnosis.answer.parameter_explorer import ParameterExplorer

        return ParameterExplorer(self._reduction(sessions), diagnosis, Watch(progress, cancelled))

    def drafted(
        self, sessions: Sequence[Session], diagnosis: Diagnosis, progress: Progress, cancelled: IsCancelled
    ) -> tuple[DraftLaw, ...]:
        """Laws for what a diagnosis leaves; called in the worker, too."""
        from fingerlab.core.progress import Watch
        from fingerlab.diagnosis.draft.laws import draft_laws

        best = [one.effect for one in sorted(diagnosis.candidates, key=lambda one: one.score)]
        watch = Watch(progress, cancelled)
        kept = self._reduction(sessions)
        diagnosis.resume(kept)
        return draft_laws(kept, diagnosis.last, diagnosis.fitted, best, watch, with_curves=True)

    def _reduction(self, sessions: Sequence[Session]) -> Reduction:
        from fingerlab.diagnosis.gram.reduction import Reduction

        if self._kept is None or not self._kept.is_of(sessions):
            self._kept = self._last = None  # let go before the next is filled
            self._kept = Reduction(sessions)
        return self._kept


def _without(held: Held, gone: Sequence[str]) -> Held:
    """What is held of a model once effects have left it (ids)."""
    return tuple(one for one in held if one[0].partition(".")[0] not in gone)


class LabController(QObject):
    """Holds the open sessions, the history of models, and the project in which all of it is kept.

    Attributes:
        history: of models; of a linear axis their diagnoses are told along the line.
        wanted: effects of a saved model, and what it holds, that the next comparison is to begin with.
        known: diagnoses of every model that was fitted to the open sessions, branches and all.
        first_look: what is known already of the model that is being diagnosed; None: nothing, or none is.

    Signals:
        sessions_changed: other sessions are open, or none.
        result_changed: another diagnosis is shown, or none any more.
        activity_changed: work started or ended.
        first_look_changed: the error of the model that is being diagnosed is there, or is no longer needed.
        restored: what was done with the open sessions before is there again.
        kept_badly(sentence): the project could not be read or written.
    """

    sessions_changed = Signal()
    result_changed = Signal()
    activity_changed = Signal()
    restored = Signal()
    kept_badly = Signal(str)
    first_look_changed = Signal()
    _looked = Signal(object, object)  # from the worker's thread to this one

    def __init__(
        self, tasks: Worker, diagnose: DiagnoseCall | None = None, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self.tasks = tasks
        self.sessions: tuple[Session, ...] = ()
        self.history: ModelHistory | None = None
        self.project: Project | None = None
        self.wanted: ModelKey = ((), ())
        self.known: dict[ModelKey, Diagnosis] = {}
        self.first_look: FirstLook | None = None
        self._running: ModelKey | None = None
        own = diagnose if isinstance(diagnose, SessionDiagnosis) else SessionDiagnosis()
        self._diagnose, self._at_hand = diagnose or own, own.at_hand
        self._drafted = own.drafted
        tasks.started.connect(self.activity_changed)
        tasks.ended.connect(self.activity_changed)
        tasks.ended.connect(self._forget_look)
        self._looked.connect(self._take_look)

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
        self._forget_look()
        self.sessions_changed.emit()
        self.result_changed.emit()

    def compare(self) -> None:
        """Diagnose the open sessions with the nominal model, and with what was tried on them before."""
        sessions, wanted = self.sessions, self.wanted
        self.wanted = ((), ())

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[Project, list[ModelStep], str]:
            problem, project = "", None
            try:
                project = load_project(sessions)
            except UserError as error:
                problem = str(error)
            project = project or Project(tuple(session.path.name for session in sessions))
            paths: list[ModelKey] = [(wanted[0][:n], ()) for n in range(len(wanted[0]) + 1)]
            if wanted[1]:
                paths.append(wanted)
            if not any(wanted) and project.path:
                paths = [model.key for model in project.path]
            steps: list[ModelStep] = []
            for number, (added, held) in enumerate(paths):
                part = part_of(progress, number, len(paths))
                try:
                    found = self._diagnosed(sessions, (added, held), part, cancelled)
                    steps.append(ModelStep(added, found, held))
                except UserError as error:
                    if not steps:  # the sessions themselves
                        raise
                    problem = problem or str(error)
                    break
            return project, steps, problem

        def done(found: tuple[Project, list[ModelStep], str]) -> None:
            project, steps, problem = found
            self.project = project
            self.history = ModelHistory(steps, len(steps) if any(wanted) else project.now)
            self.known |= {step.key: step.diagnosis for step in steps}
            self.keep()
            self.result_changed.emit()
            if project.worth_keeping:
                self.restored.emit()
            if problem:
                self.kept_badly.emit(problem)

        self._start("Comparing model and measurement", work, done)

    def go_to(self, key: ModelKey, title: str = "Refitting a model that was tried") -> None:
        """Refit a model; it becomes the next step of the history."""
        history = self.history
        if history is None or history.now.key == key:
            return
        if key in self.known:  # nothing is computed again
            self._push(history, key, self.known[key])
            return
        self._run(history, key, title)

    def hold(self, held: Mapping[str, float]) -> None:
        """Refit the present model with these parameters held, by key, SI, and all others free."""
        if self.history is not None:
            title = "Refitting with what is held" if held else "Refitting with everything free"
            self.go_to((self.history.now.added, tuple(sorted(held.items()))), title)

    def lay_out(self, done: Callable[[ParameterExplorer], None]) -> None:
        """Have the parameters of the present model at hand, in the background."""
        sessions, diagnosis = self.sessions, self.diagnosis
        if diagnosis is None or diagnosis.fitted is None:
            return
        fitted = diagnosis

        def work(progress: Progress, cancelled: IsCancelled) -> ParameterExplorer:
            return self._at_hand(sessions, fitted.computed, progress, cancelled)

        def if_still_shown(found: ParameterExplorer) -> None:
            if self.diagnosis is fitted:
                done(found)

        self._start("Laying out the parameters", work, if_still_shown)

    def draft(self, done: Callable[[tuple[DraftLaw, ...]], None]) -> None:
        """Have laws drafted for what the present diagnosis leaves, in the background."""
        sessions, diagnosis = self.sessions, self.diagnosis
        if diagnosis is None:
            return
        shown = diagnosis

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[DraftLaw, ...]:
            return self._drafted(sessions, shown.computed, progress, cancelled)

        def if_still_shown(found: tuple[DraftLaw, ...]) -> None:
            if self.diagnosis is shown:
                done(found)

        self._start("Drafting a law", work, if_still_shown)

    def keep(self) -> None:
        """Write the project, as far as there is anything to keep."""
        history, project = self.history, self.project
        if history is None or project is None:
            return
        steps = story([step.diagnosis for step in history.steps])
        evidence_lines = ("", *(f"{step.title}: {step.evidence}" if step.evidence else "" for step in steps))
        path = tuple(
            TriedModel(step.added, step.diagnosis.score, evidence, step.held)
            for step, evidence in zip(history.steps, evidence_lines, strict=True)
        )
        for model in path:
            if model not in project.tried:
                project = with_model(project, model)
        self.project = replace(project, path=path, now=len(history.done) - 1)
        self.keep_project(self.project)

    def keep_project(self, project: Project) -> None:
        """Take another state of the project, and write it."""
        self.project = project
        if self.sessions and (project.worth_keeping or self.project_path.exists()):
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
        title = f"Refitting with {in_sentence(called(history.now.diagnosis, effect))}"
        self._run(history, ((*history.now.added, effect), history.now.held), title)

    def exchange(self) -> None:
        """Refit with the better model of the same recordings, where the diagnosis knows one."""
        better = self.diagnosis.better if self.diagnosis is not None else None
        if better is not None:
            self._exchange(better.added, better.removed, better.effects)

    def take_off(self) -> None:
        """Refit without the effect that the present model does not need, where the diagnosis knows one."""
        history, smaller = self.history, self.diagnosis.smaller if self.diagnosis is not None else None
        if history is not None and smaller is not None:
            gone = needless_title(history.now.diagnosis)
            held = _without(history.now.held, (smaller.removed,))
            self._run(history, (smaller.effects, held), f"Refitting without {gone}")

    def _exchange(self, came: tuple[str, ...], gone: tuple[str, ...], added: tuple[str, ...]) -> None:
        history = self.history
        if history is not None:
            new = called_in_sentence(history.now.diagnosis, came)
            old = called_in_sentence(history.now.diagnosis, gone, on_the_path)
            title = f"Refitting with {new} in place of {old}"
            self._run(history, (added, _without(history.now.held, gone)), title)

    def _push(self, history: ModelHistory, key: ModelKey, diagnosis: Diagnosis) -> None:
        history.push(ModelStep(key[0], diagnosis, key[1]))
        self.known[key] = diagnosis
        self._forget_moved()
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
            self._forget_look()
            step(self.history)
            self._forget_moved()
            self.keep()
            self.result_changed.emit()

    def keep_moved(self, moved: Held) -> None:
        """Keep what was moved by hand with the project."""
        if self.project is not None and moved != self.project.moved:
            self.keep_project(replace(self.project, moved=moved))

    def _forget_moved(self) -> None:
        """What was moved by hand was of another model."""
        if self.project is not None:
            self.project = replace(self.project, moved=())

    def _diagnosed(
        self,
        sessions: Sequence[Session],
        key: ModelKey,
        progress: Progress,
        cancelled: IsCancelled,
        **options: Any,
    ) -> Diagnosis:
        """A model's diagnosis, in the units in which the lab shows it; called in the worker."""
        added, held = key
        if held:
            options["held"] = held
        found = self._diagnose(sessions, added, progress, cancelled, **options)
        return line_units(sessions).diagnosis(found)

    def _run(self, history: ModelHistory, key: ModelKey, title: str) -> None:
        sessions, own = self.sessions, isinstance(self._diagnose, SessionDiagnosis)

        def work(progress: Progress, cancelled: IsCancelled) -> Diagnosis:
            look = {"first": partial(self._looked.emit, key)} if own else {}
            return self._diagnosed(sessions, key, progress, cancelled, **look)

        self._start(title, work, partial(self._push, history, key))
        self._running = key

    def _take_look(self, key: ModelKey, look: FirstLook) -> None:
        if key == self._running:
            self.first_look = line_units(self.sessions).look(look)
            self.first_look_changed.emit()

    def _forget_look(self) -> None:
        """What was known already is not shown any more: the whole answer is there, or none will come."""
        self._running = None
        if self.first_look is not None:
            self.first_look = None
            self.first_look_changed.emit()

    def _start(self, title: str, work: Work, done: Callable[[Any], None]) -> None:
        sessions = self.sessions

        def if_still_open(found: Any) -> None:
            if self.sessions is sessions:
                done(found)

        self.tasks.start(title, work, if_still_open)
