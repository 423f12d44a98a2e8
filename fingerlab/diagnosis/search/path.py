"""The path from the model as given to all that is missing: effect after effect, while each is borne out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.data import Weights, change
from fingerlab.diagnosis.score.evidence import Evidence, alike
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import (
    justified,
    lacks_fit,
    least_fall,
    log_odds_among,
    redundant_steps,
)
from fingerlab.diagnosis.search.next_effect import ScoreTest, climb_grid, judge_all, readjust_shapes
from fingerlab.diagnosis.settings import (
    CANDIDATES_REFITTED,
    FULL_ITERATIONS,
    LEAST_FALL_BEYOND,
    LONGEST_PATH,
    NEXT_SHARE,
    OWN_WEIGHTS,
    RUNNERS_UP,
    SCREEN_ITERATIONS,
    STEP_GAIN,
)
from fingerlab.effects.base import Effect


def forward_selection(
    scorer: Scorer,
    first: Evidence,
    effects: Sequence[Effect],
    keep: int,
    watch: Watch,
    most: int = LONGEST_PATH,
) -> list[FittedModel]:
    """The model as given, then with each effect worth adding; all held out, under the last step's weights.

    At ``most`` so many are added. Where much is left at the end, one effect may have stood for two: the path
    then begins with another one instead, if that leads further, or as far with fewer.

    Args:
        first: every effect judged beside the model as given, which holds ``keep`` of them.
    """
    found = _forward(scorer, first, effects, keep, watch, most)
    if most == 1 or len(found) == 1:
        return found
    # What takes three effects may be two others, of which the first explains less by itself.
    beyond_a_pair = len(found) > 3 and lacks_fit(found[1])
    if lacks_fit(found[-1]) or beyond_a_pair:
        ends = [(scorer.deviance(found[-1]), found)]
        for begin in _alternative_first_steps(scorer, first, found[1]):
            settled = scorer.score_held_out(scorer.fit_reweighted(begin.choices, begin))
            other = _forward(scorer, first, effects, keep, watch, most, settled)
            explains = other[-1].misfit < (1.0 - NEXT_SHARE) * found[-1].misfit
            if explains or len(other) < len(found):
                ends.append((scorer.deviance(other[-1]), other))
        _, likeliest = min(ends, key=lambda end: end[0])
        if likeliest is not found and len(likeliest) > 2:
            ordered = reordered(scorer, likeliest)
            return likeliest if redundant_steps(ordered) else ordered
        return likeliest
    return found


def _alternative_first_steps(scorer: Scorer, evidence: Evidence, taken: FittedModel) -> list[FittedModel]:
    """The candidates that leave least after the one that was taken; of a motor alone, with few effects, all.

    Viscous friction may explain less than Coulomb's beside a weight that nothing tells yet, and all with it.
    """
    others = [c for c in evidence.candidates if c.last_effect.id not in taken.effect_ids]
    return sorted(others, key=lambda c: c.misfit)[: None if scorer.reduced.on_bench else RUNNERS_UP]


def _forward(
    scorer: Scorer,
    first: Evidence,
    effects: Sequence[Effect],
    keep: int,
    watch: Watch,
    most: int,
    begin: FittedModel | None = None,
) -> list[FittedModel]:
    """The path from ``first`` by the best effect at each step, or by ``begin`` at the first.

    Two effects may hide each other: seen through one of them alone, what the other does can pass for noise.
    A step that is not borne out by itself is therefore kept for a while where much is left to explain, and
    stands if a later one bears it out.
    """
    present = (begin or first.base).weights  # those under which a model was fitted last
    steps, weights = [first.base], [present]
    sound = 1  # so many of the steps are borne out
    rivals: dict[str, list[Effect]] = {}
    evidence = first
    while len(steps) <= most and evidence.candidates:
        if evidence.for_an_effect <= 0.0:
            break
        best = begin if begin is not None and len(steps) == 1 else evidence.best
        if not justified(evidence.base, best):
            break
        helps = _explains_lack_of_fit(steps[sound - 1], best) or worth_adding(scorer, steps[sound - 1], best)
        if not (helps or lacks_fit(best)):
            break
        chosen = eliminate_backward(scorer, best, keep)
        if len(chosen.choices) > 1:
            chosen = readjust_shapes(scorer, chosen)
        present = chosen.weights
        steps.append(chosen)
        weights.append(present)
        rivals[best.last_effect.id] = _rivals(evidence)
        sound = len(steps) if helps else sound
        if len(steps) > most:
            break
        watch.tell(0.5, f"looking beyond {best.last_effect.title.lower()}")
        evidence = judge_all(scorer, chosen, effects, watch, STEP_GAIN * least_fall(chosen))
        present = evidence.base.weights
    kept = one_more_each(steps[:sound], keep)
    if kept is None:
        present = weights[sound - 1]
        steps = reordered(scorer, [steps[0], steps[sound - 1]])
        weights = [present] * len(steps)
    else:
        steps, weights = [steps[k] for k in kept], [weights[k] for k in kept]
    if len(steps) > 2:
        every = effects if lacks_fit(steps[-1]) else ()
        exchanged = _exchanged(scorer, steps[-1], present, keep, rivals, every)
        if exchanged is not None:
            steps, weights = exchanged, [step.weights for step in exchanged]
    return _justified_steps(scorer, steps, weights)


def one_more_each(steps: Sequence[FittedModel], keep: int) -> list[int] | None:
    """Numbers of the steps to effects that the end still holds; None where those are not one effect apart."""
    end = steps[-1]
    kept = [k for k, step in enumerate(steps) if set(end.effect_ids).issuperset(step.effect_ids)]
    return kept if len(kept) == len(end.choices) - keep + 1 else None


def _refitted_steps(scorer: Scorer, end: FittedModel, keep: int) -> list[FittedModel]:
    """The path to a model with its effects in the order that they have in it."""
    sizes = range(keep, len(end.choices) + 1)
    return [scorer.score_held_out(scorer.fit(end.choices[:k], end, FULL_ITERATIONS)) for k in sizes]


def worth_adding(scorer: Scorer, base: FittedModel, best: FittedModel) -> bool:
    """Whether the step is justified with either model seen under its own weights.

    A model may not earn its own floor: what it calls noise has to be paid for in density. Nor may the bare
    model hide behind its own: where a tip seems to rub, its friction is noise to all else in contact.
    """
    best = with_own_weights(scorer, best)
    settled = scorer.fit_reweighted(base.choices, base, best.weights)
    before = scorer.score_held_out(scorer.fit_from_each(base.choices, [base, best], settled.weights))
    gained = scorer.noise_deviance(best) - scorer.noise_deviance(before)
    reach = 0.0
    if not base.choices:
        reach = scorer.score_held_out(scorer.fit_from_each((), [base, best], best.weights)).misfit
    return justified(before, best, gained, reach)


def _explains_lack_of_fit(base: FittedModel, best: FittedModel) -> bool:
    """Whether one effect more tells most of what a model lacks for certain, and leaves no such lack.

    Where no motion comes again, each model calls what it leaves its noise, and under its own weights none
    leaves much. That something is missing is then known all the same, by the weights of the other.
    """
    most = best.misfit < (1.0 - NEXT_SHARE) * base.misfit
    return lacks_fit(base) and not lacks_fit(best) and most


def with_own_weights(scorer: Scorer, fitted: FittedModel) -> FittedModel:
    """The model, held out, under weights that belong to it, if it is likelier under those.

    Where the tension is far noisier than what the joints miss of it apart, a moment arm that is a thousandth
    another one turns that noise against the weights of another model: it had weighed a hundred times as much.
    """
    if change(fitted.weights, scorer.own_weights(fitted)) < OWN_WEIGHTS:
        return fitted
    settled = scorer.score_held_out(scorer.fit_reweighted(fitted.choices, fitted))
    return min(fitted, settled, key=scorer.deviance)


def eliminate_backward(scorer: Scorer, fitted: FittedModel, keep: int) -> FittedModel:
    """The model without effects, beyond the first ``keep``, that later ones have made needless."""
    choices = list(fitted.choices)
    for choice in list(choices[keep:-1]):
        without = [c for c in choices if c is not choice]
        smaller = scorer.score_held_out(scorer.fit(without, fitted, FULL_ITERATIONS))
        reordered = scorer.score_held_out(scorer.fit([*without, choice], fitted, FULL_ITERATIONS))
        if not justified(smaller, reordered):
            choices = without
    if len(choices) == len(fitted.choices):
        return fitted
    return scorer.score_held_out(scorer.fit(choices, fitted, FULL_ITERATIONS))


def _rivals(evidence: Evidence) -> list[Effect]:
    """Effects that were hardly told from the one that was taken, itself left out."""
    return [evidence.candidates[i].last_effect for i in alike(evidence)[: CANDIDATES_REFITTED + 1]][1:]


def _exchanged(
    scorer: Scorer,
    last: FittedModel,
    weights: Weights,
    keep: int,
    rivals: Mapping[str, Sequence[Effect]],
    every: Sequence[Effect] = (),
) -> list[FittedModel] | None:
    """Steps to a model in which effects have given way to rivals that do better beside the later ones.

    What was taken first was judged with the others still missing; of ``every`` effect those are tried, too,
    that promise most beside the others. None: all stay.

    Args:
        weights: under which the effects are compared.
    """
    choices = list(last.choices)
    for place in range(keep, len(choices) - 1):
        others = [*choices[:place], *choices[place + 1 :]]
        held = {c.effect.id for c in choices}
        wanted = [e for e in rivals.get(choices[place].effect.id, ()) if e.id not in held]
        if not (wanted or every):
            continue
        base = scorer.score_held_out(scorer.fit(others, last, FULL_ITERATIONS, weights))
        predicted = ScoreTest(scorer.data, base).best_point
        known = {*held, *(e.id for e in wanted)}
        rest = sorted((e for e in every if e.id not in known), key=lambda e: -predicted(e).gain)
        wanted += rest[:CANDIDATES_REFITTED]
        tried = [choices[place], *(Choice(e, predicted(e).shape) for e in wanted)]
        own = choices[place].effect
        if len({own.law_at(i) for i in range(len(own.shapes))}) > 1:
            # Beside the others another of its laws may do better, and no neighbours lead from one to another.
            tried += [Choice(own, i) for i in range(len(own.shapes))]
        found = [
            climb_grid(scorer, scorer.fit([*others, one], last, SCREEN_ITERATIONS, weights)) for one in tried
        ]
        odds = log_odds_among(base, [scorer.score_held_out(one) for one in found])
        choices[place] = found[int(np.argmax(odds))].choices[-1]
    if [c.effect.id for c in choices] == last.effect_ids:
        return None
    return _refitted_steps(scorer, scorer.fit_reweighted(choices, last, weights), keep)


def _justified_steps(scorer: Scorer, steps: list[FittedModel], weights: list[Weights]) -> list[FittedModel]:
    """The steps as far as each is justified under the weights of the last one kept.

    Where an earlier one is not, the same effects in another order may be.
    """
    while True:
        under = weights[len(steps) - 1]
        scored = [scorer.score_held_out(scorer.fit(s.choices, s, FULL_ITERATIONS, under)) for s in steps]
        idle = redundant_steps(scored)
        if not idle:
            return scored
        if idle[0] < len(steps) - 1:
            other = reordered(scorer, scored)
            if not redundant_steps(other):
                return other
        steps = steps[: idle[0]]


def reordered(scorer: Scorer, steps: Sequence[FittedModel]) -> list[FittedModel]:
    """The path to the last model that begins with what is missed most."""
    keep = len(steps[0].choices)
    fitted, order = steps[-1], list[Choice]()
    while len(fitted.choices) > keep + 1:
        choices = fitted.choices
        without = {
            i: scorer.fit([*choices[:i], *choices[i + 1 :]], fitted, FULL_ITERATIONS)
            for i in range(keep, len(choices))
        }
        idlest = min(without, key=lambda i: without[i].fit.cost)
        order.insert(0, choices[idlest])
        fitted = without[idlest]
    path = [steps[0], scorer.score_held_out(fitted)]
    for choice in order:
        longer = scorer.fit([*path[-1].choices, choice], steps[-1], FULL_ITERATIONS)
        path.append(scorer.score_held_out(longer))
    return path


def worth_a_further_effect(refined: FittedModel) -> bool:
    """Whether one effect with refined shapes leaves enough for a further one to be worth a step."""
    return lacks_fit(refined, LEAST_FALL_BEYOND)


def does_better(one: tuple[Scorer, list[FittedModel]], other: tuple[Scorer, list[FittedModel]]) -> bool:
    """Whether a path is the better one: the likelier; a shorter one also where the longer earns no steps.

    As within a path, each further effect must explain its share of what is left.
    """
    (by, path), (than, rival) = one, other
    if by.deviance(path[-1]) < than.deviance(rival[-1]):
        return len(path) <= len(rival) or earns_its_steps(path, rival)
    return len(path) < len(rival) and not earns_its_steps(rival, path)


def earns_its_steps(
    longer: Sequence[FittedModel], shorter: Sequence[FittedModel], share: float = NEXT_SHARE
) -> bool:
    """Whether each effect more of a longer path explains its ``share`` of what the shorter one leaves."""
    left = (1.0 - share) ** (len(longer) - len(shorter))
    return longer[-1].score ** 2 - 1.0 < left * (shorter[-1].score ** 2 - 1.0)
