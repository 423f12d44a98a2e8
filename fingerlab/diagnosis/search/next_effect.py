"""Which effect next: every effect of the catalogue tried beside the model as it stands.

Which grid point of an effect to try is told by one step of its gains beside a fitted model, all grid points
at once. At the best fit of the model the gradient along its own unknowns is zero, so one Newton step with an
effect more needs only the effect's own products and how much of them the model's unknowns could take over
(the Schur complement). That costs a hundredth of a fit.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.features import Feature
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.bounded_step import bounded_step
from fingerlab.diagnosis.fit.data import Data, Weights
from fingerlab.diagnosis.fit.solver import Fitter
from fingerlab.diagnosis.gram.run_constants import EquationWeights, schur_complement
from fingerlab.diagnosis.score.evidence import Evidence, closest_of, judge
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_assumed_bounds, at_bounds
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import justified, lacks_fit, log_odds_among
from fingerlab.diagnosis.settings import (
    ASTRAY,
    CANDIDATES_REFITTED,
    FULL_ITERATIONS,
    HELD_OUT_TRIALS,
    LEADERS,
    LEADING_SHARE,
    MOST_WIDENED,
    SAME_COST_SHARE,
    SCREEN_ITERATIONS,
    SCREEN_SHARE,
    SET_LOG_ODDS,
    STRANGE_CONSTANTS,
    USUAL_ITERATIONS,
    WEAK_PRIOR,
)
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class PredictedGain:
    """A point of an effect's grid and by how much the cost falls there in one step; infinite: not known."""

    shape: int
    gain: float


ROUNDING = 1e-9
"""Share of an unknown's curvature that rounding leaves where others could take its place."""


