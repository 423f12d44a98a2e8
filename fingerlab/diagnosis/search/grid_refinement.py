"""The recordings read again for the effects that were found alone, between the points of their grids.

The catalogue is searched on coarse grids, for every point costs columns in every pass over the data. What is
found is then looked at once more, with few columns of other effects in the way: finer shapes around the best
one, and other laws of the same physics. A law that is only nearly right leaves a remainder that passes for
more physics, so every step of the path is judged again. Effects that a search could not tell apart are each
looked at again, too: on its grid a true law may leave as much as a wrong one that happens to lie on a better
point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fingerlab.core.errors import UserError
from fingerlab.core.progress import SILENT, Watch
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.weights import Weights
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.evidence import Evidence, alike, shares_of
from fingerlab.diagnosis.score.fitted_model import Trial
from fingerlab.diagnosis.score.scorer import FULL_ITERATIONS, Study
from fingerlab.diagnosis.score.selection import USUAL_LEFT, among, idle_steps, justified, least_fall
from fingerlab.diagnosis.search.next_effect import refine, weigh
from fingerlab.diagnosis.search.path import LONGEST_PATH, STEP_PROMISE, density, forward, worth_adding
from fingerlab.effects.base import Effect, Shape

LOOKING_ITERATIONS = 3
ROUNDS = 2
"""Times that the shapes of several effects are gone through, each given the others'."""


def settled(study: Study, effects: Sequence[Effect]) -> Trial:
    """All effects in, each at the point of its grid that fits best beside the others; own weights."""
    trial = study.settle([])
    for one in effects:
        choices = list(trial.model.choices)
        shapes = [study.fit([*choices, Choice(one, i)], trial, 3) for i in range(len(one.shapes))]
        trial = refine(study, min(shapes, key=lambda t: t.fit.cost))
        trial = study.settle(trial.model.choices, trial)
    return _at_best_shapes(study, trial, ROUNDS) if len(effects) > 1 else trial


def closely(
    reduction: Reduction,
    effects: Sequence[Effect],
    watch: Watch = SILENT,
) -> tuple[Study, Trial]:
    """All effects in, settled on their grids and then looked at again; own weights.

    Raises:
        UserError: an effect does not apply to these runs, or a run cannot be read.
        Cancelled: the user asked for it.
    """
    study = Study(reduction.of(effects, watch))
    for one in effects:
        if one not in study.reduced.layout.effects:
            raise UserError(f"'{one.id}' does not apply to these runs; leave it out of --add.")
    trial = settled(study, effects)
    if not worth_a_look(trial.model.choices):
        return study, trial
    return look_again(reduction, trial.model.choices, watch)


def look_again(
    reduction: Reduction,
    found: Sequence[Choice],
    watch: Watch = SILENT,
) -> tuple[Study, Trial]:
    """The effects at the best of the shapes around those found, under their own model's weights.

    Args:
        found: effects that apply to these sessions, each at a point of its grid.

    Raises:
        Cancelled: the user asked for it.
    """
    closer = [_closer(c) for c in found]
    study = Study(reduction.closer(closer, watch))
    places = [_place(e.shapes, c.effect.shapes[c.shape]) for e, c in zip(closer, found, strict=True)]
    trial = study.settle([Choice(e, i) for e, i in zip(closer, places, strict=True)])
    return study, _at_best_shapes(study, trial, ROUNDS)


def _at_best_shapes(study: Study, trial: Trial, rounds: int) -> Trial:
    """The trial with every effect at the shape that fits best beside the others."""
    several = [k for k, c in enumerate(trial.model.choices) if len(c.effect.shapes) > 1]
    for _ in range(rounds if len(several) > 1 else 1):
        for k in several:
            trial = _best_shape(study, trial, k)
    return trial


def look_again_along(
    reduction: Reduction,
    path: Sequence[Trial],
    watch: Watch = SILENT,
) -> tuple[Study, list[Trial]]:
    """A path of models, each held out, with the shapes of a second look; steps that it spares drop out.

    A step of fewer effects has them at the shapes that they have beside the others.
    """
    chosen = list(path)
    while True:
        study, last = look_again(reduction, chosen[-1].model.choices, watch)
        by_id = {c.effect.id: c for c in last.model.choices}
        kept = [[by_id[c.effect.id] for c in step.model.choices if c.effect.id in by_id] for step in chosen]
        steps = [study.hold_out(study.fit(choices, last, FULL_ITERATIONS)) for choices in kept]
        idle = idle_steps(steps)
        if not idle and len(steps) > 2 and _mends_a_shape(study, steps):
            idle = [len(steps) - 1]
        if not idle or idle[0] == 1:
            return study, steps
        chosen = chosen[: idle[0]]


def _mends_a_shape(study: Study, steps: Sequence[Trial]) -> bool:
    """Whether the last effect does no more than other shapes of the earlier ones would."""
    shorter = steps[-2]
    for k, choice in enumerate(shorter.model.choices):
        others = shorter.model.choices[:k], shorter.model.choices[k + 1 :]
        tried = [
            study.fit_like([*others[0], Choice(choice.effect, i), *others[1]], shorter, LOOKING_ITERATIONS)
            for i in range(len(choice.effect.shapes))
        ]
        shorter = min(tried, key=lambda t: t.fit.cost)
    shorter = study.hold_out(study.fit(shorter.model.choices, shorter, FULL_ITERATIONS))
    return not (justified(shorter, steps[-1]) and worth_adding(study, shorter, steps[-1]))


