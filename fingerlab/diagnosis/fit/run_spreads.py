"""How far the zeros of a bench's channels scatter from run to run, found before any model is judged.

Runs that were told the same motion miss a model's law by the same amount, whatever the law lacks. By what
their means differ all the same is no matter of physics: it is the bench's. So the spreads are those of
greatest likelihood (empirical Bayes, Searle, Casella and McCulloch, "Variance Components", 1992) of the
differences between repeated runs alone, under the bare model; a clean bench has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.fit.data import Weights
from fingerlab.diagnosis.gram.run_constants import (
    KINDS,
    SOURCES,
    EquationWeights,
    RunConstants,
    of_constants,
    share_of_equations,
    with_constants,
)
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.diagnosis.settings import (
    LEAST_CONSTANTS,
    LEAST_SHARE_OF_CONSTANTS,
    RUN_CONSTANT_RANGE,
    SPREAD_STEPS,
)
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Contrasts:
    """Differences between repeated runs: what each says of the sources.

    ``pull`` (n, 4) is the gradient of the log density at no constant, ``information`` (n, 4, 4) minus its
    curvature. ``values`` are the independent values of the runs behind them.
    """

    pull: Array
    information: Array
    values: float

    def at_most(self) -> float:
        """What no spreads can exceed: all that constants in every run would explain."""
        inverse = np.linalg.pinv(self.information, hermitian=True, rcond=1e-9)
        return float(0.5 * np.einsum("ri,rij,rj->", self.pull, inverse, self.pull))

    def log_density(self, spreads: Array) -> float:
        """Of the differences, against that with no constants of the runs; ``spreads`` (4,)."""
        pull = self.pull * spreads
        matrix = np.eye(len(spreads)) + self.information * np.outer(spreads, spreads)
        explained = np.einsum("ri,ri->", pull, np.linalg.solve(matrix, pull[:, :, None])[:, :, 0])
        return float(0.5 * explained - 0.5 * np.linalg.slogdet(matrix)[1].sum())


def find_constants(
    reduced: Reduced, model: Model, values: Array, weights: Weights, rig: Rig, motions: Sequence[int | None],
    alone: bool = False,
) -> RunConstants | None:  # fmt: skip
    """The constants that runs of these sessions have of their own; None: none that would matter.

    Args:
        model, values, weights: the bare model, its unknowns, (p,), and the weights that it was fitted under.
        motions: which runs were told just the same, see ``conditions.repeated_motions``.
        alone: of groups in which no motion comes again, and of all where constants were found already and may
            not be all, take what the model misses on the average of every run for its constants; it has to
            explain all but those.
    """
    known = dict(zip(model.index, map(float, values), strict=True))
    shares = {
        g.key: share_of_equations(g.cable_sign, not g.on_bench, reduced.radius, known, rig)
        for g in reduced.groups
    }
    found = [_contrasts(model, values, g, weights[g.key], shares[g.key], motions) for g in reduced.groups]
    lone = [alone and (reduced.constants is not None or not len(one.pull)) for one in found]
    found = [
        _averages(model, values, g, weights[g.key], shares[g.key]) if averaged else one
        for g, one, averaged in zip(reduced.groups, found, lone, strict=True)
    ]
    pull = np.concatenate([one.pull for one in found])
    if not len(pull):
        return None
    contrasts = Contrasts(
        pull, np.concatenate([one.information for one in found]), sum(one.values for one in found)
    )
    spreads = _likeliest(contrasts)
    return RunConstants(spreads, shares, any(lone)) if spreads.any() else None


def _contrasts(
    model: Model, values: Array, group: Group, weights: Array, share: Array, motions: Sequence[int | None]
) -> Contrasts:
    """Of a group's runs: orthonormal differences between those of each motion (Helmert's)."""
    h, own = model.features(values, group), EquationWeights.of(weights)
    pulls, count = [np.zeros((0, len(SOURCES)))], 0.0
    information = [np.zeros((0, len(SOURCES), len(SOURCES)))]
    every = [t for fold in group.folds for t in fold.totals]
    for motion in sorted({m for t in every if (m := motions[t.number]) is not None}):
        totals = [t for t in every if motions[t.number] == motion]
        lengths = np.array([t.counts[0] for t in totals])
        if len(totals) < 2 or not lengths.all():
            continue
        # Runs of one motion are about equally long; as if they were just so.
        each = lengths.mean() / lengths
        pull = np.einsum("rke,k,es->rs", with_constants(totals, model.pick, own), -h, share)
        mean = (of_constants(totals, own) * each[:, None, None]).mean(axis=0)
        basis = _helmert(len(totals))
        pulls.append(basis @ (pull * each[:, None]))
        information.append(np.repeat((share.T @ mean @ share)[None], len(basis), axis=0))
        count += EFFECTIVE_SHARE * group.equations * float(lengths.sum())
    return Contrasts(np.concatenate(pulls), np.concatenate(information), count)


def _averages(model: Model, values: Array, group: Group, weights: Array, share: Array) -> Contrasts:
    """What every run of a group misses on its average."""
    h, own = model.features(values, group), EquationWeights.of(weights)
    totals = [t for fold in group.folds for t in fold.totals]
    pull = np.einsum("rke,k,es->rs", with_constants(totals, model.pick, own), -h, share)
    information = share.T @ of_constants(totals, own) @ share
    count = EFFECTIVE_SHARE * group.equations * float(sum(t.counts[0] for t in totals))
    return Contrasts(pull, information, count)


def _helmert(count: int) -> Array:
    """Orthonormal contrasts of so many numbers, (count - 1, count)."""
    rows = np.zeros((count - 1, count))
    for k in range(1, count):
        rows[k - 1, :k], rows[k - 1, k] = 1.0, -float(k)
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _likeliest(contrasts: Contrasts) -> Array:
    """Spreads of greatest likelihood, (4,), each kind of channel with one; zero where it hardly matters.

    One kind after the other on a grid. A kind stays only if the others cannot take its place.
    """
    grid = np.concatenate(([0.0], np.geomspace(*RUN_CONSTANT_RANGE, SPREAD_STEPS)))

    def of(each: Sequence[float]) -> Array:
        spreads = np.zeros(len(SOURCES))
        for kind, spread in zip(KINDS, each, strict=True):
            spreads[list(kind)] = spread
        return spreads

    def climbed(each: list[float], free: Sequence[int]) -> tuple[float, list[float]]:
        best = contrasts.log_density(of(each))
        while True:
            before = best
            for k in free:
                tried = [contrasts.log_density(of([*each[:k], s, *each[k + 1 :]])) for s in grid]
                best, each[k] = max(tried), float(grid[int(np.argmax(tried))])
            if best <= before + 1e-6 * abs(before):
                return best, each

    least = LEAST_CONSTANTS * contrasts.values
    if contrasts.at_most() < least:
        return np.zeros(len(SOURCES))
    free = list(range(len(KINDS)))
    best, each = max(climbed([s] * len(KINDS), free) for s in (0.0, float(grid[len(grid) // 2])))
    if best < least:
        return np.zeros(len(SOURCES))
    while len(free) > 1:
        fewer = []
        for k in free:
            start = [0.0 if j == k else s for j, s in enumerate(each)]
            fewer.append((*climbed(start, [j for j in free if j != k]), k))
        other, values, needless = max(fewer)
        if best - other >= max(least, LEAST_SHARE_OF_CONSTANTS * best):
            break
        best, each = other, values
        free.remove(needless)
    return of(each)
