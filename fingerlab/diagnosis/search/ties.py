"""Effects that are alike on their grids, told apart by what they leave between the points.

On its grid a true law may leave as much as a wrong one that happens to lie on a better point. So effects that
a search could not tell apart are each looked at again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.data import Weights, change
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.evidence import Evidence, alike, shares_of
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit, log_odds_among, misfit_of_log_odds
from fingerlab.diagnosis.search.contained_laws import holds
from fingerlab.diagnosis.search.grid_refinement import can_refine, refine_grid, refine_last
from fingerlab.diagnosis.settings import (
    FAR_LEFT,
    FAR_LOG_ODDS,
    FULL_ITERATIONS,
    LACK_OF_FIT,
    LOOKING_ITERATIONS,
    MOST_RIVALS,
    MOST_RIVALS_FAR_OFF,
    NEAR_SHARE,
    NEARLY_RIGHT,
    OTHER_FLOORS,
    SET_LOG_ODDS,
)
from fingerlab.effects.base import Effect

Refined = Mapping[str, tuple[Scorer, FittedModel]]
"""Effects as they are between the points of their grids, by id: the model, and what scored it."""
NOTHING: Refined = MappingProxyType({})
"""No effect was looked at between the points of its grid."""


def break_ties(
    reduction: Reduction,
    scorer: Scorer,
    evidence: Evidence,
    weights: Weights,
    watch: Watch,
    least: float = -SET_LOG_ODDS,
    also: frozenset[str] = frozenset(),
    known: Refined = NOTHING,
) -> tuple[Evidence, Refined]:
    """The evidence with the odds of effects that are alike on their grids as refined shapes give them.

    Args:
        weights: from which effects without other shapes are reweighted. least: log odds of what is alike.
        also: nonlinear unknowns; effects that may go by one of them are looked at in any case.
        known: what was refined already, from the same points.

    Returns:
        The evidence, and what was looked at.

    Raises:
        Cancelled: the user asked for it.
    """
    tied = ties_to_refine(evidence, least, also)
    if not tied:
        return evidence, {}
    on_grid = {i: _in_own_floors(scorer, evidence.candidates[i]) for i in tied}
    tied = _likeliest_first(scorer, tied, on_grid)
    refined: list[tuple[Scorer, FittedModel]] = []
    beaten: list[int] = []
    for i in tied:
        candidate = evidence.candidates[i]
        if candidate.last_effect.id in known:
            one = known[candidate.last_effect.id]
        elif can_refine(candidate.choices):
            lost = _beaten(scorer, on_grid[i], *refined[0]) if refined else None
            if lost is not None:
                beaten.append(len(refined))
            one = lost or _near_or_far(reduction, scorer, candidate, refined, also, watch)
        else:
            one = scorer, scorer.fit_reweighted(candidate.choices, candidate, weights)
            weights = one[1].weights
        refined.append(one if refined else (one[0], one[0].score_held_out(one[1])))
    laws = (evidence.candidates[i].last_effect for i in tied)
    refined = [
        one if place in beaten else _no_worse_than_held(reduction, law, one, refined, watch)
        for place, (law, one) in enumerate(zip(laws, refined, strict=True))
    ]
    # All are scored in the floors of the likeliest, and judged there or in their own.
    floors = min((by.deviance(fitted), k) for k, (by, fitted) in enumerate(refined))[1]
    under = refined[floors][1].weights
    scored = [
        by.score_held_out(by.fit(fitted.choices, fitted, FULL_ITERATIONS, under)) for by, fitted in refined
    ]
    found = {
        one.last_effect.id: (by, one)
        for place, ((by, _), one) in enumerate(zip(refined, scored, strict=True))
        if place not in beaten
    }
    return with_refined_odds(evidence, tied, _judged(refined, scored, floors)), found


def _in_own_floors(scorer: Scorer, candidate: FittedModel) -> FittedModel:
    """The effect on its grid under its own weights, where these are other floors than it was judged in."""
    if change(candidate.weights, scorer.own_weights(candidate)) <= OTHER_FLOORS:
        return candidate
    return scorer.fit_reweighted(candidate.choices, candidate)


def _other_floors(one: FittedModel, other: FittedModel) -> bool:
    """Whether the weights of two models are those of floors that differ."""
    return change(one.weights, other.weights) > OTHER_FLOORS


def _likeliest_first(scorer: Scorer, tied: list[int], on_grid: Mapping[int, FittedModel]) -> list[int]:
    """The candidates; one that is by far likelier than the first in its own floors before all others."""
    deviances = {i: scorer.deviance(on_grid[i]) for i in tied}
    best = min(tied, key=deviances.__getitem__)
    near = deviances[tied[0]] <= deviances[best] + LACK_OF_FIT * scorer.data.count
    if near or not _other_floors(on_grid[tied[0]], on_grid[best]):
        return tied
    return [best, *(i for i in tied if i != best)]


def _beaten(
    scorer: Scorer, on_grid: FittedModel, by: Scorer, best: FittedModel
) -> tuple[Scorer, FittedModel] | None:
    """The effect on its grid, if it lacks far more in its own floors than the best; None: it may come near.

    Args:
        by, best: what is likeliest on the grids, refined and held out in its own floors.
    """
    if lacks_fit(best) or not _other_floors(on_grid, best):
        return None
    if scorer.deviance(on_grid) <= by.deviance(best) + FAR_LEFT * best.count:
        return None
    held_out = scorer.score_held_out(on_grid)
    return (scorer, held_out) if lacks_fit(held_out, FAR_LEFT) else None


def _near_or_far(
    reduction: Reduction,
    scorer: Scorer,
    candidate: FittedModel,
    refined: Sequence[tuple[Scorer, FittedModel]],
    also: frozenset[str],
    watch: Watch,
) -> tuple[Scorer, FittedModel]:
    """The effect between the points of its grid; only at its best shape where that is far from the first."""
    far = _far_from(reduction, scorer, candidate, refined[0][1], watch) if refined else None
    # A law by one of these numbers may lie two steps from the grid, and was not seen in one.
    if far is not None and also & candidate.last_effect.shape_units.keys():
        far = far if lacks_fit(far[1], FAR_LEFT) else None
    return far or refine_grid(reduction, candidate, watch)


def _judged(
    refined: Sequence[tuple[Scorer, FittedModel]], scored: Sequence[FittedModel], likeliest: int
) -> list[FittedModel]:
    """The laws in the floors of the likeliest; one that lacks fit in its own, and is far off, in those.

    What a friction of the joints holds near a reversal goes by angles that are noisy, and that is noise of
    its law: in such floors a friction of the drive, which has none of it, hides what it leaves.

    Args:
        refined: under their own weights. scored: the same under those of the ``likeliest``.
    """
    by, first = refined[likeliest]
    if lacks_fit(by.score_held_out(first)):
        return list(scored)
    far = by.deviance(first) + LACK_OF_FIT * first.count
    judged = []
    for (its, fitted), one in zip(refined, scored, strict=True):
        behind = its.deviance(fitted) > far and _other_floors(fitted, first)
        own = its.score_held_out(fitted) if behind else one
        judged.append(own if lacks_fit(own) else one)
    return judged


def _no_worse_than_held(
    reduction: Reduction,
    law: Effect,
    refined: tuple[Scorer, FittedModel],
    others: Sequence[tuple[Scorer, FittedModel]],
    watch: Watch,
) -> tuple[Scorer, FittedModel]:
    """A law at its refined shape; where it leaves more than one that it holds, from the shape of that on.

    With its further gains at zero it leaves as much: the shapes around the best point of its own grid, on
    which it is the ``law``, do not always lead there. Only if it is nearly right: of laws that leave far more
    none is the first of a path for being a little better than what it holds.
    """
    best = refined
    for by, held in others:
        if not holds(law, held.last_effect) or by.deviance(held) >= best[0].deviance(best[1]):
            continue
        choice = held.choices[-1]
        own = law.shape_units.keys() - choice.effect.shape_units.keys()
        each = [{name: shape[name] for name in own & shape.keys()} for shape in law.shapes]
        numbers = [one for place, one in enumerate(each) if one not in each[:place]]
        found = choice.effect.shapes[choice.shape]
        last = replace(law, shapes=tuple({**found, **one} for one in numbers))
        effects = [*at_found_shapes(held)[:-1], last]
        scorer = Scorer(reduction.refined(effects, watch))
        tried = [
            scorer.fit([Choice(e, i if e is last else 0) for e in effects], held, LOOKING_ITERATIONS)
            for i in range(len(last.shapes))
        ]
        finer, again = refine_grid(reduction, min(tried, key=lambda one: one.fit.cost), watch)
        if not lacks_fit(finer.score_held_out(again), FAR_LEFT):
            best = min(best, (finer, again), key=lambda one: one[0].deviance(one[1]))
    return best


def _far_from(
    reduction: Reduction,
    scorer: Scorer,
    candidate: FittedModel,
    best: FittedModel,
    watch: Watch,
) -> tuple[Scorer, FittedModel] | None:
    """The effect at its best shape under the weights of the likeliest one; None: it comes near that, or may.

    The more the likeliest leaves, the further off is another law that may still come to lead.

    Args:
        best: the likeliest on their grids, refined and held out.
    """
    if holds(candidate.last_effect, best.last_effect):
        return None
    under = scorer.fit(candidate.choices, candidate, LOOKING_ITERATIONS, best.weights)
    by, found = refine_last(reduction, under, watch)
    found = by.score_held_out(found)
    least = max(best.misfit, 0.0) / max(best.count, 1.0)
    near = best.count * misfit_of_log_odds(FAR_LOG_ODDS, least)
    return (by, found) if found.misfit > near else None


def rescore_refined(found: Refined, weights: Weights) -> Refined:
    """The effects between the points of their grids, fitted and held out under these weights."""
    return {
        name: (by, by.score_held_out(by.fit(one.choices, one, FULL_ITERATIONS, weights)))
        for name, (by, one) in found.items()
    }


def ties_to_refine(
    evidence: Evidence, least: float = -SET_LOG_ODDS, also: frozenset[str] = frozenset()
) -> list[int]:
    """Indices of the likeliest candidates that are alike; none where refined shapes cannot tell them apart.

    So where one is alone, or where no shape of any is left to look at. Beside those that are as likely on
    their grids stand those that explain nearly as much as the best, whose grid may be coarser. Where the best
    leaves much, a law that holds the gains of one of them and more is looked at, too: on a grid as coarse as
    its own it may leave more than the plain one.
    """
    candidates = evidence.candidates
    much = evidence.least_left > NEARLY_RIGHT
    tied = _first_rivals(candidates, alike(evidence, least), MOST_RIVALS_FAR_OFF if much else MOST_RIVALS)
    others = {i for i, one in enumerate(candidates) if also & one.last_effect.shape_units.keys()}
    if much:
        laws = [candidates[i].last_effect for i in tied]
        others |= {i for i, one in enumerate(candidates) if any(holds(one.last_effect, law) for law in laws)}
    others.update(_near_the_best(evidence))
    tied += sorted(others.difference(tied))
    return [] if len(tied) < 2 or not any(can_refine(candidates[i].choices) for i in tied) else tied


def _first_rivals(candidates: Sequence[FittedModel], alike: Sequence[int], most: int) -> list[int]:
    """The likeliest of some candidates, down to so many that have other shapes to look at."""
    first: list[int] = []
    refinable = 0
    for i in alike:
        if refinable == most:
            break
        first.append(i)
        refinable += can_refine(candidates[i].choices)
    return first


def _near_the_best(evidence: Evidence) -> list[int]:
    """Indices of candidates that explain nearly as much as the best, with shapes that are left to look at."""
    left = np.array([one.misfit for one in evidence.candidates])
    most = left.min() + NEAR_SHARE * (max(evidence.base.misfit, 0.0) - left.min())
    near = [int(i) for i in np.argsort(left) if left[i] <= most]
    return [i for i in near[:MOST_RIVALS] if can_refine(evidence.candidates[i].choices)]


def with_refined_odds(evidence: Evidence, tied: Sequence[int], refined: Sequence[FittedModel]) -> Evidence:
    """The evidence with the odds of the ``tied`` candidates by what they leave at their refined shapes."""
    log_odds = evidence.log_odds.copy()
    log_odds[tied] = log_odds_among(evidence.base, refined)
    found = float(evidence.probabilities.sum())
    return replace(evidence, log_odds=log_odds, probabilities=found * shares_of(log_odds))
