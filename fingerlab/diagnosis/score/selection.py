"""Which model: what an effect must explain to be a step worth taking, and the log odds of several effects.

All hypotheses are compared on the same held-out runs under the same weights. Log evidence is minus half the
misfit over a *temperature*: what no model explains is systematic and stays the same for about a second, so
that samples a cycle apart are not new evidence. Temperature 1 is white noise at the floor.

If one of the effects is missing, then which? What a model leaves beyond the usual is the error of its law, of
unknown size: the odds go by how many times as much one leaves as another.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.score.fitted_model import FittedModel, paired_log_odds
from fingerlab.diagnosis.settings import (
    CONTACT_PENALTY,
    CONTACT_SHARE,
    COST_OF_A_GAIN,
    DECIDING_LOG_ODDS,
    EXCESS_SPREAD,
    FAR_LEFT,
    LACK_OF_FIT,
    LEAST_DIFFERENCE,
    LEAST_EXCESS,
    LEAST_FALL,
    LEAST_FALL_BEYOND,
    LEAST_SHARE,
    MOST_ODDS,
    NEXT_SHARE,
    OVERFIT_MOST,
    OVERFIT_SHARE,
    PRIOR_EFFECTS,
    PRIOR_NOTHING,
    STRENGTH_POINTS,
    STRONGEST,
    SYSTEMATIC_VALUES,
    TOLD_ODDS,
    TRACE_STRENGTH,
    UNLIKE_SHEATHS,
    USUAL_FREEDOM,
    USUAL_LEFT,
    USUAL_POINTS,
    WEAKEST,
)
from fingerlab.effects.base import Row
from fingerlab.sessions.model import CABLE_SIGN, Array, BoolArray


def justified(base: FittedModel, fitted: FittedModel, level: float = 0.0, reach: float = 0.0) -> bool:
    """Whether adding the model's last effect to ``base`` is a step that the held-out runs bear out.

    ``level`` is added to the model's misfit where the two are seen under different weights. That a further
    effect lowers the floor makes it likelier, but explains nothing of what the first one left. ``reach``: the
    misfit of ``base`` under the other's weights, if there is more to explain by those.
    """
    if is_trace(base, fitted):
        return False
    fall = base.misfit - fitted.misfit - level
    explained = min(fall, fall + level) if base.choices else fall
    explained = min(explained, max(base.misfit, reach, 0.0))  # what lies below the floor is no misfit
    temperature = fitted.temperature()
    in_contact = contact_penalty(base, fitted)
    gain = 0.5 * (fall - complexity_penalty(base, fitted) - in_contact * fitted.count) / temperature
    likely = gain > DECIDING_LOG_ODDS + cost_of_choice(fitted)
    return bool(likely and explained > least_explained(base, base.misfit, base.count, in_contact))


def is_trace(base: FittedModel, fitted: FittedModel) -> bool:
    """Whether the last effect is so slight that every bench has that much of it, on one that fits as it is.

    However surely it is seen: no bench is quite without friction, and a model of one is none the worse.
    """
    if base.choices or lacks_fit(base) or fitted.last_effect.special:
        return False
    return 0.0 < fitted.strength_of_all(base) < TRACE_STRENGTH


def constants_speak(base: FittedModel, fitted: FittedModel) -> bool:
    """Whether constants of the rig that are off in ``base``, and come back with the last effect, tell it.

    By the odds that a verdict takes for that (``evidence.share_undetected``), at the fitted strength.
    """
    prior = PRIOR_EFFECTS / max(len(fitted.model.layout.effects), 1) / PRIOR_NOTHING
    return 0.5 * (base.constants_off - fitted.constants_off) > math.log(TOLD_ODDS / prior)


def redundant_steps(steps: Sequence[FittedModel]) -> list[int]:
    """Numbers of the steps of a path that the one before does not justify; 0 is the model as given."""
    return [k for k in range(1, len(steps)) if not justified(steps[k - 1], steps[k])]


def least_fall(base: FittedModel) -> float:
    """By how much the misfit must fall for an effect beyond ``base`` to be worth a step."""
    return least_explained(base, base.misfit, base.count)


def least_explained(base: FittedModel, misfit: float, count: float, in_contact: float = 0.0) -> float:
    """What an effect beyond ``base`` must explain of a misfit of ``count`` values.

    Args:
        in_contact: see :func:`contact_penalty`.
    """
    beyond = bool(base.choices)
    least = (LEAST_FALL_BEYOND if beyond else LEAST_FALL) + in_contact
    # Where far more is left than the error of any law that is nearly right, a partner mends nothing.
    mends = beyond and misfit <= FAR_LEFT * count
    return max((NEXT_SHARE if mends else LEAST_SHARE) * misfit, least * count)


def count_unknowns(fitted: FittedModel) -> int:
    """Unknowns that the model's last effect brings: gains, and one for its shape, on the grid or refined."""
    effect, shape = fitted.last_effect, fitted.choices[-1].shape
    gains = len(fitted.model.last_gains) - len(effect.offsets)  # what the losses could be explains no misfit
    return gains + len(effect.relaxes) + bool(effect.law_at(shape))


