"""Many effects at once: a bench that is far from its model, where no effect explains much while others miss.

The path adds one effect at a time, and each must explain a good share of what is left. On a bench that
lacks a dozen things no first step is right: beside a cable that gives by millimetres, friction that is fitted
without it takes a wrong shape, and what comes next mends that. So the search goes the other way here. A model
with the plainest law of everything that a bench has before anybody measured it (friction, slack, stretch,
routing, delay) is fitted at once and refined, what the others make needless is dropped, and only then is more
looked for. Where that finds nothing, a slack cable is tried beside each torque that passes for its tension.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes, with_shapes_of
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.grid_refinement import extend_path, fit_effects, refine_grid
from fingerlab.diagnosis.search.next_effect import ScoreTest, climb_grid
from fingerlab.diagnosis.search.path import earns_its_steps
from fingerlab.diagnosis.settings import (
    CANDIDATES_REFITTED,
    FAR_SHARE,
    FULL_ITERATIONS,
    LEAST_SHARE_OF_MANY,
    LEAST_TAUT,
    MOST_BEYOND,
    NEARLY_AS_GOOD,
    NEEDLESS_SHARE,
    REFINED_BESIDE_SLACK,
    REMOVAL_SHARE,
    SCREEN_ITERATIONS,
    TOO_CLOSE,
    USUAL_SHARE,
)
from fingerlab.effects import EVERYDAY
from fingerlab.effects.base import Effect, Row
from fingerlab.sessions.model import Array


def path_of_many(
    reduction: Reduction,
    catalogue: Sequence[Effect],
    scorer: Scorer,
    base: FittedModel,
    watch: Watch,
) -> tuple[Scorer, list[FittedModel]] | None:
    """A path of many effects that leaves a small share of what is missed; None: there is none.

    Args:
        scorer: on the whole catalogue. base: the model as given.

    Returns:
        What scores it, and its models; what explains most comes first, all under the last one's weights.

    Raises:
        Cancelled: the user asked for it.
    """
    keep, known = len(base.choices), {e.id: e for e in scorer.reduced.layout.effects}
    usual = [known[name] for name in EVERYDAY if name in known and name not in base.effect_ids]
    if len(usual) < 2:
        return None
    watch.tell(0.0, "what every bench has")
    given = [*at_found_shapes(base), *usual]
    alone = Scorer(reduction.of(given, watch))
    fitted = alone.score_held_out(fit_effects(alone, given))
    if not _explains_most(alone, fitted, keep):
        return None
    alone, fitted = refine_grid(reduction, fitted, watch)
    fitted = _without_needless(alone, fitted, keep, REMOVAL_SHARE)
    scorer, fitted = _beside_all(reduction, catalogue, fitted, watch)
    for more_than_usual in range(MOST_BEYOND):
        many = len(fitted.choices) - keep + 1
        watch.tell(more_than_usual / MOST_BEYOND, f"several effects together: {many}")
        longer = _with_one_more(scorer, fitted)
        if longer is None:
            break
        # Refined at once: beside a ripple a sheath takes another shape, and needs no friction of gears then.
        refined = refine_grid(reduction, longer, watch)[1]
        scorer, fitted = _beside_all(reduction, catalogue, refined, watch)
    fitted = _without_needless(scorer, fitted, keep, USUAL_SHARE)
    found = _as_long_as_earned(_in_order(scorer, fitted, keep))
    return (scorer, found) if _explains_most(scorer, found[-1], keep) else None


def _as_long_as_earned(path: list[FittedModel]) -> list[FittedModel]:
    """The path to where all that follow explain too little: several together mend any law a little."""
    steps = range(2, len(path))
    end = next((k for k in steps if not earns_its_steps(path, path[:k], LEAST_SHARE_OF_MANY)), len(path))
    return path[:end]


def path_beside_slack(
    reduction: Reduction,
    catalogue: Sequence[Effect],
    scorer: Scorer,
    base: FittedModel,
    watch: Watch,
) -> tuple[Scorer, list[FittedModel]] | None:
    """A path of effects that show beside a slack cable alone; None: there is none.

    A torque that the motor keeps for itself looks like tension where the cable hangs loose, and neither
    explains anything without the other.

    Args, Returns, Raises:
        As of :func:`path_of_many`.
    """
    effects, held = scorer.reduced.layout.effects, base.effect_ids
    slack = next((e for e in effects if e.special == "slack" and e.id not in held), None)
    if slack is None:
        return None
    followed = {key for keys in slack.follows.values() for key in keys}
    of_drive = [e for e in effects if any(f"{e.id}.{name}" in followed for name in e.gains)]
    tried = [[slack, one] for one in of_drive if one.id not in held]
    if any(one.id in held for one in of_drive):
        tried.insert(0, [slack])
    on_grids: list[tuple[float, FittedModel]] = []
    for more in tried:
        watch.tell(0.0, " and ".join(one.title.lower() for one in more))
        given = [*at_found_shapes(base), *more]
        of_grid = Scorer(reduction.of(given))
        fitted = fit_effects(of_grid, given)
        on_grids.append((of_grid.deviance(fitted), fitted))
    likeliest = sorted(on_grids, key=lambda pair: pair[0])[:REFINED_BESIDE_SLACK]
    found = [refine_grid(reduction, fitted, watch) for _, fitted in likeliest]
    keep = len(base.choices)
    by, best = min(found, key=lambda pair: pair[0].deviance(pair[1]))
    best = _without_needless(by, best, keep, USUAL_SHARE)
    both = slack.id in best.effect_ids and any(one.id in best.effect_ids for one in of_drive)
    if not (both and _explains_most(by, best, keep)):
        return None
    path = [by.score_held_out(by.fit(best.choices[:k], best)) for k in range(keep, len(best.choices))]
    path.append(best)
    longer = extend_path(reduction, catalogue, path, watch)
    by, path = longer or (by, path)
    return by, _in_order(by, path[-1], keep)


def _explains_most(scorer: Scorer, fitted: FittedModel, keep: int) -> bool:
    """Whether a model leaves a small share of what its first ``keep`` effects alone leave."""
    alone = scorer.score_held_out(scorer.fit(fitted.choices[:keep], fitted, FULL_ITERATIONS))
    return fitted.misfit < FAR_SHARE * alone.misfit


def _with_one_more(scorer: Scorer, fitted: FittedModel) -> FittedModel | None:
    """The model with the effect that explains most; None where none explains enough."""
    fitted = scorer.score_held_out(fitted)
    left = _left(fitted)
    tried = [scorer.fit_reweighted(one.choices, one) for one in _promising(scorer, fitted)]
    tried = [scorer.score_held_out(one) for one in tried]
    chosen = _plainest(scorer, fitted, tried)
    if chosen is None:
        return None
    best = climb_grid(scorer, chosen)
    best = scorer.score_held_out(scorer.fit_reweighted(best.choices, best))
    explains = left - _left(best) > LEAST_SHARE_OF_MANY * left
    return best if explains and scorer.deviance(best) < scorer.deviance(fitted) else None


def _left(fitted: FittedModel) -> float:
    """A scored model's misfit; none below the floor, where nothing is left to explain."""
    return max(fitted.misfit, 0.0)


