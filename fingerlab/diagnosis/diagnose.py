"""The public entry: sessions in, diagnosis out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.core.progress import SILENT, Progress, Watch
from fingerlab.diagnosis.answer.errors import equation_errors, held_out_runs
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, Fingerprint, PathStep, Verdict
from fingerlab.diagnosis.answer.wording import every_parameter, explanation, parameters
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.evidence import (
    RUN_LOG_ODDS,
    Evidence,
    alike,
    beside_others,
    borne_out,
    distrusted,
    hidden,
    least_strength,
    needed,
    unseen,
)
from fingerlab.diagnosis.score.fitted_model import Trial
from fingerlab.diagnosis.score.scorer import FULL_ITERATIONS, Study
from fingerlab.diagnosis.score.selection import LEAST_FALL_BEYOND, NEARLY_RIGHT, justified, much_left
from fingerlab.diagnosis.search.grid_refinement import (
    closely,
    closest,
    look_again_along,
    look_beyond,
    looked_at_closely,
    settled,
    shaped_like,
    worth_a_look,
)
from fingerlab.diagnosis.search.next_effect import rescore, weigh
from fingerlab.diagnosis.search.path import LONGEST_PATH, density, forward
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
    kept: Reduction | None = None,
) -> Diagnosis:
    """Where the model fails and which effect is missing.

    Args:
        sessions: at least one. added: ids of effects that the model holds already.
        progress: called with the share done (0 to 1) and what is being done.
        cancelled: asked now and then; True stops the calculation.
        with_curves: whether measured and modelled curves and fingerprints are wanted.
        executor: a second process (``core.parallel``) to share the reading, if no curves are wanted.
        left_out: ids that the catalogue is to be without; so it is tried what it says of the unknown.
        kept: what an earlier diagnosis of these sessions was given; their runs are not read again.

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
        reduction = kept or Reduction(sessions, executor)
        question = _Question(catalogue, given, _Scale(progress, cancelled), reduction)
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

    catalogue: Sequence[Effect]
    given: Sequence[Effect]
    scale: _Scale
    reduction: Reduction


@dataclass(frozen=True)
class _Found:
    """What the search found.

    Attributes:
        evidence: for one effect more than the model as given.
        path: models from the one as given to all that is missing.
        closer: of the second look at the path; None: there was none.
    """

    study: Study
    evidence: Evidence
    path: Sequence[Trial]
    closer: Study | None


def _diagnose(question: _Question, with_curves: bool, started: float) -> Diagnosis:
    display = _display() if with_curves else None
    question.reduction.begin(question.catalogue, question.scale.part(0.0, 0.2), read=bool(question.given))
    if question.given:
        question = _with_closest_shapes(question)
    reduced = question.reduction.of(
        question.catalogue,
        question.scale.part(0.25 if question.given else 0.0, 0.4),
        display.keep if display is not None else None,
    )
    return _told(question, _searched(question, Study(reduced)), display, started)


def _with_closest_shapes(question: _Question) -> _Question:
    """The same with the given effects, there and in the catalogue, at the shapes that fit best."""
    watch = question.scale.part(0.2, 0.25)
    given = closest(closely(question.reduction, question.given, watch)[1])
    return replace(question, given=given, catalogue=shaped_like(question.catalogue, given))


def _searched(question: _Question, study: Study) -> _Found:
    """One effect more, then all; judged in the end under the weights of what was found last."""
    effects = study.reduced.layout.effects
    base = settled(study, question.given)
    evidence = weigh(study, base, effects, question.scale.part(0.4, 0.7))
    first_weights = study.weights
    evidence, path, look = _way(question, study, evidence)
    evidence = _judged_beside(study, evidence, path, effects)
    if len(path) == 1 and _verdict(evidence) == "missing_effect":
        evidence = distrusted(evidence)
    closer, path = _looked_at_again(question, path, look)
    if closer is not None:
        closer, path = _walked_again(question, _best(evidence), closer, path)
    if closer is not None:
        study.weights = closer.weights
    if closer is not None or len(path) > 2:
        # Every score of an answer is told in the floors of the same, last model.
        evidence = rescore(study, evidence)
        path = [evidence.base, *path[1:]]
    else:
        study.weights = first_weights
    evidence = borne_out(evidence, path[-1])
    trials = (_unturned(study, evidence.base, trial) for trial in evidence.trials)
    evidence = replace(evidence, base=study.told(evidence.base), trials=tuple(map(study.told, trials)))
    return _Found(study, unseen(evidence), path, closer)


