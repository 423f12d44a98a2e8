"""Which effect next: every effect of the catalogue tried beside the model as it stands."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.errors import Cancelled
from fingerlab.identify.diagnosis.evidence import Evidence, judge, justified, least_fall
from fingerlab.identify.diagnosis.fitting import Weights
from fingerlab.identify.diagnosis.model import Choice
from fingerlab.identify.diagnosis.reduction import Progress
from fingerlab.identify.diagnosis.sketch import Promise, Sketch
from fingerlab.identify.diagnosis.study import FULL_ITERATIONS, Study, Trial
from fingerlab.physics.effects.base import Effect

HELD_OUT_TRIALS = 4
"""This many of the best effects are scored on held-out runs; the rest are far behind and scored in sample."""
FRONT = 8
"""This many are looked at more closely when the weights have changed."""
HOPEFUL_SHARE = 0.1
"""An effect whose first step lowers the cost by less than this share of the best's is fitted no further."""
STEP_PROMISE = 0.25
"""An effect that promises less than this share of what a further step must reach is no candidate for it."""
SAME_SHARE = 1e-3
"""Effects whose costs differ by less than this share leave the same noise, and set the same weights."""
LONGEST_PATH = 4
"""At most this many effects are added."""
SCREEN_ITERATIONS = 3


@dataclass(frozen=True)
class Watch:
    """Where a long calculation reports, and where it hears that it should stop."""

    progress: Progress | None = None
    cancelled: Callable[[], bool] | None = None

    def tell(self, share: float, what: str) -> None:
        """Report, and stop where asked to.

        Raises:
            Cancelled: the user asked for it.
        """
        if self.cancelled is not None and self.cancelled():
            raise Cancelled
        if self.progress is not None:
            self.progress(share, what)


def screen(
    study: Study, base: Trial, effects: Sequence[Effect], watch: Watch, least: float = -np.inf
) -> list[Trial]:
    """The base model with each effect that it does not hold yet, after a few steps; best first.

    Each effect stands at the grid point that promises most; one that promises a fall of the cost by less than
    ``least`` is left out.
    """
    given = base.model.choices
    held = {c.effect.id for c in given}
    rest = [e for e in effects if e.id not in held]
    trials = []
    sketch = Sketch(study, base)
    promises = {e.id: sketch.promise(e) for e in rest}
    rest = [e for e in rest if promises[e.id].fall >= least]
    hopeful = HOPEFUL_SHARE * max((p.fall for p in promises.values() if p.fall < np.inf), default=0.0)
    for number, effect in enumerate(rest):
        watch.tell(number / len(rest), f"trying {effect.title.lower()}")
        promise = promises[effect.id]
        iterations = SCREEN_ITERATIONS if promise.fall >= hopeful else 1
        start = base
        if promise.fall == np.inf and len(effect.shapes) > 1:
            shapes = [study.fit([*given, Choice(effect, i)], base, 1) for i in range(len(effect.shapes))]
            start = min(shapes, key=lambda t: t.fit.cost)
            promise = Promise(start.model.choices[-1].shape, np.inf)
        trials.append(study.fit([*given, Choice(effect, promise.shape)], start, iterations))
    return sorted(trials, key=lambda t: t.fit.cost)


def refine(study: Study, trial: Trial) -> Trial:
    """The trial fitted to the end, at its grid point or where its neighbours lead to."""
    *given, last = trial.model.choices
    tried: dict[int, Trial] = {}
    best = last.shape
    while True:
        for i in (best - 1, best, best + 1):
            if 0 <= i < len(last.effect.shapes) and i not in tried:
                tried[i] = study.fit_like([*given, Choice(last.effect, i)], trial, FULL_ITERATIONS)
        found = min(tried, key=lambda i: tried[i].fit.cost)
        if found == best:
            return study.with_best_law(tried[best], FULL_ITERATIONS)
        best = found


