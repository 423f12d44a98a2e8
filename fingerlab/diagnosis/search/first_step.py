"""What is asked, and the first step to the answer: one effect, looked at between the points of its grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from fingerlab.core.progress import Progress, Watch
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit, redundant_steps
from fingerlab.diagnosis.search.grid_refinement import can_refine, refine_path
from fingerlab.diagnosis.search.path import forward_selection, worth_a_further_effect
from fingerlab.diagnosis.search.ties import NOTHING, Refined, break_ties
from fingerlab.diagnosis.settings import FULL_ITERATIONS, GRID_LOG_ODDS, NEARLY_RIGHT
from fingerlab.effects.base import Effect


class Stages:
    """Spreads the progress of the stages over one bar, which never goes back.

    How many rounds a search takes is not known before; a later round moves on from where the last one ended.
    """

    def __init__(self, progress: Progress | None, cancelled: Callable[[], bool] | None) -> None:
        self._progress = progress
        self._cancelled = cancelled
        self._reached = 0.0

    def part(self, low: float, high: float) -> Watch:
        """What reports a stage that takes the bar from ``low`` to ``high``."""

        def tell(share: float, what: str) -> None:
            self._reached = max(self._reached, low + (high - low) * share)
            if self._progress is not None:
                self._progress(self._reached, what)

        return Watch(tell, self._cancelled)


@dataclass(frozen=True)
class Question:
    """What is asked of the sessions: which effects there are, and which of them are ``given``.

    ``alone``: the given effects without the rest of the catalogue, at the shapes found, and what fitted them.
    """

    reduction: Reduction
    catalogue: Sequence[Effect]
    given: Sequence[Effect]
    stages: Stages
    alone: tuple[Scorer, FittedModel] | None = None


@dataclass(frozen=True)
class RefinedPath:
    """A path, ``of`` effects at points of their grids, with refined shapes."""

    of: FittedModel
    scorer: Scorer
    path: list[FittedModel]

    def is_of(self, end: FittedModel) -> bool:
        """Whether a path to ``end`` would be refined from the same points."""
        return _points(self.of) == _points(end)


@dataclass(frozen=True)
class FirstStep:
    """The path of one effect at most, and the same between the points of its grid, if it has one.

    ``looked_at``: effects that were as near. ``between``: it is worth a step between those points alone.
    """

    path: list[FittedModel]
    refined: RefinedPath | None
    looked_at: Refined = field(default_factory=dict)
    between: bool = False

    @property
    def beyond_grid(self) -> frozenset[str]:
        """Nonlinear unknowns by which the effect goes between the points of its grid, and not on them.

        Of others that may go by them, too, the grids say little.
        """
        if len(self.path) != 2:
            return frozenset()  # no step was borne out by itself; one may be by those that follow
        found, on_grid = self.end.choices[-1], self.path[-1].choices[-1]
        return found.effect.law_at(found.shape) - on_grid.effect.law_at(on_grid.shape)

    @property
    def off_grid(self) -> frozenset[str]:
        """Nonlinear unknowns by which the effect may go between the points of its grid alone."""
        effect = self.path[-1].last_effect
        on_grid = (effect.law_at(i) for i in range(len(effect.shapes)))
        return frozenset(effect.shape_units).difference(*on_grid)

    def refined_of(self, evidence: Evidence) -> Refined:
        """The effect between the points of its grid, if its refinement began where the evidence has it."""
        best = evidence.best
        if self.refined is None or len(self.refined.path) != 2 or not self.refined.is_of(best):
            return {}
        return {best.last_effect.id: (self.refined.scorer, self.refined.path[-1])}

    @property
    def end(self) -> FittedModel:
        """The model it leads to, as closely as it was looked at."""
        return (self.path if self.refined is None else self.refined.path)[-1]


def _points(fitted: FittedModel) -> list[tuple[str, int]]:
    return [(c.effect.id, c.shape) for c in fitted.choices]


def first_step(question: Question, scorer: Scorer, evidence: Evidence) -> tuple[Evidence, FirstStep]:
    """The best effect, looked at between the points of its grid before others are tried beside it.

    What only its shape lacks, no other effect is asked for. Where it leaves much, those that the grid does
    not tell from it are looked at as closely: the best may be one whose grid is coarser. The evidence is that
    of what was looked at.
    """
    watch = question.stages.part(0.7, 0.72)
    effects = scorer.reduced.layout.effects
    path = forward_selection(scorer, evidence, effects, len(question.given), watch, most=1)
    if len(path) != 2:
        return evidence, _step_off_grid(question, evidence) or FirstStep(path, None)
    first = _refined_first(question, path)
    if not worth_a_further_effect(first.end):
        return evidence, first
    watch = question.stages.part(0.75, 0.77)
    weights, also = path[-1].weights, first.off_grid
    known = first.refined_of(evidence)
    resolved, found = break_ties(
        question.reduction, scorer, evidence, weights, watch, GRID_LOG_ODDS, also, known
    )
    if resolved.best is not evidence.best:
        first = _refined_first(question, [resolved.base, resolved.best], found)
    return resolved, replace(first, looked_at=found)


def _step_off_grid(question: Question, evidence: Evidence) -> FirstStep | None:
    """The best effect, where it is worth a step between the points of its grid alone; None: it is not.

    Only beside a model that is not nearly right: half-way between two points of its grid, eight degrees
    apart, a base that is tilted explained a third of what it does.
    """
    if not (evidence.candidates and lacks_fit(evidence.base, NEARLY_RIGHT)):
        return None
    if not can_refine(evidence.best.choices):
        return None
    found = _refined_first(question, [evidence.base, evidence.best])
    steps = [] if found.refined is None else found.refined.path
    return replace(found, between=True) if len(steps) == 2 and not redundant_steps(steps) else None


def _refined_first(question: Question, path: list[FittedModel], looked_at: Refined = NOTHING) -> FirstStep:
    """The path of one effect, and the same with its shape refined, if it has one."""
    if not can_refine(path[-1].choices):
        return FirstStep(path, None)
    watch = question.stages.part(0.72, 0.75)
    return FirstStep(path, refined_path(question.reduction, path, looked_at, watch))


def refined_path(
    reduction: Reduction, path: list[FittedModel], looked_at: Refined, watch: Watch
) -> RefinedPath:
    """The path with refined shapes: of one effect that was looked at, as it was found."""
    name = path[-1].last_effect.id
    if len(path) != 2 or name not in looked_at:
        return RefinedPath(path[-1], *refine_path(reduction, path, watch))
    scorer, found = looked_at[name]
    last = scorer.fit_reweighted(found.choices, found)
    base = scorer.fit(found.choices[:-1], last, FULL_ITERATIONS)
    return RefinedPath(path[-1], scorer, [scorer.score_held_out(one) for one in (base, last)])
