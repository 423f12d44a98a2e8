"""The public entry: sessions in, diagnosis out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from fingerlab.errors import UserError
from fingerlab.identify.diagnosis.errors import equation_errors
from fingerlab.identify.diagnosis.evidence import (
    Evidence,
    alike,
    borne_out,
    distrusted,
    hidden,
    justified,
    much_left,
    needed,
    unseen,
)
from fingerlab.identify.diagnosis.recall import Recall
from fingerlab.identify.diagnosis.reduction import reduce_sessions
from fingerlab.identify.diagnosis.search import LONGEST_PATH, forward, rescore, weigh
from fingerlab.identify.diagnosis.second_look import (
    closely,
    closest,
    look_again_along,
    look_beyond,
    settled,
    worth_a_look,
)
from fingerlab.identify.diagnosis.study import Study, Trial
from fingerlab.identify.diagnosis.unseen import least_strength
from fingerlab.identify.diagnosis.watch import Progress, Watch
from fingerlab.identify.diagnosis.wording import Z90, deviations, explanation, parameters
from fingerlab.identify.results import Candidate, Diagnosis, Fingerprint, ParameterEstimate, PathStep, Verdict
from fingerlab.physics.effects import effect, whole_catalogue
from fingerlab.physics.effects.base import Effect
from fingerlab.sessions.model import Session

if TYPE_CHECKING:
    from fingerlab.identify.diagnosis.display import Display


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
        executor: a second process (``fingerlab.parallel``) to share the reading, if no curves are wanted.
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
        return _diagnose(
            sessions, catalogue, given, _Scale(progress), cancelled, with_curves, Recall(executor), started
        )


class _Scale:
    """Spreads the progress of the stages over one bar, which never goes back.

    How many rounds a search takes is not known before; a later round moves on from where the last one ended.
    """

    def __init__(self, progress: Progress | None) -> None:
        self.progress = progress
        self.reached = 0.0

    def part(self, low: float, high: float) -> Progress:
        def tell(share: float, what: str) -> None:
            self.reached = max(self.reached, low + (high - low) * share)
            if self.progress is not None:
                self.progress(self.reached, what)

        return tell


def _diagnose(
    sessions: Sequence[Session],
    catalogue: Sequence[Effect],
    given: Sequence[Effect],
    scale: _Scale,
    cancelled: Callable[[], bool] | None,
    with_curves: bool,
    recall: Recall,
    started: float,
) -> Diagnosis:
    display = _display() if with_curves else None
    if given:
        given = closest(closely(sessions, given, scale.part(0.0, 0.1), cancelled, recall)[1])
        catalogue = [next((g for g in given if g.id == e.id), e) for e in catalogue]
    reduced = reduce_sessions(
        sessions,
        catalogue,
        scale.part(0.1 if given else 0.0, 0.4),
        cancelled,
        display.keep if display is not None else None,
        recall,
    )
    effects = reduced.layout.effects
    study = Study(reduced)
    watch = Watch(scale.part(0.4, 0.7), cancelled)
    base = settled(study, given)
    evidence = weigh(study, base, effects, watch)
    first_weights = study.weights
    path = forward(study, evidence, effects, len(given), Watch(scale.part(0.7, 0.9), cancelled))
    if len(path) == 1 and _verdict(evidence) == "missing_effect":
        evidence = distrusted(evidence)
    closer: Study | None = None
    if len(path) > 1 and worth_a_look(path[-1].model.choices):
        closer, path = look_again_along(sessions, path, scale.part(0.9, 0.93), cancelled, recall)
        while much_left(path[-1]) and len(path) <= LONGEST_PATH:
            beyond = Watch(scale.part(0.93, 0.97), cancelled)
            longer = look_beyond(sessions, catalogue, path, beyond, recall)
            if longer is None or len(longer[1]) <= len(path):  # found, but not borne out when looked at again
                break
            closer, path = longer
        study.weights = closer.weights
    if closer is not None or len(path) > 2:
        # Every score of an answer is told in the floors of the same, last model.
        evidence = rescore(study, evidence)
        path = [evidence.base, *path[1:]]
    else:
        study.weights = first_weights
    evidence = borne_out(evidence, path[-1])
    loose = sum(f.slack_samples for g in reduced.groups for f in g.folds)
    evidence = replace(
        evidence, base=study.told(evidence.base), trials=tuple(map(study.told, evidence.trials))
    )
    evidence = unseen(evidence)
    verdict = _verdict(evidence)
    chosen = alike(evidence) if verdict == "missing_effect" else []
    if verdict == "nothing_missing":
        chosen = hidden(evidence)
    curves = display.curves(study, evidence) if display is not None else None
    first = closer.told(path[1]) if closer is not None else None
    candidates = _candidates(evidence, chosen, loose, curves.fingerprints if curves else {}, first)
    return Diagnosis(
        sessions=tuple(str(s.path) for s in sessions),
        model=tuple(e.id for e in given),
        errors=equation_errors(study, evidence.base),
        score=evidence.base.score,
        verdict=verdict,
        candidates=candidates,
        set=tuple(evidence.trials[i].model.choices[-1].effect.id for i in chosen),
        path=tuple(PathStep(_last(s) if k else None, s.score) for k, s in enumerate(path)),
        final_model=tuple(c.effect.id for c in path[-1].model.choices),
        next_experiment=_next_experiment(sessions, study, evidence, chosen),
        seconds=time.perf_counter() - started,
        probability_nothing=evidence.nothing,
        probability_unknown=evidence.unknown,
        parameters=_model_parameters(evidence.base, evidence.temperature),
        final_parameters=_model_parameters(path[-1], evidence.temperature),
        comparisons=curves.comparisons if curves else (),
        failure=curves.failure if curves else None,
    )


def _display() -> Display:
    # Imported when it is wanted: who asks for numbers alone should not wait for it.
    from fingerlab.identify.diagnosis.display import Display

    return Display()


def _next_experiment(
    sessions: Sequence[Session], study: Study, evidence: Evidence, chosen: Sequence[int]
) -> dict[str, Any] | None:
    """The run that would separate the effects of the set, or show those that could not be seen; or None."""
    verdict = _verdict(evidence)
    if verdict == "not_in_catalogue" or len(chosen) < (2 if verdict == "missing_effect" else 1):
        return None
    from fingerlab.identify.diagnosis.next_experiment import propose, reveal

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


def _model_parameters(trial: Trial, heat: float) -> dict[str, ParameterEstimate]:
    spread = deviations(trial, heat)
    return {
        u.key: ParameterEstimate(
            float(v), u.gain.unit, float(v) - Z90 * spread[u.key], float(v) + Z90 * spread[u.key]
        )
        for u, v in zip(trial.model.unknowns, trial.fit.values, strict=True)
    }