def look_beyond(
    reduction: Reduction,
    catalogue: Sequence[Effect],
    path: Sequence[Trial],
    watch: Watch,
) -> tuple[Study, list[Trial]] | None:
    """The path with steps that show only beside the closer shapes of the effects on it; None: there are none.

    Returns:
        As ``look_again_along``.

    Raises:
        Cancelled: the user asked for it.
    """
    given = closest(path[-1])
    study = Study(reduction.of(shaped_like(catalogue, given), watch))
    effects = study.reduced.layout.effects
    base = study.hold_out(settled(study, given))
    evidence = weigh(study, base, effects, watch, STEP_PROMISE * least_fall(base))
    most = LONGEST_PATH - (len(path) - 1)
    found = forward(study, evidence, effects, len(given), watch, most)
    if len(found) == 1:
        return None
    first = len(path[0].model.choices)
    fewer = [study.fit(found[0].model.choices[:k], found[0]) for k in range(first, len(given))]
    return look_again_along(reduction, [*fewer, *found], watch)


def closest(trial: Trial) -> list[Effect]:
    """The model's effects, each with the one shape that was found as its grid."""
    return [replace(c.effect, shapes=(c.effect.shapes[c.shape],)) for c in trial.model.choices]


def shaped_like(catalogue: Sequence[Effect], found: Sequence[Effect]) -> list[Effect]:
    """The catalogue with the effects that were found in place of their namesakes."""
    return [next((f for f in found if f.id == e.id), e) for e in catalogue]


def worth_a_look(choices: Sequence[Choice]) -> bool:
    """Whether any of the effects has shapes between the points of its grid."""
    return any(len(_closer(c).shapes) > 1 for c in choices)


def _closer(choice: Choice) -> Effect:
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


def _best_shape(study: Study, trial: Trial, k: int) -> Trial:
    """The trial with its effect ``k`` at the shape that fits best, under the weights of that model."""
    choices = list(trial.model.choices)
    effect = choices[k].effect

    def at(shape: int) -> list[Choice]:
        return [*choices[:k], Choice(effect, shape), *choices[k + 1 :]]

    for _ in range(2):  # the weights that come with the best shape may prefer another one
        tried = [study.fit_like(at(i), trial, LOOKING_ITERATIONS) for i in range(len(effect.shapes))]
        found = min(tried, key=lambda t: t.fit.cost)
        same = found.model.choices[k].shape == choices[k].shape
        trial = study.settle(found.model.choices, found)
        choices = list(trial.model.choices)
        if same:
            break
    return trial


MOST_RIVALS = 3
"""So many of a set are looked at again, the likeliest first."""


def looked_at_closely(
    reduction: Reduction,
    study: Study,
    evidence: Evidence,
    watch: Watch,
) -> Evidence:
    """The evidence with the odds of the best effects among each other as a second look at each finds them.

    Unchanged where one is alone, where the best leaves no more than every model does, or where no shape of
    any is left to look at.

    Raises:
        Cancelled: the user asked for it.
    """
    rivals = alike(evidence)[:MOST_RIVALS]
    trials = [evidence.trials[i] for i in rivals]
    if len(rivals) < 2 or evidence.least_left <= USUAL_LEFT:
        return evidence
    if not any(worth_a_look(t.model.choices) for t in trials):
        return evidence
    log_odds = evidence.log_odds.copy()
    log_odds[rivals] = among(evidence.base, _seen_closely(reduction, study, trials, watch))
    found = float(evidence.probabilities.sum())
    return replace(evidence, log_odds=log_odds, probabilities=found * shares_of(log_odds))


@dataclass(frozen=True)
class _Look:
    """A trial as a second look finds it: in which study, with its own weights, and its density there."""

    study: Study
    trial: Trial
    weights: Weights
    density: float


def _seen_closely(reduction: Reduction, study: Study, trials: Sequence[Trial], watch: Watch) -> list[Trial]:
    """Every trial as a second look finds it, held out, all in the floors of the likeliest."""
    kept = study.weights
    looks = [_look(reduction, study, trial, watch) for trial in trials]
    likeliest = min(looks, key=lambda look: look.density)
    seen = [_scored(look, likeliest.weights) for look in looks]
    study.weights = kept
    return seen


def _look(reduction: Reduction, study: Study, trial: Trial, watch: Watch) -> _Look:
    if worth_a_look(trial.model.choices):
        study, trial = look_again(reduction, trial.model.choices, watch)
    else:
        trial = study.settle(trial.model.choices, trial)
    return _Look(study, trial, study.weights, density(study, trial))


def _scored(look: _Look, weights: Weights) -> Trial:
    look.study.weights = weights
    return look.study.hold_out(look.study.fit(look.trial.model.choices, look.trial, FULL_ITERATIONS))
