"""The public entry: sessions in, diagnosis out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.core.progress import SILENT, Progress, Watch
from fingerlab.diagnosis.answer.errors import equation_errors, held_out_runs
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, Fingerprint, PathStep
from fingerlab.diagnosis.answer.wording import every_parameter, explanation, parameters
from fingerlab.diagnosis.fit.weights import Weights
from fingerlab.diagnosis.gram.reduction import reduce_sessions
from fingerlab.diagnosis.gram.runs import Recall
from fingerlab.diagnosis.score.evidence import (
    RUN_LOG_ODDS,
    Evidence,
    alike,
    beside_others,
    borne_out,
    distrusted,
    least_strength,
    needed_fall,
    undetectable,
    with_undetected,
)
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import FULL_ITERATIONS, Scorer
from fingerlab.diagnosis.score.selection import LEAST_FALL_BEYOND, NEARLY_RIGHT, justified, much_left
from fingerlab.diagnosis.search.grid_refinement import (
    at_found_shapes,
    break_ties,
    can_refine,
    extend_path,
    fit_effects,
    fit_refined,
    refine_path,
    with_shapes_of,
)
from fingerlab.diagnosis.search.next_effect import judge_all, rescore
from fingerlab.diagnosis.search.path import LONGEST_PATH, forward_selection
from fingerlab.effects import effect, whole_catalogue
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Session

if TYPE_CHECKING:
    from fingerlab.diagnosis.answer.curves import Display


def diagnose(
    sessions: Sequence[Session],
    added: Sequence[str] = (),
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    with_curves: bool = True,
    executor: Executor | None = None,
    left_out: Sequence[str] = (),
) -> Diagnosis:
    """Where the model fails and which effect is missing.

    Args:
        sessions: at least one. added: ids of effects that the model holds already.
        progress: called with the share done (0 to 1) and what is being done.
        cancelled: asked now and then; True stops the calculation.
        with_curves: whether measured and modelled curves and fingerprints are wanted.
        executor: a second process (``core.parallel``) to share the reading, if no curves are wanted.
        left_out: ids that the catalogue is to be without; so it is tried what it says of the unknown.

    Raises:
        UserError: an unknown effect, nothing to analyse, a run that cannot be read.
        Cancelled: ``cancelled`` answered True.
    """
    started = time.perf_counter()
    if not sessions:
        raise UserError("No session was given; name at least one session file.")
    known = whole_catalogue()
    given = [known.get(name) or effect(name) for name in dict.fromkeys(added)]
    catalogue = [e for e in known.values() if e.id not in left_out]
    # Small matrices: several threads of linear algebra only get in each other's way.
    with threadpool_limits(limits=1, user_api="blas"):
        question = _Question(sessions, catalogue, given, _Scale(progress, cancelled), Recall(executor))
        return _diagnose(question, with_curves, started)


class _Scale:
    """Spreads the progress of the stages over one bar, which never goes back.

    How many rounds a search takes is not known before; a later round moves on from where the last one ended.
    """

    def __init__(self, progress: Progress | None, cancelled: Callable[[], bool] | None) -> None:
        self.progress = progress
        self.cancelled = cancelled
        self.reached = 0.0

    def part(self, low: float, high: float) -> Watch:
        def tell(share: float, what: str) -> None:
            self.reached = max(self.reached, low + (high - low) * share)
            if self.progress is not None:
                self.progress(self.reached, what)

        return Watch(tell, self.cancelled)


@dataclass(frozen=True)
class _Question:
    """What is asked of the sessions: which effects there are, and which of them are ``given``."""

    sessions: Sequence[Session]
    catalogue: Sequence[Effect]
    given: Sequence[Effect]
    scale: _Scale
    recall: Recall


@dataclass(frozen=True)
class _Found:
    """What the search found.

    Attributes:
        evidence: for one effect more than the model as given.
        path: models from the one as given to all that is missing.
        closer: of the second look at the path; None: there was none.
    """

    scorer: Scorer
    evidence: Evidence
    path: Sequence[FittedModel]
    closer: Scorer | None


def _diagnose(question: _Question, with_curves: bool, started: float) -> Diagnosis:
    display = _display() if with_curves else None
    if question.given:
        question = _with_closest_shapes(question)
    reduced = reduce_sessions(
        question.sessions,
        question.catalogue,
        question.scale.part(0.1 if question.given else 0.0, 0.4),
        display.keep if display is not None else None,
        question.recall,
    )
    return _told(question, _searched(question, Scorer(reduced)), display, started)


def _with_closest_shapes(question: _Question) -> _Question:
    """The same with the given effects, there and in the catalogue, at the shapes that fit best."""
    watch = question.scale.part(0.0, 0.1)
    given = at_found_shapes(fit_refined(question.sessions, question.given, watch, question.recall)[1])
    return replace(question, given=given, catalogue=with_shapes_of(question.catalogue, given))


def _searched(question: _Question, scorer: Scorer) -> _Found:
    """One effect more, then all; judged in the end under the weights of what was found last."""
    effects = scorer.reduced.layout.effects
    base = fit_effects(scorer, question.given)
    evidence = judge_all(scorer, base, effects, question.scale.part(0.4, 0.7))
    evidence, path, look = _way(question, scorer, evidence)
    evidence, weights = _judged_beside(scorer, evidence, path, effects)
    if len(path) == 1 and evidence.verdict == "missing_effect":
        evidence = distrusted(evidence)
    closer, path = _looked_at_again(question, path, look)
    if closer is not None:
        closer, path = _walked_again(question, evidence.best, closer, path)
        weights = path[-1].weights
    if closer is not None or len(path) > 2:
        # Every score of an answer is told in the floors of the same, last model.
        evidence = rescore(scorer, evidence, weights)
        path = [evidence.base, *path[1:]]
    evidence = borne_out(evidence, path[-1])
    candidates = (_unturned(scorer, evidence.base, fitted) for fitted in evidence.candidates)
    evidence = replace(
        evidence,
        base=scorer.with_sensitivity(evidence.base),
        candidates=tuple(map(scorer.with_sensitivity, candidates)),
    )
    return _Found(scorer, with_undetected(evidence), path, closer)


def _unturned(scorer: Scorer, base: FittedModel, fitted: FittedModel) -> FittedModel:
    """The model; where its effect is not seen, at a point of its grid with no effect: what hides is small."""
    *others, last = fitted.choices
    if last.effect.turns is None or justified(base, fitted):
        return fitted
    points = range(len(last.effect.shapes))
    still = [i for i in points if all(g.low <= 0.0 <= g.high for g in last.effect.gains_at(i).values())]
    fits = [scorer.fit([*others, replace(last, shape=i)], base) for i in still]
    return scorer.score_in_sample(min(fits, key=lambda t: t.fit.cost))


def _judged_beside(
    scorer: Scorer, evidence: Evidence, path: Sequence[FittedModel], effects: Sequence[Effect]
) -> tuple[Evidence, Weights]:
    """The evidence; where its best effect stood for two others, by what effects do beside the later ones.

    With the weights of the models that were compared last.
    """
    if len(path) < 3 or evidence.best.last_effect.id in path[-1].effect_ids:
        return evidence, path[-1].weights
    keep, last = len(path[0].choices), path[-1]
    others = [*last.choices[:keep], *last.choices[keep + 1 :]]
    base = scorer.score_held_out(scorer.fit(others, last, FULL_ITERATIONS))
    beside = judge_all(scorer, base, effects, SILENT)
    return beside_others(evidence, beside), beside.base.weights


@dataclass(frozen=True)
class _Look:
    """A second look at a path: which effects, at which points of their grids, and what it found."""

    choices: tuple[tuple[str, int], ...]
    scorer: Scorer
    path: list[FittedModel]


def _look(question: _Question, path: list[FittedModel], watch: Watch) -> _Look:
    return _Look(_choices(path), *refine_path(question.sessions, path, watch, question.recall))


def _choices(path: Sequence[FittedModel]) -> tuple[tuple[str, int], ...]:
    return tuple((c.effect.id, c.shape) for c in path[-1].choices)


def _way(
    question: _Question, scorer: Scorer, evidence: Evidence
) -> tuple[Evidence, list[FittedModel], _Look | None]:
    """The way from the evidence for one effect to all; and the evidence, where rivals of it were looked at.

    They are where the way ends at once: among rivals it may have taken the wrong one. The best effect is
    looked at between the points of its grid before others are tried beside it: what only its shape lacks, no
    other effect is asked for.
    """
    keep = len(question.given)
    effects, watch = scorer.reduced.layout.effects, question.scale.part(0.7, 0.88)
    path = forward_selection(scorer, evidence, effects, keep, watch, most=1)
    look = None
    if len(path) == 2 and can_refine(path[-1].choices):
        look = _look(question, path, question.scale.part(0.7, 0.75))
    if look is None or much_left(look.path[-1], LEAST_FALL_BEYOND):
        path = forward_selection(scorer, evidence, effects, keep, watch)
    if evidence.verdict != "missing_effect" or len(path) != 2:
        return evidence, path, look
    watch = question.scale.part(0.88, 0.9)
    closer = break_ties(question.sessions, scorer, evidence, path[-1].weights, watch, question.recall)
    if closer.best is evidence.best:
        return closer, path, look
    return closer, [closer.base, closer.best], look


def _looked_at_again(
    question: _Question, path: list[FittedModel], look: _Look | None
) -> tuple[Scorer | None, list[FittedModel]]:
    """The path between the points of the grids, and beyond its end; no scorer where that changes nothing.

    ``look``: what was looked at already, maybe at the same path.
    """
    if len(path) == 1 or not can_refine(path[-1].choices):
        return None, path
    sessions, scale, recall = question.sessions, question.scale, question.recall
    if look is None or look.choices != _choices(path):
        look = _look(question, path, scale.part(0.9, 0.93))
    closer, path = look.scorer, look.path
    while much_left(path[-1]) and len(path) <= LONGEST_PATH:
        longer = extend_path(sessions, question.catalogue, path, scale.part(0.93, 0.97), recall)
        if longer is None or len(longer[1]) <= len(path):  # found, but not borne out when looked at again
            break
        closer, path = longer
    return closer, path


def _walked_again(
    question: _Question, best: FittedModel, closer: Scorer, path: list[FittedModel]
) -> tuple[Scorer, list[FittedModel]]:
    """The path, or one that is likelier and begins with the ``best`` effect between the points of its grid.

    Beside an effect that stands beside its best shape, a later one may have mended the shape.
    """
    if (
        len(path) < 3
        or best.last_effect.id not in path[-1].effect_ids
        or not much_left(path[-1], NEARLY_RIGHT)
    ):
        return closer, path
    sessions, recall, watch = question.sessions, question.recall, question.scale.part(0.97, 0.99)
    first = refine_path(sessions, [path[0], best], watch, recall)[1]
    again = extend_path(sessions, question.catalogue, first, watch, recall)
    if again is None or again[0].deviance(again[1][-1]) >= closer.deviance(path[-1]):
        return closer, path
    return again


def _told(question: _Question, found: _Found, display: Display | None, started: float) -> Diagnosis:
    """The answer, as it is given to others."""
    scorer, evidence, path = found.scorer, found.evidence, found.path
    verdict = evidence.verdict
    chosen = alike(evidence) if verdict == "missing_effect" else []
    if verdict == "nothing_missing":
        chosen = undetectable(evidence)
    curves = display.curves(scorer.reduced, evidence) if display is not None else None
    first = found.closer.with_sensitivity(path[1]) if found.closer is not None else None
    loose = sum(f.slack_samples for g in scorer.reduced.groups for f in g.folds)
    candidates = _candidates(evidence, chosen, loose, curves.fingerprints if curves else {}, first)
    return Diagnosis(
        sessions=tuple(str(s.path) for s in question.sessions),
        model=tuple(e.id for e in question.given),
        errors=equation_errors(scorer.reduced, evidence.base),
        score=evidence.base.score,
        verdict=verdict,
        candidates=candidates,
        set=tuple(evidence.candidates[i].last_effect.id for i in chosen),
        path=tuple(PathStep(_last(s) if k else None, s.score) for k, s in enumerate(path)),
        final_model=tuple(path[-1].effect_ids),
        next_experiment=_next_experiment(question.sessions, scorer, evidence, chosen),
        seconds=time.perf_counter() - started,
        probability_nothing=evidence.nothing,
        probability_unknown=evidence.unknown,
        parameters=every_parameter(evidence.base, evidence.temperature),
        final_parameters=every_parameter(path[-1], evidence.temperature),
        comparisons=curves.comparisons if curves else (),
        failure=curves.failure if curves else None,
        held_out=held_out_runs(question.sessions, scorer.reduced, evidence.base),
        repeats=all(group.repeats for group in scorer.reduced.groups),
    )


def _display() -> Display:
    # Imported when it is wanted: who asks for numbers alone should not wait for it.
    from fingerlab.diagnosis.answer.curves import Display

    return Display()


def _next_experiment(
    sessions: Sequence[Session], scorer: Scorer, evidence: Evidence, chosen: Sequence[int]
) -> dict[str, Any] | None:
    """The run that would separate the effects of the set, or show those that could not be seen; or None."""
    verdict = evidence.verdict
    if verdict == "missing_effect":
        chosen = alike(evidence, -RUN_LOG_ODDS)
    if verdict == "not_in_catalogue" or len(chosen) < (2 if verdict == "missing_effect" else 1):
        return None
    from fingerlab.diagnosis.experiment.proposal import propose, reveal

    return (propose if verdict == "missing_effect" else reveal)(sessions, scorer, evidence, chosen)


def _last(fitted: FittedModel) -> str | None:
    return fitted.last_effect.id if fitted.choices else None


def _candidates(
    evidence: Evidence,
    chosen: Sequence[int],
    loose: int,
    prints: Mapping[str, Fingerprint],
    closer: FittedModel | None,
) -> tuple[Candidate, ...]:
    """What is told of every effect; of the first that was added, as a second look finds it."""
    result = []
    posterior = evidence.posterior
    order = sorted(
        range(len(evidence.candidates)), key=lambda i: (-posterior[i], evidence.candidates[i].misfit)
    )
    for i in order:
        fitted = evidence.candidates[i]
        if closer is not None and _last(closer) == _last(fitted):
            fitted = closer
        one = fitted.last_effect
        least = least_strength(fitted, needed_fall(evidence, fitted))
        shown = loose > 0 if one.special == "slack" else least <= 1.0
        shown = shown or justified(evidence.base, fitted)
        result.append(
            Candidate(
                effect=one.id,
                title=one.title,
                score=fitted.score,
                probability=float(posterior[i]),
                in_set=i in chosen,
                parameters=parameters(fitted, one, evidence.temperature),
                equations=one.acts_on,
                explanation=explanation(evidence, fitted, one, shown, least),
                detectable=shown,
                fingerprint=prints.get(one.id),
            )
        )
    return tuple(result)
