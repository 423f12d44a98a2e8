"""A model with its fit and its scores, and what its last effect would do at its typical strength.

The misfit of a model is counted in units of the repeatability floor: chi-square per independent value, after
what noise alone would give has been taken away. It is reproducible by construction. A strength shows as far
as the other unknowns cannot take its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fingerlab.diagnosis.equations.features import BoolArray
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.fit.solver import Fit, Fitter, bounded_step
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array


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


@dataclass(frozen=True)
class Trial:
    """A model with its fit and the misfit left on each run.

    ``misfits`` holds one entry a condition of each group: (chi-square without noise, independent values);
    from held-out runs where ``held_out`` is set.
    """

    model: Model
    fit: Fit
    misfits: Array = field(default_factory=lambda: np.zeros((0, 2)))  # (conditions, 2); empty: not counted
    touching: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))  # (conditions,): in contact
    held_out: bool = False
    in_sample: Array = field(default_factory=lambda: np.zeros((0, 2)))
    """As ``misfits``, always of the fit to all runs: where trials are compared that are not all held out.

    Empty where it was not asked for (see ``Study.told``)."""
    residuals: Mapping[GroupKey, Array] = field(default_factory=dict)
    """Mean products of the equations' residuals for each group, (5, 5) over ``Row``, noise included."""
    widening: float = 0.0
    """What it costs in twice the log density that sticking friction may hold any value at rest."""
    surprise: float = 0.0
    """What the constants of the joints' equations cost in twice the log density (see ``solver.surprise``)."""
    reach: Reach = NO_REACH
    """What the last effect would do at its typical strength (see ``Study.told``)."""

    @property
    def misfit(self) -> float:
        """Chi-square without noise, every condition counting with the root of its length."""
        return float(self.misfits[:, 0] @ condition_weights(self.misfits[:, 1]))

    @property
    def misfit_in_contact(self) -> float:
        """The part of it that lies in contact."""
        weighted = self.misfits[:, 0] * condition_weights(self.misfits[:, 1])
        return float(weighted[self.touching].sum())

    @property
    def misfit_in_sample(self) -> float:
        """As ``misfit``, of the fit to all runs."""
        return float(self.in_sample[:, 0] @ condition_weights(self.in_sample[:, 1]))

    @property
    def fall_in_reach(self) -> float:
        """By how much the misfit would fall with the last effect if it had its typical strength."""
        if not len(self.reach.falls):
            return 0.0
        return float(self.reach.falls @ condition_weights(self.misfits[:, 1]))

    @property
    def count(self) -> float:
        """Independent values behind ``misfit``."""
        return float(self.misfits[:, 1].sum())

    @property
    def score(self) -> float:
        """Error over all equations and samples in units of the repeatability floor; 1.0 is the floor."""
        return float(np.sqrt(1.0 + max(float(self.misfits[:, 0].sum()), 0.0) / max(self.count, 1.0)))


def condition_weights(counts: Array) -> Array:
    """What each value of a condition counts, (conditions,); 1 on average.

    What no model explains is partly the same in every run of a condition, and partly another in each: a
    condition counts with the root of its length.

    Args:
        counts: independent values of each condition, (conditions,).
    """
    if not len(counts) or counts.sum() <= 0:
        return np.ones(len(counts))
    weights = 1.0 / np.sqrt(np.maximum(counts, 1.0))
    return np.asarray(weights * counts.sum() / float(weights @ counts))


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
    typical = np.array([trial.model.unknowns[i].parameter.typical for i in places])
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
