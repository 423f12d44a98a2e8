"""Whether a bench changed at one moment, drifted or stayed: a change named, with its probability.

Three laws are weighed for every quantity over time: steady, a straight drift, and a step between two sessions
that follow one another. For a number, with normal scatter of unknown size, the Bayes factors are those of a
regression against the mean alone under the prior of Zellner and Siow (Liang et al., "Mixtures of g priors for
Bayesian variable selection", J. Am. Stat. Assoc. 103, 2008, eqs. 6 and 9). Whether an effect was found
missing is a yes or no of each session: one rate, or one before and another after, under Jeffreys' prior.

A step may lie anywhere, so its factor is the mean over all places. One that is found in many quantities is
judged as one of many: beforehand, as much speaks for no change in any of them as for a change in one. Two
sessions at least stand on either side, so that one that went wrong is no change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.batch.table import Row, ageing_rows, days_of, followed_columns, number_of
from fingerlab.core.text import ParameterEstimate
from fingerlab.sessions.model import Array

LEAST_SIDE = 2
"""Sessions on either side of a step."""
LEAST_SESSIONS = 5
"""Fewer leave a step and a slope nearly alike."""
TOLD = 0.5
"""From this probability on a change is named."""
MOSTLY = 0.5
"""An effect is in the models of a side if it is in more than so many of them."""


@dataclass(frozen=True)
class Weighed:
    """What became of one quantity.

    Attributes:
        steady, drift, step: probabilities, together 1. place: number of sessions before the likeliest step.
        certain_place: probability of that place, if there is a step.
    """

    steady: float
    drift: float
    step: float
    place: int
    certain_place: float


@dataclass(frozen=True)
class Change:
    """Something that changed between two sessions.

    Attributes:
        kind: "new" or "gone" (an effect that is missing only after it, or only before it), "grown" or
            "shrunk" (the same effect, of another strength), "moved" (a number of the bench).
        effect: id of the effect; empty: none. column: of the number that moved; empty: none.
        chance: probability that there was a step, 0 to 1. certain_place: that it was here, if so.
        before, after: names of the sessions next to it. when: ISO time of the one after it.
        first, second: the number's mean on either side with its 90 % interval; None without one.
        found: sessions with the effect and all sessions, before and after.
        others: columns that moved with it.
    """

    kind: str
    effect: str
    column: str
    chance: float
    certain_place: float
    before: str
    after: str
    when: str
    first: ParameterEstimate | None = None
    second: ParameterEstimate | None = None
    found: tuple[int, int, int, int] = (0, 0, 0, 0)
    others: tuple[str, ...] = ()


def weigh(days: Array, values: Array, prior: float = 0.5) -> Weighed | None:
    """Steady, drift or step of a number; None for fewer than five sessions or with no place for a step.

    Args:
        days: of recording, (n,), rising. values: (n,).
        prior: probability of any change beforehand, half of it of a drift.
    """
    places = _places(days)
    if len(values) < LEAST_SESSIONS or not places:
        return None
    steps = [_factor(values, (np.arange(len(values)) >= place).astype(float)) for place in places]
    return _weighed(places, steps, _factor(values, days), prior)


def weigh_found(days: Array, found: Sequence[bool], prior: float = 0.5) -> Weighed | None:
    """The same of whether something was found; a drift is not asked for."""
    places = _places(days)
    if len(found) < LEAST_SESSIONS or not places:
        return None
    hits = np.asarray(found, dtype=bool)
    one = _rate(hits)
    steps = [math.exp(_rate(hits[:place]) + _rate(hits[place:]) - one) for place in places]
    return _weighed(places, steps, 0.0, prior)


def _places(days: Array) -> list[int]:
    """Numbers of sessions that may stand before a step: not between two of one time."""
    inside = range(LEAST_SIDE, len(days) - LEAST_SIDE + 1)
    return [place for place in inside if days[place] > days[place - 1]]


def _factor(values: Array, regressor: Array) -> float:
    """Bayes factor of a regression against the mean alone."""
    n = len(values)
    spread, centred = values - values.mean(), regressor - regressor.mean()
    total, size = float(spread @ spread), float(centred @ centred)
    if total <= 0.0 or size <= 0.0:  # nothing differs at all
        return 0.0
    missed = max(1.0 - float(spread @ centred) ** 2 / (total * size), 1e-12)
    g = np.exp(_LOG_G)
    prior = 0.5 * (np.log(0.5 * n / np.pi) - _LOG_G - n / g)  # of log g: inverse gamma (1/2, n/2)
    factor = 0.5 * (n - 2) * np.log1p(g) - 0.5 * (n - 1) * np.log1p(g * missed)
    return float(np.sum(np.exp(prior + factor)) * (_LOG_G[1] - _LOG_G[0]))


_LOG_G = np.linspace(-6.0, 30.0, 361)
"""Over which the weight of the prior is integrated; beyond, nothing is left."""


def _rate(hits: Array) -> float:
    """Logarithm of the probability of a sequence of yes and no whose rate may be anything."""
    yes, n = int(np.sum(hits)), len(hits)
    return math.lgamma(yes + 0.5) + math.lgamma(n - yes + 0.5) - math.lgamma(n + 1) - math.log(math.pi)


def _weighed(places: list[int], steps: Sequence[float], drift: float, prior: float) -> Weighed:
    mean = float(np.mean(steps))
    share = 0.5 * prior if drift else prior
    weights = np.array([1.0 - prior, share * drift, share * mean])
    steady, drifts, step = map(float, weights / weights.sum())
    best = int(np.argmax(steps))
    certain = steps[best] / sum(steps) if sum(steps) > 0 else 0.0
    return Weighed(steady, drifts, step, places[best], certain)


def changes(rows: Sequence[Row], units: Mapping[str, str]) -> list[Change]:
    """What changed between two sessions, surest first; what is as likely steady as not is left out."""
    usable = ageing_rows(rows)
    days = days_of(usable)
    effects = sorted({str(name) for row in usable for name in _model(row)})
    columns = [*followed_columns(usable)[2:], *_strengths(usable)]  # not the errors: they only follow
    columns = list(dict.fromkeys(columns))
    prior = 1.0 / (1.0 + max(len(effects) + len(columns), 1))
    found = [c for column in columns if (c := _of_column(usable, days, column, units, prior)) is not None]
    found += [c for effect in effects if (c := _of_effect(usable, days, effect, prior)) is not None]
    moments: dict[str, list[Change]] = {}
    for change in found:
        moments.setdefault(change.after, []).append(change)
    return sorted(map(_named, moments.values()), key=lambda one: -one.chance)


ORDER = ("new", "gone", "grown", "shrunk", "moved")


def _named(together: Sequence[Change]) -> Change:
    """What changed at one moment: the effect that came, went or grew; all else moved with it.

    A fit that lacks an effect leans on the others, so that their numbers step when it comes.
    """

    def rank(one: Change) -> tuple[int, bool, float, float]:
        before, n, after, m = one.found
        share = abs(after / max(m, 1) - before / max(n, 1))
        return ORDER.index(one.kind), bool(one.effect) and one.kind == "moved", -share, -one.chance

    first, *others = sorted(together, key=rank)
    if first.effect:
        own = [one for one in together if one.effect == first.effect]
        best = max(own, key=lambda one: (bool(one.column), one.chance))
        sure = max(own, key=lambda one: one.chance)
        first = replace(best, kind=first.kind, chance=sure.chance, certain_place=sure.certain_place)
        others = [one for one in together if one.effect != first.effect]
    return replace(first, others=tuple(one.column for one in others if one.column))


def _of_effect(rows: Sequence[Row], days: Array, effect: str, prior: float) -> Change | None:
    found = [effect in _model(row) for row in rows]
    weighed = weigh_found(days, found, prior)
    if weighed is None or weighed.step < TOLD:
        return None
    k = weighed.place
    counts = (sum(found[:k]), k, sum(found[k:]), len(found) - k)
    kind = "new" if counts[0] * counts[3] < counts[2] * counts[1] else "gone"
    return _change(rows, k, weighed, kind, effect, "", counts)


def _of_column(
    rows: Sequence[Row], days: Array, column: str, units: Mapping[str, str], prior: float
) -> Change | None:
    values = np.array([number_of(row.get(column)) for row in rows])
    known = np.flatnonzero(np.isfinite(values))
    weighed = weigh(days[known], values[known], prior) if len(known) else None
    if weighed is None or weighed.step < TOLD:
        return None
    k, unit = weighed.place, units.get(column, "1")
    kept = [rows[int(i)] for i in known]
    first, second = (_mean(part, unit) for part in (values[known][:k], values[known][k:]))
    effect = effect_of(column)
    counts = (sum(effect in _model(r) for r in kept[:k]), k, sum(effect in _model(r) for r in kept[k:]),
              len(kept) - k)  # fmt: skip
    grown = "grown" if abs(second.value) > abs(first.value) else "shrunk"
    kinds = {(False, True): "new", (True, False): "gone", (True, True): grown}
    sides = counts[0] > MOSTLY * counts[1], counts[2] > MOSTLY * counts[3]
    return _change(kept, k, weighed, kinds.get(sides, "moved"), effect, column, counts, first, second)


def _change(
    rows: Sequence[Row], k: int, weighed: Weighed, kind: str, effect: str, column: str,
    found: tuple[int, int, int, int], first: ParameterEstimate | None = None,
    second: ParameterEstimate | None = None,
) -> Change:  # fmt: skip
    before, after = rows[k - 1], rows[k]
    return Change(
        kind, effect, column, weighed.step, weighed.certain_place, str(before["session"]),
        str(after["session"]), str(after["created"]), first, second, found,
    )  # fmt: skip


def _mean(values: Array, unit: str) -> ParameterEstimate:
    """Mean with its 90 % interval by Student's t."""
    from scipy.stats import t

    mean, n = float(values.mean()), len(values)
    half = float(t.ppf(0.95, n - 1) * values.std(ddof=1) / math.sqrt(n))
    return ParameterEstimate(mean, unit, mean - half, mean + half)


def _model(row: Row) -> tuple[str, ...]:
    return tuple(row.get("final_model") or ())


def _strengths(rows: Sequence[Row]) -> list[str]:
    """Columns of the strengths of effects that were in models."""
    names = sorted({name for row in rows for name in row})
    return [n for n in names if n.startswith("param.") and effect_of(n) and not n.endswith((".low", ".high"))]


def effect_of(column: str) -> str:
    """The effect whose strength a column holds; empty: none's."""
    kind, _, rest = column.partition(".")
    if kind == "alone" or (kind == "param" and "." in rest):
        return rest.partition(".")[0]
    return ""
