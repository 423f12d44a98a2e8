"""From misfits on held-out runs to probabilities: nothing missing, an effect, or something unknown.

``selection`` says what an effect must explain at all, and which of several it is. Effects that are
undetectable could be there all the same: where even a plausible strength changes the held-out misfit by less
than a verdict needs, "nothing is missing" is no answer about that effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.diagnosis.score.calibration import Odds, Verdict
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.selection import (
    bayes_factor,
    complexity_penalty,
    contact_penalty,
    is_trace,
    lacks_fit,
    least_explained,
    least_strength,
    log_odds_among,
    reaches_contact_alone,
)
from fingerlab.diagnosis.settings import (
    AS_LIKELY,
    CONTACT_PENALTY,
    DECIDING_LOG_ODDS,
    DOUBTED,
    HALF,
    HALF_UNEXPLAINED,
    IMPOSSIBLE,
    LACK_OF_FIT,
    LEAST_PROBABILITY,
    MOST_UNDETECTED,
    NOT_BORNE_OUT,
    PRIOR_EFFECTS,
    PRIOR_NOTHING,
    PRIOR_UNKNOWN,
    RIVAL_LOG_ODDS,
    SET_LOG_ODDS,
    SET_PROBABILITY,
    TIE_LOG_ODDS,
    TOLD_ODDS,
    UNEXPLAINED,
    UNEXPLAINED_SHARE,
    UNKNOWN_LEAST,
    UNKNOWN_LEAST_BEYOND,
    UNKNOWN_SHARE,
)
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Evidence:
    """Judged hypotheses: the candidates with their probabilities, and the two other verdicts.

    A candidate is the ``base`` model with one effect more.
    """

    base: FittedModel
    candidates: tuple[FittedModel, ...]
    probabilities: Array  # (candidates,)
    log_odds: Array  # (candidates,), against the best candidate
    nothing: float
    unknown: float
    temperature: float
    logs: Array
    """Log weights of an effect of the catalogue, nothing, and something unknown, (3,): also where the others
    are too unlikely beside one of them to have a probability."""
    least_left: float = 0.0
    """Misfit of each value that the best candidate left when all were judged; later one may fit closer."""
    undetected: Array = field(default_factory=lambda: np.zeros(0))
    """Probabilities of effects that are not found because they could not show, (candidates,)."""
    instead: Array = field(default_factory=lambda: np.zeros(0))
    """Share of each probability that its effect stands in place of a given one, (candidates,); (0,): none."""
    no_better: float = 0.0
    """Probability of effects in place of given ones that are not clearly the better ones."""
    factors: Array = field(default_factory=lambda: np.zeros(0))
    """How much likelier the data are with each effect at a plausible strength than without, (candidates,)."""

    @property
    def for_an_effect(self) -> float:
        """Log odds that an effect of the catalogue is missing rather than nothing."""
        return float(self.logs[0] - self.logs[1])

    @property
    def posterior(self) -> Array:
        """Probability of each candidate's last effect, found or not, (candidates,)."""
        return self.probabilities + self.undetected if len(self.undetected) else self.probabilities

    @property
    def odds(self) -> Odds:
        """The same as plain numbers, to be set against trials."""
        effects = tuple(t.last_effect.id for t in self.candidates)
        hidden = self.undetected if len(self.undetected) else np.zeros(len(effects))
        if not len(self.instead):
            return Odds(effects, self.probabilities, hidden, self.nothing, self.unknown)
        instead = self.instead * self.probabilities
        return Odds(effects, self.probabilities - instead, hidden, self.nothing, self.unknown, instead)

    @property
    def best(self) -> FittedModel:
        """The likeliest candidate, if one of their effects is missing; there must be one."""
        return self.candidates[int(np.argmax(self.log_odds))]

    @property
    def verdict(self) -> Verdict:
        """The likeliest of the three answers; a model that does no better than the given one adds nothing."""
        found = float(np.sum(self.probabilities)) - self.no_better
        if self.nothing + self.no_better >= max(found, self.unknown):
            return Verdict.NOTHING_MISSING
        return Verdict.MISSING_EFFECT if found >= self.unknown else Verdict.NOT_IN_CATALOGUE


