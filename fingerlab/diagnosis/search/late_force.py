"""A load cell whose reading comes late: the filter of its amplifier, as of many at 10 Hz.

In contact the force that is read lags behind the cable's torque and the joints, by more the faster it
changes; in free motion nothing is late. No effect of a finger does that, and none can be judged beside it. So
where the best model leaves much, the lag is looked for beside it, taken off the channel, and everything is
searched anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.search.grid_refinement import refine_grid
from fingerlab.diagnosis.settings import (
    HALF_LEFT,
    LEAST_FORCE_LAG_S,
    MOST_FORCE_LAG_S,
    NEARLY_RIGHT,
    STILL_LEFT,
)
from fingerlab.effects.base import Effect, Row, Shape, Term
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter

_Work = TypeVar("_Work")


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """What the force has changed by since it was read, in both joints: its first and second derivative."""
    force, step = (
        np.zeros_like(motion.time) if motion.force is None else motion.force,
        1.0 / motion.sample_rate_hz,
    )
    rate = np.gradient(force, step)
    each = {"lag": rate, "lag_square": np.gradient(rate, step)}
    levers = zip((Row.MCP, Row.PIP), motion.contact_levers, strict=True)
    return [Term(row, name, lever * f, "joint") for row, lever in levers for name, f in each.items()]


LATE_FORCE = Effect(
    id="late_force",
    title="Late load cell",
    family="Sensors",
    acts_on=("endpoint_force",),
    gains={
        "lag": Parameter("s", -MOST_FORCE_LAG_S, MOST_FORCE_LAG_S, 0.25 * MOST_FORCE_LAG_S),
        # Half its square of a pure delay, nothing of a filter of first order.
        "lag_square": Parameter(
            "s^2", -(MOST_FORCE_LAG_S**2), MOST_FORCE_LAG_S**2, 0.1 * MOST_FORCE_LAG_S**2
        ),
    },
    columns=columns,
    coordinate="force",
    equation=Row.PIP,
    explanation="In contact both joints miss a torque in proportion to the change of the force.",
    reveal="",
    phases=("contact",),
)
"""Of the bench, and so in no catalogue: the force is its reading, plus its lag times its rate."""


def find_force_lag(reduction: Reduction, models: Sequence[FittedModel]) -> tuple[float, float] | None:
    """By how much the load cell's reading is late, s, and the second coefficient, s^2, in reduced units.

    None: with it none of the models leaves far less than the first one does without, or that leaves little.

    Args:
        models: the best first.
    """
    pressed = any(run.phase == "contact" for run in reduction.analysed)
    if not pressed or not lacks_fit(models[0], NEARLY_RIGHT):
        return None
    tried: list[FittedModel] = []
    for model in models:
        effects = at_found_shapes(model)
        scorer = Scorer(reduction.refined([*effects, LATE_FORCE]))
        choices = [Choice(e) for e in (*effects, LATE_FORCE)]
        tried.append(scorer.score_held_out(scorer.fit_reweighted(choices, model)))
    best = min(tried, key=lambda one: one.misfit)
    if not best.misfit < HALF_LEFT * models[0].misfit:
        return None
    if len(best.choices) > 1:  # friction that was found without the lag turns round over another travel
        best = refine_grid(reduction, best)[1]
    lag, square = (best.values[f"{LATE_FORCE.id}.{name}"] for name in LATE_FORCE.gains)
    return (lag, square) if abs(lag) * reduction.scales.of("s") >= LEAST_FORCE_LAG_S else None


def with_force_corrected(
    reduction: Reduction,
    models: Sequence[FittedModel],
    again: Callable[[], _Work],
    outcome: Callable[[_Work], tuple[FittedModel, str]],
) -> _Work | None:
    """The work done again with a lag taken off the load cell's reading; None: none is borne out.

    Args:
        models: that it came to, the best first. outcome: its best model, held out, and its verdict.
    """
    lag = None if any(reduction.force_lag) else find_force_lag(reduction, models)
    if lag is None:
        return None
    reduction.correct_force(lag)
    found = again()
    if is_borne_out(models[0], *outcome(found)):
        return found
    reduction.correct_force((0.0, 0.0))
    return None


def is_borne_out(before: FittedModel, end: FittedModel, verdict: str) -> bool:
    """Whether a bench's own errors, once taken off, leave far less of the best model's misfit.

    Half, where nothing more is found to be missing beside them, or the path ends near the floor.
    """
    near = verdict == Verdict.NOTHING_MISSING or not lacks_fit(end, NEARLY_RIGHT)
    return end.misfit < (HALF_LEFT if near else STILL_LEFT) * before.misfit