def _unturned(study: Study, base: Trial, trial: Trial) -> Trial:
    """The trial; where its effect is not seen, at a point of its grid with no effect: what hides is small."""
    *others, last = trial.model.choices
    if last.effect.turns is None or justified(base, trial):
        return trial
    points = range(len(last.effect.shapes))
    still = [i for i in points if all(g.low <= 0.0 <= g.high for g in last.effect.gains_at(i).values())]
    fits = [study.fit([*others, replace(last, shape=i)], base) for i in still]
    return study.count(min(fits, key=lambda t: t.fit.cost))


def _judged_beside(
    study: Study, evidence: Evidence, path: Sequence[Trial], effects: Sequence[Effect]
) -> Evidence:
    """The evidence; where its best effect stood for two others, by what effects do beside the later ones."""
    if len(path) < 3:
        return evidence
    best = _last(_best(evidence))
    if best in {c.effect.id for c in path[-1].model.choices}:
        return evidence
    keep, last = len(path[0].model.choices), path[-1]
    others = [*last.model.choices[:keep], *last.model.choices[keep + 1 :]]
    base = study.hold_out(study.fit(others, last, FULL_ITERATIONS))
    return beside_others(evidence, weigh(study, base, effects, SILENT))


@dataclass(frozen=True)
class _Look:
    """A second look at a path: which effects, at which points of their grids, and what it found."""

    choices: tuple[tuple[str, int], ...]
    study: Study
    path: list[Trial]


def _look(question: _Question, path: list[Trial], watch: Watch) -> _Look:
    return _Look(_choices(path), *look_again_along(question.reduction, path, watch))


def _choices(path: Sequence[Trial]) -> tuple[tuple[str, int], ...]:
    return tuple((c.effect.id, c.shape) for c in path[-1].model.choices)


def _way(question: _Question, study: Study, evidence: Evidence) -> tuple[Evidence, list[Trial], _Look | None]:
    """The way from the evidence for one effect to all; and the evidence, where rivals of it were looked at.

    They are where the way ends at once: among rivals it may have taken the wrong one. The best effect is
    looked at between the points of its grid before others are tried beside it: what only its shape lacks, no
    other effect is asked for.
    """
    first_weights, keep = study.weights, len(question.given)
    effects, watch = study.reduced.layout.effects, question.scale.part(0.7, 0.88)
    path = forward(study, evidence, effects, keep, watch, most=1)
    look = None
    if len(path) == 2 and worth_a_look(path[-1].model.choices):
        look = _look(question, path, question.scale.part(0.7, 0.75))
    if look is None or much_left(look.path[-1], LEAST_FALL_BEYOND):
        study.weights = first_weights
        path = forward(study, evidence, effects, keep, watch)
    if _verdict(evidence) != "missing_effect" or len(path) != 2:
        return evidence, path, look
    watch = question.scale.part(0.88, 0.9)
    closer = looked_at_closely(question.reduction, study, evidence, watch)
    if _best(closer) is _best(evidence):
        return closer, path, look
    study.weights = first_weights
    return closer, [closer.base, _best(closer)], look


def _best(evidence: Evidence) -> Trial:
    return evidence.trials[int(np.argmax(evidence.log_odds))]


def _looked_at_again(
    question: _Question, path: list[Trial], look: _Look | None
) -> tuple[Study | None, list[Trial]]:
    """The path between the points of the grids, and beyond its end; no study where that changes nothing.

    ``look``: what was looked at already, maybe at the same path.
    """
    if len(path) == 1 or not worth_a_look(path[-1].model.choices):
        return None, path
    reduction, scale = question.reduction, question.scale
    if look is None or look.choices != _choices(path):
        look = _look(question, path, scale.part(0.9, 0.93))
    closer, path = look.study, look.path
    while much_left(path[-1]) and len(path) <= LONGEST_PATH:
        longer = look_beyond(reduction, question.catalogue, path, scale.part(0.93, 0.97))
        if longer is None or len(longer[1]) <= len(path):  # found, but not borne out when looked at again
            break
        closer, path = longer
    return closer, path


def _walked_again(
    question: _Question, best: Trial, closer: Study, path: list[Trial]
) -> tuple[Study, list[Trial]]:
    """The path, or one that is likelier and begins with the ``best`` effect between the points of its grid.

    Beside an effect that stands beside its best shape, a later one may have mended the shape.
    """
    found = {c.effect.id for c in path[-1].model.choices}
    if len(path) < 3 or _last(best) not in found or not much_left(path[-1], NEARLY_RIGHT):
        return closer, path
    reduction, watch = question.reduction, question.scale.part(0.97, 0.99)
    first = look_again_along(reduction, [path[0], best], watch)[1]
    again = look_beyond(reduction, question.catalogue, first, watch)
    if again is None or density(again[0], again[1][-1]) >= density(closer, path[-1]):
        return closer, path
    return again