class ScoreTest:
    """Products of a fitted model with every feature of the catalogue, under the model's weights."""

    def __init__(self, data: Data, base: FittedModel) -> None:
        model, values = base.model, base.fit.values
        self.layout, self.missed = model.layout, base.fit.cost
        fitter = Fitter(model, data, base.weights)
        # As the sums of single features, which hold all of every run.
        fitter.set_friction_weights(values, apart=False)
        gradient, information = fitter.normal_equations(values)
        # Unknowns that stand at a bound and are pushed out of it stay where they are, or come back beside an
        # effect: what is missing may have pushed them there.
        held = ((values <= model.low) & (gradient > 0)) | ((values >= model.high) & (gradient < 0))
        self.free, self.held = np.flatnonzero(~held), np.flatnonzero(held)
        self.inverse = np.linalg.pinv(information[np.ix_(self.free, self.free)], hermitian=True)
        self.gradient = gradient[self.free]
        across = information[np.ix_(self.free, self.held)]
        self.taken = self.inverse @ across
        self.slope = gradient[self.held] - self.taken.T @ self.gradient
        of_held = information[np.ix_(self.held, self.held)]
        self.curvature = of_held - across.T @ self.taken
        least = ROUNDING * of_held.diagonal()
        np.fill_diagonal(self.curvature, np.maximum(self.curvature.diagonal(), least))
        self.room = (model.low - values)[self.held], (model.high - values)[self.held]
        self._gains: dict[tuple[str, int], float] = {}
        self.groups = []
        for i, group in enumerate(data.groups):
            raw, clean = data.raw(i, None), data.noiseless[i]
            weights = EquationWeights.of(
                EFFECTIVE_SHARE * base.weights[group.key], EFFECTIVE_SHARE * fitter.standing(i)
            )
            h, jacobian = model.coefficients(values, group)
            every = self.layout.every
            pull = clean.across(h[None], model.pick, weights, every)[0]
            cross = raw.across(jacobian.T, model.pick, weights, every)
            own = data.by_constants(i, None, fitter.equation_weights(i), (model.pick, every))
            if own is not None:
                posterior_covariance, (mine, theirs) = own
                of_all = schur_complement(mine, posterior_covariance, theirs)
                pull, cross = pull - h @ of_all, cross - jacobian.T @ of_all
            unit = model.unit_coefficients(values, group)
            taken = None if own is None else (own[0], own[1][1])
            self.groups.append((raw, weights, pull, cross, unit, taken))

    def best_point(self, effect: Effect) -> PredictedGain:
        """The effect's grid point whose first step lowers the cost most, and by how much."""
        if effect.special or effect.relaxes or effect.turns or not effect.gains:
            return PredictedGain(0, np.inf)  # more than new columns: one step of the gains does not tell
        gains = [self.gain(effect, shape) for shape in range(len(effect.shapes))]
        best = int(np.argmax(gains))
        return PredictedGain(best, gains[best])

    def best_of_other_kinds(self, effect: Effect, taken: int) -> list[int]:
        """The best grid point of each kind of shape, told by the names of its values, but that of ``taken``.

        A first step does not tell what else moves when friction at rest has another torque to hold: of a
        link's weight it promised a tenth of what it explained, and less than a ripple's line.
        """
        kinds: dict[frozenset[str], list[int]] = {}
        for i, shape in enumerate(effect.shapes):
            kinds.setdefault(frozenset(shape), []).append(i)
        others = [places for places in kinds.values() if taken not in places]
        return [max(places, key=lambda i: self.gain(effect, i)) for places in others]

    def best_of_possible(self, effect: Effect, taken: int) -> list[int]:
        """The best grid point that promises no more than all that is missed, if that of ``taken`` does.

        Where a joint hardly moves, what else could be there goes far beyond its bounds in one step.
        """
        if self.gain(effect, taken) <= self.missed:
            return []
        gains = {i: self.gain(effect, i) for i in range(len(effect.shapes))}
        possible = [i for i, gain in gains.items() if gain <= self.missed]
        return [max(possible, key=lambda i: gains[i])] if possible else []

    def gain(self, effect: Effect, shape: int) -> float:
        """By how much the cost (minus twice the log posterior) falls in one step of the effect's gains."""
        key = effect.id, shape
        if key not in self._gains:
            self._gains[key] = self._gain(effect, shape)
        return self._gains[key]

    def _gain(self, effect: Effect, shape: int) -> float:
        places = self.layout.indices(effect.id, shape)
        names = [name for name in effect.gains if name not in effect.offsets]
        pick = _picks([self.layout.features[i] for i in places], names)
        within = effect.gains_at(shape)
        gains = [within[name] for name in names]
        prior = np.array([WEAK_PRIOR / g.typical**2 for g in gains])
        curvature = np.diag(prior)
        slope = np.zeros(len(gains))
        shared = np.zeros((len(self.free) + len(self.held), len(gains)))
        theirs = self.layout.every[places]
        for raw, weights, pull, cross, unit, own in self.groups:
            columns = pick * unit[places][:, None]
            among = raw.among(theirs, weights)
            if own is not None:
                among -= schur_complement(own[1][:, places], own[0], own[1][:, places])
            curvature += columns.T @ among @ columns
            slope += pull[places] @ columns
            shared += cross[:, places] @ columns
        shared, back = shared[self.free], shared[self.held]
        taken = self.inverse @ shared
        curvature -= shared.T @ taken
        # Of what the other unknowns could explain entirely, its prior is left: the rest is rounding.
        np.fill_diagonal(curvature, np.maximum(curvature.diagonal(), prior))
        slope -= taken.T @ self.gradient
        low, high = np.array([g.low for g in gains]), np.array([g.high for g in gains])
        if len(self.held):
            back = back - self.taken.T @ shared
            curvature = np.block([[curvature, back.T], [back, self.curvature]])
            slope = np.concatenate((slope, self.slope))
            low, high = np.concatenate((low, self.room[0])), np.concatenate((high, self.room[1]))
        step = bounded_step(np.zeros(len(slope)), slope, curvature, low, high)
        return float(-2 * slope @ step - step @ curvature @ step)


def _picks(features: list[Feature], names: list[str]) -> Array:
    """1 where a feature is multiplied by a gain, shape (features, gains)."""
    return np.array([[float(f.parameter == name) for name in names] for f in features])


