"""Sparse regression of the remainder: which few terms of the library explain it on runs left out.

Every term is fitted beside all that the bench leaves open, under the weights of the last model, and scored
on runs that the fit has not seen. One step of the score test tells which terms promise most; the best of
these by held-out misfit is taken, its travel, speed or time looked for, then the next, while each explains
enough of what is left. Terms that later ones make needless are taken out again. Several beginnings give
several laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

from fingerlab.core.progress import SILENT, Watch
from fingerlab.diagnosis.draft.library import library
from fingerlab.diagnosis.draft.terms import DraftTerm, as_effects
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.next_effect import ScoreTest, climb_grid
from fingerlab.diagnosis.settings import (
    DRAFT_BEGINNINGS,
    DRAFT_FACTORS,
    DRAFT_FINE_FACTORS,
    DRAFT_FRONT,
    DRAFT_LAWS,
    DRAFT_LEAST,
    DRAFT_LEAST_FALL,
    DRAFT_LEAST_SHARE,
    DRAFT_NEEDLESS,
    DRAFT_TERMS,
    FULL_ITERATIONS,
    SCREEN_ITERATIONS,
)
from fingerlab.effects import effect
from fingerlab.effects.base import Effect
from fingerlab.effects.transmission import RIPPLE_ORDERS
from fingerlab.physics.motion import Motion, strongest_lines
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Terms:
    """Terms beside a model, and what is left with them on runs left out; the most important first."""

    terms: tuple[DraftTerm, ...]
    fitted: FittedModel


@dataclass(frozen=True)
class Law:
    """A law beside a model, under weights that all laws of a draft have in common.

    Attributes:
        base: the model alone. steps: with the first term, the first two, and so on to the law itself.
    """

    terms: tuple[DraftTerm, ...]
    scorer: Scorer
    base: FittedModel
    steps: tuple[FittedModel, ...]

    @property
    def fitted(self) -> FittedModel:
        """The model with the whole law."""
        return self.steps[-1]

    @property
    def cost(self) -> float:
        """What is left, and a charge for each of its terms and for each effect that it stands beside."""
        parts = len(self.terms) + len(self.base.choices)
        return self.fitted.misfit + parts * DRAFT_LEAST_FALL * self.fitted.count


class Remainder:
    """What a model leaves of its recordings, and the terms that it may be drafted of.

    Attributes:
        effects: of the model, each at the shape that was found. base: the model on held-out runs.
    """

    def __init__(self, reduction: Reduction, last: FittedModel, watch: Watch = SILENT) -> None:
        """``reduction``: that was given to the diagnosis which found the model ``last``.

        Raises:
            UserError: a run cannot be read. Cancelled: the user asked for it.
        """
        self._reduction, self._watch = reduction, watch
        self.effects = at_found_shapes(last)
        self._motions = reduction.examples()
        self._terms = {term.id: term for term in _offered(reduction, self._motions)}
        self._as_effects: dict[DraftTerm, Effect] = {}
        self._weights: Weights = last.weights
        self.scorer = self._scorer(self._offers())
        base = self.scorer.fit([Choice(e) for e in self.effects], last, FULL_ITERATIONS, last.weights)
        self.base = self.scorer.score_held_out(base)

    @property
    def worth_drafting(self) -> bool:
        """Whether the model leaves what no bench does."""
        return self.base.misfit > DRAFT_LEAST * self.base.count

    def laws(self) -> list[Terms]:
        """Laws from several beginnings, as they come."""
        found = []
        for number, begun in enumerate(self._promising(Terms((), self.base))[:DRAFT_BEGINNINGS]):
            self._watch.tell(number / DRAFT_BEGINNINGS, f"drafting a law with {begun.terms[0].words}")
            law = self._shortened(self._grown(begun))
            if self.base.misfit - law.fitted.misfit >= least_fall(self.base):
                found.append(law)
        return found

    def settled(self, terms: Sequence[DraftTerm], weights: Weights) -> Law:
        """A law under other weights, its terms in the order in which each explains most."""
        scorer = self._scorer([self._effect(term) for term in terms])
        base = scorer.fit([Choice(e) for e in self.effects], self.base, FULL_ITERATIONS, weights)
        base = scorer.score_held_out(base)
        left, order, steps = list(terms), list[DraftTerm](), [base]
        while left:
            tried = [(t, self._with(scorer, steps[-1], t)) for t in left]
            best, fitted = min(tried, key=lambda one: one[1].misfit)
            left.remove(best)
            order.append(best)
            steps.append(fitted)
        return Law(tuple(order), scorer, base, tuple(steps[1:]))

    def with_effect(self, name: str, weights: Weights) -> FittedModel:
        """The model with one more effect of the catalogue, or without it if it is the better for that."""
        suited = self._reduction.suited([effect(name)])
        scorer = self._scorer(suited)
        base = scorer.fit([Choice(e) for e in self.effects], self.base, FULL_ITERATIONS, weights)
        base = scorer.score_held_out(base)
        if suited[0] not in scorer.reduced.layout.effects:
            return base
        point = ScoreTest(scorer.data, base).best_point(suited[0])
        fitted = scorer.fit([*base.choices, Choice(suited[0], point.shape)], base, SCREEN_ITERATIONS)
        fitted = scorer.score_held_out(climb_grid(scorer, fitted))
        return fitted if fitted.misfit < base.misfit else base

    def own_weights(self, law: Terms) -> Weights:
        """The weights of a law's own floor; where nothing repeats those of the model, which stand for it."""
        scorer = self._scorer([self._effect(term) for term in law.terms])
        if not all(group.repeats for group in scorer.reduced.groups):
            return self._weights
        return scorer.fit_reweighted(law.fitted.choices, law.fitted).weights

    def _scorer(self, offered: Sequence[Effect]) -> Scorer:
        reduced = self._reduction.refined([*self.effects, *offered], self._watch)
        fixed = self._reduction.fixed
        scorer = Scorer(replace(reduced, constants=self._reduction.constants, fixed=fixed))
        return (
            scorer if all(group.repeats for group in scorer.reduced.groups) else scorer.with_floor_weights()
        )

    def _effect(self, term: DraftTerm) -> Effect:
        if term not in self._as_effects:
            self._as_effects |= as_effects([term], self._motions)
        return self._as_effects[term]

    def _offers(self, known: Sequence[DraftTerm] = ()) -> list[Effect]:
        """All terms that these recordings move, those ``known`` with the numbers that were found."""
        every = {**self._terms, **{term.id: term for term in known}}
        new = [term for term in every.values() if term not in self._as_effects]
        self._as_effects |= as_effects(new, self._motions)
        self._terms = {i: term for i, term in self._terms.items() if term in self._as_effects}
        return [self._as_effects[term] for term in every.values() if term in self._as_effects]

    def _promising(self, law: Terms) -> list[Terms]:
        """The law with one more term each, its number about where it fits best; what leaves least first."""
        known = {term.id for term in law.terms}
        scorer = self.scorer
        if any(term.number for term in law.terms):
            scorer = self._scorer(self._offers(law.terms))
        here = scorer.fit(law.fitted.choices, law.fitted, FULL_ITERATIONS)
        test = ScoreTest(scorer.data, here)
        gains = {t: test.gain(self._effect(t), 0) for t in self._terms.values() if t.id not in known}
        front = sorted(gains, key=lambda t: -gains[t])[:DRAFT_FRONT]
        tried = [Terms((*law.terms, t), self._with(scorer, here, t)) for t in front]
        return sorted(
            (self._refined(one, (DRAFT_FACTORS,)) for one in tried), key=lambda one: one.fitted.misfit
        )

    def _with(self, scorer: Scorer, fitted: FittedModel, term: DraftTerm) -> FittedModel:
        choices = [*fitted.choices, Choice(self._effect(term))]
        return scorer.score_held_out(scorer.fit(choices, fitted, FULL_ITERATIONS))

    def _grown(self, law: Terms) -> Terms:
        """The law, while each further term explains enough of what is left."""
        law = self._refined(law, DRAFT_FINE_FACTORS)
        while len(law.terms) < DRAFT_TERMS and law.fitted.misfit > DRAFT_LEAST_FALL * law.fitted.count:
            found = self._promising(law)
            if not found or law.fitted.misfit - found[0].fitted.misfit < least_fall(law.fitted):
                break
            law = self._refined(found[0], DRAFT_FINE_FACTORS)
        return law

    def _refined(self, law: Terms, passes: Sequence[Sequence[float]]) -> Terms:
        """The law with the number of its last term where it fits best, of some factors in turn."""
        *others, last = law.terms
        if not last.number:
            return law
        sharp = (0.0, 1.0) if any("¤" in part.code for part in last.parts) else (0.0,)
        term = last
        for factors in passes:
            term = self._best_of(law, term, factors, sharp)
        if term == last:
            return law
        before = law.fitted.choices[:-1]
        scorer = self._scorer([*(self._effect(t) for t in others), self._effect(term)])
        fitted = self._with(scorer, scorer.fit(before, law.fitted, FULL_ITERATIONS), term)
        return Terms((*others, term), fitted) if fitted.misfit < law.fitted.misfit else law

    def _best_of(
        self, law: Terms, term: DraftTerm, factors: Sequence[float], sharp: Sequence[float]
    ) -> DraftTerm:
        """``term`` in place of a law's last one, with its number times the factor that fits best."""
        near = [replace(term, number=term.number * f, sharpness=s) for f, s in product(factors, sharp)]
        shapes = tuple({"number": one.number, "sharpness": one.sharpness} for one in near)
        tried = replace(self._effect(term), shapes=shapes)
        scorer = self._scorer([*map(self._effect, law.terms[:-1]), tried])
        before = law.fitted.choices[:-1]
        fits = [
            scorer.fit_same_law([*before, Choice(tried, i)], law.fitted, SCREEN_ITERATIONS)
            for i in range(len(near))
        ]
        return near[min(range(len(fits)), key=lambda i: fits[i].fit.cost)]

    def _shortened(self, law: Terms) -> Terms:
        """The law without needless terms."""
        scorer = self._scorer([self._effect(term) for term in law.terms])
        while len(law.terms) > 1:
            kept = [law.terms[:i] + law.terms[i + 1 :] for i in range(len(law.terms))]
            fewer = []
            for terms in kept:
                choices = [Choice(e) for e in (*self.effects, *map(self._effect, terms))]
                fewer.append(
                    Terms(terms, scorer.score_held_out(scorer.fit(choices, law.fitted, FULL_ITERATIONS)))
                )
            least = min(fewer, key=lambda one: one.fitted.misfit)
            if least.fitted.misfit - law.fitted.misfit > DRAFT_NEEDLESS * least_fall(least.fitted):
                break
            law = least
        return law


