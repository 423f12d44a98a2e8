"""Which effects are missing: one more than the model as given, then all, then between their grids' points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fingerlab.core.progress import SILENT
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.diagnosis.score.evidence import (
    Evidence,
    at_least_as_unknown,
    averaged_over_weights,
    exchanged,
    given_the_others,
    judge,
    judged_with_path,
    no_less_likely,
    with_best_unconfirmed,
    with_first_step,
    with_lack_of_fit,
    with_rivals,
    with_undetected,
)
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.floors import scored_in_floors, weights_at_floor
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import justified, lacks_fit
from fingerlab.diagnosis.search.contained_laws import holds, with_plainer_end, without_contained_laws
from fingerlab.diagnosis.search.exchange import (
    ExchangedModel,
    Given,
    extended,
    find_rivals,
    odds_of_rivals,
    without_needless,
)
from fingerlab.diagnosis.search.first_step import FirstStep, Question, RefinedPath, first_step, refined_path
from fingerlab.diagnosis.search.grid_refinement import (
    can_refine,
    extend_path,
    fit_effects,
    refine_path,
)
from fingerlab.diagnosis.search.joint_search import path_beside_slack, path_of_many
from fingerlab.diagnosis.search.next_effect import judge_all, rescore
from fingerlab.diagnosis.search.path import (
    does_better,
    forward_selection,
    with_own_weights,
    worth_a_further_effect,
)
from fingerlab.diagnosis.search.ties import Refined, break_ties, rescore_refined
from fingerlab.diagnosis.settings import (
    FULL_ITERATIONS,
    JOINT_SEARCH_LEVEL,
    LONGEST_PATH,
    NEARLY_RIGHT,
    RIVAL_LOG_ODDS,
)
from fingerlab.effects.base import Effect


@dataclass(frozen=True)
class Found:
    """What the search found.

    Attributes:
        scorer: on the whole catalogue.
        evidence: for one effect more than the model as given.
        path: models from the one as given to all that is missing.
            Where a rival is clearly better, it leads there: its first step is an exchange.
        refined: what scored the path where its shapes were refined; None: they were not.
        rivals: models with a given effect exchanged that the data prefer, or hardly tell from it; best first.
        many: whether the path is one of many effects, found together.
        looked_at: further effects that could be the one, between the points of their grids.
        smaller: the model as given with one effect fewer, which explains as much; None: there is no such one.
    """

    scorer: Scorer
    evidence: Evidence
    path: Sequence[FittedModel]
    refined: Scorer | None
    rivals: Sequence[ExchangedModel] = ()
    many: bool = False
    looked_at: Refined = field(default_factory=dict)
    smaller: ExchangedModel | None = None

    @property
    def models(self) -> list[FittedModel]:
        """See :func:`_models`."""
        return _models(self.path, self.looked_at)

    @property
    def better(self) -> ExchangedModel | None:
        """The rival that the path leads to, if one is clearly better."""
        return self.rivals[0] if self.rivals and self.rivals[0].better else None


@dataclass(frozen=True)
class Begun:
    """A search after its first step.

    ``evidence`` is that on the grids, ``resolved`` that of what was looked at between their points.
    """

    scorer: Scorer
    evidence: Evidence
    resolved: Evidence
    first: FirstStep

    @property
    def models(self) -> list[FittedModel]:
        """See :func:`_models`."""
        first = self.first
        return _models([*first.path[:-1], first.end], first.looked_at)


def _models(path: Sequence[FittedModel], looked_at: Refined) -> list[FittedModel]:
    """The model that a path leads to, those that were as near, those on the way; the given one last."""
    return [path[-1], *(one for _, one in looked_at.values()), *reversed(path[:-1])]


def begin_search(question: Question, scorer: Scorer) -> Begun:
    """One effect more, if any.

    Args:
        scorer: on the whole catalogue.

    Raises:
        Cancelled: the user asked for it.
    """
    base = fit_effects(scorer, question.given)
    if question.given:  # whether it lacks fit decides whether the shapes of what is given are looked at again
        base = scorer.score_held_out(base)
    evidence = judge_all(scorer, base, scorer.reduced.layout.effects, question.stages.part(0.4, 0.7))
    resolved, first = first_step(question, scorer, evidence)
    return Begun(scorer, evidence, resolved, first)


def search_effects(question: Question, begun: Begun) -> Found:
    """All that is missing, from the first step on; judged in the end under the weights of what came last.

    Raises:
        Cancelled: the user asked for it.
    """
    scorer, evidence, resolved, first = begun.scorer, begun.evidence, begun.resolved, begun.first
    effects = scorer.reduced.layout.effects
    resolved, path, looked_at = _path(question, scorer, resolved, first)
    many = _many(question, scorer, evidence, path, first)
    refined: Scorer | None
    if many is not None:
        refined, path = many
        weights = path[-1].weights
    else:
        evidence, weights = _judged_given_path(scorer, resolved, path, effects)
        refined, path = _refined(question, path, first.refined, looked_at)
        evidence, by, path = _restarted(question, evidence, resolved, first, refined or scorer, path)
        if by is not scorer:
            refined, weights = by, path[-1].weights
        if len(path) == 1 and evidence.verdict == Verdict.MISSING_EFFECT:
            evidence = with_best_unconfirmed(evidence)
    if refined is not None:
        watch = question.stages.part(0.97, 0.98)
        refined, path = without_contained_laws(question.reduction, refined, path, watch)
        evidence = _with_law_of_path(evidence, path[-1])
        laws = path[-1].effect_ids
        refined, path = with_plainer_end(question.reduction, question.catalogue, refined, path, watch)
        for law, plainer in zip(laws, path[-1].effect_ids, strict=True):
            evidence = evidence if law == plainer else exchanged(evidence, law, plainer)
        weights = path[-1].weights
    looked_at = looked_at if len(path) == 2 else {}
    if refined is not None or len(path) > 2 or scorer.reduced.pairs or looked_at:
        # Every score of an answer is told in the floors of the same, last model.
        evidence = rescore(scorer, evidence, weights)
        path = [evidence.base, *path[1:]]
        if len(path) == 2:
            looked_at = rescore_refined(looked_at, weights)
            evidence, refined, path = _of_likeliest(evidence, refined, path, looked_at)
    if many is not None:
        evidence = with_first_step(evidence, path)
    evidence = judged_with_path(evidence, path[-1])
    rivals: list[ExchangedModel] = []
    smaller = None
    if question.alone is not None:
        path = [evidence.base, *path[1:]]
        given = Given(scorer, path[0], *question.alone)
        rivals = _rivals(question, given, path, refined or scorer, evidence.candidates)
        smaller = without_needless(given)
        evidence = with_rivals(evidence, odds_of_rivals(rivals))
        if rivals and rivals[0].better:
            path, refined = [evidence.base, *rivals[0].steps], rivals[0].scorer
    found = Found(scorer, evidence, path, refined, rivals, many is not None, looked_at, smaller)
    if not all(group.repeats for group in scorer.reduced.groups):
        found = _in_floors(question, found)
    return _in_floors_of_given(question, _with_what_could_hide(found))


def _in_floors_of_given(question: Question, found: Found) -> Found:
    """What was found; where nothing is missing beside a given model, told in the floors of that, if likelier.

    The effect that leads beside it set them, which is not there: given, a friction of the joints that was
    found at 1.26 floors left 1.64. Not where nothing repeats: a model's own floors are what it leaves there.
    """
    evidence, scorer = found.evidence, found.scorer
    if question.alone is None or len(found.path) > 1 or evidence.verdict != Verdict.NOTHING_MISSING:
        return found
    if not all(group.repeats for group in scorer.reduced.groups):
        return found
    if (smaller := found.smaller) is not None:
        alone = with_own_weights(smaller.scorer, smaller.fitted)
        found = replace(found, smaller=replace(smaller, steps=(alone,)))
    own = with_own_weights(scorer, evidence.base)
    if own is evidence.base:
        return found
    told = rescore(scorer, evidence, own.weights)
    # What could not be seen was judged as it was compared.
    each = zip(told.candidates, evidence.candidates, strict=True)
    candidates = tuple(replace(new, sensitivity=old.sensitivity) for new, old in each)
    return replace(found, evidence=replace(told, candidates=candidates), path=[told.base])


def _with_law_of_path(evidence: Evidence, end: FittedModel) -> Evidence:
    """The evidence; where beside others a law stands that contains the likeliest one effect, with that.

    By itself the plain law may be likelier: what the larger one has more, the others tell.
    """
    best = evidence.best.last_effect if evidence.candidates else None
    if best is None or best.id in end.effect_ids:
        return evidence
    larger = (c.effect.id for c in end.choices if holds(c.effect, best))
    return next((exchanged(evidence, best.id, name) for name in larger), evidence)


def _of_likeliest(
    evidence: Evidence, refined: Scorer | None, path: list[FittedModel], looked_at: Refined
) -> tuple[Evidence, Scorer | None, list[FittedModel]]:
    """Odds by all that was looked at between the points of the grids; and the path of the likeliest of it.

    A plainer law stands first unless the one that holds it is twice as likely.

    Args:
        evidence, path, looked_at: all scored under the same weights. refined: what scored the path, if that
            was refined.
    """
    first = path[1].last_effect.id
    evidence = averaged_over_weights(evidence, [*(one for _, one in looked_at.values()), path[1]])
    name = evidence.best.last_effect.id
    near = evidence.log_odds > -RIVAL_LOG_ODDS
    for one in (c.last_effect for c, close in zip(evidence.candidates, near, strict=True) if close):
        if holds(evidence.best.last_effect, one) and one.id in (first, *looked_at):
            name = one.id
    if name != first and name in looked_at:
        refined, likeliest = looked_at[name]
        path = [path[0], likeliest]
    return no_less_likely(evidence, path[1].last_effect.id), refined, path


def _with_what_could_hide(found: Found) -> Found:
    """What was found, with a share for every effect that these data could not have shown."""
    scorer, evidence = found.scorer, with_lack_of_fit(found.evidence, found.path[-1])
    candidates = (_with_no_turn(scorer, evidence.base, one) for one in evidence.candidates)
    evidence = replace(
        evidence,
        base=scorer.with_sensitivity(evidence.base),
        candidates=tuple(map(scorer.with_sensitivity, candidates)),
    )
    told = with_undetected(evidence)
    if told.verdict == evidence.verdict:
        return replace(found, evidence=told)
    # How far constants of the rig are off is told by fits that have ended, of every effect.
    ended = (one if one.held_out else _ended(scorer, one) for one in evidence.candidates)
    told = with_undetected(replace(evidence, candidates=tuple(ended)))
    if told.verdict == evidence.verdict:
        return replace(found, evidence=told)
    missing = scorer.with_sensitivity(scorer.score_held_out(told.best))
    return replace(found, evidence=told, path=[evidence.base, missing], refined=None, looked_at={})


def _ended(scorer: Scorer, fitted: FittedModel) -> FittedModel:
    """A model of which only a few steps were taken, fitted to the end."""
    again = scorer.fit(fitted.choices, fitted, FULL_ITERATIONS)
    return scorer.with_sensitivity(scorer.score_held_out(again))


def _in_floors(question: Question, found: Found) -> Found:
    """What was found where nothing repeats, with every score in the floors of the last model.

    Where that leaves much more than a law of the state, which knows no physics, the evidence is judged again:
    in the search all that a model left passed for noise.
    """
    weights = weights_at_floor(question.reduction, found.path[-1])
    scorer = found.scorer.with_floor_weights()
    evidence = rescore(scorer, found.evidence, weights)
    by, steps = scored_in_floors(found.refined or found.scorer, found.path[1:], weights)
    rivals = [_other_in_floors(rival, weights) for rival in found.rivals]
    smaller = None if found.smaller is None else _other_in_floors(found.smaller, weights)
    path, refined = [evidence.base, *steps], None if found.refined is None else by
    if lacks_fit(path[-1]):
        evidence = at_least_as_unknown(
            evidence, judged_with_path(judge(evidence.base, evidence.candidates), path[-1])
        )
    looked_at = {
        name: (its, one)
        for name, (old, model) in found.looked_at.items()
        for its, (one,) in [scored_in_floors(old, [model], weights)]
    }
    return Found(scorer, evidence, path, refined, rivals, found.many, looked_at, smaller)


def _other_in_floors(other: ExchangedModel, weights: Weights) -> ExchangedModel:
    """Another model with its scores in the floors of these weights."""
    scorer, steps = scored_in_floors(other.scorer, other.steps, weights)
    return replace(other, scorer=scorer, steps=tuple(steps))


def _rivals(
    question: Question,
    given: Given,
    path: Sequence[FittedModel],
    path_scorer: Scorer,
    beside: Sequence[FittedModel],
) -> list[ExchangedModel]:
    """The rivals of the model as given and its path; a better one with what is missing beside it."""
    watch = question.stages.part(0.97, 0.99)
    rivals = find_rivals(question.reduction, given, path, path_scorer, beside, watch)
    if not (rivals and rivals[0].better and worth_a_further_effect(rivals[0].fitted)):
        return rivals
    first = extended(question.reduction, question.catalogue, rivals[0], path[0].weights, watch)
    return [first, *rivals[1:]]


def _many(
    question: Question,
    scorer: Scorer,
    evidence: Evidence,
    path: Sequence[FittedModel],
    first: FirstStep,
) -> tuple[Scorer, list[FittedModel]] | None:
    """The path of many effects where no usual one leaves a bench near its model; None: there is none."""
    far = (
        evidence.least_left >= JOINT_SEARCH_LEVEL
        and lacks_fit(first.end, JOINT_SEARCH_LEVEL)
        and lacks_fit(path[-1], JOINT_SEARCH_LEVEL)
    )
    if scorer.reduced.on_bench or not far:
        return None
    watch = question.stages.part(0.9, 0.95)
    ways = (
        search(question.reduction, question.catalogue, scorer, evidence.base, watch)
        for search in (path_of_many, path_beside_slack)
    )
    return next((way for way in ways if way is not None), None)


def _path(
    question: Question, scorer: Scorer, evidence: Evidence, first: FirstStep
) -> tuple[Evidence, list[FittedModel], Refined]:
    """The path from the evidence for one effect to all; and the evidence, where ties of it were broken.

    They are where the path ends at once: among rivals it may have taken the wrong one.

    Returns:
        The evidence, the path, and what was looked at between the points of the grids.
    """
    path = first.path
    if first.refined is None or worth_a_further_effect(first.end):
        effects, watch = scorer.reduced.layout.effects, question.stages.part(0.75, 0.88)
        path = forward_selection(scorer, evidence, effects, len(question.given), watch)
    if len(path) != 2 or not (first.between or evidence.verdict == Verdict.MISSING_EFFECT):
        return evidence, path, first.looked_at
    watch, beyond = question.stages.part(0.88, 0.9), first.beyond_grid
    known = first.refined_of(evidence)
    resolved, found = break_ties(
        question.reduction, scorer, evidence, path[-1].weights, watch, also=beyond, known=known
    )
    found = {**first.looked_at, **found}
    if resolved.best is evidence.best:
        return resolved, path, found
    return resolved, [resolved.base, resolved.best], found


def _judged_given_path(
    scorer: Scorer, evidence: Evidence, path: Sequence[FittedModel], effects: Sequence[Effect]
) -> tuple[Evidence, Weights]:
    """The evidence; where its best effect stood for two others, by what effects do beside the later ones.

    With the weights of the models that were compared last.
    """
    last = path[-1]
    if len(path) < 3 or evidence.best.last_effect.id in last.effect_ids:
        return evidence, last.weights
    keep = len(path[0].choices)
    others = [*last.choices[:keep], *last.choices[keep + 1 :]]
    base = scorer.score_held_out(scorer.fit(others, last, FULL_ITERATIONS))
    beside = judge_all(scorer, base, effects, SILENT)
    return given_the_others(evidence, beside), beside.base.weights


def _refined(
    question: Question, path: list[FittedModel], first: RefinedPath | None, looked_at: Refined
) -> tuple[Scorer | None, list[FittedModel]]:
    """The path between the points of the grids, and beyond its end; no scorer where that changes nothing.

    Args:
        first: a path that is refined already, maybe the same. looked_at: effects that are.
    """
    if len(path) == 1 or not can_refine(path[-1].choices):
        return None, path
    reduction, stages = question.reduction, question.stages
    if first is None or not first.is_of(path[-1]):
        first = refined_path(reduction, path, looked_at, stages.part(0.9, 0.93))
    scorer, path = first.scorer, first.path
    while lacks_fit(path[-1]) and len(path) <= LONGEST_PATH:
        longer = extend_path(reduction, question.catalogue, path, stages.part(0.93, 0.97))
        if longer is None or len(longer[1]) <= len(path):  # found, but not borne out when refined
            break
        scorer, path = longer
    return scorer, path


def _restarted(
    question: Question,
    beside: Evidence,
    alone: Evidence,
    first: FirstStep,
    scorer: Scorer,
    path: list[FittedModel],
) -> tuple[Evidence, Scorer, list[FittedModel]]:
    """The path, or a likelier one that begins with one effect at its refined shape, maybe with that alone.

    Args:
        beside: the evidence as the path has it. alone: the same before it went on from the ``first`` step.
    """
    best = (beside, scorer, path)
    watch = question.stages.part(0.97, 0.99)
    for evidence in (beside,) if alone.best is beside.best else (beside, alone):
        if not worth_restarting(path, evidence.best, first):
            continue
        start = [path[0], evidence.best]
        if first.refined is not None and first.refined.is_of(evidence.best):
            by, begun = first.refined.scorer, first.refined.path
        else:
            by, begun = refine_path(question.reduction, start, watch)
        longer = extend_path(question.reduction, question.catalogue, begun, watch)
        ways = [(evidence, by, begun), *([] if longer is None else [(evidence, *longer)])]
        for way in ways:
            best = way if does_better(way[1:], best[1:]) else best
    return best


def worth_restarting(path: Sequence[FittedModel], best: FittedModel, first: FirstStep) -> bool:
    """Whether a path may lead further if it begins with the ``best`` effect refined.

    Beside an effect that stands beside its best shape, a later one may have mended the shape, or others stand
    where its refined shape alone does most.
    """
    end, name = path[-1], best.last_effect.id
    known = {*end.effect_ids, *(() if first.refined is None else first.refined.of.effect_ids)}
    other = len(path) > 2 or name not in end.effect_ids
    return other and name in known and lacks_fit(end, NEARLY_RIGHT)


def _with_no_turn(scorer: Scorer, base: FittedModel, fitted: FittedModel) -> FittedModel:
    """The model; where its effect is not seen, at a point of its grid with no effect: what hides is small."""
    *others, last = fitted.choices
    if last.effect.turns is None or justified(base, fitted):
        return fitted
    points = range(len(last.effect.shapes))
    still = [i for i in points if all(g.low <= 0.0 <= g.high for g in last.effect.gains_at(i).values())]
    fits = [scorer.fit([*others, replace(last, shape=i)], base) for i in still]
    return scorer.score_in_sample(min(fits, key=lambda one: one.fit.cost))