def judge(base: FittedModel, candidates: Sequence[FittedModel]) -> Evidence:
    """Probabilities of "nothing missing", of every candidate's last effect, and of something unknown.

    Args:
        base: the model as given. candidates: it with one effect more, each; all scored on held-out runs where
            they could matter.
    """
    zero, count = max(base.misfit, 0.0), base.count
    charged = np.array([t.misfit + complexity_penalty(base, t) for t in candidates])
    temperature = base.temperature(min((t.misfit for t in candidates), default=zero))
    in_contact = contact_penalty(base, candidates[int(np.argmin(charged))]) if len(candidates) else 0.0
    tolerated = zero - least_explained(base, zero, count, in_contact)
    effects = -0.5 * charged / temperature + np.log(PRIOR_EFFECTS / max(len(candidates), 1))
    nothing = -0.5 * tolerated / temperature + np.log(PRIOR_NOTHING)
    least_unknown = UNKNOWN_LEAST_BEYOND if base.choices else UNKNOWN_LEAST
    unexplained = (1.0 - UNKNOWN_SHARE) * zero + least_unknown * count + 2 * DECIDING_LOG_ODDS * temperature
    unknown = -0.5 * unexplained / temperature + np.log(PRIOR_UNKNOWN)
    log_odds = log_odds_among(base, candidates)
    traces = np.array([is_trace(base, t) for t in candidates], dtype=bool)
    if traces.any() and traces[np.argmax(log_odds)] and np.logaddexp.reduce(effects) > nothing:
        # Nothing is missing of a bench that has no more than a trace of something.
        nothing = np.logaddexp.reduce([nothing, *effects[traces]])
        effects, log_odds = (np.where(traces, IMPOSSIBLE, odds) for odds in (effects, log_odds))
        log_odds = log_odds - log_odds.max()
    logs = np.array([np.logaddexp.reduce(effects), nothing, unknown])
    least_left = max(float(min(charged, default=zero)), 0.0) / max(count, 1.0)
    found, none, other = _shared(logs)
    shares = found * shares_of(log_odds)
    return Evidence(base, tuple(candidates), shares, log_odds, none, other, temperature, logs, least_left)


def _shared(logs: Array) -> tuple[float, float, float]:
    """Probabilities of an effect of the catalogue, nothing, and something unknown by their log weights."""
    weights = np.exp(logs - logs.max())
    found, none, other = map(float, weights / weights.sum())
    return found, none, other


def shares_of(log_odds: Array) -> Array:
    """Probability of each effect if one of them is missing, (candidates,)."""
    shares = np.exp(log_odds)
    return np.asarray(shares / max(float(shares.sum()), 1.0))


def with_best_unconfirmed(evidence: Evidence) -> Evidence:
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


def judged_with_path(evidence: Evidence, last: FittedModel) -> Evidence:
    """The evidence when steps of which each is justified lead from the base to ``last``.

    What one effect leaves and others of the catalogue explain is no sign of something outside of it. All is
    judged again as it stands under the weights of ``last``: those of a model with nothing found take much of
    what is missed for noise.

    Args:
        evidence: rescored under the weights of ``last``.
    """
    beyond = len(last.choices) - len(evidence.base.choices) - 1
    if beyond < 0 or not evidence.candidates:
        return evidence
    again = judge(evidence.base, evidence.candidates)
    best = min(t.misfit for t in evidence.candidates)
    further = beyond * (np.log(PRIOR_EFFECTS / len(evidence.candidates)) - DECIDING_LOG_ODDS)
    gain = 0.5 * (best - last.misfit) / again.temperature + further
    if gain <= 0.0:
        return evidence
    logs = again.logs + np.array([gain, 0.0, 0.0])
    found, none, other = _shared(logs)
    if found <= float(evidence.probabilities.sum()):
        return evidence
    shares = found * shares_of(evidence.log_odds)
    return replace(evidence, probabilities=shares, nothing=none, unknown=other, logs=logs)


