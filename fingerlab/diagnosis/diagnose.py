"""The public entry: sessions in, diagnosis out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.diagnosis.answer.bench_findings import bench_findings
from fingerlab.diagnosis.answer.budget import error_budget
from fingerlab.diagnosis.answer.candidates import (
    JudgedEffects,
    ToldModels,
    candidates,
    cannot_be_ruled_out,
    every_parameter,
    temperature_for,
    titles_in,
)
from fingerlab.diagnosis.answer.error_parts import EquationError
from fingerlab.diagnosis.answer.errors import (
    equation_errors,
    equation_floors,
    excluded_times,
    held_out_runs,
    run_shares,
    with_floors,
)
from fingerlab.diagnosis.answer.results import (
    Diagnosis,
    FirstLook,
    OtherModel,
    PairedDifference,
    PathStep,
    SmallerModel,
)
from fingerlab.diagnosis.answer.row_and_score import row_and_score
from fingerlab.diagnosis.answer.shape_spread import variance_over_shapes
from fingerlab.diagnosis.equations.model import Choice, build
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import residual_offsets
from fingerlab.diagnosis.score.bench_constants import (
    is_borne_out,
    lag_beside,
    likeliest_constants,
    settle_constants,
    zero_is_confounded,
)
from fingerlab.diagnosis.score.calibration import (
    Verdict,
    calibrated,
    session_features,
)
from fingerlab.diagnosis.score.evidence import (
    Evidence,
    alike,
    shares_of_rivals,
)
from fingerlab.diagnosis.score.fitted_model import (
    FittedModel,
    at_found_shapes,
    nearest,
    paired_score,
    reaching,
    with_other_laws,
    with_shapes_of,
)
from fingerlab.diagnosis.score.floors import noise_below_floor
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.search.disagreeing_run import searched_without_run
from fingerlab.diagnosis.search.exchange import ExchangedModel, odds_of_rivals
from fingerlab.diagnosis.search.first_step import Question, Stages
from fingerlab.diagnosis.search.grid_refinement import fit_refined
from fingerlab.diagnosis.search.moved_zeros import with_zeros_for_last_effect, with_zeros_taken_off
from fingerlab.diagnosis.search.next_effect import at_edges, fitted_to_the_end
from fingerlab.diagnosis.search.reading_errors import with_readings_corrected
from fingerlab.diagnosis.search.strategy import Found, begin_search, search_effects
from fingerlab.diagnosis.settings import (
    CANDIDATES_REFITTED,
    FAR_LEFT,
    FULL_ITERATIONS,
    HALF_LEFT,
    LEAST_SHARE,
    MODELS_BESIDE_ERRORS,
    MOST_CORRECTIONS,
    NEARLY_RIGHT,
    REPLACING_SHARE,
    RUN_LOG_ODDS,
    SET_LOG_ODDS,
)
from fingerlab.effects import effect, whole_catalogue
from fingerlab.effects.base import Effect
from fingerlab.sessions.model import Array, Session

if TYPE_CHECKING:
    from fingerlab.diagnosis.answer.curves import Curves, Display
    from fingerlab.diagnosis.experiment.proposal import NextRun


@dataclass(frozen=True)
class DiagnosisOptions:
    """What is asked of a diagnosis beside which effect is missing, and what it may use.

    Attributes:
        left_out: ids that the catalogue is to be without; so it is tried what it says of the unknown.
        held: unknowns of the model as given, by key, and the value that every model is to hold them at, SI.
        kept: what an earlier diagnosis of these sessions was given; their runs are not read again.
        executor: a second process (``core.progress``) to share the reading, if no curves are wanted.
        first: is told the error of the model with the ``added`` effects before others are looked for; once
            more when their shapes are found between the points of their grids.
        before: an earlier diagnosis of these sessions, in whose floors ``first`` is told; None: the model's.
    """

    left_out: Sequence[str] = ()
    held: Mapping[str, float] | None = None
    kept: Reduction | None = None
    executor: Executor | None = None
    first: Callable[[FirstLook], None] | None = None
    before: Diagnosis | None = None


def diagnose(
    sessions: Sequence[Session],
    added: Sequence[str] = (),
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    with_curves: bool = True,
    options: DiagnosisOptions | None = None,
) -> Diagnosis:
    """Where the model fails and which effect is missing.

    Args:
        sessions: at least one. added: ids of effects that the model holds already.
        progress: called with the share done (0 to 1) and what is being done.
        cancelled: asked now and then; True stops the calculation.
        with_curves: whether measured and modelled curves and fingerprints are wanted.
        options: what else is asked; None: nothing.

    Raises:
        UserError: an unknown effect or unknown to hold, nothing to analyse, a run that cannot be read.
        Cancelled: ``cancelled`` answered True.
    """
    started = time.perf_counter()
    if not sessions:
        raise UserError("No session was given; name at least one session file.")
    asked, known = options or DiagnosisOptions(), whole_catalogue()
    given = [known.get(name) or effect(name) for name in dict.fromkeys(added)]
    catalogue = [e for e in known.values() if e.id not in asked.left_out]
    stages = Stages(progress, cancelled)
    # Small matrices: several threads of linear algebra only get in each other's way.
    with threadpool_limits(limits=1, user_api="blas"):
        reduction = asked.kept or Reduction(sessions, asked.executor)
        reduction.restart(asked.held)
        catalogue = reduction.suited(catalogue)
        given = [reaching(one, asked.held or {}, reduction.scales) for one in reduction.suited(given)]
        question, found, display = _searched(reduction, catalogue, given, stages, asked, with_curves)
        found = searched_below_floor(question, found)
        return _answer(question, found, display, started)


_Searched = tuple[Question, Found, "Display | None"]


def _searched(
    reduction: Reduction,
    catalogue: Sequence[Effect],
    given: Sequence[Effect],
    stages: Stages,
    asked: DiagnosisOptions,
    with_curves: bool,
    corrections: int = 0,
    before: FittedModel | None = None,
) -> _Searched:
    """The recordings read, what is missing of the model with these effects, and what there is to be shown.

    Where much is left that an error of a channel explains, all of it with its reading corrected.

    Args:
        corrections: so many of them were made already.
        before: the best model without what was taken off the recordings last; None: nothing was.
    """
    again = partial(_searched, reduction, catalogue, given, stages, asked, with_curves, corrections + 1)
    alone, display = None, _display() if with_curves else None
    reduction.begin(catalogue, stages.part(0.0, 0.2), read=bool(given))
    if given:
        settle_constants(reduction, Scorer(reduction.of([])))
        # There and in the catalogue at the shapes that fit best.
        look = None if asked.first is None else partial(_look, asked.first, asked.before)
        alone = fit_refined(reduction, given, stages.part(0.2, 0.25), look)
        given = with_other_laws(at_found_shapes(alone[1]), catalogue)
        catalogue = with_shapes_of(catalogue, given)
    watch = stages.part(0.25 if given else 0.0, 0.4)
    scorer = Scorer(reduction.of(catalogue, watch, display.keep if display is not None else None))
    scorer = settle_constants(reduction, scorer)
    check_held(reduction, scorer, given)
    question = Question(reduction, catalogue, given, stages, alone)
    begun = begin_search(question, scorer)
    may_correct = corrections < MOST_CORRECTIONS
    corrected = partial(with_readings_corrected, reduction, again=again, outcome=_outcome)
    if may_correct and (other := corrected(begun.models, ended=False)):
        return other
    found = search_effects(question, begun)
    if before is not None and _hardly_helps(before, found.path[-1]):
        return question, found, display  # nor will a further error of the bench beside it
    if lacks_fit(found.path[-1], NEARLY_RIGHT):
        searched = question, found, display
        other = searched_with_constants(searched, scorer, again)
        if given and other is not searched:
            return other
        question, found, display = other
    by, last = found.refined or found.scorer, found.path[-1]
    if other := searched_without_run(reduction, by, last, again, _outcome):
        return other
    if (other := searched_with_lag(reduction, found, again)) is not None:
        return other
    near = [*found.models, *found.evidence.candidates]
    if other := with_zeros_taken_off(reduction, near, again, _outcome):
        return other
    if other := with_zeros_for_last_effect(reduction, found.path, again, _outcome):
        return other
    # Once many effects that were found together leave little beside it, a second error is no simpler reading.
    settled = found.many and corrections > 0 and not lacks_fit(found.path[-1], NEARLY_RIGHT)
    if may_correct and not settled and (other := corrected(found.models)):
        return other
    return question, found, display


def _hardly_helps(before: FittedModel, end: FittedModel) -> bool:
    """Whether an error taken off the recordings explains next to nothing of what the best model missed."""
    fewer = len(end.choices) < len(before.choices)
    return not fewer and lacks_fit(end, NEARLY_RIGHT) and end.misfit > (1.0 - LEAST_SHARE) * before.misfit


def _outcome(searched: _Searched) -> tuple[FittedModel, bool]:
    """The best model, and whether nothing more is missing beside it."""
    found = searched[1]
    return found.path[-1], found.evidence.verdict == Verdict.NOTHING_MISSING


def _look(
    first: Callable[[FirstLook], None], before: Diagnosis | None, scorer: Scorer, fitted: FittedModel
) -> None:
    """Tell what a model leaves of the runs that its fit has not seen, in the floors of the last answer."""
    known = before if before is not None and before.fitted is not None else None
    if known is not None and known.fitted is not None:
        fitted = scorer.fit(fitted.choices, fitted, FULL_ITERATIONS, known.fitted.weights)
        scorer = scorer.with_floor_weights()
    found = scorer.score_held_out(fitted, residuals=True)
    errors = equation_errors(scorer.reduced, found)
    if known is not None:
        errors = with_floors(errors, {name: error.floor for name, error in known.errors.items()})
    first(FirstLook(tuple(found.effect_ids), found.score, errors))


def check_held(reduction: Reduction, scorer: Scorer, given: Sequence[Effect]) -> None:
    """Refuse to hold what the model as given lacks, or where no fit goes.

    Raises:
        UserError: so it is; the sentence names what could be held, or between which values.
    """
    reduced = scorer.reduced
    free = build(reduced.layout, reduced.groups, [Choice(one) for one in given])
    known = {u.key: u.parameter for u in free.unknowns}
    for key, value in reduction.fixed.items():
        if key not in known:
            raise UserError(f"This model has no parameter '{key}' to hold; it has {', '.join(known)}.")
        size = reduced.layout.scales.of(known[key].unit)
        low, high = known[key].low * size, known[key].high * size
        if not low <= value <= high:
            unit = known[key].unit
            raise UserError(f"{key} is {value:g} {unit}; hold it between {low:g} and {high:g} {unit}.")


def searched_with_constants(
    searched: _Searched, scorer: Scorer, again: Callable[[FittedModel], _Searched]
) -> _Searched:
    """The search with constants of the runs by what the best models miss on their averages.

    What moves and what is missing may each hide the other: alone neither explains anything.
    Only of runs whose motion does not come again, which would have told them, or where some were told and
    others may be hidden by those; and only if that leaves far less, or half and nothing more to be found.
    Given effects were looked at without the constants and bent to them, so they are fitted anew.
    """
    question, found, display = searched
    reduction, last = question.reduction, found.path[-1]
    if scorer.reduced.on_bench and zero_is_confounded(reduction.analysed):
        return searched
    others = [one for name, one in found.looked_at.items() if name not in last.effect_ids]
    near = nearest(found.evidence.candidates)[:CANDIDATES_REFITTED]
    models = [(found.refined or scorer, last), *others, *((found.scorer, one) for one in near)]
    each = (likeliest_constants(reduction, by, model) for by, model in models)
    constants, beside = min(each, key=lambda one: math.inf if one[0] is None else one[1].misfit)
    if constants is None or not beside.misfit < HALF_LEFT * last.misfit:
        return searched
    before, reduction.constants = reduction.known_of_bench, constants
    if question.given:
        other = again(last)
    else:
        begun = begin_search(question, scorer.with_constants(constants))
        other = question, search_effects(question, begun), display
    if is_borne_out(last, *_outcome(other)):
        return other
    reduction.go_back(before)
    return searched


def searched_with_lag(
    reduction: Reduction, found: Found, again: Callable[[FittedModel], _Searched]
) -> _Searched | None:
    """The search with a lag of the torque of a motor alone, by what the nearest models leave; None: no help.

    Where the bare model left far more than a lag, it was not looked for, or not believed. Now it has to leave
    half of what the path does, or less, from the models to the end.
    """
    last = found.path[-1]
    if not reduction.on_bench or reduction.late_torque or not lacks_fit(last, NEARLY_RIGHT):
        return None
    near = nearest([*found.models, *found.evidence.candidates])
    beside = lag_beside(reduction, near[:MODELS_BESIDE_ERRORS])
    if beside is None or not beside.misfit < HALF_LEFT * last.misfit:
        return None
    before, reduction.late_torque = reduction.known_of_bench, True
    other = again(last)
    if is_borne_out(last, *_outcome(other)):
        return other
    reduction.go_back(before)
    return None


def searched_below_floor(question: Question, found: Found) -> Found:
    """The search where what passed for noise is mostly none; see ``noise_below_floor``.

    What the given effects explain counts as well as what was found beside them.
    """
    reduction, scorer = question.reduction, found.scorer
    last = found.refined or scorer, found.path[-1]
    first = found.path[0]
    if question.given:
        bare = scorer.fit([], scorer.bare, FULL_ITERATIONS, found.path[-1].weights)
        first = scorer.score_held_out(bare)
    reduction.torque_noise = noise_below_floor(reduction, (scorer, first), last)
    if not reduction.torque_noise.told_by:
        return found
    again = Scorer(reduction.of(question.catalogue))
    return search_effects(question, begin_search(question, settle_constants(reduction, again)))


def _ruled_out(found: Found) -> tuple[str, ...]:
    """Effects that leave far more than a law that is nearly right, where the one found leaves little.

    Not those that were looked at as closely: on its grid a law may leave more than between its points.
    """
    if len(found.path) != 2 or found.better is not None or lacks_fit(found.path[-1], NEARLY_RIGHT):
        return ()
    far = (c.last_effect.id for c in found.evidence.candidates if lacks_fit(c, FAR_LEFT))
    return tuple(name for name in far if name not in found.looked_at)


def _answer(question: Question, found: Found, display: Display | None, started: float) -> Diagnosis:
    """The answer, as it is given to others."""
    scorer, evidence, path = found.scorer, found.evidence, found.path
    verdict = evidence.verdict
    reduction, by_last = question.reduction, found.refined or scorer
    first_by, told_by, told_path = _told_path(question, found)
    floor_by, floor_of = _whose_floors((first_by, told_path[0]), (told_by, told_path[-1]))
    floors = equation_floors(floor_by.reduced, floor_of)
    sessions, errors = reduction.sessions, with_floors(_errors(first_by, told_path[0]), floors)
    runs = [run for session in sessions for run in session.runs]
    usual = session_features(runs, errors.values(), evidence.base.score, path[-1].score)
    odds = replace(evidence.odds, ruled_out=_ruled_out(found))
    probabilities, calibration = calibrated(odds, verdict, *usual)
    probability = dict(zip(odds.answers, map(float, probabilities), strict=True))
    looked_at = [one for _, one in found.looked_at.values()]
    stuck = at_edges(scorer, evidence, [*looked_at, *path[1:2]] if len(path) == 2 else ())
    chosen = cannot_be_ruled_out(evidence, calibration, probability)
    chosen += [i for i in stuck if i not in chosen]

    def offsets(fitted: FittedModel) -> dict[tuple[str, str], Array]:
        return residual_offsets(scorer.run_offsets(fitted), reduction.runs)

    curves = None if display is None else _curves(display, scorer, evidence, offsets, floor_by, floor_of)
    replacing = _replacing(evidence, found.rivals)
    closer = {name: one.scorer.with_sensitivity(one.steps[0]) for name, one in replacing.items()}
    if found.refined is not None and found.better is None:
        closer.setdefault(path[1].last_effect.id, found.refined.with_sensitivity(path[1]))
    for name, (by, one) in found.looked_at.items():
        closer.setdefault(name, by.with_sensitivity(one))
    loose = any(f.slack_samples for g in scorer.reduced.groups for f in g.folds)
    replaced = {name: (one.removed,) for name, one in replacing.items()}
    prints = curves.fingerprints if curves else {}
    reported = {**fitted_to_the_end(scorer, evidence), **closer}
    judged = JudgedEffects(evidence, probability, chosen, stuck)
    open_ones = {evidence.candidates[i].last_effect.id for i in chosen}
    variances = _variances(found, {name: one for name, one in closer.items() if name in open_ones})
    of_last = variances.get(path[-1].last_effect.id) if len(path) == 2 else None  # the same model
    if of_last is None:
        of_last = {} if found.refined is None else variance_over_shapes(found.refined, path[-1])
    told = ToldModels(closer, reported, replaced, variances)
    pairs = [(session, run) for (session, _), run in zip(reduction.runs, reduction.analysed, strict=True)]
    each_share, parts = run_shares(pairs, scorer.reduced, evidence.base)
    excluded, excluded_by_motion = excluded_times(reduction, scorer.reduced, evidence.base)
    following = _next_run(sessions, scorer, evidence, chosen, usual)
    # A base to which nothing was added is told as it stands beside what was tried, under the same weights.
    steps = _path_steps([evidence.base, *path[1:]], found.better)
    return Diagnosis(
        sessions=tuple(str(s.path) for s in sessions),
        model=tuple(e.id for e in question.given),
        errors=errors,
        score=evidence.base.score,
        verdict=verdict,
        candidates=candidates(judged, told, prints, loose, _none_left_out(scorer)),
        set=tuple(evidence.candidates[i].last_effect.id for i in chosen),
        path=steps,
        final_model=tuple(path[-1].effect_ids),
        next_experiment=None if following is None else following.proposal,
        seconds=time.perf_counter() - started,
        probability_nothing=probability[Verdict.NOTHING_MISSING],
        probability_unknown=probability[Verdict.NOT_IN_CATALOGUE],
        parameters=every_parameter(evidence.base, temperature_for(evidence, evidence.base)),
        final_parameters=every_parameter(path[-1], temperature_for(evidence, path[-1]), of_last),
        comparisons=curves.comparisons if curves else (),
        failure=curves.failure if curves else None,
        held_out=held_out_runs(reduction.analysed, scorer.reduced, evidence.base),
        score_parts=parts,
        excluded_by_motion=excluded_by_motion,
        run_shares=each_share,
        excluded_times=excluded,
        held_out_by_parts=any(group.in_parts for group in scorer.reduced.groups),
        repeats=scorer.reduced.floor_from != "state law",
        partly_repeats=any(group.repeats and not group.bounded for group in scorer.reduced.groups),
        floor_from=scorer.reduced.floor_from,
        calibration=calibration,
        odds=odds,
        predicted=None if following is None else following.predicted,
        paired=_paired(question.reduction, scorer, evidence, chosen),
        held=dict(reduction.fixed),
        constants=reduction.constants,
        torque_noise=reduction.torque_noise,
        reading_errors=reduction.reading_errors,
        run_zeros=reduction.run_zeros,
        disagreeing=reduction.disagreeing,
        fitted=evidence.base,
        last=path[-1],
        bench=bench_findings(reduction, path[-1], by_last.run_offsets(path[-1])),
        better=None if found.better is None else _other_model(question.given, found.better),
        as_good=tuple(_other_model(question.given, one) for one in _as_good(found)),
        smaller=_smaller(question.given, found),
        budget=error_budget(told_path[0], errors, steps, told_path, told_by),
        row_and_score=row_and_score(scorer, evidence.base, errors),
        titles={**titles_in(path[-1]), **titles_in(evidence.base)},
    )


def _told_path(question: Question, found: Found) -> tuple[Scorer, Scorer, Sequence[FittedModel]]:
    """What scored the first and the last model of which errors by equations are told; and all of them.

    A given model beside which nothing is missing is told as it was fitted on the reduction of its own
    effects, like every refined path: so it has the same errors and floors whether it was found or given. The
    more signals a reduction holds, the less of their noise it takes off a torque.
    """
    scorer = found.scorer
    if question.alone is None or len(found.path) > 1:
        return scorer, found.refined or scorer, [found.evidence.base, *found.path[1:]]
    alone, fitted = question.alone
    return alone, alone, [alone.score_held_out(fitted, residuals=True)]


def _variances(found: Found, told: Mapping[str, FittedModel]) -> dict[str, dict[str, float]]:
    """Variances of the unknowns of models with one effect more, by its id, over the shapes of their effects.

    Of those that were looked at between the points of their grids.
    """
    scorers = {name: by for name, (by, _) in found.looked_at.items()}
    if found.refined is not None and len(found.path) > 1:
        scorers[found.path[1].last_effect.id] = found.refined
    return {name: variance_over_shapes(scorers[name], one) for name, one in told.items() if name in scorers}


def _whose_floors(
    first: tuple[Scorer, FittedModel], last: tuple[Scorer, FittedModel]
) -> tuple[Scorer, FittedModel]:
    """The model by which floors are told, and what scored it: the last one, as the scores are.

    Of a motor alone the given one, under the weights of the last: how well its torque repeats no effect has a
    say in, and by what friction of another size in each run would look like the score takes off its own.
    """
    return first if first[0].reduced.on_bench else last


def _errors(scorer: Scorer, fitted: FittedModel) -> dict[str, EquationError]:
    """Of each family of equations on runs left out, beside what it is where the fit has seen them."""
    seen = equation_errors(scorer.reduced, scorer.residuals_in_sample(fitted))
    left_out = equation_errors(scorer.reduced, fitted)
    return {family: replace(error, seen=seen[family].rmse) for family, error in left_out.items()}


def _none_left_out(scorer: Scorer) -> bool:
    """Whether there is one run, and nothing of it could be left out of the fit."""
    groups = scorer.reduced.groups
    return len(groups) == 1 and len(groups[0].folds) == 1


def _paired(
    reduction: Reduction, scorer: Scorer, evidence: Evidence, chosen: Sequence[int]
) -> tuple[PairedDifference, ...]:
    """What was made of every pair of runs before a known change of the machine and with it."""
    found = []
    for k, pair in enumerate(scorer.reduced.pairs):
        (first, before), (second, after) = reduction.runs[pair.before], reduction.runs[pair.after]
        change = reduction.changes[pair.after]
        each = {c.last_effect.id: paired_score(c, k) for c in (evidence.candidates[i] for i in chosen)}
        found.append(
            PairedDifference(
                before, after, (first, second), change.to_json(), change.words(),
                paired_score(evidence.base, k), each,
            )
        )  # fmt: skip
    return tuple(found)


def _path_steps(path: Sequence[FittedModel], better: ExchangedModel | None) -> tuple[PathStep, ...]:
    """The error path; a better model begins with an exchange."""
    removed = {1: better.removed} if better is not None else {}
    first, *others = path
    return (
        PathStep(None, first.score),
        *(
            PathStep(s.last_effect.id, s.score, removed.get(k), titles_in(s)[s.last_effect.id])
            for k, s in enumerate(others, 1)
        ),
    )


def _as_good(found: Found) -> list[ExchangedModel]:
    """The rivals that these data cannot tell from the best model."""
    best = max((0.0, *(one.log_odds for one in found.rivals)))
    near = [one for one in found.rivals if one.log_odds >= best - SET_LOG_ODDS]
    return [one for one in near if one is not found.better]


def _other_model(given: Sequence[Effect], rival: ExchangedModel) -> OtherModel:
    """A rival as it is told: the first exchanged effect where the removed one stood."""
    first, *rest = rival.added
    effects = [first if e.id == rival.removed else e.id for e in given]
    return OtherModel((rival.removed,), rival.added, (*effects, *rest), rival.fitted.score, rival.log_odds)


def _smaller(given: Sequence[Effect], found: Found) -> SmallerModel | None:
    """The model with one effect fewer that explains as much, where nothing is missing.

    Beside what is missing an effect may look needless for that alone.
    """
    one, settled = found.smaller, found.evidence.verdict == Verdict.NOTHING_MISSING and found.better is None
    if one is None or not settled:
        return None
    return SmallerModel(one.removed, tuple(e.id for e in given if e.id != one.removed), one.fitted.score)


def _replacing(evidence: Evidence, rivals: Sequence[ExchangedModel]) -> dict[str, ExchangedModel]:
    """Rivals whose effect is rather in place of a given one than missing beside it, by its id."""
    shares = shares_of_rivals(odds_of_rivals(rivals))
    whole = {c.last_effect.id: p for c, p in zip(evidence.candidates, evidence.posterior, strict=True)}
    best = {one.added[0]: one for one in reversed(rivals)}
    return {name: one for name, one in best.items() if shares[name] > REPLACING_SHARE * whole.get(name, 0.0)}


def _curves(
    display: Display,
    scorer: Scorer,
    evidence: Evidence,
    offsets: Callable[[FittedModel], dict[tuple[str, str], Array]],
    by_last: Scorer,
    last: FittedModel,
) -> Curves:
    """What is to be drawn, with the floors of the last model."""
    from fingerlab.diagnosis.answer.curves import FloorModel

    return display.curves(scorer.reduced, evidence, offsets, FloorModel(by_last.reduced, last))


def _display() -> Display:
    # Imported when it is wanted: who asks for numbers alone should not wait for it.
    from fingerlab.diagnosis.answer.curves import Display

    return Display()


def _next_run(
    sessions: Sequence[Session],
    scorer: Scorer,
    evidence: Evidence,
    chosen: Sequence[int],
    usual: tuple[dict[str, float], str],
) -> NextRun | None:
    """The run that would separate the effects of the set, or show those that could not be seen; or None."""
    verdict = evidence.verdict
    if verdict == Verdict.MISSING_EFFECT:
        chosen = alike(evidence, -RUN_LOG_ODDS)
    if verdict == Verdict.NOT_IN_CATALOGUE or len(chosen) < (2 if verdict == Verdict.MISSING_EFFECT else 1):
        return None
    from fingerlab.diagnosis.experiment.proposal import propose, reveal

    return (propose if verdict == Verdict.MISSING_EFFECT else reveal)(
        sessions, scorer, evidence, chosen, usual
    )
