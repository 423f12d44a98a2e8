"""Why the one row of a motor alone may tell another multiple of its floor than the error over all does.

Both are of the same residual. The row takes it as it is, by how well the torque repeats from cycle to
cycle and what runs differ by. The score weighs it by the former alone, and takes off what a run may have of
its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt

import numpy as np

from fingerlab.diagnosis.answer.error_parts import EquationError, RowAndScore
from fingerlab.diagnosis.answer.errors import equation_floors
from fingerlab.diagnosis.fit.solver import Fitter
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.settings import LEAST_TORQUE_SPREAD
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Row


def row_and_score(
    scorer: Scorer, fitted: FittedModel, errors: Mapping[str, EquationError]
) -> RowAndScore | None:
    """The factors of a motor alone; None beside a finger, and where the floor is the least there can be.

    Args:
        fitted: scored on held-out runs. errors: as they are told of it, by family.
    """
    groups = scorer.reduced.groups
    weights = np.array([fitted.weights[group.key][Row.BENCH, Row.BENCH] for group in groups])
    if not scorer.reduced.on_bench or weights.max() > TOO_FINE / LEAST_TORQUE_SPREAD**2:
        return None
    whole = errors["motor_torque"].floor
    alone = equation_floors(scorer.reduced, fitted, cycles_alone=True)["motor_torque"]
    if min(whole, alone) <= 0.0:
        return None
    weighed = Fitter(fitted.model, scorer.data, fitted.weights)
    full = _in_floors(scorer, fitted, weighed)
    weighed.set_friction_weights(fitted.fit.values)
    less = _in_floors(scorer, fitted, weighed)
    return RowAndScore(
        runs=whole / alone * fitted.score / less,
        stuck=less / full,
    )


TOO_FINE = 0.5
"""Share of the greatest weight there is, above which a floor is that of no bench."""


def _in_floors(scorer: Scorer, fitted: FittedModel, fitter: Fitter) -> float:
    """Error over all samples where nothing is a run's own, in floors."""
    coefficients, misfit = fitter.coefficients(fitted.fit.values)[0], 0.0
    for i, (group, h) in enumerate(zip(scorer.reduced.groups, coefficients, strict=True)):
        misfit += float(h @ fitter.part(i, None).matrix @ h)
        if not group.repeats:  # its weights are those of all that a model leaves
            misfit -= EFFECTIVE_SHARE * group.samples
    return sqrt(1.0 + max(misfit, 0.0) / max(fitted.count, 1.0))
