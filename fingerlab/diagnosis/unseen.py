"""Effects that could be there all the same: what these data could not have shown.

Where even a plausible strength changes the held-out misfit by less than a verdict needs (see ``reach``),
"nothing is missing" is no answer about that effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fingerlab.diagnosis.evidence import PRIOR_EFFECTS, PRIOR_NOTHING, Evidence
from fingerlab.diagnosis.steps import (
    CONTACT_CHARGE,
    CONTACT_SHARE,
    DECIDING_LOG_ODDS,
    charge,
    least_explained,
)
from fingerlab.diagnosis.trial import Trial

WEAKEST, STRONGEST = 0.5, 2.0
"""Multiples of its typical strength between which an effect that is there is thought to lie, evenly in their
logarithm; assumed."""
MOST_ODDS = float(np.exp(2.0))
"""What is below a verdict's threshold speaks for an effect by at most this factor; assumed."""
AS_LIKELY = np.exp(-1.0)
"""An effect of which the data say that it is less likely by more than this factor has not stayed unseen."""
MOST_UNSEEN = 0.95
"""Effects that were not seen are together less likely than nothing."""


def unseen(evidence: Evidence) -> Evidence:
    """The evidence with a share for every effect that these data could not have shown.

    A cable that was never slack has shown that it was not.
    """
    base = evidence.base
    factors = []
    for trial in evidence.trials:
        if trial.model.choices[-1].effect.special == "slack":
            factors.append(0.0)
        else:
            fall = base.misfit_in_sample - trial.misfit_in_sample - charge(base, trial)
            factors.append(bayes_factor(trial, fall, needed(evidence, trial)))
    prior = PRIOR_EFFECTS / max(len(factors), 1) / PRIOR_NOTHING
    return with_unseen(evidence, factors, prior)


def needed(evidence: Evidence, trial: Trial) -> float:
    """By how much the misfit must fall for a trial's last effect to be told, beside the best model found."""
    base = evidence.base
    remaining = min([base.misfit, *(t.misfit for t in evidence.trials)])
    in_contact = CONTACT_CHARGE if _reaches_contact_alone(trial) else 0.0
    least = least_explained(base, remaining, base.count) + in_contact * base.count
    return max(least, 2.0 * DECIDING_LOG_ODDS * evidence.temperature)


def _reaches_contact_alone(trial: Trial) -> bool:
    falls = trial.reach.falls
    return bool(len(falls)) and float(falls[trial.touching].sum()) > CONTACT_SHARE * float(falls.sum())


def with_unseen(evidence: Evidence, factors: Sequence[float], prior: float) -> Evidence:
    """The evidence with a share of "nothing missing" given to effects that the data could not have shown.

    Args:
        factors: of every trial, its likelihood against that of nothing. prior: odds of one effect against
            nothing before anything was seen.
    """
    odds = np.minimum(prior * np.asarray(factors), 1.0)
    odds *= min(1.0, MOST_UNSEEN / max(float(odds.sum()), 1e-300))
    nothing = evidence.nothing / (1.0 + float(odds.sum()))
    return replace(evidence, nothing=nothing, unseen=odds * nothing, factors=np.asarray(factors))


def bayes_factor(trial: Trial, fall: float, needed: float) -> float:
    """How much likelier what was seen is with the effect at a plausible strength than with nothing.

    The likelihood of a strength is taken as normal about the one that the ``fall`` of the misfit stands for,
    and as wide as makes the least strength that shows decide.
    """
    least = least_strength(trial, needed)
    if not np.isfinite(least):
        return 1.0
    width = 2.0 * DECIDING_LOG_ODDS / least**2
    seen = least * np.sqrt(max(fall, 0.0) / needed)
    strengths = np.exp(np.linspace(np.log(WEAKEST), np.log(STRONGEST), 33))
    log_likely = -0.5 * width * strengths * (strengths - 2.0 * seen)
    return float(np.exp(np.minimum(log_likely, np.log(MOST_ODDS))).mean())


def least_strength(trial: Trial, needed: float) -> float:
    """The multiple of its typical strength from which on the last effect would have shown; may be inf.

    Args:
        needed: fall of the misfit that a verdict needs.
    """
    shown = trial.fall_in_reach
    return float(np.sqrt(needed / shown)) if shown > 0 else float("inf")


def hidden(evidence: Evidence) -> list[int]:
    """Indices of the trials whose effect could be there although no verdict says so, likeliest first.

    These are effects of which the data speak rather for than against, and such as a typical strength of
    would not have shown and the data hardly speak against.
    """
    order = np.argsort(-evidence.unseen, kind="stable")
    return [int(i) for i in order if evidence.factors[i] >= 1.0 or _could_hide(evidence, int(i))]


def _could_hide(evidence: Evidence, i: int) -> bool:
    trial = evidence.trials[i]
    return evidence.factors[i] >= AS_LIKELY and least_strength(trial, needed(evidence, trial)) > 1.0
