"""Channels that read late, as behind a filter, at another scale, or something where there is nothing.

A load cell behind its amplifier's filter lags behind the cable's torque and the joints, in contact alone;
angle sensors lag behind the motor's channels and the load cell; a current's lag, or its scale, is that of
every torque. No effect of a finger does what these do, and none can be judged beside them. So where the best
model leaves much, or such an error alone explains nearly all that the bare one does, it is taken off the
channel, and everything is searched anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.bench_constants import is_borne_out
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes, nearest
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.search.grid_refinement import refine_grid
from fingerlab.diagnosis.search.suspects import (
    ANGLE_READINGS,
    FORCE_ALONE,
    LATE_FORCE,
    LATE_MOTION,
    READING,
    TORQUE_SCALE,
    Suspect,
)
from fingerlab.diagnosis.settings import (
    CORRECTION_ROUNDS,
    HALF_LEFT,
    JOINT_SEARCH_LEVEL,
    LAG_SHARE,
    LEAST_FALL,
    LEAST_FALL_BEYOND,
    LEAST_IN_CONTACT,
    LEAST_READING_LAG_S,
    LEAST_SHARE,
    MODELS_BESIDE_ERRORS,
    NEARLY_RIGHT,
    SETTLED_LAG,
)
from fingerlab.diagnosis.signals.reading_errors import FORCE, NO_ERROR

_Work = TypeVar("_Work")


@dataclass(frozen=True)
class _Tried:
    """A model, and the same beside the error of a suspect, held out."""

    without: FittedModel
    suspect: Suspect
    fitted: FittedModel


def find_reading_error(
    reduction: Reduction, models: Sequence[FittedModel], ended: bool
) -> tuple[Suspect, FittedModel] | None:
    """What is wrong with a channel's reading beyond what was known, and the model that holds it.

    None: with it none of the models leaves far less than the first one does without, or that leaves little;
    nor does it explain nearly all that the last one leaves, and more than the first one does. Where no effect
    is borne out, an error that explains a share may stand in the way of all of them. Zero and scale of a
    joint's angle count from less on, for a law may pass for them where little is left. A simpler error that
    leaves about as much is taken for it.

    Args:
        models: the best first, the one as given last.
        ended: the search has ended; else it has taken its first step.
    """
    best, given = models[0], models[-1]
    lacking = lacks_fit(best, NEARLY_RIGHT)
    # Late angles and force, by one number, are the simpler error: what is missing beside them comes first.
    late = any(choice.effect.special == "delay" for choice in best.choices)
    suspects = list(LATE_MOTION) if lacking and (ended or not late) else []
    longer = len(best.choices) > len(given.choices) + 1
    suspects += [TORQUE_SCALE] if ended and (lacking or longer) else []
    suspects += ANGLE_READINGS if ended and lacks_fit(best, 2.0 * LEAST_FALL) else []
    could_be = [one for one in (best, given) if lacks_fit(one, NEARLY_RIGHT)]
    if any(one.misfit_in_contact > LEAST_IN_CONTACT * one.misfit for one in could_be):
        suspects.append(FORCE_ALONE if reduction.zero_in_the_air is None else LATE_FORCE)
    if not suspects:
        return None
    tried = [one for model in _nearest(models, lacking) for one in _beside(reduction, model, suspects)]
    if late and lacking and ended:
        tried += _beside(reduction, best, LATE_MOTION, instead_of_delay=True)

    def explains_all(one: _Tried) -> bool:
        left = min((1.0 - LAG_SHARE) * given.misfit, best.misfit)
        left -= LEAST_FALL_BEYOND * best.count if late else 0.0
        return one.without is given and one.fitted.misfit < left

    def leaves_far_less(one: _Tried) -> bool:
        # On a bench that lacks a dozen things anything looks late beside one of them: all come first.
        told_soon = ended or (one.suspect.channel == FORCE and not lacks_fit(one.fitted, JOINT_SEARCH_LEVEL))
        share = HALF_LEFT if told_soon else 1.0 - LAG_SHARE
        return lacking and one.fitted.misfit < share * best.misfit

    def stands_for_others(one: _Tried) -> bool:
        fewer = len(one.without.choices) < len(best.choices)
        left = best.misfit + LEAST_FALL_BEYOND * best.count
        about_as_much = one.fitted.misfit < left and not lacks_fit(one.fitted, NEARLY_RIGHT)
        return one.suspect is TORQUE_SCALE and fewer and about_as_much

    def stands_for_a_law(one: _Tried) -> bool:
        much = min(HALF_LEFT * best.misfit, LEAST_FALL_BEYOND * best.count)
        fall = best.misfit - one.fitted.misfit
        return one.suspect.of_an_angle and fall > max(LEAST_FALL * best.count, much)

    def stands_in_the_way(one: _Tried) -> bool:
        none_found = ended and len(best.choices) == len(given.choices)
        return lacking and none_found and one.fitted.misfit < (1.0 - LEAST_SHARE) * best.misfit

    for holds in (explains_all, leaves_far_less, stands_for_others, stands_for_a_law, stands_in_the_way):
        found = list(filter(holds, tried))
        if found:
            most = min(one.fitted.misfit + LEAST_FALL_BEYOND * one.fitted.count for one in found)
            plainest = min(
                found,
                key=lambda one: (one.fitted.misfit > most, len(one.without.choices), one.fitted.misfit),
            )
            return _simplest(reduction, plainest)
    return None


def _nearest(models: Sequence[FittedModel], lacking: bool) -> list[FittedModel]:
    """The models that an error may complete, one of the same effects each, and the one as given, last.

    ``lacking``: the first one lacks fit; else an error only stands in the place of effects of it.
    """
    *others, given = models
    size = len(models[0].choices)
    near = [one for one in nearest(others) if one is not given and (lacking or len(one.choices) < size)]
    near = near[:MODELS_BESIDE_ERRORS]
    return [*near, given] if lacking or len(given.choices) < size else near


def _simplest(reduction: Reduction, tried: _Tried) -> tuple[Suspect, FittedModel]:
    """The suspect, or one of less that leaves about as much; friction turns round over another travel now."""
    suspect, found = tried.suspect, tried.fitted
    if len(found.choices) > 1:
        scorer, found = refine_grid(reduction, found)
        found = scorer.score_held_out(found)
    if not suspect.simpler:
        return suspect, found
    fewer = _beside(reduction, found, [replace(suspect, names=n, simpler=()) for n in suspect.simpler])
    simplest = min(fewer, key=lambda one: one.fitted.misfit)
    most = LEAST_FALL if suspect.of_an_angle else LEAST_FALL_BEYOND
    if simplest.fitted.misfit - found.misfit >= most * found.count:
        return suspect, found
    return simplest.suspect, simplest.fitted


def _beside(
    reduction: Reduction, model: FittedModel, suspects: Sequence[Suspect], instead_of_delay: bool = False
) -> list[_Tried]:
    """The model with each of the errors alone; beside one that is known it may be less as well.

    ``instead_of_delay``: where the model has late angles and force.
    """
    errors = [one.effect(either_way=one.channel in reduction.reading_errors) for one in suspects]
    effects = [e for e in at_found_shapes(model) if not e.id.startswith(READING)]
    effects = [e for e in effects if not (instead_of_delay and e.special == "delay")]
    scorer = Scorer(reduction.refined([*effects, *errors]))
    fits = (scorer.fit_reweighted([Choice(e) for e in (*effects, error)], model) for error in errors)
    each = zip(suspects, map(scorer.score_held_out, fits), strict=True)
    return [_Tried(model, suspect, fitted) for suspect, fitted in each]


def _followed(reduction: Reduction, suspect: Suspect, found: FittedModel) -> bool:
    """Take an error off the readings; a lag of the motion to its last, beside what was corrected of it.

    Angles that move change levers, friction and all else that is made of them. False: hardly any is left.
    """
    before = reduction.reading_errors
    error = before.get(suspect.channel, NO_ERROR).then(suspect.found_in(found))
    for _ in range(CORRECTION_ROUNDS if suspect in LATE_MOTION else 0):
        reduction.correct_readings({**before, suspect.channel: error})
        (again,) = _beside(reduction, found, [suspect])
        found = again.fitted
        more = suspect.found_in(found)
        error = error.then(more)
        if abs(more.lag) < SETTLED_LAG * abs(error.lag):
            break
    if abs(error.lag) * reduction.scales.of("s") < LEAST_READING_LAG_S:
        error = error._replace(lag=0.0, lag_square=0.0)
    reduction.correct_readings({**before, suspect.channel: error})
    return reduction.reading_errors != before


def with_readings_corrected(
    reduction: Reduction,
    models: Sequence[FittedModel],
    again: Callable[[FittedModel], _Work],
    outcome: Callable[[_Work], tuple[FittedModel, bool]],
    ended: bool = True,
) -> _Work | None:
    """The work done again with an error taken off a channel's reading; None: none is borne out.

    It is where far less is left, or no more with an effect less and nothing else missing, or with two less;
    of a joint's angle also where as much less is left as a further effect would have to leave. Of channels of
    the motion, which other laws may look like, only where little is left.

    Args:
        models: that it came to, the best first, the one as given last.
        outcome: its best model, held out, and whether nothing more is missing beside it.
        ended: whether the work has ended; else it has taken its first step.
    """
    before, best = reduction.known_of_bench, models[0]
    suspected = None if reduction.on_bench else find_reading_error(reduction, models, ended)
    if suspected is None:
        return None
    suspect, fitted = suspected
    if _followed(reduction, suspect, fitted):
        found = again(best)
        end, complete = outcome(found)
        fewer = len(best.choices) - len(end.choices) >= (1 if complete else 2)
        explained = suspect.channel == FORCE or not lacks_fit(end, suspect.most_left)
        explained = explained and (ended or not lacks_fit(end, NEARLY_RIGHT))
        if explained and (
            (fewer and end.misfit <= best.misfit)
            or is_borne_out(best, end, complete)
            or (suspect.of_an_angle and _explains_beside(best, end))
        ):
            return found
    reduction.go_back(before)
    return None


def _explains_beside(best: FittedModel, end: FittedModel) -> bool:
    """Whether a path of no more effects leaves as much less as a further effect would have to."""
    fall = best.misfit - end.misfit
    return len(end.choices) <= len(best.choices) and fall > LEAST_FALL_BEYOND * best.count
