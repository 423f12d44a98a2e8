"""From misfits on held-out runs to probabilities, and the rules by which a step is justified.

All hypotheses are compared on the same held-out runs under the same weights. Log evidence is minus half the
misfit over a *temperature*: what no model explains is systematic and stays the same for about a second, so
that samples a cycle apart are not new evidence. Temperature 1 is white noise at the floor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.identify.diagnosis.study import Trial
from fingerlab.identify.diagnosis.sums import BoolArray
from fingerlab.identify.diagnosis.unseen import (
    AS_LIKELY,
    DECIDING_LOG_ODDS,
    bayes_factor,
    least_strength,
    with_unseen,
)
from fingerlab.sessions.model import Array

CORRELATED_VALUES = 16.0
"""Independent noise values within one correlation time (about a second) of a systematic misfit; assumed."""
EARNED_SHARE = 0.001
"""Share of the explained misfit that every further unknown gains by chance and bias."""
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
LEAST_SHARE = 0.2
"""A missing effect must explain this share of the reproducible misfit, or nothing is missing."""
LEAST_FALL = 0.05
"""... and lower the squared score by this much: below, the misfit is a matter of sensor steps."""
LEAST_FALL_BEYOND = 0.2
"""The same for a model that holds an effect already: its own law is never quite the plant's."""
CONTACT_CHARGE = 0.1
"""... and by this much more where it explains runs in contact alone: how a tip rubs and settles is never
described to the end, and a lean of the force takes up what is left."""
CONTACT_SHARE = 0.6
"""An effect of whose gain this share lies in contact explains the contact."""
UNKNOWN_SHARE = 0.65
"""An effect outside the catalogue is thought to explain this share of the misfit."""
UNKNOWN_LEAST = 0.5
"""... and is not thought of where the squared score is above one by less than about this: a misfit that small
comes from what every bench does a little (rubbing at the fingertip, joints that stick)."""
UNKNOWN_LEAST_BEYOND = 6.0
"""The same for a model that holds an effect already, whose own law is never quite the plant's."""
NEXT_SHARE = 0.4
"""A second effect must explain more of what is left: the first one's own law is never quite the plant's
(where a joint sticks, say), and a partner that only mends that law is not missing physics."""
PRIOR_NOTHING, PRIOR_UNKNOWN, PRIOR_EFFECTS = 0.5, 0.05, 0.45
SET_PROBABILITY = 0.95
SET_LOG_ODDS = 3.0
"""An effect is in the set when its log odds against the best are above minus this (odds of about 1 to 20)."""


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
    for_an_effect: float
    """Log odds that an effect of the catalogue is missing rather than nothing; held also where the two
    probabilities are too small to be told beside that of something unknown."""
    least_left: float = 0.0
    """Misfit of each value that the best trial left when all were judged; later it may be fitted closer."""
    unseen: Array = field(default_factory=lambda: np.zeros(0))
    """Probabilities of effects that are not found because they could not show, (trials,); see ``unseen``."""
    factors: Array = field(default_factory=lambda: np.zeros(0))
    """How much likelier the data are with a plausible strength of each effect than with none, (trials,)."""

    @property
    def told(self) -> Array:
        """Probability of each trial's last effect, seen or unseen, (trials,)."""
        return self.probabilities + self.unseen if len(self.unseen) else self.probabilities


def freedom(trial: Trial) -> int:
    """Unknowns that the trial's last effect brings: gains, and one for a grid of shapes."""
    effect = trial.model.choices[-1].effect
    gains = len(trial.model.last_gains) - len(effect.offsets)  # what the losses could be explains no misfit
    return gains + len(effect.relaxes) + (1 if len(effect.shapes) > 3 else 0)


def charge(base: Trial, trial: Trial) -> float:
    """What is added to a trial's misfit for the unknowns that its last effect brings."""
    earned = EARNED_SHARE * freedom(trial) * max(max(base.misfit, 0.0) - trial.misfit, 0.0)
    return earned + max(trial.widening - base.widening, 0.0)


def _contact_charge(base: Trial, trial: Trial) -> float:
    if trial.model.choices[-1].effect.phases == ("contact",):
        return CONTACT_CHARGE
    fall, there = base.misfit - trial.misfit, base.misfit_in_contact - trial.misfit_in_contact
    return CONTACT_CHARGE if fall > 0 and there > CONTACT_SHARE * fall else 0.0


def temperature(misfit: float, count: float) -> float:
    """How much less than its face value a misfit weighs (see the module's text)."""
    return 1.0 + CORRELATED_VALUES * max(misfit, 0.0) / max(count, 1.0)


