"""Which effect next: every effect of the catalogue tried beside the model as it stands.

Which grid point of an effect to try is told by one step of its gains beside a fitted model, all grid points
at once. At the best fit of the model the gradient along its own unknowns is zero, so one Newton step with an
effect more needs only the effect's own products and how much of them the model's unknowns could take over
(the Schur complement). That costs a hundredth of a fit.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.features import Feature
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.solver import WEAK_PRIOR, Fitter, bounded_step
from fingerlab.diagnosis.fit.weights import feature_weights
from fingerlab.diagnosis.score.evidence import Evidence, judge
from fingerlab.diagnosis.score.fitted_model import Trial
from fingerlab.diagnosis.score.scorer import FULL_ITERATIONS, Study
from fingerlab.diagnosis.score.selection import much_left
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Promise:
    """A grid point and by how much the cost falls there in one step; infinite: not known."""

    shape: int
    fall: float


class Sketch:
    """Products of a fitted model with every feature of the catalogue, under the study's weights."""

    def __init__(self, study: Study, base: Trial) -> None:
        model, values = base.model, base.fit.values
        self.layout = model.layout
        fitter = Fitter(model, study.data, study.weights)
        fitter.hold(values)
        gradient, information = fitter.normal_equations(values)
        # Unknowns that stand at a bound and are pushed out of it stay where they are.
        held = ((values <= model.low) & (gradient > 0)) | ((values >= model.high) & (gradient < 0))
        self.free = np.flatnonzero(~held)
        self.inverse = np.linalg.pinv(information[np.ix_(self.free, self.free)], hermitian=True)
        self.gradient = gradient[self.free]
        self.groups = []
        for i, group in enumerate(study.data.groups):
            raw, clean = study.data.raw(i, None), study.data.noiseless[i]
            weights = EFFECTIVE_SHARE * study.weights[group.key]
            h, jacobian = model.coefficients(values, group)
            still = EFFECTIVE_SHARE * fitter.standing(i)
            every = self.layout.every
            self.groups.append(
                (
                    raw,
                    weights,
                    clean.across(h[None], model.pick, weights, every, still)[0],
                    raw.across(jacobian[:, self.free].T, model.pick, weights, every, still),
                    model.unit_coefficients(values, group),
                )
            )

    def promise(self, effect: Effect) -> Promise:
        """The effect's grid point whose first step lowers the cost most, and by how much."""
        if effect.special or effect.relaxes or effect.turns or not effect.gains:
            return Promise(0, np.inf)  # more than new columns: one step of the gains does not tell
        falls = [self.fall(effect, shape) for shape in range(len(effect.shapes))]
        best = int(np.argmax(falls))
        return Promise(best, falls[best])

    def fall(self, effect: Effect, shape: int) -> float:
        """By how much the cost (minus twice the log posterior) falls in one step of the effect's gains."""
        places = self.layout.indices(effect.id, shape)
        names = [name for name in effect.gains if name not in effect.offsets]
        pick = _picks([self.layout.features[i] for i in places], names)
        gains = [effect.gains[name] for name in names]
        curvature = np.diag([WEAK_PRIOR / g.typical**2 for g in gains])
        slope = np.zeros(len(gains))
        shared = np.zeros((len(self.free), len(gains)))
        theirs = self.layout.every[places]
        for raw, weights, pull, cross, unit in self.groups:
            columns = pick * unit[places][:, None]
            curvature += columns.T @ (raw.of(theirs) * feature_weights(weights, theirs.rows)) @ columns
            slope += pull[places] @ columns
            shared += cross[:, places] @ columns
        taken = self.inverse @ shared
        curvature -= shared.T @ taken
        slope -= taken.T @ self.gradient
        zero = np.zeros(len(gains))
        low, high = np.array([g.low for g in gains]), np.array([g.high for g in gains])
        step = bounded_step(zero, slope, curvature, low, high)
        return float(-2 * slope @ step - step @ curvature @ step)


def _picks(features: list[Feature], names: list[str]) -> Array:
    """1 where a feature is multiplied by a gain, shape (features, gains)."""
    return np.array([[float(f.parameter == name) for name in names] for f in features])


HELD_OUT_TRIALS = 4
"""This many of the best effects are scored on held-out runs; the rest are far behind and scored in sample."""
FRONT = 8
"""This many are looked at more closely when the weights have changed."""
HOPEFUL_SHARE = 0.1
"""An effect whose first step lowers the cost by less than this share of the best's is fitted no further."""
SAME_SHARE = 1e-3
"""Effects whose costs differ by less than this share leave the same noise, and set the same weights."""
SCREEN_ITERATIONS = 3


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
            shapes = [_first_try(study, base, Choice(effect, i)) for i in range(len(effect.shapes))]
            start = min(shapes, key=_cost)
            promise = Promise(start.model.choices[-1].shape, np.inf)
        trial = study.fit([*given, Choice(effect, promise.shape)], start, iterations)
        # Without the effect the tip may have seemed to do what it does not.
        trials.append(study.with_best_law(trial, SCREEN_ITERATIONS))
    return sorted(trials, key=_cost)


