"""Laws that contain others: Stribeck's is Coulomb's and more, so that of one friction one of the two stands.

The larger law can do all that the smaller one does. Beside each other they share what one of them does; by
itself the larger one takes up what only the shape of the smaller one lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import justified, lacks_fit, log_odds_among
from fingerlab.diagnosis.search.grid_refinement import refine_path
from fingerlab.diagnosis.settings import FAR_LEFT, FULL_ITERATIONS, LOOKING_ITERATIONS, RIVAL_LOG_ODDS
from fingerlab.effects.base import Effect


def holds(effect: Effect, law: Effect) -> bool:
    """Whether an effect is a law with further gains."""
    return bool(law.gains) and law.gains.keys() < effect.gains.keys() and law.equation == effect.equation


def with_plainer_end(
    reduction: Reduction,
    catalogue: Sequence[Effect],
    scorer: Scorer,
    path: Sequence[FittedModel],
    watch: Watch,
) -> tuple[Scorer, list[FittedModel]]:
    """The path; where a plainer law than an effect's does as well beside the others, with that one.

    On its grid a law with gains to spare takes up what only the shape of the plainer one lacks, or what later
    effects explain.
    """
    steps = list(path)
    for place in range(len(path[0].choices), len(path[-1].choices)):
        law = steps[-1].choices[place].effect if place < len(steps[-1].choices) else None
        if law is None or not law.excess:
            continue
        plainer = [e for e in catalogue if holds(law, e) and e.id not in steps[-1].effect_ids]
        for effect in plainer:
            scorer, steps = _plainer_at(reduction, scorer, steps, place, effect, watch)
    return scorer, steps


def without_contained_laws(
    reduction: Reduction, scorer: Scorer, path: Sequence[FittedModel], watch: Watch
) -> tuple[Scorer, list[FittedModel]]:
    """The path without laws that another one of it contains, where that does as well alone, refined.

    Beside each other two laws share what is one friction, each at a shape of its own, and both together mend
    what the shape of one lacks. They stay where one leaves more than any friction's own law does.
    """
    steps = list(path)
    for contained in path[-1].choices[len(path[0].choices) :]:
        end = steps[-1]
        larger = next((c for c in end.choices if holds(c.effect, contained.effect)), None)
        if larger is None:
            continue
        place = end.effect_ids.index(contained.effect.id)
        others = [c for k, c in enumerate(end.choices) if k != place and c is not larger]
        others.insert(min(place, end.choices.index(larger)), larger)
        fewer = [
            scorer.fit(others[:k], end, LOOKING_ITERATIONS)
            for k in range(len(path[0].choices) + 1, len(others))
        ]
        begun = scorer.fit_reweighted(others, end)
        by, shorter = refine_path(reduction, [path[0], *fewer, begun], watch)
        if len(shorter) >= len(steps):
            continue
        both = _with_last(scorer, end, place, end.weights)
        alone = by.score_held_out(by.fit(shorter[-1].choices, shorter[-1], FULL_ITERATIONS, end.weights))
        if not (justified(alone, both) and lacks_fit(alone, FAR_LEFT)):
            scorer, steps = by, shorter
    return scorer, steps


def _plainer_at(
    reduction: Reduction,
    scorer: Scorer,
    path: list[FittedModel],
    place: int,
    effect: Effect,
    watch: Watch,
) -> tuple[Scorer, list[FittedModel]]:
    """The path, or that with an effect in place of another one, if the latter is not twice as likely."""
    end, first = path[-1], len(path[0].choices)
    given = at_found_shapes(end)
    effect = _with_shape_of(effect, given[place])
    effects = [*given[:place], effect, *given[place + 1 :]]
    by = Scorer(reduction.refined(effects, watch))
    each = [
        by.fit([Choice(e, i if e is effect else 0) for e in effects], end, LOOKING_ITERATIONS)
        for i in range(len(effect.shapes))
    ]
    best = by.fit_reweighted(min(each, key=lambda m: m.fit.cost).choices, end)
    fewer = [by.fit(best.choices[:k], best, LOOKING_ITERATIONS) for k in range(first + 1, len(effects))]
    finer, steps = refine_path(reduction, [path[0], *fewer, best], watch)
    if len(steps) != len(path):
        return scorer, path
    weights = steps[-1].weights
    rivals = [_with_last(finer, steps[-1], place, weights), _with_last(scorer, end, place, weights)]
    base = finer.score_held_out(finer.fit(rivals[0].choices[:-1], steps[-1], FULL_ITERATIONS, weights))
    odds = log_odds_among(base, rivals)
    return (finer, steps) if odds[0] > odds[1] - RIVAL_LOG_ODDS else (scorer, path)


def _with_shape_of(plainer: Effect, law: Effect) -> Effect:
    """The plainer law with the shape at which the one that contains it was found, without what is its own.

    As it is, if the larger one was found at none of its numbers.
    """
    own = law.shape_units.keys() - plainer.shape_units.keys()
    found = {name: number for name, number in law.shapes[0].items() if name not in own}
    known = found in plainer.shapes or not found.keys() & plainer.shape_units.keys()
    return plainer if known else replace(plainer, shapes=(found, *plainer.shapes))


def _with_last(scorer: Scorer, fitted: FittedModel, place: int, weights: Weights) -> FittedModel:
    """The model, held out under these weights, with the effect of that place as its last."""
    choices = fitted.choices
    order = [*choices[:place], *choices[place + 1 :], choices[place]]
    return scorer.score_held_out(scorer.fit(order, fitted, FULL_ITERATIONS, weights))