def averaged_over_weights(rescored: Evidence, refined: Sequence[FittedModel]) -> Evidence:
    """The evidence with the mean of the odds that its effects have and those that its weights give them.

    How much of what is left a model may call noise is not known better: near the floor, odds of e^10 under
    the weights of the search were odds of e^-5 under those of the effect that it found.

    Args:
        refined: models of effects with refined shapes; they count as they are there.
    """
    closest = closest_of(rescored.candidates, refined)
    log_odds = 0.5 * (rescored.log_odds + log_odds_among(rescored.base, closest))
    return _with_log_odds(rescored, log_odds)


def closest_of(candidates: Sequence[FittedModel], refined: Sequence[FittedModel]) -> list[FittedModel]:
    """The candidates, each as it is with its refined shape if it leaves less there."""
    by_id = {one.last_effect.id: one for one in refined}

    def misfit(fitted: FittedModel) -> float:
        return fitted.misfit

    return [min(one, by_id.get(one.last_effect.id, one), key=misfit) for one in candidates]


def _with_log_odds(evidence: Evidence, log_odds: Array) -> Evidence:
    """The evidence, and which effect it is by these odds, (candidates,)."""
    log_odds = log_odds - log_odds.max(initial=-np.inf)
    found = float(evidence.probabilities.sum())
    return replace(evidence, log_odds=log_odds, probabilities=found * shares_of(log_odds))


def no_less_likely(evidence: Evidence, name: str) -> Evidence:
    """The evidence where the effect of this id, with which a path begins, is as likely as any other."""
    names = [one.last_effect.id for one in evidence.candidates]
    if name not in names:
        return evidence
    log_odds, i = evidence.log_odds.copy(), names.index(name)
    log_odds[i] = max(log_odds[i], float(log_odds.max()) + TIE_LOG_ODDS)
    return _with_log_odds(evidence, log_odds)


def exchanged(evidence: Evidence, law: str, plainer: str) -> Evidence:
    """The evidence where beside others a ``plainer`` law does as well as the one that seemed likelier alone.

    The odds of the two are exchanged; ids of effects.
    """
    names = [t.last_effect.id for t in evidence.candidates]
    if law not in names or plainer not in names:
        return evidence
    both = [names.index(law), names.index(plainer)]
    if evidence.log_odds[both[0]] <= evidence.log_odds[both[1]]:
        return evidence
    log_odds, probabilities = evidence.log_odds.copy(), evidence.probabilities.copy()
    log_odds[both], probabilities[both] = log_odds[both[::-1]], probabilities[both[::-1]]
    return replace(evidence, log_odds=log_odds, probabilities=probabilities)


def with_first_step(evidence: Evidence, path: Sequence[FittedModel]) -> Evidence:
    """The evidence when a path of many effects leaves little of what is missed: its first effect is missing.

    Which is first depends on the others, which single effects do not have beside them.
    """
    first, last = path[1].last_effect.id, path[-1]
    temperature = last.temperature()
    share = np.log(PRIOR_EFFECTS / max(len(evidence.candidates), 1)) - DECIDING_LOG_ODDS
    effects = -0.5 * max(last.misfit, 0.0) / temperature + (len(path) - 1) * share
    zero = max(path[0].misfit, 0.0)
    unexplained = (1.0 - UNKNOWN_SHARE) * zero
    unknown = -0.5 * unexplained / temperature + np.log(PRIOR_UNKNOWN)
    logs = np.array([effects, -0.5 * zero / temperature + np.log(PRIOR_NOTHING), unknown])
    found, none, other = _shared(logs)
    odds = np.array([0.0 if t.last_effect.id == first else IMPOSSIBLE for t in evidence.candidates])
    shares = found * shares_of(odds)
    return replace(
        evidence,
        probabilities=shares,
        log_odds=odds,
        nothing=none,
        unknown=other,
        temperature=temperature,
        logs=logs,
    )