def _first_try(study: Study, base: Trial, choice: Choice) -> Trial:
    choices = [*base.model.choices, choice]
    if not choice.effect.turns:
        return study.fit(choices, base, 1)
    # Where the face has turned, the tip may do otherwise than it seemed to.
    return study.with_best_law(study.fit(choices, base, SCREEN_ITERATIONS), SCREEN_ITERATIONS)


def refine(study: Study, trial: Trial) -> Trial:
    """The trial fitted to the end, at its grid point or where its neighbours lead to."""
    *given, last = trial.model.choices
    tried: dict[int, Trial] = {}
    fit = study.fit if last.effect.turns else study.fit_like
    best = last.shape
    while True:
        for i in (best - 1, best, best + 1):
            if 0 <= i < len(last.effect.shapes) and i not in tried:
                tried[i] = fit([*given, Choice(last.effect, i)], trial, FULL_ITERATIONS)
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
    misshapen = much_left(base)  # what the base's effects look like may come from what is still missing
    for _ in range(3):
        front = sorted((_at_its_best(study, t, misshapen) for t in trials[:HELD_OUT_TRIALS]), key=_cost)
        trials = front + trials[HELD_OUT_TRIALS:]
        if not front or front[0].fit.cost >= base.fit.cost or _led(front, leaders):
            break
        leaders.add(front[0].model.choices[-1].effect.id)
        study.settle(front[0].model.choices, front[0])
        base = study.fit(base.model.choices, base, FULL_ITERATIONS)
        # Under the new weights another effect may come to the front.
        again = (
            study.fit(t.model.choices, t, SCREEN_ITERATIONS if i < FRONT else 1) for i, t in enumerate(trials)
        )
        trials = sorted(again, key=_cost)
    watch.tell(0.95, "scoring on held-out runs")
    base = study.told(study.hold_out(base, residuals=True))
    scored = [study.hold_out(t) for t in trials[:HELD_OUT_TRIALS]]
    scored += [_as_held_out(base, study.count(t)) for t in trials[HELD_OUT_TRIALS:]]
    return judge(base, scored)


def _as_held_out(base: Trial, trial: Trial) -> Trial:
    """A trial scored in sample, as much below the held-out base as it is below it in sample.

    Where runs differ, a model misses more in those that it has not seen, with an effect or without.
    """
    misfits = trial.misfits.copy()
    misfits[:, 0] += base.misfits[:, 0] - base.in_sample[:, 0]
    return replace(trial, misfits=misfits)


def _cost(trial: Trial) -> float:
    return trial.fit.cost


def _at_its_best(study: Study, trial: Trial, every: bool) -> Trial:
    """The trial with its last effect at the best grid point, or every effect."""
    refined = refine(study, trial)
    return _reshaped(study, refined) if every else refined


def _led(front: Sequence[Trial], leaders: Collection[str]) -> bool:
    """Whether the best of the front has set the weights, or one that these data hardly tell from it."""
    best = front[0].fit.cost
    return any(
        t.model.choices[-1].effect.id in leaders and t.fit.cost - best <= SAME_SHARE * abs(best)
        for t in front
    )


def reshape(study: Study, trial: Trial) -> Trial:
    """The trial with every earlier effect at the grid point that fits best now that a later one is there."""
    found = _reshaped(study, trial)
    if [c.shape for c in found.model.choices] == [c.shape for c in trial.model.choices]:
        return trial
    return study.hold_out(study.settle(found.model.choices, found))


def _reshaped(study: Study, trial: Trial) -> Trial:
    """The same under the present weights, not yet scored."""
    choices, found = list(trial.model.choices), trial
    for i, choice in enumerate(choices[:-1]):
        if len(choice.effect.shapes) > 1:
            others = [c for k, c in enumerate(choices) if k != i]
            found = refine(study, study.fit([*others, choice], found, SCREEN_ITERATIONS))
            choices[i] = found.model.choices[-1]
    if found is trial:
        return trial
    return study.fit(choices, found, FULL_ITERATIONS)


def rescore(study: Study, evidence: Evidence) -> Evidence:
    """The same verdict and probabilities, with every model fitted and scored under the present weights."""
    fitted = study.fit(evidence.base.model.choices, evidence.base, FULL_ITERATIONS)
    base = study.told(study.hold_out(fitted, residuals=True))
    trials = [study.fit(t.model.choices, t, FULL_ITERATIONS if t.held_out else 1) for t in evidence.trials]
    scored = [
        study.hold_out(new) if old.held_out else _as_held_out(base, study.count(new))
        for old, new in zip(evidence.trials, trials, strict=True)
    ]
    return replace(evidence, base=base, trials=tuple(scored))