def judge(base: Trial, trials: Sequence[Trial]) -> Evidence:
    """Probabilities of "nothing missing", of every trial's last effect, and of something unknown.

    Args:
        base: the model as given. trials: the model with one effect more, each; all scored on held-out runs
            where they could matter.
    """
    zero, count = max(base.misfit, 0.0), base.count
    charged = np.array([t.misfit + charge(base, t) for t in trials])
    heat = temperature(min((t.misfit for t in trials), default=zero), count)
    least = _least_part(base) + (
        _contact_charge(base, trials[int(np.argmin(charged))]) if len(trials) else 0.0
    )
    tolerated = zero - max(least_share(base) * zero, least * count)
    effects = -0.5 * charged / heat + np.log(PRIOR_EFFECTS / max(len(trials), 1))
    nothing = -0.5 * tolerated / heat + np.log(PRIOR_NOTHING)
    least_unknown = UNKNOWN_LEAST_BEYOND if base.model.choices else UNKNOWN_LEAST
    unexplained = (1.0 - UNKNOWN_SHARE) * zero + least_unknown * count + 2 * DECIDING_LOG_ODDS * heat
    unknown = -0.5 * unexplained / heat + np.log(PRIOR_UNKNOWN)
    everything = np.concatenate((effects, [nothing, unknown]))
    weights = np.exp(everything - everything.max())
    weights /= weights.sum()
    log_odds = among(base, trials)
    shares = np.exp(log_odds) / max(float(np.exp(log_odds).sum()), 1.0)
    found = shares * float(weights[:-2].sum())
    odds = float(np.logaddexp.reduce(effects) - nothing)
    least_left = max(float(min(charged, default=zero)), 0.0) / max(count, 1.0)
    none, other = map(float, weights[-2:])
    return Evidence(base, tuple(trials), found, log_odds, none, other, heat, odds, least_left)


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


def against_nothing(base: Trial, misfit: float, left: float, count: float) -> float:
    """Log odds of one of many effects against none, by the misfit without it and with it."""
    least = max(least_share(base) * misfit, _least_part(base) * count)
    return 0.5 * (misfit - least - left) / temperature(left, count) + float(
        np.log(PRIOR_EFFECTS / PRIOR_NOTHING)
    )


LEAST_EXCESS = 0.2
"""Share of a friction by which that at low speed is usually larger at least where one speaks of Stribeck's;
assumed. The unevenness of a simple law of friction is taken up by a smaller one."""
EXCESS_SPREAD = 0.3
"""How far below it may lie, one standard deviation of its logarithm; assumed."""


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


MUCH = 1.0
"""Squared score above one that no bench leaves (``USUAL_LEFT``) and no nearly right law (about 0.5)."""


def much_left(trial: Trial) -> bool:
    """Whether a model leaves so much that something is missing for certain."""
    return trial.misfit > MUCH * trial.count


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
    found = float(evidence.probabilities.sum())
    if gain <= 0.0 or found <= 0.0:
        return evidence
    grown = np.log(found) + gain
    weights = np.array([grown, np.log(max(evidence.nothing, 1e-300)), np.log(max(evidence.unknown, 1e-300))])
    weights = np.exp(weights - weights.max())
    weights /= weights.sum()
    return replace(
        evidence,
        probabilities=evidence.probabilities * float(weights[0]) / found,
        nothing=float(weights[1]),
        unknown=float(weights[2]),
    )


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
    least = max(least_share(base) * max(remaining, 0.0), _least_part(base) * base.count)
    least += in_contact * base.count
    return max(least, 2.0 * DECIDING_LOG_ODDS * evidence.temperature)


def _reaches_contact_alone(trial: Trial) -> bool:
    falls = trial.reach.falls
    return bool(len(falls)) and float(falls[trial.touching].sum()) > CONTACT_SHARE * float(falls.sum())


def alike(evidence: Evidence) -> list[int]:
    """Indices of the trials that these data cannot tell apart, best first."""
    order = np.argsort(-evidence.probabilities, kind="stable")
    total = evidence.probabilities.sum()
    chosen: list[int] = []
    covered = 0.0
    for i in order:
        enough = total > 0 and covered / total >= SET_PROBABILITY
        if enough and evidence.log_odds[i] < -SET_LOG_ODDS:
            continue
        chosen.append(int(i))
        covered += float(evidence.probabilities[i])
    return chosen


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


def least_share(base: Trial) -> float:
    """Share of the misfit that an effect beyond ``base`` must explain."""
    return NEXT_SHARE if base.model.choices else LEAST_SHARE


def least_fall(base: Trial) -> float:
    """By how much the misfit must fall for an effect beyond ``base`` to be worth a step."""
    return max(least_share(base) * max(base.misfit, 0.0), _least_part(base) * base.count)


def _least_part(base: Trial) -> float:
    return LEAST_FALL_BEYOND if base.model.choices else LEAST_FALL


def justified(base: Trial, trial: Trial, level: float = 0.0) -> bool:
    """Whether adding the trial's last effect to ``base`` is a step that the held-out runs bear out.

    ``level`` is added to the trial's misfit where the two are seen under different weights. That a further
    effect lowers the floor makes it likelier, but explains nothing of what the first one left.
    """
    fall = base.misfit - trial.misfit - level
    explained = min(fall, fall + level) if base.model.choices else fall
    heat = temperature(trial.misfit, trial.count)
    in_contact = _contact_charge(base, trial)
    likely = 0.5 * (fall - charge(base, trial) - in_contact * trial.count) / heat > DECIDING_LOG_ODDS
    least = _least_part(base) + in_contact
    shares = explained > max(least_share(base) * max(base.misfit, 0.0), least * base.count)
    return bool(likely and shares)
