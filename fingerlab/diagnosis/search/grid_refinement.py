"""The recordings read again for the effects that were found alone, between the points of their grids.

The catalogue is searched on coarse grids, for every point costs columns in every pass over the data. What is
found is then read once more, with few columns of other effects in the way: finer shapes around the best
one, and other laws of the same physics. A law that is only nearly right leaves a remainder that passes for
more physics, so every step of the path is judged again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import SILENT, Watch
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import (
    FittedModel,
    at_found_shapes,
    own_keys,
    with_other_laws,
    with_shapes_of,
)
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import (
    justified,
    least_fall,
    redundant_steps,
)
from fingerlab.diagnosis.search.next_effect import climb_grid, judge_all, off_its_bounds
from fingerlab.diagnosis.search.path import forward_selection, reordered, worth_adding
from fingerlab.diagnosis.settings import (
    DECIDING_LOG_ODDS,
    FOLLOWING_ROUNDS,
    FULL_ITERATIONS,
    LEAST_NEAR_SHAPES,
    LONGEST_PATH,
    LOOKING_ITERATIONS,
    NEAR_SHAPES,
    OFF_GRID_PASSES,
    SAME_SHAPE,
    SHAPE_PASSES,
    SHAPE_ROUNDS,
    STEP_GAIN,
)
from fingerlab.effects.base import Effect, Shape, of_shape


def fit_effects(scorer: Scorer, effects: Sequence[Effect]) -> FittedModel:
    """All effects in, each at the point of its grid that fits best beside the others; own weights."""
    fitted = scorer.bare
    for one in effects:
        choices = list(fitted.choices)
        shapes = [
            scorer.fit([*choices, Choice(one, i)], fitted, LOOKING_ITERATIONS) for i in range(len(one.shapes))
        ]
        fitted = climb_grid(scorer, min(shapes, key=lambda m: m.fit.cost))
        fitted = off_its_bounds(scorer, scorer.fit_reweighted(fitted.choices, fitted), FULL_ITERATIONS)
        if fitted.last_effect.widened != one.widened:
            fitted = scorer.fit_reweighted(fitted.choices, fitted)
    return _at_best_shapes(scorer, fitted) if len(effects) > 1 else fitted


def fit_refined(
    reduction: Reduction,
    effects: Sequence[Effect],
    watch: Watch = SILENT,
    look: Callable[[Scorer, FittedModel], None] | None = None,
) -> tuple[Scorer, FittedModel]:
    """All effects in, fitted on their grids and then between the points; own weights.

    Args:
        look: is shown the model on the grids, which is there long before the other, and then that.

    Raises:
        UserError: an effect does not apply to these runs, or a run cannot be read.
        Cancelled: the user asked for it.
    """
    effects = reduction.suited(effects)
    scorer = Scorer(reduction.of(effects, watch))
    for one in effects:
        if one not in scorer.reduced.layout.effects:
            raise UserError(f"{one.title} ({one.id}) does not apply to these runs; leave it out.")
    fitted = fit_effects(scorer, effects)
    if look is not None:
        look(scorer, fitted)
    if not can_refine(fitted.choices):
        return scorer, fitted
    scorer, fitted = refine_grid(reduction, fitted, watch)
    if look is not None:
        look(scorer, fitted)
    return scorer, fitted


def refine_grid(
    reduction: Reduction,
    found: FittedModel,
    watch: Watch = SILENT,
) -> tuple[Scorer, FittedModel]:
    """The effects at the best of the shapes around those found, under their own model's weights.

    Where a shape takes numbers from what is fitted, it is fitted again until they stand, and if they have
    moved, or another law was better, the shapes are looked at once more; around a law that no grid holds, for
    as long as a better one is found. So they are where a shape went far, which then has to be clearly better
    for that: two numbers that do nearly the same run away along each other for next to nothing.

    Raises:
        Cancelled: the user asked for it.
    """
    choices, near = _with_dependent_shapes(found), None
    for passed in range(1, OFF_GRID_PASSES + 1):
        finer = [_finer(c) for c in choices]
        places = [_place(e.shapes, c.effect.shapes[c.shape]) for e, c in zip(finer, choices, strict=True)]
        scorer = Scorer(reduction.refined(finer, watch))
        began = [Choice(e, place) for e, place in zip(finer, places, strict=True)]
        of_shapes = fitted = reduction.remember(finer, places, partial(_best_of_finer, scorer, finer, places))
        scorer, fitted = _iterate_dependent_shapes(reduction, scorer, fitted, watch)
        if near is not None and scorer.deviance(fitted) > near[0].deviance(near[1]) - 2.0 * DECIDING_LOG_ODDS:
            return near
        moved = bool(_moved_shapes(of_shapes)) or any(map(_is_another_law, fitted.choices, began))
        off_grid = any(map(_is_beyond_grid, fitted.choices, found.choices))
        again = passed < SHAPE_PASSES and moved
        again = again or (off_grid and [c.shape for c in fitted.choices] != places)
        far = not again and passed < SHAPE_PASSES and any(map(_went_far, fitted.choices, began))
        if not (again or far):
            break
        near = (scorer, fitted) if far else None
        choices = _with_dependent_shapes(fitted)
    return scorer, fitted


def _iterate_dependent_shapes(
    reduction: Reduction, scorer: Scorer, found: FittedModel, watch: Watch
) -> tuple[Scorer, FittedModel]:
    """The model fitted again while shapes that take numbers from it move, as far as the data bear that out.

    A fixed point of this iteration need not attract: where a number goes with the shape by more than the
    shape with the number, going on leads away. Of a sheath that seemed to take a twentieth less, the share
    came down by half.
    """
    fitted = found
    for _ in range(FOLLOWING_ROUNDS):
        moved = _moved_shapes(fitted)
        if not moved:
            break
        given = [replace(c.effect, shapes=(c.effect.shapes[c.shape],)) for c in moved]
        by = Scorer(reduction.refined(given, watch))
        followed = by.fit([Choice(e) for e in given], fitted, FULL_ITERATIONS)
        if followed.fit.cost > fitted.fit.cost + 2.0 * DECIDING_LOG_ODDS:
            break
        scorer, fitted = by, followed
    return scorer, fitted if fitted is found else scorer.fit_reweighted(fitted.choices, fitted)


def _moved_shapes(fitted: FittedModel) -> list[Choice]:
    """The choices with the numbers that their shapes take from the model now; none where all have stood."""
    now = _with_dependent_shapes(fitted)
    moved = any(_has_moved(one, then, fitted) for one, then in zip(now, fitted.choices, strict=True))
    steps = [_steps(choice, fitted) for choice in fitted.choices]
    if not moved and not any(steps):
        return []
    return [_stepped(choice, step) for choice, step in zip(now, steps, strict=True)]


def _steps(choice: Choice, fitted: FittedModel) -> dict[str, float]:
    """By how much numbers of a shape are off by the gains that stand for them; none that is known no closer.

    A gain that stands for a small change of a number does so to first order alone: of a stop whose edge is a
    quarter of a degree off, what lies between the two edges is left. Least squares over the gains (Newton).
    """
    effect, shape = choice.effect, choice.effect.shapes[choice.shape]
    if effect.slopes is None:
        return {}
    keys, values, found = own_keys(fitted, effect), fitted.values, {}
    gains = {name: values[keys[name]] if name in keys else 0.0 for name in effect.gains}
    for number, slopes in effect.slopes(shape, gains).items():
        names = [name for name in slopes if name in keys]
        places = [fitted.model.index[keys[name]] for name in names]
        variances = np.diag(fitted.fit.covariance)[places]
        told = variances > 0.0
        slope, gain = (np.array([of[name] for name in names])[told] for of in (slopes, gains))
        information = float(np.sum(slope**2 / variances[told]))
        pull = float(np.sum(slope * gain / variances[told]))
        if information > 0.0 and pull**2 > information:
            found[number] = pull / information
    return found


def _stepped(choice: Choice, steps: Mapping[str, float]) -> Choice:
    shapes = list(choice.effect.shapes)
    shapes[choice.shape] = {
        **shapes[choice.shape], **{name: shapes[choice.shape][name] + step for name, step in steps.items()}
    }  # fmt: skip
    return Choice(replace(choice.effect, shapes=tuple(shapes)), choice.shape)


def _is_beyond_grid(one: Choice, found: Choice) -> bool:
    """Whether a choice goes by a law that no point of the grid has from which it was found."""
    grid = found.effect
    return one.effect.law_at(one.shape) not in {grid.law_at(i) for i in range(len(grid.shapes))}


def _went_far(one: Choice, began: Choice) -> bool:
    """Whether a number of its shape has come to the end of those that were looked at, or beyond its octave.

    It may go further, or was looked at too coarsely there.
    """
    effect, law = one.effect, one.effect.law_at(one.shape)
    if one.shape == began.shape:
        return False
    found, start = effect.shapes[one.shape], effect.shapes[began.shape]
    numbers = (*law, *({"travel_deg"} & found.keys() - law))
    kind = found.keys() - set(numbers)  # as how steep a travel is: each has ends of its own
    same = [
        shape
        for i, shape in enumerate(effect.shapes)
        if effect.law_at(i) == law and all(shape.get(name) == found[name] for name in kind)
    ]
    for name in numbers:
        number, before = found[name], start.get(name)
        ends = [pick(shape[name] for shape in same if name in shape) for pick in (min, max)]
        if number != before and number in ends:
            return True
        if before and not 0.5 <= number / before <= 2.0:
            return True
    return False


def _is_another_law(one: Choice, other: Choice) -> bool:
    return one.effect.law_at(one.shape) != other.effect.law_at(other.shape)


def _best_of_finer(scorer: Scorer, finer: Sequence[Effect], places: Sequence[int]) -> FittedModel:
    """The effects at the best of their shapes, looked for from these ``places`` on."""
    fitted = scorer.fit_reweighted([Choice(e, i) for e, i in zip(finer, places, strict=True)])
    found = _at_best_shapes(scorer, fitted)
    # What one law leaves to another at its best shape may be more than was looked for on the grid.
    wider = off_its_bounds(scorer, found, FULL_ITERATIONS, every=True)
    return found if wider is found else scorer.fit_reweighted(wider.choices, wider)


def refine_last(
    reduction: Reduction, fitted: FittedModel, watch: Watch = SILENT
) -> tuple[Scorer, FittedModel]:
    """The model with its last effect at the best of the shapes around it, all else and the weights as before.

    Raises:
        Cancelled: the user asked for it.
    """
    *others, last = [*at_found_shapes(fitted)[:-1], _finer(fitted.choices[-1])]
    scorer = Scorer(reduction.refined([*others, last], watch))
    given = [Choice(one) for one in others]
    tried = [
        scorer.fit_same_law([*given, Choice(last, i)], fitted, LOOKING_ITERATIONS)
        for i in range(len(last.shapes))
    ]
    best = min(tried, key=lambda one: one.fit.cost)
    return scorer, scorer.fit(best.choices, best, FULL_ITERATIONS)


def _at_best_shapes(scorer: Scorer, fitted: FittedModel) -> FittedModel:
    """The model with every effect at the shape that fits best beside the others."""
    several = [k for k, c in enumerate(fitted.choices) if len(c.effect.shapes) > 1]
    for _ in range(SHAPE_PASSES if len(several) > 1 else 1):
        for k in several:
            fitted = _best_shape(scorer, fitted, k)
    return fitted


def _best_shape(scorer: Scorer, fitted: FittedModel, k: int) -> FittedModel:
    """The model with its effect ``k`` at the shape that fits best, under the weights of that model.

    Those weights may prefer another one, of the shapes that were near.
    """
    shapes: Sequence[int] = range(len(fitted.choices[k].effect.shapes))
    for _ in range(SHAPE_ROUNDS):
        before = fitted.choices[k].shape
        tried = sorted(_at_shapes(scorer, fitted, k, shapes), key=lambda m: m.fit.cost + _cost_of_law(m, k))
        fitted = scorer.fit_reweighted(tried[0].choices, tried[0])
        if fitted.choices[k].shape == before:
            break
        nearest = max(int(np.ceil(NEAR_SHAPES * len(tried))), LEAST_NEAR_SHAPES)
        shapes = [one.choices[k].shape for one in tried[:nearest]]
    return fitted


def _cost_of_law(fitted: FittedModel, k: int) -> float:
    """What the law of effect ``k`` must explain for each of its numbers, in units of the cost.

    A damping of what sticks does nearly what an inertia does: for next to nothing it took a quarter of one.
    """
    choice = fitted.choices[k]
    return 2.0 * DECIDING_LOG_ODDS * len(choice.effect.law_at(choice.shape))


def _at_shapes(scorer: Scorer, fitted: FittedModel, k: int, shapes: Sequence[int]) -> list[FittedModel]:
    """The model with its effect ``k`` at each of these of its shapes."""
    before, effect, after = fitted.choices[:k], fitted.choices[k].effect, fitted.choices[k + 1 :]
    return [
        scorer.fit_same_law([*before, Choice(effect, i), *after], fitted, LOOKING_ITERATIONS) for i in shapes
    ]


def refine_path(
    reduction: Reduction,
    path: Sequence[FittedModel],
    watch: Watch = SILENT,
) -> tuple[Scorer, list[FittedModel]]:
    """A path of models, each held out, with refined shapes; steps that it spares drop out.

    A step of fewer effects has them at the shapes that they have beside the others.
    """
    chosen = list(path)
    while True:
        scorer, last = refine_grid(reduction, chosen[-1], watch)
        by_id = {c.effect.id: c for c in last.choices}
        kept = [[by_id[name] for name in step.effect_ids if name in by_id] for step in chosen]
        steps = [scorer.score_held_out(scorer.fit(choices, last, FULL_ITERATIONS)) for choices in kept]
        idle = redundant_steps(steps)
        if idle and 1 < idle[0] < len(steps) - 1:
            # What a step needs that comes before one it was found after: others may be needless in its stead.
            ordered = reordered(scorer, steps)
            needless = redundant_steps(ordered)
            if not needless:
                return scorer, ordered
            if needless[0] > idle[0]:
                chosen, idle = ordered, needless
        if not idle and len(steps) > 2 and _stands_in_for_shapes(reduction, scorer, steps, watch):
            idle = [len(steps) - 1]
        if not idle or idle[0] == 1:
            return scorer, steps
        chosen = chosen[: idle[0]]


def _stands_in_for_shapes(
    reduction: Reduction, scorer: Scorer, steps: Sequence[FittedModel], watch: Watch
) -> bool:
    """Whether the last effect does no more than other shapes of the earlier ones would."""
    before, last = steps[-2:]
    shorter = before
    for k in range(len(shorter.choices)):
        every = range(len(shorter.choices[k].effect.shapes))
        shorter = min(_at_shapes(scorer, shorter, k, every), key=lambda m: m.fit.cost)
    # Friction of a motor alone goes by travel or by speed: around the other one nothing was looked at yet.
    if scorer.reduced.on_bench and shorter.choices != before.choices:
        by, shorter = refine_grid(reduction, shorter, watch)
        found = by.fit(shorter.choices, shorter, FULL_ITERATIONS, last.weights)
        return not justified(by.score_held_out(found), last)
    shorter = scorer.score_held_out(scorer.fit(shorter.choices, shorter, FULL_ITERATIONS))
    return not (justified(shorter, last) and worth_adding(scorer, shorter, last))


def extend_path(
    reduction: Reduction,
    catalogue: Sequence[Effect],
    path: Sequence[FittedModel],
    watch: Watch,
) -> tuple[Scorer, list[FittedModel]] | None:
    """The path with steps that show only beside the refined shapes of its effects; None: there are none.

    Returns:
        As ``refine_path``.

    Raises:
        Cancelled: the user asked for it.
    """
    given = with_other_laws(at_found_shapes(path[-1]), catalogue)
    scorer = Scorer(reduction.of(with_shapes_of(catalogue, given), watch))
    effects = scorer.reduced.layout.effects
    base = scorer.score_held_out(fit_effects(scorer, given))
    evidence = judge_all(scorer, base, effects, watch, STEP_GAIN * least_fall(base))
    most = LONGEST_PATH - (len(path) - 1)
    found = forward_selection(scorer, evidence, effects, len(given), watch, most)
    if len(found) == 1:
        return None
    first = len(path[0].choices)
    fewer = [scorer.fit(found[0].choices[:k], found[0]) for k in range(first, len(given))]
    return refine_path(reduction, [*fewer, *found], watch)


def can_refine(choices: Sequence[Choice]) -> bool:
    """Whether any of the effects has shapes between the points of its grid, or takes one from a gain."""
    if any(len(_finer(c).shapes) > 1 for c in choices):
        return True
    gains = {f"{c.effect.id}.{name}" for c in choices for name in c.effect.gains}
    return any(gains.intersection(keys) for c in choices for keys in c.effect.follows.values())


def _with_dependent_shapes(fitted: FittedModel) -> list[Choice]:
    """A model's choices with what their shapes take from its unknowns and from each other's shapes."""
    values = dict(fitted.values)
    for c in fitted.choices:
        shape = c.effect.shapes[c.shape] if len(c.effect.shapes) else {}
        values |= {of_shape(c.effect.id, name): number for name, number in shape.items()}
    return [_with_dependent_shape(c, values) for c in fitted.choices]


def _with_dependent_shape(choice: Choice, values: Mapping[str, float]) -> Choice:
    effect = choice.effect
    taken = {name: sum(values.get(k, 0.0) for k in keys) for name, keys in effect.follows.items()}
    if not taken:
        return choice
    return Choice(replace(effect, shapes=tuple({**shape, **taken} for shape in effect.shapes)), choice.shape)


def _has_moved(choice: Choice, before: Choice, fitted: FittedModel) -> bool:
    """Whether what its shape takes from other unknowns is another number, as closely as it is known."""
    now, then = choice.effect.shapes[choice.shape], before.effect.shapes[before.shape]
    for name, keys in choice.effect.follows.items():
        places = [fitted.model.index[key] for key in keys if key in fitted.model.index]
        known_to = float(np.sqrt(max(fitted.fit.covariance[np.ix_(places, places)].sum(), 0.0)))
        if abs(now[name] - then.get(name, 0.0)) > max(SAME_SHAPE * abs(now[name]), known_to):
            return True
    return False


def _finer(choice: Choice) -> Effect:
    """The effect with the shapes around the one found, which is among them."""
    effect = choice.effect
    if not len(effect.shapes):
        return effect
    found = effect.shapes[choice.shape]
    shapes = list(effect.closer(found))
    if not any(_same(found, shape) for shape in shapes):
        shapes.insert(0, found)
    return replace(effect, shapes=tuple(shapes))


def _place(shapes: Sequence[Shape], wanted: Shape) -> int:
    return next((i for i, shape in enumerate(shapes) if _same(shape, wanted)), 0)


def _same(one: Shape, other: Shape) -> bool:
    return all(abs(one.get(k, 0.0) - other.get(k, 0.0)) < 1e-9 for k in {*one, *other})