def with_rivals(evidence: Evidence, log_odds: Mapping[str, float]) -> Evidence:
    """The evidence with a share for every effect that may be the right one in place of a given one.

    Args:
        log_odds: by the effect's id, of the model with it exchanged, against the model as given and all that
            may be missing beside it.
    """
    if not log_odds:
        return evidence
    shares = shares_of_rivals(log_odds)
    kept = 1.0 - sum(shares.values())
    instead = np.array([shares.get(t.last_effect.id, 0.0) for t in evidence.candidates])
    probabilities = kept * evidence.probabilities + instead
    odds = np.log(np.maximum(probabilities, LEAST_PROBABILITY))
    return replace(
        evidence,
        probabilities=probabilities,
        log_odds=odds - odds.max(),
        nothing=kept * evidence.nothing,
        unknown=kept * evidence.unknown,
        instead=instead / np.maximum(probabilities, LEAST_PROBABILITY),
        no_better=sum(shares[name] for name, odds in log_odds.items() if odds < RIVAL_LOG_ODDS),
    )


def shares_of_rivals(log_odds: Mapping[str, float]) -> dict[str, float]:
    """Probability of each of some models that exclude each other and one more, against which the odds are."""
    total = float(np.logaddexp.reduce([0.0, *log_odds.values()]))
    return {name: float(np.exp(odds - total)) for name, odds in log_odds.items()}


def with_lack_of_fit(evidence: Evidence, last: FittedModel) -> Evidence:
    """The evidence where what is left at the ``last`` of the path says that something unknown is missing.

    Where a model leaves much, "nothing missing" cannot be said; nor can an effect be said to be what is
    missing where it and all that follow explain too little of it.
    """
    # What is told is the score, which counts every sample; in the misfit long conditions count for less.
    told, left = evidence.base.score**2 - 1.0, last.score**2 - 1.0
    lacking = lacks_fit(evidence.base) or told > LACK_OF_FIT
    if evidence.verdict == Verdict.NOTHING_MISSING and lacking:
        nothing = DOUBTED * evidence.nothing
        return replace(evidence, nothing=nothing, unknown=evidence.unknown + evidence.nothing - nothing)
    # Each effect more takes its part of whatever is missing, so that less may be left by many.
    steps = max(len(last.choices) - len(evidence.base.choices), 1)
    far = lacks_fit(last, UNEXPLAINED) and last.misfit > UNEXPLAINED_SHARE / steps * evidence.base.misfit
    far |= left > HALF_UNEXPLAINED and left > HALF * told
    if evidence.verdict == Verdict.MISSING_EFFECT and far:
        taken = (1.0 - DOUBTED) * float(evidence.probabilities.sum())
        return replace(
            evidence, probabilities=DOUBTED * evidence.probabilities, unknown=evidence.unknown + taken
        )
    return evidence


def at_least_as_unknown(evidence: Evidence, again: Evidence) -> Evidence:
    """The evidence where something unknown is at least as likely as when it is judged ``again``."""
    if again.unknown <= evidence.unknown:
        return evidence
    rest = (1.0 - again.unknown) / max(1.0 - evidence.unknown, 1e-300)
    return replace(
        evidence,
        probabilities=rest * evidence.probabilities,
        nothing=rest * evidence.nothing,
        unknown=again.unknown,
    )


