"""From misfits on held-out runs to probabilities: nothing missing, an effect, or something unknown.

``steps`` says what an effect must explain at all, ``odds`` which of several it is, ``unseen`` which could be
there without showing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.diagnosis.odds import among
from fingerlab.diagnosis.steps import (
    DECIDING_LOG_ODDS,
    charge,
    contact_charge,
    least_explained,
    temperature,
)
from fingerlab.diagnosis.trial import Trial
from fingerlab.sessions.model import Array

UNKNOWN_SHARE = 0.65
"""An effect outside the catalogue is thought to explain this share of the misfit."""
UNKNOWN_LEAST = 0.5
"""... and is not thought of where the squared score is above one by less than about this: a misfit that small
comes from what every bench does a little (rubbing at the fingertip, joints that stick)."""
UNKNOWN_LEAST_BEYOND = 6.0
"""The same for a model that holds an effect already, whose own law is never quite the plant's."""
PRIOR_NOTHING, PRIOR_UNKNOWN, PRIOR_EFFECTS = 0.5, 0.05, 0.45
SET_PROBABILITY = 0.95
SET_LOG_ODDS = 3.0
"""An effect is in the set when its log odds against the best are above minus this (odds of about 1 to 20)."""
RUN_LOG_ODDS = float(np.log(100.0))
"""A run is proposed until the best is a hundred times likelier than the next: what a law lacks, or a tip does
that no law here tells, moves odds by several."""


@dataclass(frozen=True)
class Evidence:
    """Judged hypotheses: the trials with their probabilities, and the two other verdicts."""

    base: Trial
    trials: tuple[Trial, ...]
    probabilities: Array  # (trials,)
    log_odds: Array  # (trials,), against the best trial
    nothing: float
    unknown: float
    temperature: float
    logs: Array
    """Log weights of an effect of the catalogue, nothing, and something unknown, (3,): also where the others
    are too unlikely beside one of them to have a probability."""
    least_left: float = 0.0
    """Misfit of each value that the best trial left when all were judged; later it may be fitted closer."""
    unseen: Array = field(default_factory=lambda: np.zeros(0))
    """Probabilities of effects that are not found because they could not show, (trials,); see ``unseen``."""
    factors: Array = field(default_factory=lambda: np.zeros(0))
    """How much likelier the data are with a plausible strength of each effect than with none, (trials,)."""

    @property
    def for_an_effect(self) -> float:
        """Log odds that an effect of the catalogue is missing rather than nothing."""
        return float(self.logs[0] - self.logs[1])

    @property
    def told(self) -> Array:
        """Probability of each trial's last effect, seen or unseen, (trials,)."""
        return self.probabilities + self.unseen if len(self.unseen) else self.probabilities


def judge(base: Trial, trials: Sequence[Trial]) -> Evidence:
    """Probabilities of "nothing missing", of every trial's last effect, and of something unknown.

    Args:
        base: the model as given. trials: the model with one effect more, each; all scored on held-out runs
            where they could matter.
    """
    zero, count = max(base.misfit, 0.0), base.count
    charged = np.array([t.misfit + charge(base, t) for t in trials])
    heat = temperature(min((t.misfit for t in trials), default=zero), count)
    in_contact = contact_charge(base, trials[int(np.argmin(charged))]) if len(trials) else 0.0
    tolerated = zero - least_explained(base, zero, count, in_contact)
    effects = -0.5 * charged / heat + np.log(PRIOR_EFFECTS / max(len(trials), 1))
    nothing = -0.5 * tolerated / heat + np.log(PRIOR_NOTHING)
    least_unknown = UNKNOWN_LEAST_BEYOND if base.model.choices else UNKNOWN_LEAST
    unexplained = (1.0 - UNKNOWN_SHARE) * zero + least_unknown * count + 2 * DECIDING_LOG_ODDS * heat
    unknown = -0.5 * unexplained / heat + np.log(PRIOR_UNKNOWN)
    logs = np.array([np.logaddexp.reduce(effects), nothing, unknown])
    log_odds = among(base, trials)
    least_left = max(float(min(charged, default=zero)), 0.0) / max(count, 1.0)
    found, none, other = _shared(logs)
    shares = found * shares_of(log_odds)
    return Evidence(base, tuple(trials), shares, log_odds, none, other, heat, logs, least_left)


