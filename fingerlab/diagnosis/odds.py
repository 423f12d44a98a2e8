"""If one of the effects is missing, then which? Their log odds among each other.

What a model leaves beyond the usual is the error of its law, of unknown size: the odds go by how many times
as much one leaves as another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.steps import DECIDING_LOG_ODDS, charge, freedom, least_fall
from fingerlab.diagnosis.sums import BoolArray
from fingerlab.diagnosis.trial import Trial
from fingerlab.sessions.model import Array

SYSTEMATIC_VALUES = 16.0
"""Independent values that a session's systematic misfit is worth, however long it is: what no model explains
is the same in every run. Found on blind trials of the simulated bench for odds by the ratio of whole scores;
the present form was chosen on such trials, too, and is not cross-validated."""
USUAL_LEFT = 0.14
"""Squared score, above one, that every model leaves of a bench (bench-plain's); it tells nothing."""
LEAST_DIFFERENCE = 0.02
"""Two models whose squared scores differ by less than this leave the same."""
COST_OF_A_GAIN = 0.5
"""Log odds that a further unknown must overcome."""
LEAST_EXCESS = 0.2
"""Share of a friction by which that at low speed is usually larger at least where one speaks of Stribeck's;
assumed. The unevenness of a simple law of friction is taken up by a smaller one."""
EXCESS_SPREAD = 0.3
"""How far below it may lie, one standard deviation of its logarithm; assumed."""


def among(base: Trial, trials: Sequence[Trial]) -> Array:
    """Log odds of the effects among each other, against the best, (trials,): if one of them, then which?

    What the best of them leaves beyond the usual is systematic, the error of its law, and the other laws have
    errors of unknown size, too: the odds go by how many times as much a model leaves, not by the difference.
    """
    if not trials:
        return np.zeros(0)
    left = np.array([max(t.misfit + charge(base, t), 0.0) / max(t.count, 1.0) for t in trials])
    log = by_what_is_left(left)
    log -= COST_OF_A_GAIN * np.array([freedom(t) for t in trials])
    log -= 0.5 * np.array([t.surprise for t in trials])
    log -= np.array([small_excess(t) for t in trials])
    log[idle(base, trials)] -= 2.0 * DECIDING_LOG_ODDS
    return np.asarray(log - log.max())


def idle(base: Trial, trials: Sequence[Trial]) -> BoolArray:
    """Which effects explain so little that they would not be missing if they were alone, (trials,)."""
    falls = np.array([base.misfit - t.misfit - charge(base, t) for t in trials])
    return falls < least_fall(base)


def by_what_is_left(left: Array) -> Array:
    """Log odds of models by the misfit that they leave of each value, (models,), up to a constant."""
    return np.asarray(-0.5 * SYSTEMATIC_VALUES * np.log(_law_error(left) + left - left.min()))


def _law_error(left: Array) -> float:
    return LEAST_DIFFERENCE + max(float(left.min()) - USUAL_LEFT, 0.0)


def left_for(log_odds: float, least: float) -> float:
    """What a model leaves of each value that has these log odds, not above 0, against one that leaves least.

    The inverse of :func:`by_what_is_left`.
    """
    return least + _law_error(np.array([least])) * float(np.expm1(-2.0 * log_odds / SYSTEMATIC_VALUES))


def small_excess(trial: Trial, zero_spread: float | None = None) -> float:
    """Log odds against a last effect whose excess is so small that the simpler effect would be named.

    ``zero_spread``: as it would be if a constant were there to none but this spread (N m).
    """
    effect = trial.model.choices[-1].effect
    if not effect.excess:
        return 0.0
    index = trial.model.index
    names = [(index[f"{effect.id}.{a}"], index[f"{effect.id}.{b}"]) for a, b in effect.excess.items()]
    extra = sum(abs(float(trial.fit.values[a])) for a, _ in names)
    under = sum(abs(float(trial.fit.values[b])) for _, b in names)
    if effect.offsets:
        spread = sum(float(trial.fit.deviations[a]) for a, _ in names)
        if zero_spread is not None:
            extra, spread = 0.0, 1.0 / np.hypot(1.0 / spread, 1.0 / zero_spread)
        return min(-_log_beyond(LEAST_EXCESS * under, extra, spread), 2.0 * DECIDING_LOG_ODDS)
    short = np.log(LEAST_EXCESS * under / max(extra, 1e-300)) if under > 0 else 0.0
    return float(min(0.5 * (max(short, 0.0) / EXCESS_SPREAD) ** 2, 2.0 * DECIDING_LOG_ODDS))


def _log_beyond(least: float, value: float, spread: float) -> float:
    """Logarithm of the chance that a constant known to a normal ``spread`` is beyond ``least`` either way.

    What no misfit tells, only what is known of it beforehand: it may be larger than it came out.
    """
    scale = np.sqrt(2.0) * max(spread, 1e-300)
    beyond = 0.5 * (math.erfc((least - value) / scale) + math.erfc((least + value) / scale))
    return math.log(max(beyond, 1e-300))