def _promising(scorer: Scorer, fitted: FittedModel) -> list[FittedModel]:
    """The model with each effect of which one step promises most, and with those of which none tells."""
    effects = [e for e in scorer.reduced.layout.effects if e.id not in fitted.effect_ids]
    test = ScoreTest(scorer.data, fitted)
    points = {e.id: test.best_point(e) for e in effects}
    order = sorted(effects, key=lambda e: -points[e.id].gain)
    unranked = sum(points[e.id].gain == float("inf") for e in order)
    result = []
    for effect in order[: unranked + CANDIDATES_REFITTED]:
        point = points[effect.id]
        shapes = range(len(effect.shapes)) if point.gain == float("inf") else [point.shape]
        one = [
            scorer.fit_same_law([*fitted.choices, Choice(effect, i)], fitted, SCREEN_ITERATIONS)
            for i in shapes
        ]
        result.append(min(one, key=lambda m: m.fit.cost))
    return result


def _plainest(scorer: Scorer, base: FittedModel, tried: Sequence[FittedModel]) -> FittedModel | None:
    """The one that explains most of runs left out, or a plainer one that does nearly as well.

    None where the likeliest are others, or where what explains nearly as much is not alike. A constant of
    every model set free is plainer than any law, and of laws that are alike the one that stands first in the
    catalogue.

    Args:
        base, tried: held out.
    """
    before = scorer.deviance(base)
    gains = {t.last_effect.id: before - scorer.deviance(t) for t in tried}
    most = max(gains.values(), default=0.0)
    if most <= 0.0:
        return None
    left, foremost = _left(base), min(tried, key=lambda t: t.misfit)
    near = [t for t in tried if gains[t.last_effect.id] >= NEARLY_AS_GOOD * most]
    freed = [t for t in near if t.last_effect.relaxes]
    alike = [t for t in near if t is foremost or _alike(foremost.last_effect, t.last_effect)]
    explained = TOO_CLOSE * (left - _left(foremost))
    tied = [t for t in near if t not in alike and left - _left(t) >= explained]
    if foremost not in near or (tied and not freed):
        return None
    order = [e.id for e in scorer.reduced.layout.effects]
    return min(freed or alike, key=lambda t: order.index(t.last_effect.id))