def screen(
    scorer: Scorer,
    base: FittedModel,
    effects: Sequence[Effect],
    watch: Watch,
    least: float = -np.inf,
    shapes: Mapping[str, int] = MappingProxyType({}),
) -> list[FittedModel]:
    """The base model with each effect that it does not hold yet, after a few steps; best first.

    Each effect stands at the point of its grid with the largest predicted gain; one with less than ``least``
    is left out. One whose gain no step tells stands where ``shapes`` says, or is tried at every point.
    """
    given = base.choices
    test = ScoreTest(scorer.data, base)
    points = {e.id: test.best_point(e) for e in effects if e.id not in base.effect_ids}
    rest = [e for e in effects if e.id in points and points[e.id].gain >= least]
    hopeful = SCREEN_SHARE * max((p.gain for p in points.values() if p.gain < np.inf), default=0.0)
    candidates = []
    for number, effect in enumerate(rest):
        watch.tell(number / len(rest), f"trying {effect.title.lower()}")
        point, start = points[effect.id], base
        iterations = SCREEN_ITERATIONS if point.gain >= hopeful else 1
        if point.gain == np.inf and effect.id in shapes:
            point = PredictedGain(shapes[effect.id], np.inf)
        elif point.gain == np.inf and len(effect.shapes) > 1:
            everywhere = [_first_try(scorer, base, Choice(effect, i)) for i in range(len(effect.shapes))]
            start = min(everywhere, key=_cost)
            point = PredictedGain(start.choices[-1].shape, np.inf)
        fitted = scorer.fit([*given, Choice(effect, point.shape)], start, iterations)
        if point.gain < np.inf:
            others = test.best_of_other_kinds(effect, point.shape)
            others += [i for i in test.best_of_possible(effect, point.shape) if i not in others]
            tried = [scorer.fit([*given, Choice(effect, i)], base, SCREEN_ITERATIONS) for i in others]
            fitted = min([fitted, *tried], key=_cost)
        if base.constants_off > STRANGE_CONSTANTS:
            # They may have gone so far for want of the effect that no step beside it leads them back.
            anew = scorer.fit_same_law(
                fitted.choices, None, USUAL_ITERATIONS, base.weights, base.model.tip_law
            )
            fitted = min(fitted, anew, key=_cost)
        # Without the effect the tip may have seemed to do what it does not.
        candidates.append(off_its_bounds(scorer, scorer.with_best_law(fitted, SCREEN_ITERATIONS)))
    return sorted(candidates, key=_cost)


def off_its_bounds(
    scorer: Scorer, fitted: FittedModel, iterations: int = SCREEN_ITERATIONS, every: bool = False
) -> FittedModel:
    """The model; where its last effect stands at an assumed bound, or ``every``, with a wider range."""
    places = range(len(fitted.choices)) if every else [len(fitted.choices) - 1]
    for _ in range(MOST_WIDENED):
        choices, stuck = list(fitted.choices), {k: at_assumed_bounds(fitted, k) for k in places}
        if not any(stuck.values()):
            break
        for k, names in stuck.items():
            choices[k] = replace(choices[k], effect=choices[k].effect.wider(names)) if names else choices[k]
        wider = scorer.fit(choices, fitted, iterations)
        if wider.fit.cost >= fitted.fit.cost:
            break
        fitted = wider
    return fitted


def at_edges(scorer: Scorer, evidence: Evidence, refined: Sequence[FittedModel] = ()) -> list[int]:
    """Indices of candidates at the edge of what is allowed, which could be what is missing beyond it.

    With ten times the range, or more, each would be a step worth taking, and as likely as those that cannot
    be ruled out. Who stands at an edge and explains no more beyond it is ruled out as others are.

    Args:
        refined: models of effects between the points of their grids, scored under the same weights.
    """
    found = []
    closest = closest_of(evidence.candidates, refined)
    for i, fitted in enumerate(evidence.candidates):
        beyond = fitted
        for _ in range(MOST_WIDENED):  # what one strength may grow to brings the next one to its edge
            names = at_bounds(beyond)
            if not names:
                break
            *given, last = beyond.choices
            wider = Choice(last.effect.wider(names), last.shape)
            beyond = scorer.fit([*given, wider], beyond, FULL_ITERATIONS)
        if beyond is fitted:
            continue
        beyond = scorer.score_held_out(beyond)
        others = [c for k, c in enumerate(closest) if k != i]
        odds = log_odds_among(evidence.base, [*others, beyond])[-1]
        if odds > -SET_LOG_ODDS and justified(evidence.base, beyond):
            found.append(i)
    return found