def _shared(logs: Array) -> tuple[float, float, float]:
    """Probabilities of an effect of the catalogue, nothing, and something unknown by their log weights."""
    weights = np.exp(logs - logs.max())
    found, none, other = map(float, weights / weights.sum())
    return found, none, other


def shares_of(log_odds: Array) -> Array:
    """Probability of each effect if one of them is missing, (trials,)."""
    shares = np.exp(log_odds)
    return np.asarray(shares / max(float(shares.sum()), 1.0))


def against_nothing(base: Trial, misfit: float, left: float, count: float) -> float:
    """Log odds of one of many effects against none, by the misfit without it and with it."""
    fall = misfit - least_explained(base, misfit, count) - left
    return 0.5 * fall / temperature(left, count) + float(np.log(PRIOR_EFFECTS / PRIOR_NOTHING))


IMPOSSIBLE = -700.0
"""Log odds that leave no probability."""
NOT_BORNE_OUT = 0.05
"""Share of their probability that effects keep when adding the best of them is no justified step."""


def distrusted(evidence: Evidence) -> Evidence:
    """The evidence when the held-out runs do not bear the best step out under the weights of either model."""
    kept = evidence.probabilities * NOT_BORNE_OUT
    rest = float(evidence.probabilities.sum() - kept.sum())
    others = max(evidence.nothing + evidence.unknown, 1e-300)
    share = evidence.nothing / others if evidence.unknown > evidence.nothing else 1.0
    return replace(
        evidence,
        probabilities=kept,
        nothing=evidence.nothing + share * rest,
        unknown=evidence.unknown + (1.0 - share) * rest,
    )


def borne_out(evidence: Evidence, last: Trial) -> Evidence:
    """The evidence when steps of which each is justified lead from the base to ``last``.

    What one effect leaves and others of the catalogue explain is no sign of something outside of it.
    """
    beyond = len(last.model.choices) - len(evidence.base.model.choices) - 1
    if beyond < 1 or not evidence.trials:
        return evidence
    best = min(t.misfit for t in evidence.trials)
    further = beyond * (np.log(PRIOR_EFFECTS / len(evidence.trials)) - DECIDING_LOG_ODDS)
    gain = 0.5 * (best - last.misfit) / evidence.temperature + further
    if gain <= 0.0:
        return evidence
    logs = evidence.logs + np.array([gain, 0.0, 0.0])
    found, none, other = _shared(logs)
    shares = found * shares_of(evidence.log_odds)
    return replace(evidence, probabilities=shares, nothing=none, unknown=other, logs=logs)


def beside_others(evidence: Evidence, beside: Evidence) -> Evidence:
    """The evidence, and which effect it is by what each does ``beside`` others that are missing, too.

    Those others are in the models of ``beside``, and are none of the answers.
    """
    known = {
        t.model.choices[-1].effect.id: odds for t, odds in zip(beside.trials, beside.log_odds, strict=True)
    }
    told = [known.get(t.model.choices[-1].effect.id, IMPOSSIBLE) for t in evidence.trials]
    log_odds = np.array(told) - max(told)
    shares = float(evidence.probabilities.sum()) * shares_of(log_odds)
    return replace(evidence, probabilities=shares, log_odds=log_odds)


def alike(evidence: Evidence, least: float = -SET_LOG_ODDS) -> list[int]:
    """Indices of the trials that these data cannot tell apart, best first: log odds not below ``least``."""
    order = np.argsort(-evidence.probabilities, kind="stable")
    total = evidence.probabilities.sum()
    chosen: list[int] = []
    covered = 0.0
    for i in order:
        enough = total > 0 and covered / total >= SET_PROBABILITY
        if enough and evidence.log_odds[i] < least:
            continue
        chosen.append(int(i))
        covered += float(evidence.probabilities[i])
    return chosen
