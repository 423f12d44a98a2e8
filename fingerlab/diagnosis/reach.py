"""What an effect would do to these data at its typical strength.

A strength shows as far as the other unknowns cannot take its place.
"""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.fitting import Fitter
from fingerlab.diagnosis.numerics import bounded_step
from fingerlab.diagnosis.trial import NO_REACH, Reach, Trial
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array

CLEARLY_SHOWN = 0.5
"""An effect whose typical strength changes the squared score by more than this is seen in any case."""


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