def given_the_others(evidence: Evidence, beside: Evidence) -> Evidence:
    """The evidence, and which effect it is by what each does ``beside`` others that are missing, too.

    Those others are in the models of ``beside``, and are none of the answers.
    """
    known = {t.last_effect.id: odds for t, odds in zip(beside.candidates, beside.log_odds, strict=True)}
    log_odds_beside = [known.get(t.last_effect.id, IMPOSSIBLE) for t in evidence.candidates]
    log_odds = np.array(log_odds_beside) - max(log_odds_beside)
    shares = float(evidence.probabilities.sum()) * shares_of(log_odds)
    return replace(evidence, probabilities=shares, log_odds=log_odds)


def alike(evidence: Evidence, least: float = -SET_LOG_ODDS) -> list[int]:
    """Indices of candidates that these data cannot tell apart, best first: log odds not below ``least``."""
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


def with_undetected(evidence: Evidence) -> Evidence:
    """The evidence with a share for every effect that these data could not have shown.

    A cable that was never slack has shown that it was not.
    """
    base = evidence.base
    factors = []
    for fitted in evidence.candidates:
        if fitted.last_effect.special == "slack":
            factors.append(0.0)
        else:
            fall = base.misfit_in_sample - fitted.misfit_in_sample - complexity_penalty(base, fitted)
            factors.append(bayes_factor(base, fitted, fall, needed_fall(evidence, fitted)))
    prior = PRIOR_EFFECTS / max(len(factors), 1) / PRIOR_NOTHING
    return share_undetected(evidence, factors, prior)


def needed_fall(evidence: Evidence, fitted: FittedModel) -> float:
    """By how much the misfit must fall for a candidate's effect to be told, beside the best model found."""
    base = evidence.base
    remaining = min([base.misfit, *(t.misfit for t in evidence.candidates)])
    in_contact = CONTACT_PENALTY if reaches_contact_alone(fitted) else 0.0
    least = least_explained(base, remaining, base.count) + in_contact * base.count
    return max(least, 2.0 * DECIDING_LOG_ODDS * evidence.temperature)


def share_undetected(evidence: Evidence, factors: Sequence[float], prior: float) -> Evidence:
    """The evidence with a share of "nothing missing" given to effects that the data could not have shown.

    One that the rig's constants speak for so clearly that it is far likelier than nothing is found.

    Args:
        factors: of every candidate, its likelihood against that of nothing. prior: odds of one effect against
            nothing before anything was seen.
    """
    likelier = np.asarray(factors)
    odds = prior * likelier
    if evidence.verdict == Verdict.NOTHING_MISSING and odds.max(initial=0.0) > TOLD_ODDS:
        return replace(_found_by(evidence, odds), undetected=np.zeros(len(odds)), factors=likelier)
    odds = np.minimum(odds, 1.0)
    odds *= min(1.0, MOST_UNDETECTED / max(float(odds.sum()), 1e-300))
    nothing = evidence.nothing / (1.0 + float(odds.sum()))
    return replace(evidence, nothing=nothing, undetected=odds * nothing, factors=likelier)


def _found_by(evidence: Evidence, odds: Array) -> Evidence:
    """The evidence where each effect is so many times as likely as nothing, (candidates,), and found."""
    nothing = evidence.nothing / (1.0 + float(odds.sum()))
    probabilities = evidence.probabilities + odds * nothing
    log_odds = np.log(np.maximum(probabilities, LEAST_PROBABILITY))
    return replace(evidence, nothing=nothing, probabilities=probabilities, log_odds=log_odds - log_odds.max())


def undetectable(evidence: Evidence) -> list[int]:
    """Indices of the candidates whose effect could be there although no verdict says so, likeliest first.

    These are effects of which the data speak rather for than against, and such as a typical strength of
    would not have shown and the data hardly speak against.
    """
    order = np.argsort(-evidence.undetected, kind="stable")
    return [int(i) for i in order if evidence.factors[i] >= 1.0 or _could_hide(evidence, int(i))]


def _could_hide(evidence: Evidence, i: int) -> bool:
    fitted = evidence.candidates[i]
    return evidence.factors[i] >= AS_LIKELY and least_strength(fitted, needed_fall(evidence, fitted)) > 1.0
