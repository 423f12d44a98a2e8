"""The way from the model as given to all that is missing: effect after effect, while each is borne out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.weights import Weights
from fingerlab.diagnosis.score.evidence import Evidence, alike
from fingerlab.diagnosis.score.fitted_model import Trial
from fingerlab.diagnosis.score.scorer import FULL_ITERATIONS, Study
from fingerlab.diagnosis.score.selection import (
    NEXT_SHARE,
    among,
    idle_steps,
    justified,
    least_fall,
    much_left,
)
from fingerlab.diagnosis.search.next_effect import FRONT, SCREEN_ITERATIONS, Sketch, refine, reshape, weigh
from fingerlab.effects.base import Effect

LONGEST_PATH = 4
"""At most this many effects are added."""
STEP_PROMISE = 0.25
"""An effect that promises less than this share of what a further step must reach is no candidate for it."""
RUNNERS_UP = 2
"""So many other beginnings are tried where a way ends with much left."""


def forward(
    study: Study,
    first: Evidence,
    effects: Sequence[Effect],
    keep: int,
    watch: Watch,
    most: int = LONGEST_PATH,
) -> list[Trial]:
    """The model as given, then with each effect worth adding; all held out, under the last step's weights.

    At ``most`` so many are added. Where much is left at the end, one effect may have stood for two: the way
    then begins with one of the next best instead, if that leads further.
    """
    weights = study.weights
    found = _walked(study, first, effects, keep, watch, most)
    if most > 1 and len(found) > 1 and much_left(found[-1]):
        ends = [(density(study, found[-1]), found, study.weights)]
        for begin in _runners_up(first, found[1]):
            study.weights = weights
            settled = study.hold_out(study.settle(begin.model.choices, begin))
            other = _walked(study, first, effects, keep, watch, most, settled)
            if other[-1].misfit < (1.0 - NEXT_SHARE) * found[-1].misfit:
                ends.append((density(study, other[-1]), other, study.weights))
        _, found, study.weights = min(ends, key=lambda end: end[0])
    return found


def density(study: Study, trial: Trial) -> float:
    """Minus twice the log density of the data under a model and its own weights, up to a constant."""
    return trial.fit.cost + study.level(trial)


def _runners_up(evidence: Evidence, taken: Trial) -> list[Trial]:
    """The trials that leave least after the one that was taken."""
    held = {c.effect.id for c in taken.model.choices}
    others = [t for t in evidence.trials if t.model.choices[-1].effect.id not in held]
    return sorted(others, key=lambda t: t.misfit)[:RUNNERS_UP]


def _walked(
    study: Study,
    first: Evidence,
    effects: Sequence[Effect],
    keep: int,
    watch: Watch,
    most: int,
    begin: Trial | None = None,
) -> list[Trial]:
    """The way from ``first`` by the best effect at each step, or by ``begin`` at the first.

    Two effects may hide each other: seen through one of them alone, what the other does can pass for noise.
    A step that is not borne out by itself is therefore kept for a while where much is left to explain, and
    stands if a later one bears it out.
    """
    steps, weights = [first.base], [study.weights]
    sound = 1  # so many of the steps are borne out
    rivals: dict[str, list[Effect]] = {}
    evidence = first
    while len(steps) <= most and evidence.trials:
        if evidence.for_an_effect <= 0.0:
            break
        best = evidence.trials[int(np.argmax(evidence.log_odds))]
        best = begin if begin is not None and len(steps) == 1 else best
        if not justified(evidence.base, best):
            break
        borne_out = worth_adding(study, steps[sound - 1], best)
        if not (borne_out or much_left(best)):
            break
        chosen = drop_idle(study, best, keep)
        if len(chosen.model.choices) > 1:
            chosen = reshape(study, chosen)
        steps.append(chosen)
        weights.append(study.weights)
        rivals[best.model.choices[-1].effect.id] = _rivals(evidence)
        sound = len(steps) if borne_out else sound
        if len(steps) > most:
            break
        watch.tell(0.5, f"looking beyond {best.model.choices[-1].effect.title.lower()}")
        evidence = weigh(study, chosen, effects, watch, STEP_PROMISE * least_fall(chosen))
    steps, weights = _straight(study, steps[:sound], weights[:sound], keep)
    if len(steps) > 2:
        every = effects if much_left(steps[-1]) else ()
        steps, weights = _exchanged(study, steps[-1], keep, rivals, every) or (steps, weights)
    return _borne_out(study, steps, weights)


def _straight(
    study: Study, steps: Sequence[Trial], weights: Sequence[Weights], keep: int
) -> tuple[list[Trial], list[Weights]]:
    """The way, one effect more at each step, without steps to effects that the end has made needless."""
    choices = steps[-1].model.choices
    last = {c.effect.id for c in choices}
    kept = [k for k, step in enumerate(steps) if last.issuperset(c.effect.id for c in step.model.choices)]
    if len(kept) == len(choices) - keep + 1:
        return [steps[k] for k in kept], [weights[k] for k in kept]
    study.weights = weights[-1]
    return _one_by_one(study, steps[-1], keep), [weights[-1]] * (len(choices) - keep + 1)


def _one_by_one(study: Study, end: Trial, keep: int) -> list[Trial]:
    """The way to a model with its effects in the order that they have in it."""
    choices, sizes = end.model.choices, range(keep, len(end.model.choices) + 1)
    return [study.hold_out(study.fit(choices[:k], end, FULL_ITERATIONS)) for k in sizes]


def worth_adding(study: Study, base: Trial, best: Trial) -> bool:
    """Whether the step is justified with either model seen under its own weights.

    A model may not earn its own floor: what it calls noise has to be paid for in density.
    """
    kept, gained = study.weights, study.level(best)
    study.settle(base.model.choices, base)
    before = study.hold_out(study.fit(base.model.choices, base, FULL_ITERATIONS))
    gained -= study.level(before)
    study.weights = kept
    return justified(before, best, gained)


def drop_idle(study: Study, trial: Trial, keep: int) -> Trial:
    """The trial without effects, beyond the first ``keep``, that later ones have made needless."""
    choices = list(trial.model.choices)
    for choice in list(choices[keep:-1]):
        without = [c for c in choices if c is not choice]
        smaller = study.hold_out(study.fit(without, trial, FULL_ITERATIONS))
        reordered = study.hold_out(study.fit([*without, choice], trial, FULL_ITERATIONS))
        if not justified(smaller, reordered):
            choices = without
    if len(choices) == len(trial.model.choices):
        return trial
    return study.hold_out(study.fit(choices, trial, FULL_ITERATIONS))


def _rivals(evidence: Evidence) -> list[Effect]:
    """Effects that were hardly told from the one that was taken, itself left out."""
    return [evidence.trials[i].model.choices[-1].effect for i in alike(evidence)[: FRONT + 1]][1:]


def _exchanged(
    study: Study, last: Trial, keep: int, rivals: Mapping[str, Sequence[Effect]], every: Sequence[Effect] = ()
) -> tuple[list[Trial], list[Weights]] | None:
    """Steps to a model in which effects have given way to rivals that do better beside the later ones.

    What was taken first was judged with the others still missing; of ``every`` effect those are tried, too,
    that promise most beside the others. None: all stay.
    """
    choices = list(last.model.choices)
    for place in range(keep, len(choices) - 1):
        others = [*choices[:place], *choices[place + 1 :]]
        held = {c.effect.id for c in choices}
        wanted = [e for e in rivals.get(choices[place].effect.id, ()) if e.id not in held]
        if not (wanted or every):
            continue
        base = study.hold_out(study.fit(others, last, FULL_ITERATIONS))
        promise = Sketch(study, base).promise
        known = {*held, *(e.id for e in wanted)}
        rest = sorted((e for e in every if e.id not in known), key=lambda e: -promise(e).fall)
        wanted += rest[:FRONT]
        tried = [refine(study, study.fit([*others, choices[place]], last, SCREEN_ITERATIONS))]
        tried += [
            refine(study, study.fit([*others, Choice(e, promise(e).shape)], last, SCREEN_ITERATIONS))
            for e in wanted
        ]
        odds = among(base, [study.hold_out(t) for t in tried])
        choices[place] = tried[int(np.argmax(odds))].model.choices[-1]
    if [c.effect.id for c in choices] == [c.effect.id for c in last.model.choices]:
        return None
    steps = _one_by_one(study, study.settle(choices, last), keep)
    return steps, [study.weights] * len(steps)


def _borne_out(study: Study, steps: list[Trial], weights: list[Weights]) -> list[Trial]:
    """The steps as far as each is justified under the weights of the last one kept.

    Where an earlier one is not, the same effects in another order may be.
    """
    while True:
        study.weights = weights[-1]
        scored = [study.hold_out(study.fit(s.model.choices, s, FULL_ITERATIONS)) for s in steps]
        idle = idle_steps(scored)
        if not idle:
            return scored
        if idle[0] < len(steps) - 1:
            other = _reordered(study, scored)
            if not idle_steps(other):
                return other
        steps, weights = steps[: idle[0]], weights[: idle[0]]


def _reordered(study: Study, steps: Sequence[Trial]) -> list[Trial]:
    """The way to the last model that begins with what is missed most."""
    keep = len(steps[0].model.choices)
    trial, order = steps[-1], list[Choice]()
    while len(trial.model.choices) > keep + 1:
        choices = trial.model.choices
        without = {
            i: study.fit([*choices[:i], *choices[i + 1 :]], trial, FULL_ITERATIONS)
            for i in range(keep, len(choices))
        }
        idlest = min(without, key=lambda i: without[i].fit.cost)
        order.insert(0, choices[idlest])
        trial = without[idlest]
    path = [steps[0], study.hold_out(trial)]
    for choice in order:
        path.append(study.hold_out(study.fit([*path[-1].model.choices, choice], steps[-1], FULL_ITERATIONS)))
    return path