def weigh(
    study: Study, base: Trial, effects: Sequence[Effect], watch: Watch, least: float = -np.inf
) -> Evidence:
    """Judge all effects beside ``base`` that promise ``least``, under the weights of the best of them.

    The repeatability of the equations depends on the model that they are seen through, so the best effect
    sets the weights, and all are judged again until the best stays the best.
    """
    trials = screen(study, base, effects, watch, least)
    leaders: set[str] = set()
    for _ in range(3):
        front = sorted((refine(study, t) for t in trials[:HELD_OUT_TRIALS]), key=lambda t: t.fit.cost)
        trials = front + trials[HELD_OUT_TRIALS:]
        if not front or front[0].fit.cost >= base.fit.cost or _led(front, leaders):
            break
        leaders.add(front[0].model.choices[-1].effect.id)
        study.settle(front[0].model.choices, front[0], rounds=2)
        base = study.fit(base.model.choices, base, FULL_ITERATIONS)
        # Under the new weights another effect may come to the front.
        again = (
            study.fit(t.model.choices, t, SCREEN_ITERATIONS if i < FRONT else 1) for i, t in enumerate(trials)
        )
        trials = sorted(again, key=lambda t: t.fit.cost)
    watch.tell(0.95, "scoring on held-out runs")
    scored = [study.hold_out(t) for t in trials[:HELD_OUT_TRIALS]]
    scored += [study.count(t) for t in trials[HELD_OUT_TRIALS:]]
    return judge(study.hold_out(base, residuals=True), scored)


def _led(front: Sequence[Trial], leaders: Collection[str]) -> bool:
    """Whether the best of the front has set the weights, or one that these data hardly tell from it."""
    best = front[0].fit.cost
    return any(
        t.model.choices[-1].effect.id in leaders and t.fit.cost - best <= SAME_SHARE * abs(best)
        for t in front
    )


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


def reshape(study: Study, trial: Trial) -> Trial:
    """The trial with every earlier effect at the grid point that fits best now that a later one is there."""
    choices, changed, found = list(trial.model.choices), False, trial
    for i, choice in enumerate(choices[:-1]):
        if len(choice.effect.shapes) > 1:
            others = [c for k, c in enumerate(choices) if k != i]
            found = refine(study, study.fit([*others, choice], found, SCREEN_ITERATIONS))
            changed |= found.model.choices[-1].shape != choice.shape
            choices[i] = found.model.choices[-1]
    return study.hold_out(study.settle(choices, found, rounds=2)) if changed else trial


def worth_adding(study: Study, base: Trial, best: Trial) -> bool:
    """Whether the step is justified with either model seen under its own weights.

    A model may not earn its own floor: what it calls noise has to be paid for in density.
    """
    kept, gained = study.weights, study.level(best)
    study.settle(base.model.choices, base, rounds=2)
    before = study.hold_out(study.fit(base.model.choices, base, FULL_ITERATIONS))
    gained -= study.level(before)
    study.weights = kept
    return justified(before, best, gained)


def forward(study: Study, first: Evidence, effects: Sequence[Effect], keep: int, watch: Watch) -> list[Trial]:
    """The model as given, then with each effect worth adding; all held out, under the last step's weights."""
    steps, weights = [first.base], [study.weights]
    evidence = first
    while len(steps) <= LONGEST_PATH and evidence.trials:
        if evidence.nothing >= float(evidence.probabilities.sum()):
            break
        best = evidence.trials[int(np.argmax(evidence.probabilities))]
        if not (justified(evidence.base, best) and worth_adding(study, evidence.base, best)):
            break
        chosen = drop_idle(study, best, keep)
        if len(chosen.model.choices) > 1:
            chosen = reshape(study, chosen)
        steps.append(chosen)
        weights.append(study.weights)
        watch.tell(0.5, f"looking beyond {best.model.choices[-1].effect.title.lower()}")
        evidence = weigh(study, chosen, effects, watch, STEP_PROMISE * least_fall(chosen))
    return _borne_out(study, steps, weights)


def _borne_out(study: Study, steps: list[Trial], weights: list[Weights]) -> list[Trial]:
    """The steps as far as each is justified under the weights of the last one kept."""
    while True:
        study.weights = weights[-1]
        scored = [study.hold_out(study.fit(s.model.choices, s, FULL_ITERATIONS)) for s in steps]
        idle = [k for k in range(1, len(scored)) if not justified(scored[k - 1], scored[k])]
        if not idle:
            return scored
        steps, weights = steps[: idle[0]], weights[: idle[0]]


def rescore(study: Study, evidence: Evidence) -> Evidence:
    """The same verdict and probabilities, with every model fitted and scored under the present weights."""
    base = study.hold_out(
        study.fit(evidence.base.model.choices, evidence.base, FULL_ITERATIONS), residuals=True
    )
    trials = [study.fit(t.model.choices, t, FULL_ITERATIONS if t.held_out else 1) for t in evidence.trials]
    scored = [
        study.hold_out(new) if old.held_out else study.count(new)
        for old, new in zip(evidence.trials, trials, strict=True)
    ]
    return replace(evidence, base=base, trials=tuple(scored))
