"""A run that no model explains while the others agree without it.

A hand on the finger, a wrist that was turned, a tip that slipped off: one run in ten then makes a search look
for physics that the others do not know. It is left aside if that settles the rest.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.settings import DISAGREEING_SHARE, GROSSLY_OFF, LEAST_ALIKE, NEARLY_RIGHT

_Searched = TypeVar("_Searched")


def searched_without_run(
    reduction: Reduction,
    scorer: Scorer,
    last: FittedModel,
    again: Callable[[FittedModel], _Searched],
    outcome: Callable[[_Searched], tuple[FittedModel, bool]],
) -> _Searched | None:
    """The search without a run that holds most of what the best model misses; None: that settles nothing.

    It has to: the path without it ends near the floor, and needs no more effects than it did before, or one.
    A run is left aside only of a kind that has three.

    Args:
        scorer: of ``last``, the model at the end of the path. again: searches anew. outcome: of a search, the
            model at the end of its path and whether nothing more is missing.

    Raises:
        UserError, Cancelled: as of a diagnosis.
    """
    if not lacks_fit(last, GROSSLY_OFF):
        return None
    number = _disagreeing(scorer, last)
    if number is None:
        return None
    before, aside = reduction.known_of_bench, reduction.disagreeing
    reduction.leave_aside(aside | {reduction.runs[number]})
    # What was found wrong with the readings was found with that run among the others.
    reduction.correct_readings({})
    reduction.correct_runs({})
    other = again(last)
    end, _ = outcome(other)
    if not lacks_fit(end, NEARLY_RIGHT) and len(end.effect_ids) <= max(len(last.effect_ids), 1):
        return other
    reduction.go_back(before)
    return None


def _disagreeing(scorer: Scorer, last: FittedModel) -> int | None:
    """Number of the run that holds most of what a model misses of all that were left out; None: none does."""
    scored = scorer.score_held_out(last, residuals=True)
    found: dict[int, float] = {}
    kinds: dict[int, int] = {}
    for group in scorer.reduced.groups:
        for fold, misfit in zip(group.folds, scored.folds[group.key].misfits, strict=True):
            for one in fold.totals:
                share = float(one.counts[0]) / max(fold.samples, 1)
                found[one.number] = found.get(one.number, 0.0) + share * max(float(misfit), 0.0)
                kinds[one.number] = len(group.run_totals)
    total = sum(found.values())
    if not total > 0.0:
        return None
    worst = max(found, key=lambda number: found[number])
    few = kinds[worst] < LEAST_ALIKE
    return None if few or found[worst] < DISAGREEING_SHARE * total else worst
