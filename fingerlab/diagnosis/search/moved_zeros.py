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
from fingerlab.diagnosis.fit.bounded_step import aitken_factor
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import SOURCES
from fingerlab.diagnosis.score.bench_constants import is_borne_out
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_found_shapes, nearest
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.search.grid_refinement import refine_grid
from fingerlab.diagnosis.settings import (
    HALF_LEFT,
    LEAST_FALL,
    MODELS_BESIDE_ZEROS,
    NEARLY_RIGHT,
    SETTLED_ZERO,
    STILL_FALLING,
    ZERO_PASSES,
    ZERO_ROUNDS,
)
from fingerlab.diagnosis.signals.reading_errors import MCP, NO_ERROR, PIP, ReadingError, RunZeros
from fingerlab.sessions.model import Array

_Work = TypeVar("_Work")

ANGLES = [SOURCES.index(MCP), SOURCES.index(PIP)]
"""Places of the joints' angles among the sources of constants."""


def with_zeros_taken_off(
    reduction: Reduction,
    models: Sequence[FittedModel],
    again: Callable[[FittedModel], _Work],
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
    for model in nearest(models)[:MODELS_BESIDE_ZEROS]:
        reduction.go_back(before)
        each.append(_settled(reduction, model))
    fitted, zeros = min(each, key=lambda one: one[0].misfit)
    reduction.go_back(before)
    if fitted.misfit < HALF_LEFT * best.misfit:
        reduction.correct_runs(zeros)
        found = again(best)
        first = reduction.known_of_bench
        zeros = _of_fewest(reduction, outcome(found)[0])
        if _alike(zeros, first.run_zeros):
            reduction.go_back(first)
        else:
            found = again(best)
        if is_borne_out(best, *outcome(found)):
            return found
        reduction.go_back(before)
    return None


def with_zeros_for_last_effect(
    reduction: Reduction,
    path: Sequence[FittedModel],
    again: Callable[[FittedModel], _Work],
    outcome: Callable[[_Work], tuple[FittedModel, bool]],
) -> _Work | None:
    """The work done again with zeros taken off the angles where the path's last effect stands for them.

    Through a weight, which is no straight line of the angles, a zero leaves what an effect more can mend.
    None: there are no such zeros, or the effects need the last one.

    Args:
        path: of models, each held out. outcome: as for :func:`with_zeros_taken_off`.
    """
    if len(path) < 2 or lacks_fit(path[-1], NEARLY_RIGHT):
        return None
    before = reduction.known_of_bench
    found = with_zeros_taken_off(reduction, [path[-2]], again, outcome)
    if found is None:
        return None
    end, last = outcome(found)[0], path[-1]
    if end.misfit <= last.misfit + LEAST_FALL * last.count and len(end.choices) < len(last.choices):
        return found
    reduction.go_back(before)
    return None


def _of_fewest(reduction: Reduction, end: FittedModel) -> RunZeros:
    """Zeros beside the first effects of a path that leave little with zeros of their own; they are taken off.

    Beside another law they were others, and what that put into them an effect more may have to mend. Those
    that were known, where no effects leave little.
    """
    known = reduction.run_zeros
    effects = at_found_shapes(end)
    for count in range(1, len(effects) + 1):
        reduction.correct_runs({})
        chosen = effects[:count]
        scorer = Scorer(reduction.refined(chosen))
        alone = scorer.score_held_out(scorer.fit_reweighted([Choice(e) for e in chosen], end))
        fitted, zeros = _settled(reduction, alone)
        if not lacks_fit(fitted, NEARLY_RIGHT):
            known = zeros
            break
    reduction.correct_runs(known)
    return known


def _alike(one: RunZeros, other: RunZeros) -> bool:
    """Whether zeros of the same runs differ by no more than what is left of them when they stand."""
    if one.keys() != other.keys():
        return False
    each, others = (
        np.array([[e.zero for e in zeros[run].values()] for run in other]) for zeros in (one, other)
    )
    return bool(np.linalg.norm(each - others) <= SETTLED_ZERO * np.linalg.norm(others))


def _settled(reduction: Reduction, model: FittedModel) -> tuple[FittedModel, RunZeros]:
    """The model beside zeros of single runs that stand, held out, and these zeros."""
    best, fitted, step = (model, reduction.run_zeros), model, None
    for _ in range(ZERO_PASSES):
        if fitted.choices:
            scorer, fitted = refine_grid(reduction, fitted)
        else:
            scorer = Scorer(reduction.refined([]))
            fitted = scorer.fit_reweighted([], fitted)
        effects = at_found_shapes(fitted)
        for _ in range(ZERO_ROUNDS):
            runs, more = _found(scorer, fitted)
            known = _known(reduction, runs)
            if np.linalg.norm(more) <= SETTLED_ZERO * np.linalg.norm(known + more):
                break
            # Through a stiff stop a zero does far more than through its spring, by which it was told.
            factor = aitken_factor(step, more.reshape(-1))
            step = factor, more.reshape(-1)
            _take_off(reduction, runs, known + factor * more)
            scorer = Scorer(reduction.refined(effects))
            fitted = scorer.fit_reweighted([Choice(e) for e in effects], fitted)
        found, before = scorer.score_held_out(fitted), best[0].misfit
        best = min(best, (found, reduction.run_zeros), key=lambda one: one[0].misfit)
        if best[0].misfit > STILL_FALLING * before:
            break
    return best


def _found(scorer: Scorer, fitted: FittedModel) -> tuple[list[int], Array]:
    """Numbers of runs, and what a model tells of the zeros of both angles in them, rad, (runs, 2)."""
    offsets = scorer.run_offsets(fitted)
    numbers = [number for one in offsets for number in one.numbers]
    return numbers, np.concatenate([one.sources[:, ANGLES] for one in offsets])


def _known(reduction: Reduction, numbers: Sequence[int]) -> Array:
    """What was taken off the angles of these runs, rad, (runs, 2)."""
    each = [reduction.run_zeros.get(reduction.runs[number], {}) for number in numbers]
    return np.array([[errors.get(SOURCES[k], NO_ERROR).zero for k in ANGLES] for errors in each])


def _take_off(reduction: Reduction, numbers: Sequence[int], zeros: Array) -> None:
    """Take such zeros off the angles of these runs, rad, (runs, 2)."""
    names = [SOURCES[k] for k in ANGLES]
    each = (dict(zip(names, map(ReadingError, mine), strict=True)) for mine in zeros.tolist())
    reduction.correct_runs({reduction.runs[n]: errors for n, errors in zip(numbers, each, strict=True)})