def _alike(one: Effect, other: Effect) -> bool:
    named = [(one, other), (other, one)]
    return any(a.formula is not None and b.id in a.formula.alike for a, b in named)


def _beside_all(
    reduction: Reduction, catalogue: Sequence[Effect], fitted: FittedModel, watch: Watch
) -> tuple[Scorer, FittedModel]:
    """The model at its shapes, and what scores it and every other effect beside it."""
    given = at_found_shapes(fitted)
    scorer = Scorer(reduction.of(with_shapes_of(catalogue, given), watch))
    return scorer, scorer.fit_reweighted([Choice(one) for one in given], fitted)


def _without_needless(scorer: Scorer, fitted: FittedModel, keep: int, usual: float) -> FittedModel:
    """The model less the effects of which the others leave nothing to explain, the idlest first.

    What every bench has also stays where a single equation needs it: slack is seen in the cable's alone, of
    which the score, where much is left of the others, says nothing.

    Args:
        usual: share by which the squared score rises at least without what every bench has.

    Returns:
        Held out.
    """
    fitted = scorer.score_held_out(fitted, residuals=True)
    while len(fitted.choices) > keep + 1:
        spared = _each_left_out(scorer, fitted, keep, residuals=True)
        each = zip(fitted.choices[keep:], spared, strict=True)
        rises = [_rise_without(scorer, c, fitted, one, usual) for c, one in each]
        if min(rises) > 1.0:
            break
        idlest = spared[int(np.argmin(rises))]
        fitted = scorer.score_held_out(scorer.fit_reweighted(idlest.choices, idlest), residuals=True)
    return fitted


def _rise_without(
    scorer: Scorer, left_out: Choice, fitted: FittedModel, without: FittedModel, usual: float
) -> float:
    """By how much what is missed rises without an effect, in shares of it that are needless for its kind."""
    explained = _left(without) - _left(fitted)
    if left_out.effect.id not in EVERYDAY:
        return explained / (LEAST_SHARE_OF_MANY * _left(without)) if explained > 0.0 else 0.0
    rise = explained / (_left(fitted) + fitted.count)
    before, after = _mean_squares(scorer, fitted), _mean_squares(scorer, without)
    seen = before > 0.0
    most = float((after[seen] / before[seen] - 1.0).max(initial=0.0))
    return max(rise / usual, most / NEEDLESS_SHARE)


def _mean_squares(scorer: Scorer, fitted: FittedModel) -> Array:
    """Of the equations' residuals, noise included, (groups, 5); the cable's where it counts."""
    squares = np.array([np.diag(fitted.residuals[g.key]) for g in scorer.reduced.groups])
    if fitted.model.slack_free:
        taut = [sum(f.taut_samples for f in g.folds) / max(g.samples, 1) for g in scorer.reduced.groups]
        squares[:, Row.CABLE] /= np.maximum(taut, LEAST_TAUT)
    return squares


def _each_left_out(
    scorer: Scorer, fitted: FittedModel, keep: int, residuals: bool = False
) -> list[FittedModel]:
    """The model without each of its effects beyond the first ``keep``, held out, under its weights."""
    choices = fitted.choices
    without = (
        scorer.fit([*choices[:i], *choices[i + 1 :]], fitted, FULL_ITERATIONS)
        for i in range(keep, len(choices))
    )
    return [scorer.score_held_out(one, residuals) for one in without]


def _in_order(scorer: Scorer, fitted: FittedModel, keep: int) -> list[FittedModel]:
    """The path to a model, held out: always what explains most beside those before it, of runs left out.

    Of effects that explain nearly as much, the one comes first that the whole model can spare least.
    """
    without = zip(fitted.choices[keep:], _each_left_out(scorer, fitted, keep), strict=True)
    rest = [c for c, one in sorted(without, key=lambda pair: -pair[1].misfit)]
    path = [scorer.score_held_out(scorer.fit(fitted.choices[:keep], fitted, FULL_ITERATIONS))]
    while rest:
        longer = [scorer.fit([*path[-1].choices, one], fitted, FULL_ITERATIONS) for one in rest]
        longer = [scorer.score_held_out(one) for one in longer]
        gains = [path[-1].misfit - one.misfit for one in longer]
        most = max(gains)  # below zero where none gains: then what can be spared least comes next
        near = next((i for i, gain in enumerate(gains) if gain >= TOO_CLOSE * most), 0)
        path.append(longer[near])
        del rest[near]
    return path
