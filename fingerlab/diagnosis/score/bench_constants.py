"""What is settled of a bench by models of it: a late torque, and constants that every run has of its own.

Both are looked for under the bare model, whatever effects are given, before an effect is; constants once more
by what the best model misses, where the runs' motions do not come again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.equations.parameters import TORQUE_LAG
from fingerlab.diagnosis.fit.run_spreads import find_constants
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import RunConstants
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import (
    CONSTANTS_ROUNDS,
    DECIDING_LOG_ODDS,
    LAG_AT_EDGE,
    LAG_SHARE,
    ONE_WAY,
    ONE_WAY_POINTS,
    STANDING_LOAD,
)
from fingerlab.effects import CATALOGUE
from fingerlab.sessions.model import Run


def settle_constants(reduction: Reduction, scorer: Scorer) -> Scorer:
    """The scorer, with a late torque and constants that every run has of its own, if any were found.

    They are looked for once, under the bare model, whatever effects are given.
    """
    if scorer.reduced.on_bench and not (reduction.settled or reduction.late_torque):
        told = scorer.with_late_told()
        reduction.late_torque = torque_is_late(reduction, told)
        scorer = told if reduction.late_torque else scorer
    if reduction.late_torque:
        scorer = scorer.with_late_torque()
    if reduction.constants is None and not reduction.settled:
        free = Scorer(replace(scorer.reduced, fixed={})) if scorer.reduced.fixed else scorer
        bare, rig = free.bare, reduction.sessions[0].rig
        reduction.settle(
            find_constants(scorer.reduced, bare.model, bare.fit.values, bare.weights, rig, reduction.motions)
        )
    return scorer if reduction.constants is None else scorer.with_constants(reduction.constants)


def torque_is_late(reduction: Reduction, scorer: Scorer) -> bool:
    """Whether the torque of a motor alone is logged so far from its position that it has to be known.

    Only where that explains nearly all that the bare model misses, and more than viscous friction would: the
    lag of a machine that rubs is not told from its friction. A torque that comes early looks like nothing
    that rubs.
    """
    late, bare = scorer.with_late_torque(), scorer.score_held_out(scorer.bare)
    lagging = late.score_held_out(late.fit_reweighted([], bare))
    place = lagging.model.index[TORQUE_LAG]
    lag, most = float(lagging.fit.values[place]), float(lagging.model.high[place])
    if not lagging.misfit < (1.0 - LAG_SHARE) * bare.misfit:
        return False
    if lag < 0.0:
        return True
    if lag >= LAG_AT_EDGE * most:
        return False
    # Also where it is not asked for, or left out of the catalogue.
    rubs = next(e for e in CATALOGUE.values() if e.like_late_torque)
    beside = Scorer(replace(reduction.refined([rubs]), late_is_no_noise=True))
    rubbing = beside.score_held_out(beside.fit_reweighted([Choice(rubs)], bare))
    return rubbing.misfit - lagging.misfit > 2.0 * DECIDING_LOG_ODDS


def zero_is_confounded(runs: Sequence[Run]) -> bool:
    """Whether a zero of the torque in each run of a motor alone would pass for what rubs or for a known load.

    Of runs that go one way each, some this way and some that, friction is a constant; of runs under a load
    that stands, another in each, so is what the load's gain lacks.
    """
    ways, loads = [], []
    for run in runs:
        every = slice(None, None, max(run.length // ONE_WAY_POINTS, 1))
        position = run.channel("motor_position")[every]
        moves = np.diff(position[np.isfinite(position)])
        travel = float(np.abs(moves).sum())
        ways.append(float(moves.sum()) / travel if travel > 0 else 0.0)
        if run.has("load_torque"):
            loads.append(run.channel("load_torque")[every])
    one_way = min(map(abs, ways)) > ONE_WAY and min(ways) < 0 < max(ways)
    between = float(np.ptp([np.nanmean(one) for one in loads])) if loads else 0.0
    within = max((float(np.nanstd(one)) for one in loads), default=0.0)
    return one_way or (len(loads) == len(runs) and between > 0 and within < STANDING_LOAD * between)


def likeliest_constants(
    reduction: Reduction, scorer: Scorer, last: FittedModel
) -> tuple[RunConstants | None, FittedModel]:
    """Constants of the runs by what a model misses on their averages, and the model beside them, held out.

    A model that was fitted without them has bent to them, and misses less than they are. Beside them it is
    fitted anew, and they are looked for again (expectation and maximisation in turn), until they stand.
    None: there are none that would matter.
    """
    found, rig, fitted = None, reduction.sessions[0].rig, last
    for _ in range(CONSTANTS_ROUNDS):
        of_model = fitted.model, fitted.fit.values, fitted.weights
        again = find_constants(scorer.reduced, *of_model, rig, reduction.motions, alone=True)
        if again is None or (found is not None and np.array_equal(found.spreads, again.spreads)):
            break
        found, beside = again, scorer.with_constants(again)
        fitted = beside.score_held_out(beside.fit_reweighted(last.choices, fitted))
    return found, fitted