def _first_try(scorer: Scorer, base: FittedModel, choice: Choice) -> FittedModel:
    # One step may lead far above where two more come to: of a cable that gives, to five times the cost.
    found = scorer.fit([*base.choices, choice], base, SCREEN_ITERATIONS)
    # Where the face has turned, the tip may do otherwise than it seemed to.
    return scorer.with_best_law(found, SCREEN_ITERATIONS) if choice.effect.turns else found


def climb_grid(scorer: Scorer, fitted: FittedModel) -> FittedModel:
    """The model fitted to the end, its last effect at its grid point or where the neighbours lead to."""
    *given, last = fitted.choices
    tried: dict[int, FittedModel] = {}
    fit = scorer.fit if last.effect.turns else scorer.fit_same_law
    best = last.shape
    while True:
        for i in (best - 1, best, best + 1):
            if 0 <= i < len(last.effect.shapes) and i not in tried:
                tried[i] = fit([*given, Choice(last.effect, i)], fitted, FULL_ITERATIONS)
        found = min(tried, key=lambda i: tried[i].fit.cost)
        if found == best:
            return scorer.with_best_law(tried[best], FULL_ITERATIONS)
        best = found


def judge_all(
    scorer: Scorer, base: FittedModel, effects: Sequence[Effect], watch: Watch, least: float = -np.inf
) -> Evidence:
    """Judge all effects beside ``base`` whose predicted gain is ``least``, under the weights of the best.

    The repeatability of the equations depends on the model that they are seen through, so the best effect
    sets the weights, and all are judged again until the best stays the best.
    """
    candidates = screen(scorer, base, effects, watch, least)
    leaders: set[str] = set()
    misshapen = lacks_fit(base)  # what the base's effects look like may come from what is still missing
    for _ in range(LEADERS):
        front = sorted((_at_its_best(scorer, c, misshapen) for c in candidates[:HELD_OUT_TRIALS]), key=_cost)
        candidates = front + candidates[HELD_OUT_TRIALS:]
        if not front or front[0].fit.cost >= base.fit.cost or _led(front, leaders):
            break
        leader = _leader(scorer, base, front)
        if leader.last_effect.id in leaders:
            break
        leaders.add(leader.last_effect.id)
        weights = leader.weights
        base = scorer.fit_from_each(base.choices, [base, leader], weights)
        # Under the new weights another effect may come to the front.
        again = (
            scorer.fit(c.choices, c, SCREEN_ITERATIONS if i < CANDIDATES_REFITTED else 1, weights)
            for i, c in enumerate(candidates)
        )
        candidates = sorted(again, key=_cost)
    watch.tell(0.95, "scoring on held-out runs")
    base = scorer.with_sensitivity(scorer.score_held_out(base, residuals=True))
    scored = [scorer.score_held_out(c) for c in candidates[:HELD_OUT_TRIALS]]
    scored += [_as_held_out(base, scorer.score_in_sample(c)) for c in candidates[HELD_OUT_TRIALS:]]
    return judge(base, scored)


def _leader(scorer: Scorer, base: FittedModel, front: Sequence[FittedModel]) -> FittedModel:
    """The likeliest of the front under its own weights, of those that explain as much as the best does.

    Under the weights of a model that calls much of the recordings noise nothing speaks against another such
    one: where a tip seems to rub, its friction is noise to all else in contact.
    """
    least = base.fit.cost - LEADING_SHARE * (base.fit.cost - front[0].fit.cost)
    best, most = None, np.inf
    for one in (c for c in front if c.fit.cost <= least):
        fitted = scorer.fit_reweighted(one.choices, one, most=most)
        deviance = scorer.deviance(fitted)
        if best is None or deviance < most:
            best, most = fitted, deviance
    assert best is not None, "the first of the front is one"
    return best