def count_unknowns_of_a_run(fitted: FittedModel) -> int:
    """Those of them that one run sees: of the gains that each cable has for itself, one cable's."""
    gains = fitted.last_effect.gains
    cables = Counter(gains[name].cable for name in fitted.model.last_gains if gains[name].cable)
    return count_unknowns(fitted) - cables.total() + max(cables.values(), default=0)


def cost_of_choice(fitted: FittedModel) -> float:
    """Log odds that the model's last effect must overcome for being more flexible than effects usually are.

    By chance one of many points of a grid fits better than one of few, and many gains better than two.
    """
    points = len(fitted.last_effect.shapes)
    beyond = max(count_unknowns(fitted) - USUAL_FREEDOM, 0)
    return COST_OF_A_GAIN * beyond + math.log(max(points / USUAL_POINTS, 1.0))


def complexity_penalty(base: FittedModel, fitted: FittedModel) -> float:
    """What is added to a model's misfit for the unknowns that its last effect brings."""
    fall = max(max(base.misfit, 0.0) - fitted.misfit, 0.0)
    earned = OVERFIT_SHARE * count_unknowns_of_a_run(fitted) * min(fall, OVERFIT_MOST * base.count)
    return earned + max(fitted.widening - base.widening, 0.0)


def contact_penalty(base: FittedModel, fitted: FittedModel) -> float:
    """By how much more the squared score must fall for an effect that explains runs in contact alone.

    Not for one that is there in contact only, and neither moves the tip nor acts along the load cell's face:
    how a tip rubs and settles is a force along the face, and cannot pass for another span of the load cell.
    """
    if acts_along_load_axis(fitted):
        return 0.0
    if fitted.last_effect.phases == ("contact",):
        return CONTACT_PENALTY
    fall, there = base.misfit - fitted.misfit, base.misfit_in_contact - fitted.misfit_in_contact
    return CONTACT_PENALTY if fall > 0 and there > CONTACT_SHARE * fall else 0.0


def acts_along_load_axis(fitted: FittedModel) -> bool:
    """Whether the last effect is one of contact alone with no say in where the tip stands or how it rubs."""
    effect = fitted.last_effect
    if effect.phases != ("contact",) or effect.relaxes:
        return False
    return not any(f.owner == effect.id and f.row == Row.TIP for f in fitted.model.layout.features)


def lacks_fit(fitted: FittedModel, much: float = LACK_OF_FIT) -> bool:
    """Whether a model leaves so much that something is missing for certain."""
    return fitted.misfit > much * fitted.count


def log_odds_among(base: FittedModel, candidates: Sequence[FittedModel]) -> Array:
    """Log odds of the effects among each other, against the best, (candidates,): if one of them, then which?

    What the best of them leaves beyond the usual is systematic, the error of its law, and the other laws have
    errors of unknown size, too: the odds go by how many times as much a model leaves, not by the difference.
    """
    if not candidates:
        return np.zeros(0)
    left = np.array(
        [max(t.misfit + complexity_penalty(base, t), 0.0) / max(t.count, 1.0) for t in candidates]
    )
    log = log_odds_of_misfits(left)
    log -= COST_OF_A_GAIN * np.array([count_unknowns(t) for t in candidates])
    log -= 0.5 * np.array([t.prior_penalty for t in candidates])
    log -= np.array([penalty_of_small_excess(t) + penalty_of_unlike_cables(t) for t in candidates])
    log[idle(base, candidates)] -= 2.0 * DECIDING_LOG_ODDS
    log += paired_log_odds(candidates)
    return np.asarray(log - log.max())


def idle(base: FittedModel, candidates: Sequence[FittedModel]) -> BoolArray:
    """Which effects explain so little that they would not be missing if they were alone, (candidates,)."""
    falls = np.array([base.misfit - t.misfit - complexity_penalty(base, t) for t in candidates])
    return falls < least_fall(base)


def log_odds_of_misfits(left: Array) -> Array:
    """Log odds of models by the misfit that they leave of each value, (models,), up to a constant."""
    return np.asarray(-0.5 * SYSTEMATIC_VALUES * np.log(_law_error(left) + left - left.min()))


def _law_error(left: Array) -> float:
    return LEAST_DIFFERENCE + max(float(left.min()) - USUAL_LEFT, 0.0)


def misfit_of_log_odds(log_odds: float, least: float) -> float:
    """What a model leaves of each value that has these log odds, not above 0, against one that leaves least.

    The inverse of :func:`log_odds_of_misfits`.
    """
    return least + _law_error(np.array([least])) * float(np.expm1(-2.0 * log_odds / SYSTEMATIC_VALUES))


