"""Zeros of the angles that moved from run to run, where a law of the joints is no straight line.

A zero adds a constant to the equations as far as springs and cable are straight lines of the angles; so it is
integrated out of every fit. Through a stop, a hardening spring or an arm that varies it is none: there the
zeros are found beside the law, taken off the angles, and found once more, until they stand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import SOURCES
from fingerlab.diagnosis.score.bench_constants import is_borne_out
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.search.grid_refinement import refine_grid
from fingerlab.diagnosis.settings import (
    HALF_LEFT,
    MODELS_BESIDE_ZEROS,
    NEARLY_RIGHT,
    SETTLED_ZERO,
    STILL_FALLING,
    ZERO_PASSES,
    ZERO_ROUNDS,
)
from fingerlab.diagnosis.signals.reading_errors import MCP, NO_ERROR, PIP, ReadingError, RunZeros

_Work = TypeVar("_Work")

ANGLES = (SOURCES.index(MCP), SOURCES.index(PIP))
"""Places of the joints' angles among the sources of constants."""


def with_zeros_taken_off(
    reduction: Reduction,
    models: Sequence[FittedModel],
    again: Callable[[], _Work],
    outcome: Callable[[_Work], tuple[FittedModel, bool]],
) -> _Work | None:
    """The work done again with the zeros of single runs taken off the angles; None: that bears nothing out.

    Where the angles' zeros move, the best model lacks fit, and one of the nearest leaves far less beside
    zeros that were taken off.

    Args:
        models: that it came to and others as near, the best first.
        outcome: its best model, held out, and whether nothing more is missing beside it.
    """
    constants, best, before = reduction.constants, models[0], reduction.known_of_bench
    moves = constants is not None and bool(constants.spreads[list(ANGLES)].any())
    if reduction.run_zeros or not moves or not lacks_fit(best, NEARLY_RIGHT):
        return None
    each = []
    for model in _nearest(models):
        reduction.go_back(before)
        each.append(_settled(reduction, model))
    fitted, zeros = min(each, key=lambda one: one[0].misfit)
    reduction.go_back(before)
    if fitted.misfit < HALF_LEFT * best.misfit:
        reduction.correct_runs(zeros)
        found = again()
        # Beside the law that was found now they may be others.
        _, zeros = _settled(reduction, outcome(found)[0])
        if zeros != reduction.run_zeros:
            reduction.correct_runs(zeros)
            found = again()
        if is_borne_out(best, *outcome(found)):
            return found
        reduction.go_back(before)
    return None


def _nearest(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Of the models those that leave least, one of the same effects each."""
    each = {tuple(one.effect_ids): one for one in sorted(models, key=lambda one: -one.misfit)}
    return sorted(each.values(), key=lambda one: one.misfit)[:MODELS_BESIDE_ZEROS]


def _settled(reduction: Reduction, model: FittedModel) -> tuple[FittedModel, RunZeros]:
    """The model beside zeros of single runs that stand, held out, and these zeros."""
    best, fitted = (model, reduction.run_zeros), model
    for _ in range(ZERO_PASSES):
        if fitted.choices:
            scorer, fitted = refine_grid(reduction, fitted)
        else:
            scorer = Scorer(reduction.refined([]))
            fitted = scorer.fit_reweighted([], fitted)
        effects = at_found_shapes(fitted)
        for _ in range(ZERO_ROUNDS):
            zeros, change, size = _moved(reduction, scorer, fitted)
            if change <= SETTLED_ZERO * size:
                break
            reduction.correct_runs(zeros)
            scorer = Scorer(reduction.refined(effects))
            fitted = scorer.fit_reweighted([Choice(e) for e in effects], fitted)
        found, before = scorer.score_held_out(fitted), best[0].misfit
        best = min(best, (found, reduction.run_zeros), key=lambda one: one[0].misfit)
        if best[0].misfit > STILL_FALLING * before or not lacks_fit(found, NEARLY_RIGHT):
            break
    return best


def _moved(reduction: Reduction, scorer: Scorer, fitted: FittedModel) -> tuple[RunZeros, float, float]:
    """The zeros of the runs with what more a model tells of them; rms of that and of all, rad."""
    zeros = {run: dict(errors) for run, errors in reduction.run_zeros.items()}
    more = []
    for offsets in scorer.run_offsets(fitted):
        for number, sources in zip(offsets.numbers, offsets.sources, strict=True):
            mine = zeros.setdefault(reduction.runs[number], {})
            for place in ANGLES:
                known = mine.get(SOURCES[place], NO_ERROR).zero
                mine[SOURCES[place]] = ReadingError(known + float(sources[place]))
                more.append(float(sources[place]))
    every = [error.zero for errors in zeros.values() for error in errors.values()]
    return zeros, _rms(more), _rms(every)


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else 0.0
