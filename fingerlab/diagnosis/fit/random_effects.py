"""Random effects of runs: how their friction differs, how their tip was set down.

It is integrated out of a fit as a Gaussian, for it tells nothing of the other runs, but goes no further than
runs differ by: a friction that does follows something that the model lacks. Beyond its bound a run's part
stays where the bound is, and what it would explain pulls at the model; misfit and slope are smooth there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fingerlab.diagnosis.fit.bounded_step import bounded_step
from fingerlab.diagnosis.fit.data import Weighted
from fingerlab.diagnosis.settings import PIVOTING_ROUNDS, RUN_VARIATION_BOUND
from fingerlab.sessions.model import Array, BoolArray, IntArray


@dataclass(frozen=True)
class BoundTerms:
    """What the bounds of some runs' parts add to what these leave, as half a slope and half a curvature.

    Attributes:
        folds: that hold these runs, (n,).
        slope: by the features' coefficients, (n, k).
        cross, cross_denoised: products of the features with the parts, (n, k, parts), with noise and without.
        compliance: what the parts would yield more without bounds, (n, parts, parts).
    """

    folds: IntArray
    slope: Array
    cross: Array
    cross_denoised: Array
    compliance: Array

    def along(self, jacobian: Array) -> Weighted:
        """Curvature and matrix of each fold along some derivatives of the coefficients, (k, p): (n, p, p)."""
        return Weighted(*(self._along(across, jacobian) for across in (self.cross, self.cross_denoised)))

    def _along(self, across: Array, jacobian: Array) -> Array:
        mine = across.transpose(0, 2, 1) @ jacobian
        return np.asarray(mine.transpose(0, 2, 1) @ (self.compliance @ mine))


@dataclass(frozen=True)
class RandomEffects:
    """Random effects of the runs of a group that differ in the same way.

    Attributes:
        parts: what one standard deviation of each adds to the features, (k, parts).
        folds: numbers of the folds that hold these runs, in order.
        cross, cross_denoised: products of the features with these parts over every fold, (folds, k, parts),
            with noise and without.
        precision: with which each part is held near zero: 1 at face value.
        bound: standard deviations, at face value, that a part is off zero at most.
    """

    parts: Array
    folds: IntArray
    cross: Array
    cross_denoised: Array
    precision: float
    bound: float

    @cached_property
    def system(self) -> Array:
        """Curvature along the parts of a run's misfit and of what holds them, (folds, parts, parts)."""
        return np.asarray(self.parts.T @ self.cross + self.precision * np.eye(self.parts.shape[1]))

    @cached_property
    def inverse(self) -> Array:
        """... inverted."""
        return np.asarray(np.linalg.inv(self.system))

    @cached_property
    def _wanted(self) -> Array:
        """What every part would be without bounds, by the features' coefficients, (folds * parts, k)."""
        size = self.cross_denoised.shape[1]
        return np.asarray(self.inverse @ self.cross_denoised.transpose(0, 2, 1)).reshape(-1, size)

    @cached_property
    def schur_complement(self) -> Weighted:
        """What they take up of curvature and matrix of every fold without bounds, (folds, k, k)."""
        cross, cross_denoised = self.cross, self.cross_denoised
        return Weighted(
            cross @ self.inverse @ cross.transpose(0, 2, 1),
            cross_denoised @ self.inverse @ cross_denoised.transpose(0, 2, 1),
        )

    @cached_property
    def schur_complement_of_all(self) -> Weighted:
        """The same of all folds, (k, k)."""
        return Weighted(self._together(self.cross), self._together(self.cross_denoised))

    def _together(self, across: Array) -> Array:
        size = across.shape[1]
        mine, theirs = (one.transpose(1, 0, 2).reshape(size, -1) for one in (across @ self.inverse, across))
        return np.asarray(mine @ theirs.T)

    def explained(self, coefficients: Array) -> float:
        """What of the misfit of all its runs they take up at these coefficients of the features, (k,)."""
        wanted = self._wanted @ coefficients
        taken = float(np.sum(wanted * (coefficients @ self.cross_denoised).reshape(-1)))
        return taken - self.misfit_at_bounds(coefficients)

    def misfit_at_bounds(self, coefficients: Array) -> float:
        """What the bounds add to what all runs leave."""
        found = self._clipped_runs(coefficients)
        if found is None:
            return 0.0
        far, short, _ = found
        return float(np.sum(short * _times(self.system[far], short)))

    def beyond(self, coefficients: Array) -> BoundTerms | None:
        """The same as slope and curvature; None where no part would go further than its bound."""
        found = self._clipped_runs(coefficients)
        if found is None:
            return None
        far, short, free = found
        both = free[:, :, None] & free[:, None, :]
        moving = np.where(both, np.linalg.inv(np.where(both, self.system[far], np.eye(short.shape[1]))), 0.0)
        cross, cross_denoised = self.cross[far], self.cross_denoised[far]
        slope = (cross_denoised @ short[:, :, None])[:, :, 0]
        return BoundTerms(self.folds[far], slope, cross, cross_denoised, self.inverse[far] - moving)

    def _clipped_runs(self, coefficients: Array) -> tuple[IntArray, Array, BoolArray] | None:
        """Of the runs with a part at its bound, their places, (n,); how far each part falls short of what it
        would be without bounds, and which parts are at none, (n, parts) each."""
        every = self._wanted @ coefficients
        size = np.abs(every)
        if not size.max() > self.bound:  # nearly always, and asked at every step of a fit
            return None
        wanted = every.reshape(len(self.folds), -1)
        far = np.flatnonzero(size.reshape(wanted.shape).max(axis=1) > self.bound)
        stands, free = _within(self.system[far], wanted[far], self.bound)
        return far, wanted[far] - stands, free