def _offered(reduction: Reduction, motions: Sequence[Motion]) -> list[DraftTerm]:
    """The terms for the kinds of runs that there are."""
    turned = [m.joints for m in motions if m.joints is not None]
    travel = {
        "mcp": _travel([joints.mcp for joints in turned]), "pip": _travel([joints.pip for joints in turned]),
    } if turned else None  # fmt: skip
    alone = [m for m in motions if m.joints is None]
    orders = tuple(strongest_lines(alone)) if alone and not turned else tuple(map(float, RIPPLE_ORDERS))
    contact = any(m.force is not None for m in motions)
    of = reduction.scales.of
    return list(library(travel, contact, bool(alone), orders, of("s"), of("N"), of("rad")))


def _travel(angles: Sequence[Array]) -> tuple[float, float]:
    """Least and largest angle, rad."""
    return min(float(one.min()) for one in angles), max(float(one.max()) for one in angles)


def least_fall(fitted: FittedModel) -> float:
    """By how much a model's misfit must fall for one more term."""
    return max(DRAFT_LEAST_SHARE * fitted.misfit, DRAFT_LEAST_FALL * fitted.count)


@dataclass(frozen=True)
class Draft:
    """Up to three laws, best first, and what the catalogue does under the same weights.

    Attributes:
        best: id of the catalogue's best effect; None: none is known. best_score: held out, with it.
    """

    laws: tuple[Law, ...] = ()
    best: str | None = None
    best_score: float = 0.0