def _told(question: _Question, found: _Found, display: Display | None, started: float) -> Diagnosis:
    """The answer, as it is given to others."""
    study, evidence, path = found.study, found.evidence, found.path
    verdict = _verdict(evidence)
    chosen = alike(evidence) if verdict == "missing_effect" else []
    if verdict == "nothing_missing":
        chosen = hidden(evidence)
    curves = display.curves(study, evidence) if display is not None else None
    first = found.closer.told(path[1]) if found.closer is not None else None
    loose = sum(f.slack_samples for g in study.reduced.groups for f in g.folds)
    candidates = _candidates(evidence, chosen, loose, curves.fingerprints if curves else {}, first)
    return Diagnosis(
        sessions=tuple(str(s.path) for s in question.reduction.sessions),
        model=tuple(e.id for e in question.given),
        errors=equation_errors(study, evidence.base),
        score=evidence.base.score,
        verdict=verdict,
        candidates=candidates,
        set=tuple(evidence.trials[i].model.choices[-1].effect.id for i in chosen),
        path=tuple(PathStep(_last(s) if k else None, s.score) for k, s in enumerate(path)),
        final_model=tuple(c.effect.id for c in path[-1].model.choices),
        next_experiment=_next_experiment(question.reduction.sessions, study, evidence, chosen),
        seconds=time.perf_counter() - started,
        probability_nothing=evidence.nothing,
        probability_unknown=evidence.unknown,
        parameters=every_parameter(evidence.base, evidence.temperature),
        final_parameters=every_parameter(path[-1], evidence.temperature),
        comparisons=curves.comparisons if curves else (),
        failure=curves.failure if curves else None,
        held_out=held_out_runs(question.reduction.sessions, study.reduced, evidence.base),
        repeats=all(group.repeats for group in study.reduced.groups),
    )


def _display() -> Display:
    # Imported when it is wanted: who asks for numbers alone should not wait for it.
    from fingerlab.diagnosis.answer.curves import Display

    return Display()


def _next_experiment(
    sessions: Sequence[Session], study: Study, evidence: Evidence, chosen: Sequence[int]
) -> dict[str, Any] | None:
    """The run that would separate the effects of the set, or show those that could not be seen; or None."""
    verdict = _verdict(evidence)
    if verdict == "missing_effect":
        chosen = alike(evidence, -RUN_LOG_ODDS)
    if verdict == "not_in_catalogue" or len(chosen) < (2 if verdict == "missing_effect" else 1):
        return None
    from fingerlab.diagnosis.experiment.proposal import propose, reveal

    return (propose if verdict == "missing_effect" else reveal)(sessions, study, evidence, chosen)


def _last(trial: Trial) -> str | None:
    return trial.model.choices[-1].effect.id if trial.model.choices else None


def _verdict(evidence: Evidence) -> Verdict:
    found = float(np.sum(evidence.probabilities))
    if evidence.nothing >= max(found, evidence.unknown):
        return "nothing_missing"
    return "missing_effect" if found >= evidence.unknown else "not_in_catalogue"


def _candidates(
    evidence: Evidence,
    chosen: Sequence[int],
    loose: int,
    prints: Mapping[str, Fingerprint],
    closer: Trial | None,
) -> tuple[Candidate, ...]:
    """What is told of every effect; of the first that was added, as a second look finds it."""
    result = []
    told = evidence.told
    order = sorted(range(len(evidence.trials)), key=lambda i: (-told[i], evidence.trials[i].misfit))
    for i in order:
        trial = evidence.trials[i]
        if closer is not None and _last(closer) == _last(trial):
            trial = closer
        one = trial.model.choices[-1].effect
        least = least_strength(trial, needed(evidence, trial))
        shown = loose > 0 if one.special == "slack" else least <= 1.0
        shown = shown or justified(evidence.base, trial)
        result.append(
            Candidate(
                effect=one.id,
                title=one.title,
                score=trial.score,
                probability=float(told[i]),
                in_set=i in chosen,
                parameters=parameters(trial, one, evidence.temperature),
                equations=one.acts_on,
                explanation=explanation(evidence, trial, one, shown, least),
                detectable=shown,
                fingerprint=prints.get(one.id),
            )
        )
    return tuple(result)