def _as_held_out(base: FittedModel, fitted: FittedModel) -> FittedModel:
    """A model scored in sample, as much below the held-out base as it is below it in sample.

    Where runs differ, a model misses more in those that it has not seen, with an effect or without.
    """
    misfits = fitted.misfits.copy()
    misfits[:, 0] += base.misfits[:, 0] - base.in_sample[:, 0]
    return replace(fitted, misfits=misfits)


def _cost(fitted: FittedModel) -> float:
    return fitted.fit.cost


def _at_its_best(scorer: Scorer, fitted: FittedModel, every: bool) -> FittedModel:
    """The model with its last effect at the best grid point, or every effect."""
    climbed = off_its_bounds(scorer, climb_grid(scorer, fitted), FULL_ITERATIONS)
    return _readjusted(scorer, climbed) if every else climbed


def _led(front: Sequence[FittedModel], leaders: Collection[str]) -> bool:
    """Whether the best of the front has set the weights, or one that these data hardly tell from it."""
    best = front[0].fit.cost
    return any(
        c.last_effect.id in leaders and c.fit.cost - best <= SAME_COST_SHARE * abs(best) for c in front
    )


def readjust_shapes(scorer: Scorer, fitted: FittedModel) -> FittedModel:
    """The model with every earlier effect at the grid point that fits best now that a later one is there."""
    found = _readjusted(scorer, fitted)
    if [c.shape for c in found.choices] == [c.shape for c in fitted.choices]:
        return fitted
    return scorer.score_held_out(scorer.fit_reweighted(found.choices, found))


def _readjusted(scorer: Scorer, fitted: FittedModel) -> FittedModel:
    """The same under the model's weights, not yet scored."""
    choices, found = list(fitted.choices), fitted
    for i, choice in enumerate(choices[:-1]):
        if len(choice.effect.shapes) > 1:
            others = [c for k, c in enumerate(choices) if k != i]
            found = climb_grid(scorer, scorer.fit([*others, choice], found, SCREEN_ITERATIONS))
            choices[i] = found.choices[-1]
    if found is fitted:
        return fitted
    return scorer.fit(choices, found, FULL_ITERATIONS)


def rescore(scorer: Scorer, evidence: Evidence, weights: Weights) -> Evidence:
    """The same verdict and probabilities, with every model fitted and scored under these weights."""
    starts = [evidence.base, evidence.best] if evidence.candidates else [evidence.base]
    fitted = scorer.fit_from_each(evidence.base.choices, starts, weights)
    base = scorer.with_sensitivity(scorer.score_held_out(fitted, residuals=True))
    scored = []
    for old in evidence.candidates:
        new = scorer.fit(old.choices, old, FULL_ITERATIONS if old.held_out else 1, weights)
        scored.append(
            scorer.score_held_out(new) if old.held_out else _as_held_out(base, scorer.score_in_sample(new))
        )
    return replace(evidence, base=base, candidates=tuple(scored))


def fitted_to_the_end(scorer: Scorer, evidence: Evidence) -> dict[str, FittedModel]:
    """Candidates that a first step led far above the model as given, fitted to the end, by effect's id.

    A first step is enough to see that others explain far more, and no number to be told where it leads away:
    of a friction that bends the moment arms it left fifty floors where the fit leaves five.
    """
    found, base = {}, evidence.base
    astray = (one for one in evidence.candidates if not one.held_out and one.score > ASTRAY * base.score)
    for old in astray:
        new = scorer.score_held_out(scorer.fit(old.choices, old, FULL_ITERATIONS))
        if new.misfit > base.misfit:  # it began too far off: one effect more can do as well
            anew = scorer.score_held_out(scorer.fit(old.choices, base, FULL_ITERATIONS, old.weights))
            new = min(new, anew, key=lambda one: one.misfit)
        found[old.last_effect.id] = replace(new, sensitivity=old.sensitivity)
    return found