def draft(
    reduction: Reduction, models: Sequence[FittedModel], candidates: Sequence[str] = (), watch: Watch = SILENT
) -> Draft:
    """Up to three laws; none where the first model leaves little, or no law explains enough of it.

    Args:
        reduction: that was given to the diagnosis. models: the one at the end of its path, and others that a
            law may stand beside instead, such as that without effects.
        candidates: ids of effects of the catalogue, best first.

    Raises:
        UserError: a run cannot be read. Cancelled: the user asked for it.
    """
    rests: list[Remainder] = []
    for model in models:
        rests.append(Remainder(reduction, replace(model, weights=models[0].weights), watch))
        if not rests[0].worth_drafting:
            return Draft()
    found = [(rest, law) for rest in rests for law in rest.laws()]
    if not found:
        return Draft()
    found.sort(key=lambda one: one[1].fitted.misfit + _charge(one[1].fitted))
    weights = found[0][0].own_weights(found[0][1])
    laws: dict[frozenset[str], Law] = {}
    for rest, law in found:  # the same law beside effects that it makes needless is told once
        key = frozenset(t.id for t in law.terms)
        if key not in laws:
            laws[key] = rest.settled(law.terms, weights)
    rest = rests[0]
    effect = next((name for name in candidates if name not in rest.base.effect_ids), None)
    beside = rest.with_effect(effect, weights) if effect is not None else rest.settled((), weights).base
    kept = [law for law in laws.values() if beside.misfit - law.fitted.misfit >= least_fall(beside)]
    kept.sort(key=lambda law: law.cost)
    return Draft(tuple(kept[:DRAFT_LAWS]), beside.effect_ids[-1] if beside.choices else None, beside.score)


def _charge(fitted: FittedModel) -> float:
    return len(fitted.choices) * DRAFT_LEAST_FALL * fitted.count