def penalty_of_small_excess(fitted: FittedModel, zero_spread: float | None = None) -> float:
    """Log odds against a last effect whose excess is so small that the simpler effect would be named.

    ``zero_spread``: as it would be if a constant were there to none but this spread (N m).
    """
    effect = fitted.last_effect
    if not effect.excess:
        return 0.0
    index = fitted.model.index
    names = [(index[f"{effect.id}.{a}"], index[f"{effect.id}.{b}"]) for a, b in effect.excess.items()]
    extra = sum(abs(float(fitted.fit.values[a])) for a, _ in names)
    under = sum(abs(float(fitted.fit.values[b])) for _, b in names)
    if effect.offsets:
        spread = sum(float(fitted.fit.deviations[a]) for a, _ in names)
        if zero_spread is not None:
            extra, spread = 0.0, 1.0 / np.hypot(1.0 / spread, 1.0 / zero_spread)
        return min(-_log_beyond(LEAST_EXCESS * under, extra, spread), 2.0 * DECIDING_LOG_ODDS)
    short = np.log(LEAST_EXCESS * under / max(extra, 1e-300)) if under > 0 else 0.0
    return float(min(0.5 * (max(short, 0.0) / EXCESS_SPREAD) ** 2, 2.0 * DECIDING_LOG_ODDS))


def penalty_of_unlike_cables(fitted: FittedModel) -> float:
    """Log odds against a last effect that has each cable take another share, the smaller of one the larger.

    Sheaths are alike within a factor; one that takes nothing beside one that takes a tenth is no sheath.
    """
    effect, index = fitted.last_effect, fitted.model.index
    keys = [f"{effect.id}.{name}" for name, gain in effect.gains.items() if gain.cable in CABLE_SIGN]
    shares = [abs(float(fitted.fit.values[index[key]])) for key in keys if key in index]
    if len(shares) < 2 or max(shares) <= 0.0:
        return 0.0
    ratio = np.log(max(shares) / max(min(shares), 1e-300))
    return float(min(0.5 * (ratio / UNLIKE_SHEATHS) ** 2, 2.0 * DECIDING_LOG_ODDS))


def _log_beyond(least: float, value: float, spread: float) -> float:
    """Logarithm of the chance that a constant known to a normal ``spread`` is beyond ``least`` either way.

    What no misfit tells, only what is known of it beforehand: it may be larger than it came out.
    """
    scale = np.sqrt(2.0) * max(spread, 1e-300)
    beyond = 0.5 * (math.erfc((least - value) / scale) + math.erfc((least + value) / scale))
    return math.log(max(beyond, 1e-300))


def reaches_contact_alone(fitted: FittedModel) -> bool:
    """Whether the last effect would show in contact alone, though it does not act along the load axis."""
    if acts_along_load_axis(fitted):
        return False
    falls = fitted.sensitivity.falls
    return bool(len(falls)) and float(falls[fitted.in_contact].sum()) > CONTACT_SHARE * float(falls.sum())


def bayes_factor(base: FittedModel, fitted: FittedModel, fall: float, needed: float) -> float:
    """How much likelier what was seen is with the effect at a plausible strength than with nothing.

    Up to the strength that was fitted, the likelihood of one rises as a parabola by the ``fall`` of the
    misfit, and beyond it falls as makes the least strength that shows decide. By how much constants of the
    rig are off without the effect, and are not with it, is told by their tolerances: a parabola, too.
    """
    least = least_strength(fitted, needed)
    if not np.isfinite(least):
        return 1.0
    strengths = np.exp(np.linspace(np.log(WEAKEST), np.log(STRONGEST), STRENGTH_POINTS))
    found, width = fitted.strength_beside(base), 2.0 * DECIDING_LOG_ODDS / least**2
    beyond = np.maximum(strengths - found, 0.0)
    short = 1.0 - np.minimum(strengths / found, 1.0) if found > 0.0 else np.zeros(STRENGTH_POINTS)
    rise = DECIDING_LOG_ODDS * fall / needed
    back = 0.5 * (base.constants_off - fitted.constants_off) if found > 0.0 else 0.0
    log_likely = np.minimum(rise * (1.0 - short**2) - 0.5 * width * beyond**2, np.log(MOST_ODDS))
    if back <= 0.0:
        return float(np.exp(log_likely + back * (1.0 - short**2)).mean())
    # Constants that come back at one strength go off again beyond it, whichever part brings them back.
    away = strengths / max(fitted.strength_of_all(base), found) - 1.0
    return float(np.exp(log_likely + back * (1.0 - away**2)).mean())


def least_strength(fitted: FittedModel, needed: float) -> float:
    """The multiple of its typical strength from which on the last effect would have shown; may be inf.

    Args:
        needed: fall of the misfit that a verdict needs.
    """
    shown = fitted.sensitive_fall
    return float(np.sqrt(needed / shown)) if shown > 0 else float("inf")