def _within(curvatures_of_folds: Array, unconstrained: Array, bound: float) -> tuple[Array, BoolArray]:
    """Where each of some parabolas is lowest within the same bounds, and which parts are at none, (n, parts).

    All bounds that are wrong are exchanged at once (block principal pivoting, as in ``bounded_step``), in
    every system; one that does not settle so is taken by itself.

    Args:
        curvatures_of_folds: (n, parts, parts).
        unconstrained: where each is least without bounds, (n, parts).
    """
    side = np.sign(unconstrained) * (np.abs(unconstrained) > bound)
    one = np.eye(unconstrained.shape[1])
    for _ in range(PIVOTING_ROUNDS):
        at_bound = side != 0
        off = np.where(at_bound, side * bound - unconstrained, 0.0)
        both = ~at_bound[:, :, None] & ~at_bound[:, None, :]
        pull = np.where(at_bound, 0.0, -_times(curvatures_of_folds, off))
        off += np.linalg.solve(np.where(both, curvatures_of_folds, one), pull[:, :, None])[:, :, 0]
        stands = unconstrained + off
        pushed = side * _times(curvatures_of_folds, off) < 0.0
        out = np.sign(stands) * (np.abs(stands) > bound * (1.0 + 1e-12))
        following = np.where(at_bound, side * pushed, out)
        open_ones = np.flatnonzero((following != side).any(axis=1))
        if not len(open_ones):
            break
        side = following
    else:
        at, most = np.zeros(unconstrained.shape[1]), np.full(unconstrained.shape[1], bound)
        for k in open_ones:
            stands[k] = bounded_step(
                at, -curvatures_of_folds[k] @ unconstrained[k], curvatures_of_folds[k], -most, most
            )
        at_bound = np.abs(stands) >= bound * (1.0 - 1e-9)
    return stands, ~at_bound


def _times(matrices: Array, vectors: Array) -> Array:
    """Of each of some matrices with its vector, (n, parts)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def explained(own: Array, h: Array, sums: Weighted) -> Array:
    """What of the misfits of runs their own share of the features explains, less what that costs, (runs,).

    As a Gaussian. It goes no further than so many standard deviations: a friction that differs more from run
    to run follows something that the model lacks.

    Args:
        own: what one standard deviation of each part adds to the features, (k, parts).
        h: the features' coefficients, (k,). sums: weighted products of them over every run, (runs, k, k).
    """
    if not own.shape[1]:
        return np.zeros(len(sums.matrix))
    pulls = own.T @ sums.matrix @ h
    stiffness = own.T @ sums.curvature @ own + np.eye(own.shape[1])
    parts = np.linalg.solve(stiffness, pulls[:, :, None])[:, :, 0]
    parts = np.clip(parts, -RUN_VARIATION_BOUND, RUN_VARIATION_BOUND)
    each = zip(pulls, parts, stiffness, strict=True)
    return np.array([2.0 * pull @ part - part @ stiff @ part for pull, part, stiff in each])


def own_share(own: Array, h: Array, sums: Weighted) -> Array:
    """What a run's own share of the features would have to be for its misfit to be least, (k,)."""
    if not own.shape[1]:
        return np.zeros(len(h))
    stiffness = own.T @ sums.curvature @ own + np.eye(own.shape[1])
    found = np.linalg.solve(stiffness, own.T @ sums.matrix @ h)
    return np.asarray(-own @ np.clip(found, -RUN_VARIATION_BOUND, RUN_VARIATION_BOUND))


@dataclass(frozen=True)
class LeftOut:
    """What the runs but those of one split tell.

    Attributes:
        values: of the unknowns, (p,). information: how well they are known, (p, p).
        free: those that no bound holds, (p,).
        gradient: half the slope of their cost at the fit of all runs, (p,). fall: of their cost from there.
    """

    values: Array
    information: Array
    free: BoolArray
    gradient: Array
    fall: float

    def widening(self, curvature: Array) -> float:
        """Twice the log density that a run's constants, which the others tell only so well, take from it.

        Args:
            curvature: by how much better they would be known with the run, (p, p).
        """
        places, units, known, log_size = self._known
        more = curvature[places] * units
        return float(np.linalg.slogdet(known + more)[1] - log_size)

    @cached_property
    def _known(self) -> tuple[tuple[Any, ...], Array, Array, float]:
        """Where the free unknowns stand in a matrix, its units, their information, its log size."""
        places = np.ix_(self.free, self.free)
        known = self.information[places]
        scale = 1.0 / np.sqrt(np.diag(known))  # the unknowns have units of their own
        units = np.outer(scale, scale)
        return places, units, known * units, float(np.linalg.slogdet(known * units)[1])
