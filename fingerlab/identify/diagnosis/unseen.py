"""Effects that could be there all the same: what a strength that matters would do to these data.

A strength shows as far as the other unknowns cannot take its place. Where even a plausible one changes the
held-out misfit by less than a verdict needs, "nothing is missing" is no answer about that effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fingerlab.identify.diagnosis.fitting import Fitter, bounded_step
from fingerlab.physics.effects.base import Effect
from fingerlab.sessions.model import Array

if TYPE_CHECKING:
    from fingerlab.identify.diagnosis.evidence import Evidence
    from fingerlab.identify.diagnosis.study import Trial

WEAKEST, STRONGEST = 0.5, 2.0
"""Multiples of its typical strength between which an effect that is there is thought to lie, evenly in their
logarithm; assumed."""
MOST_ODDS = float(np.exp(2.0))
"""What is below a verdict's threshold speaks for an effect by at most this factor; assumed."""
AS_LIKELY = np.exp(-1.0)
"""An effect of which the data say that it is less likely by more than this factor has not stayed unseen."""
CLEARLY_SHOWN = 0.5
"""An effect whose typical strength changes the squared score by more than this is seen in any case."""
DECIDING_LOG_ODDS = 5.0
"""Log odds that decide (about 150 to 1)."""


@dataclass(frozen=True)
class Reach:
    """What the last effect of a trial would do at its typical strength.

    Attributes:
        falls: by how much the misfit would fall with the effect, (conditions,); chi-square.
        strengths: the typical strength by key of the unknown, SI.
    """

    falls: Array
    strengths: Mapping[str, float]


NO_REACH = Reach(np.zeros(0), {})


def own_keys(trial: Trial, effect: Effect) -> dict[str, str]:
    """Name of each of the effect's parameters -> key of the unknown, as far as the trial's model has it."""
    if effect.special == "delay":
        return {"delay": "delay"}
    keys = {name: f"{effect.id}.{name}" for name in effect.gains} | {name: name for name in effect.relaxes}
    return {name: key for name, key in keys.items() if key in trial.model.index}


def reach(fitter: Fitter, trial: Trial) -> Reach:
    """What the trial's last effect would do at its typical strength, whichever of its gains shows best."""
    if not trial.model.choices:
        return NO_REACH
    effect = trial.model.choices[-1].effect
    names = [n for n in own_keys(trial, effect).items() if n[0] not in effect.offsets]
    places = [trial.model.index[key] for _, key in names]
    typical = np.array([trial.model.unknowns[i].gain.typical for i in places])
    if not places:
        return NO_REACH
    patterns = list(np.diag(typical)) + ([typical] if len(places) > 1 else [])
    best = NO_REACH
    for pattern in patterns:
        falls = _falls(fitter, trial, _unbound(trial, places, pattern))
        if falls.sum() < CLEARLY_SHOWN * fitter.data.count:
            falls = _falls(fitter, trial, _moved(trial, trial.fit.values, places, pattern))
        if not len(best.falls) or falls.sum() > best.falls.sum():
            strengths = {key: float(s) for (_, key), s in zip(names, pattern, strict=True) if s}
            best = Reach(falls, strengths)
    return best


def _unbound(trial: Trial, places: list[int], strengths: Array) -> Array:
    """As ``_moved``, but beyond the bounds of the others: what is seen then is seen the more within them."""
    covariance = trial.fit.covariance
    own = np.linalg.lstsq(covariance[np.ix_(places, places)], strengths, rcond=None)[0]
    return np.asarray(covariance[:, places] @ own)


def hidden_values(trial: Trial, values: Array) -> Array:
    """``values`` of the trial's unknowns, (p,), without its last effect -> with the strengths of its reach.

    The other unknowns do about it what hides it best, within their bounds.
    """
    places = [trial.model.index[key] for key in trial.reach.strengths]
    strengths = np.array(list(trial.reach.strengths.values()))
    reached = values + _moved(trial, values, places, strengths)
    return np.asarray(np.clip(reached, trial.model.low, trial.model.high))


def _moved(trial: Trial, values: Array, places: list[int], strengths: Array) -> Array:
    """The strengths at their places, and what the other unknowns do about them within their bounds, (p,)."""
    start = np.zeros(len(values))
    start[places] = strengths
    own = np.zeros(len(start), dtype=bool)
    own[places] = True
    low = np.where(own, start, np.minimum(trial.model.low - values, 0.0))
    high = np.where(own, start, np.maximum(trial.model.high - values, 0.0))
    information = trial.fit.information
    return np.asarray(start + bounded_step(start, information @ start, information, low, high))


def _falls(fitter: Fitter, trial: Trial, moved: Array) -> Array:
    """Chi-square that ``moved`` unknowns stand for, (conditions,)."""
    falls = []
    for i, group in enumerate(fitter.data.groups):
        change = trial.model.coefficients(trial.fit.values, group)[1] @ moved
        for condition in group.conditions:
            matrix = fitter.part(i, tuple(group.of_condition(condition))).matrix
            falls.append(max(float(change @ matrix @ change), 0.0))
    return np.array(falls)


def least_strength(trial: Trial, needed: float) -> float:
    """The multiple of its typical strength from which on the last effect would have shown; may be inf.

    Args:
        needed: fall of the misfit that a verdict needs.
    """
    shown = trial.fall_in_reach
    return float(np.sqrt(needed / shown)) if shown > 0 else float("inf")


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


MOST_UNSEEN = 0.95
"""Effects that were not seen are together less likely than nothing."""
