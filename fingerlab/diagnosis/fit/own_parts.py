"""What every run has of its own: how its friction differs from the others', how its tip was set down.

It is integrated out of a fit as a Gaussian, for it tells nothing of the other runs, but goes no further than
runs differ by: a friction that does follows something that the model lacks. Beyond its bound a run's part stays
where the bound is, and what it would explain pulls at the model; the misfit and its slope change smoothly there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fingerlab.diagnosis.equations.features import IntArray
from fingerlab.diagnosis.fit.data import Weighted
from fingerlab.diagnosis.settings import SWEEPS
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Beyond:
    """What the bounds of some runs' parts add to what these leave.

    Attributes:
        folds: that hold these runs, (n,).
        misfit: half of its slope is ``pull``, (n, k), by the features' coefficients.
        curvature, matrix: of it, with noise and without, (n, k, k).
    """

    folds: IntArray
    misfit: float
    pull: Array
    bend: Weighted


@dataclass(frozen=True)
class Own:
    """What runs of one condition have of their own.

    Attributes:
        parts: what one standard deviation of each adds to the features, (k, parts).
        folds: numbers of the folds that hold these runs, in order.
        curved, pulled: products of the features with these parts over every fold, (folds, k, parts), with
            noise and without.
        firmness: with which each part is held near zero: 1 at face value.
        bound: standard deviations that a part is off zero at most.
    """

    parts: Array
    folds: IntArray
    curved: Array
    pulled: Array
    firmness: float
    bound: float

    @cached_property
    def bowl(self) -> Array:
        """Curvature along the parts of a run's misfit and of what holds them, (folds, parts, parts)."""
        return np.asarray(self.parts.T @ self.curved + self.firmness * np.eye(self.parts.shape[1]))

    @cached_property
    def inverse(self) -> Array:
        """... inverted."""
        return np.asarray(np.linalg.inv(self.bowl))

    @cached_property
    def _wanted(self) -> Array:
        """What each part of every run would be without bounds, by the features' coefficients, (folds * parts, k)."""
        size = self.pulled.shape[1]
        return np.asarray(self.inverse @ self.pulled.transpose(0, 2, 1)).reshape(-1, size)

    @cached_property
    def taken_up(self) -> Weighted:
        """What they take up of curvature and matrix of every fold without bounds, (folds, k, k)."""
        return self._across(self.inverse)

    @cached_property
    def taken_up_together(self) -> Weighted:
        """The same of all folds, (k, k)."""
        return Weighted(self._together(self.curved), self._together(self.pulled))

    def _together(self, across: Array) -> Array:
        size = across.shape[1]
        mine, theirs = (one.transpose(1, 0, 2).reshape(size, -1) for one in (across @ self.inverse, across))
        return np.asarray(mine @ theirs.T)

    def _across(self, inverse: Array, among: IntArray | slice = slice(None)) -> Weighted:
        curved, pulled = self.curved[among], self.pulled[among]
        return Weighted(
            curved @ inverse @ curved.transpose(0, 2, 1), pulled @ inverse @ pulled.transpose(0, 2, 1)
        )

    def explained(self, told: Array) -> float:
        """What of the misfit of all its runs they take up at these coefficients of the features, (k,)."""
        wanted = self._wanted @ told
        taken = float(np.sum(wanted * (told @ self.pulled).reshape(-1)))
        return taken - self.misfit_beyond(told)

    def misfit_beyond(self, told: Array) -> float:
        """What the bounds add to what all runs leave."""
        found = self._stand(told)
        if found is None:
            return 0.0
        far, short, _ = found
        return float(np.einsum("fi,fij,fj->", short, self.bowl[far], short))

    def beyond(self, told: Array) -> Beyond | None:
        """The same with its slopes and curvature; None where no part would go further than its bound."""
        found = self._stand(told)
        if found is None:
            return None
        far, short, free = found
        both = free[:, :, None] & free[:, None, :]
        size = short.shape[1]
        moving = np.where(both, np.linalg.inv(np.where(both, self.bowl[far], np.eye(size))), 0.0)
        pull = np.einsum("fki,fi->fk", self.pulled[far], short)
        return Beyond(
            self.folds[far],
            float(np.einsum("fi,fij,fj->", short, self.bowl[far], short)),
            pull,
            self._across(self.inverse[far] - moving, far),
        )

    def _stand(self, told: Array) -> tuple[IntArray, Array, Array] | None:
        """Of the runs with a part at its bound: their places, by how much each part falls short of what it would
        be without bounds, and which parts are at none, (n, parts) each."""
        wanted = (self._wanted @ told).reshape(len(self.folds), -1)
        far = np.flatnonzero(np.abs(wanted).max(axis=1) > self.bound)
        if not len(far):
            return None
        stands = within_bounds(self.bowl[far], wanted[far], self.bound)
        return far, wanted[far] - stands, np.abs(stands) < self.bound


def within_bounds(bowl: Array, lowest: Array, bound: float) -> Array:
    """Where some bowls are lowest within ``bound`` of zero on each axis, (n, parts).

    Gauss and Seidel's way, projected: one axis after the other, in turn.

    Args:
        bowl: their curvatures, (n, parts, parts). lowest: where they are lowest of all, (n, parts).
    """
    found = np.clip(lowest, -bound, bound)
    pull = np.einsum("nij,nj->ni", bowl, lowest)
    for _ in range(SWEEPS):
        before = found.copy()
        for k in range(found.shape[1]):
            rest = pull[:, k] - np.einsum("nj,nj->n", bowl[:, k], found)
            found[:, k] = np.clip(found[:, k] + rest / bowl[:, k, k], -bound, bound)
        if np.abs(found - before).max() < 1e-6:
            break
    return found
