"""Other models of the same recordings: an effect of the model as given exchanged for another.

What is tried beside a model as given says nothing of what would do better in its place: a wrong effect that
takes up most of what the right one does leaves too little for that one to be missed. So every given effect is
taken out again, and the effects that promise as much are tried where it stood: by the score test first, then
by a fit. Whole models are compared, on the same held-out runs and under the same weights; the path from the
model as given is one of them. So is the model with one given effect fewer: what it leaves tells whether that
one earns its place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.progress import Watch
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import (
    constants_speak,
    justified,
    log_odds_among,
    misfit_of_log_odds,
)
from fingerlab.diagnosis.search.grid_refinement import can_refine, extend_path, refine_last
from fingerlab.diagnosis.search.next_effect import climb_grid, screen
from fingerlab.diagnosis.settings import (
    CLOSER_RIVALS,
    FULL_ITERATIONS,
    GRID_SHARE,
    HELD_OUT_TRIALS,
    PRIOR_EFFECTS,
    RIVAL_LOG_ODDS,
    RIVAL_SHARE,
    SET_LOG_ODDS,
)
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class ExchangedModel:
    """Another model of the same recordings.

    Attributes:
        removed: id of the given effect that is not in it. added: ids of those in its place, in order; none:
            nothing is.
        steps: from the first exchange on, each held out under the weights of the model as given.
        scorer: what fitted them.
        log_odds: against the model as given or, where that is likelier, the end of the path from it.
    """

    removed: str
    added: tuple[str, ...]
    steps: tuple[FittedModel, ...]
    scorer: Scorer
    log_odds: float = 0.0

    @property
    def fitted(self) -> FittedModel:
        """The whole model."""
        return self.steps[-1]

    @property
    def better(self) -> bool:
        """Whether it is clearly the better one."""
        return self.log_odds >= RIVAL_LOG_ODDS


@dataclass(frozen=True)
class Given:
    """The model as given, fitted on the whole catalogue's reduction, and on that of its effects alone.

    The more signals a reduction holds, the more carefully their noise is taken away, and the more a model
    leaves: what the two leave tells how much that makes here.
    """

    scorer: Scorer
    fitted: FittedModel
    alone: Scorer
    fitted_alone: FittedModel

    def last(self, place: int, weights: Weights | None = None) -> tuple[FittedModel, Array]:
        """The model with its effect at ``place`` as its last, and what it leaves more of each condition.

        ``weights``: under which both are fitted; None: its own.
        """
        under, fitted = weights or self.fitted.weights, self.fitted
        if place < len(fitted.choices) - 1:
            fitted = _with_last(self.scorer, fitted, place)
        fitted = scored_under(self.scorer, fitted, under)
        alone = scored_under(self.alone, self.fitted_alone, under)
        return fitted, scored_under(self.scorer, self.fitted, under).misfits[:, 0] - alone.misfits[:, 0]


def find_rivals(
    reduction: Reduction,
    given: Given,
    path: Sequence[FittedModel],
    path_scorer: Scorer,
    beside: Sequence[FittedModel],
    watch: Watch,
) -> list[ExchangedModel]:
    """The models with one given effect exchanged that do as well as the path, or nearly; best first.

    Args:
        path: from the model as given. path_scorer: what fitted its further steps.
        beside: the model as given with every effect beside it, each at the best point of its grid there.
    """
    shapes = {one.last_effect.id: one.choices[-1].shape for one in beside}
    end = scored_under(path_scorer, path[-1], given.fitted.weights) if len(path) > 1 else None
    found: dict[tuple[str, tuple[str, ...]], ExchangedModel] = {}
    choices = given.fitted.choices
    for place, choice in enumerate(choices):
        watch.tell(place / len(choices), f"trying others in place of {choice.effect.title.lower()}")
        for one in _in_place_of(reduction, given, end, path_scorer, place, shapes, watch):
            known = found.get((one.removed, one.added))  # one model may be found at two shapes
            if known is None or known.log_odds < one.log_odds:
                found[one.removed, one.added] = one
    return sorted(found.values(), key=lambda one: -one.log_odds)


def without_needless(given: Given) -> ExchangedModel | None:
    """The model as given without the effect that earns its place least; None: every one earns it.

    An effect earns it as a step of a path does, or by constants of the rig that are off without it.
    """
    found: list[ExchangedModel] = []
    for place, choice in enumerate(given.fitted.choices):
        own, _ = given.last(place)
        fewer = given.scorer.fit(own.choices[:-1], own, FULL_ITERATIONS, own.weights)
        without = given.scorer.score_held_out(fewer)
        if not (justified(without, own) or constants_speak(without, own)):
            found.append(ExchangedModel(choice.effect.id, (), (without,), given.scorer))
    return min(found, key=lambda one: one.fitted.misfit, default=None)


def odds_of_rivals(rivals: Sequence[ExchangedModel]) -> dict[str, float]:
    """The best log odds of each effect that comes in first, by its id."""
    return {one.added[0]: one.log_odds for one in reversed(rivals)}


def extended(
    reduction: Reduction, catalogue: Sequence[Effect], rival: ExchangedModel, weights: Weights, watch: Watch
) -> ExchangedModel:
    """The rival with what is missing beside it, too.

    Args:
        weights: of the model as given.

    Raises:
        Cancelled: the user asked for it.
    """
    first = rival.steps[0]
    without = rival.scorer.fit(first.choices[:-1], first, FULL_ITERATIONS)
    longer = extend_path(reduction, catalogue, [without, *rival.steps], watch)
    if longer is None:
        return rival
    scorer, steps = longer
    under = tuple(scored_under(scorer, one, weights) for one in steps[1:])
    return replace(rival, added=tuple(one.last_effect.id for one in under), steps=under, scorer=scorer)


def scored_under(scorer: Scorer, fitted: FittedModel, weights: Weights) -> FittedModel:
    """The model fitted and held out under these weights."""
    if fitted.held_out and fitted.weights is weights:
        return fitted
    return scorer.score_held_out(scorer.fit(fitted.choices, fitted, FULL_ITERATIONS, weights))


def _with_last(scorer: Scorer, fitted: FittedModel, place: int) -> FittedModel:
    """The model with its effect at ``place`` as its last; not yet scored."""
    others = [c for k, c in enumerate(fitted.choices) if k != place]
    return scorer.fit([*others, fitted.choices[place]], fitted, FULL_ITERATIONS)


def _leaving_more(fitted: FittedModel, more: Array) -> FittedModel:
    """The model as if it left so much more of each condition, (conditions,)."""
    misfits = fitted.misfits.copy()
    misfits[:, 0] += more
    return replace(fitted, misfits=misfits)


def _in_place_of(
    reduction: Reduction,
    given: Given,
    end: FittedModel | None,
    path_scorer: Scorer,
    place: int,
    shapes: Mapping[str, int],
    watch: Watch,
) -> list[ExchangedModel]:
    """Models without the given effect at ``place`` that do as well as the model as given and its path."""
    scorer = given.scorer
    own, _ = given.last(place)
    without = scorer.score_held_out(scorer.fit(own.choices[:-1], own, FULL_ITERATIONS))
    rivals = _exchanged(reduction, scorer, without, own, shapes, watch)
    if end is not None:
        spared = _spared(path_scorer, end, place, len(own.choices))
        rivals += [] if spared is None else [spared]
    known = None if end is None else (path_scorer, end)
    under = _judged_under(given, known, place, own.weights, rivals)
    return [_in_either_floors(given, known, place, one) for one in under if one.log_odds > -SET_LOG_ODDS]


def _judged_under(
    given: Given,
    end: tuple[Scorer, FittedModel] | None,
    place: int,
    weights: Weights,
    rivals: Sequence[ExchangedModel],
) -> list[ExchangedModel]:
    """The rivals that are worth an effect, with their odds in the floors of these ``weights``."""
    scorer = given.scorer
    own, more = given.last(place, weights)
    without = scorer.score_held_out(scorer.fit(own.choices[:-1], own, FULL_ITERATIONS))

    def seen(by: Scorer, fitted: FittedModel) -> FittedModel:
        one = scored_under(by, fitted, weights)
        return one if by is scorer else _leaving_more(one, more)

    known = [own] if end is None else [own, seen(*end)]
    rivals = [replace(one, steps=tuple(seen(one.scorer, step) for step in one.steps)) for one in rivals]
    # What would not be missing if neither were there is no rival: then the given effect is idle, too.
    rivals = [one for one in rivals if justified(without, one.steps[0])]
    odds = _log_odds(without, known, rivals)
    return [replace(one, log_odds=o) for one, o in zip(rivals, odds, strict=True)]


def _in_either_floors(
    given: Given, end: tuple[Scorer, FittedModel] | None, place: int, rival: ExchangedModel
) -> ExchangedModel:
    """The rival; one that seems better, with its odds in its own floors, if they are lower there.

    Each of two sheaths may leave less in the floors of the other: added in place of each other in turn, each
    was told to be the better one.
    """
    if not rival.better:
        return rival
    settled = rival.scorer.fit_reweighted(rival.fitted.choices, rival.fitted)
    found = _judged_under(given, end, place, settled.weights, [rival])
    odds = found[0].log_odds if found else -SET_LOG_ODDS
    return replace(rival, log_odds=min(rival.log_odds, odds))


def _exchanged(
    reduction: Reduction,
    scorer: Scorer,
    without: FittedModel,
    own: FittedModel,
    shapes: Mapping[str, int],
    watch: Watch,
) -> list[ExchangedModel]:
    """The model with other effects where ``own`` has its last one; those that do not leave far more.

    The given effect stands between the points of its grid; so do those that come near it.
    """
    catalogue = [e for e in scorer.reduced.layout.effects if e.id not in own.effect_ids]
    gained = without.fit.cost - own.fit.cost
    least = max(own.misfit, 0.0) / max(own.count, 1.0)
    reach = own.fit.cost + own.count * (misfit_of_log_odds(-2.0 * SET_LOG_ODDS, least) - least)
    beyond = max(reach, own.fit.cost + GRID_SHARE * gained)
    tried = screen(scorer, without, catalogue, watch, RIVAL_SHARE * gained, shapes)[:HELD_OUT_TRIALS]
    near = [climb_grid(scorer, one) for one in tried if one.fit.cost < own.fit.cost + RIVAL_SHARE * gained]
    rivals: list[ExchangedModel] = []
    for one in sorted((one for one in near if one.fit.cost < beyond), key=lambda one: one.fit.cost):
        found, by, closer = one, scorer, len(rivals) < CLOSER_RIVALS and can_refine([one.choices[-1]])
        if closer:
            by, found = refine_last(reduction, one, watch)
        # What was looked at closely is judged by runs held out: the cost in sample is for more parameters.
        if closer or found.fit.cost < reach:
            name = one.last_effect.id
            rivals.append(ExchangedModel(own.last_effect.id, (name,), (by.score_held_out(found),), by))
    return rivals


def _spared(scorer: Scorer, end: FittedModel, place: int, given: int) -> ExchangedModel | None:
    """The path's end without the given effect at ``place``, if the later ones have made that needless."""
    choices = list(end.choices)
    idle = choices.pop(place)
    shorter = scorer.score_held_out(scorer.fit(choices, end, FULL_ITERATIONS))
    if justified(shorter, scorer.score_held_out(scorer.fit([*choices, idle], end, FULL_ITERATIONS))):
        return None
    fewer = [
        scorer.score_held_out(scorer.fit(choices[:k], end, FULL_ITERATIONS))
        for k in range(given, len(choices))
    ]
    added = tuple(c.effect.id for c in choices[given - 1 :])
    return ExchangedModel(idle.effect.id, added, (*fewer, shorter), scorer)


def _log_odds(
    without: FittedModel, known: Sequence[FittedModel], rivals: Sequence[ExchangedModel]
) -> list[float]:
    """Log odds of whole models against the likeliest known one; every further effect costs its prior."""
    if not rivals:
        return []
    models = [*known, *(one.fitted for one in rivals)]
    each = float(np.log(PRIOR_EFFECTS / len(without.model.layout.effects)))
    beyond = np.array([len(one.choices) - len(without.choices) - 1 for one in models])
    log = log_odds_among(without, models) + each * beyond
    return [float(odds) for odds in log[len(known) :] - log[: len(known)].max()]
