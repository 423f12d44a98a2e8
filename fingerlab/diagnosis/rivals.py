"""Effects that a search could not tell apart, each looked at again: between the points of its own grid.

On its grid a true law may leave as much as a wrong one that happens to lie on a better point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fingerlab.diagnosis.evidence import Evidence, alike, shares_of
from fingerlab.diagnosis.odds import USUAL_LEFT, among
from fingerlab.diagnosis.path import density
from fingerlab.diagnosis.recall import Recall
from fingerlab.diagnosis.second_look import look_again, worth_a_look
from fingerlab.diagnosis.study import FULL_ITERATIONS, Study
from fingerlab.diagnosis.trial import Trial
from fingerlab.diagnosis.watch import Watch
from fingerlab.diagnosis.weighing import Weights
from fingerlab.sessions.model import Session

MOST_RIVALS = 3
"""So many of a set are looked at again, the likeliest first."""


def looked_at_closely(
    sessions: Sequence[Session],
    study: Study,
    evidence: Evidence,
    watch: Watch,
    recall: Recall | None = None,
) -> Evidence:
    """The evidence with the odds of the best effects among each other as a second look at each finds them.

    Unchanged where one is alone, where the best leaves no more than every model does, or where no shape of
    any is left to look at.

    Raises:
        Cancelled: the user asked for it.
    """
    rivals = alike(evidence)[:MOST_RIVALS]
    trials = [evidence.trials[i] for i in rivals]
    if len(rivals) < 2 or evidence.least_left <= USUAL_LEFT:
        return evidence
    if not any(worth_a_look(t.model.choices) for t in trials):
        return evidence
    log_odds = evidence.log_odds.copy()
    log_odds[rivals] = among(evidence.base, _seen_closely(sessions, study, trials, watch, recall))
    found = float(evidence.probabilities.sum())
    return replace(evidence, log_odds=log_odds, probabilities=found * shares_of(log_odds))


@dataclass(frozen=True)
class _Look:
    """A trial as a second look finds it: in which study, with its own weights, and its density there."""

    study: Study
    trial: Trial
    weights: Weights
    density: float


def _seen_closely(
    sessions: Sequence[Session], study: Study, trials: Sequence[Trial], watch: Watch, recall: Recall | None
) -> list[Trial]:
    """Every trial as a second look finds it, held out, all in the floors of the likeliest."""
    kept = study.weights
    looks = [_look(sessions, study, trial, watch, recall) for trial in trials]
    likeliest = min(looks, key=lambda look: look.density)
    seen = [_scored(look, likeliest.weights) for look in looks]
    study.weights = kept
    return seen


def _look(
    sessions: Sequence[Session], study: Study, trial: Trial, watch: Watch, recall: Recall | None
) -> _Look:
    if worth_a_look(trial.model.choices):
        study, trial = look_again(sessions, trial.model.choices, watch, recall)
    else:
        trial = study.settle(trial.model.choices, trial)
    return _Look(study, trial, study.weights, density(study, trial))


def _scored(look: _Look, weights: Weights) -> Trial:
    look.study.weights = weights
    return look.study.hold_out(look.study.fit(look.trial.model.choices, look.trial, FULL_ITERATIONS))
