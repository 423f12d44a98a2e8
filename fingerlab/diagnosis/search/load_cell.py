"""A load cell that reads late, as behind its amplifier's filter, or something with nothing on it.

In contact the force that is read lags behind the cable's torque and the joints, by more the faster it
changes; in free motion nothing is late. No effect of a finger does that, and none can be judged beside it. So
where the best model leaves much, or such an error alone explains nearly all that the bare one does, it is
taken off the channel, and everything is searched anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

import numpy as np

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.bench_constants import is_borne_out
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.search.grid_refinement import refine_grid
from fingerlab.diagnosis.settings import (
    HALF_LEFT,
    LAG_SHARE,
    LEAST_FALL_BEYOND,
    LEAST_FORCE_LAG_S,
    MOST_FORCE_LAG_S,
    MOST_FORCE_ZERO_N,
    NEARLY_RIGHT,
)
from fingerlab.diagnosis.signals.load_cell import LoadCellError
from fingerlab.effects.base import Effect, Row, Shape, Term
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter

_Work = TypeVar("_Work")


def _columns(names: Sequence[str], motion: Motion, shape: Shape) -> list[Term]:
    """What the reading lacks of the force, in both joints: a constant, its rate and that one's rate."""
    force = np.zeros_like(motion.time) if motion.force is None else motion.force
    step = 1.0 / motion.sample_rate_hz
    rate = np.gradient(force, step)
    read = np.zeros_like(force) if motion.force is None else -np.ones_like(force)
    each = dict(zip(LoadCellError._fields, (read, rate, np.gradient(rate, step)), strict=True))
    levers = zip((Row.MCP, Row.PIP), motion.contact_levers, strict=True)
    return [Term(row, name, lever * each[name], "joint") for row, lever in levers for name in names]


def _up_to(most: float, unit: str) -> Parameter:
    return Parameter(unit, -most, most, 0.25 * most)


UNKNOWNS = {
    "zero": _up_to(MOST_FORCE_ZERO_N, "N"),
    "lag": _up_to(MOST_FORCE_LAG_S, "s"),
    # Half its square of a pure delay, nothing of a filter of first order.
    "lag_square": _up_to(MOST_FORCE_LAG_S**2, "s^2"),
}


def _error_of(*names: str) -> Effect:
    """The load cell's errors of these names, as an effect; of the bench, and so in no catalogue."""
    return Effect(
        id="force_error",
        title="Errors of the load cell",
        family="Sensors",
        acts_on=("endpoint_force",),
        gains={name: UNKNOWNS[name] for name in names},
        columns=partial(_columns, names),
        coordinate="force",
        equation=Row.PIP,
        explanation="In contact both joints miss torques that go with the force's change, or constant ones.",
        reveal="",
        phases=("contact",),
    )


LATE_ALONE, EVERY = _error_of("lag", "lag_square"), _error_of(*UNKNOWNS)
SIMPLER = (_error_of("zero"), LATE_ALONE)


def find_force_error(reduction: Reduction, models: Sequence[FittedModel]) -> LoadCellError | None:
    """What is wrong with the load cell's reading beyond what was known, in reduced units.

    None: with it none of the models leaves far less than the first one does without, or that leaves little;
    nor does it explain nearly all that the last one leaves, and more than the first one does. A simpler error
    that leaves about as much is taken for it.

    Args:
        models: the best first, the one as given last.
    """
    best, given = models[0], models[-1]
    # In free motion it explains nothing.
    lacking = lacks_fit(best, NEARLY_RIGHT) and best.misfit_in_contact > HALF_LEFT * best.misfit
    could_be_all = lacks_fit(given, NEARLY_RIGHT) and given.misfit_in_contact > HALF_LEFT * given.misfit
    if not (lacking or could_be_all):
        return None
    every, simpler = (EVERY, SIMPLER) if reduction.zero_in_the_air is None else (LATE_ALONE, ())
    tried = [_beside(reduction, model, every) for model in (models if lacking else [given])]
    alone, found = tried[-1], min(tried, key=lambda one: one.misfit)
    if alone.misfit < min((1.0 - LAG_SHARE) * given.misfit, best.misfit):
        found = alone
    elif not (lacking and found.misfit < HALF_LEFT * best.misfit):
        return None
    if len(found.choices) > 1:  # friction that was found without it turns round over another travel
        scorer, found = refine_grid(reduction, found)
        found = scorer.score_held_out(found)
    for one in simpler:
        other = _beside(reduction, found, one)
        if other.misfit - found.misfit < LEAST_FALL_BEYOND * found.count:
            found = other
            break
    zero, lag, square = (found.values.get(f"{every.id}.{name}", 0.0) for name in LoadCellError._fields)
    if abs(lag) * reduction.scales.of("s") < LEAST_FORCE_LAG_S:
        lag = square = 0.0
    known = reduction.force_error
    error = LoadCellError(known.zero + zero, lag, square)
    return None if error == known else error


def _beside(reduction: Reduction, model: FittedModel, error: Effect) -> FittedModel:
    """The model with an error of the load cell, held out."""
    effects = [*(e for e in at_found_shapes(model) if e.id != error.id), error]
    scorer = Scorer(reduction.refined(effects))
    return scorer.score_held_out(scorer.fit_reweighted([Choice(e) for e in effects], model))


def with_force_corrected(
    reduction: Reduction,
    models: Sequence[FittedModel],
    again: Callable[[], _Work],
    outcome: Callable[[_Work], tuple[FittedModel, bool]],
) -> _Work | None:
    """The work done again with an error taken off the load cell's reading; None: none is borne out.

    It is where far less is left, or no more with fewer effects and nothing else missing.

    Args:
        models: that it came to, the best first, the one as given last.
        outcome: its best model, held out, and whether nothing more is missing beside it.
    """
    before, best = reduction.force_error, models[0]
    error = find_force_error(reduction, models)
    if error is None:
        return None
    reduction.correct_force(error)
    found = again()
    end, complete = outcome(found)
    fewer = complete and len(end.choices) < len(best.choices) and end.misfit <= best.misfit
    if fewer or is_borne_out(best, end, complete):
        return found
    reduction.correct_force(before)
    return None
