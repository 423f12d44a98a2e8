"""What every run has of its own: how its friction differs from the others', how its tip was set down.

It is integrated out of a fit as a Gaussian, for it tells nothing of the other runs, but goes no further than
runs differ by: a friction that does follows something that the model lacks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fingerlab.diagnosis.equations.features import IntArray
from fingerlab.diagnosis.fit.data import Weighted
from fingerlab.diagnosis.settings import MOST_WANDER, SWEEPS
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Own:
    """What runs of one condition have of their own.

    Attributes:
        parts: what one standard deviation of each adds to the features, (k, parts).
        folds: numbers of the folds that hold these runs, in order.
        curved, pulled: products of the features with these parts over every fold, (folds, k, parts), with
            noise and without.
        firmness: of what holds each part of each run near zero, (folds, parts): 1, and more where it would go
            further than runs do.
    """

    parts: Array
    folds: IntArray
    curved: Array
    pulled: Array
    firmness: Array

    @cached_property
    def bend(self) -> Array:
        """Curvature of the runs' misfit along their parts, (folds, parts, parts)."""
        return np.asarray(self.parts.T @ self.curved)

    @cached_property
    def inverse(self) -> Array:
        """... and of what holds them, inverted."""
        return np.asarray(np.linalg.inv(self.bend + self.firmness[:, :, None] * np.eye(self.parts.shape[1])))

    @property
    def at_bound(self) -> bool:
        """Whether any part would go further than runs do: all others are held alike."""
        return bool(np.ptp(self.firmness) > 0.0)

    def explained(self, told: Array) -> float:
        """What of the misfit of all its runs they take up at these coefficients of the features, (k,)."""
        pull = told @ self.pulled
        return float(np.einsum("fi,fij,fj->", pull, self.inverse, pull))

    @cached_property
    def taken_up(self) -> Weighted:
        """What they take up of curvature and matrix of every fold, (folds, k, k)."""
        return Weighted(
            self.curved @ self.inverse @ self.curved.transpose(0, 2, 1),
            self.pulled @ self.inverse @ self.pulled.transpose(0, 2, 1),
        )

    @cached_property
    def taken_up_together(self) -> Weighted:
        """The same of all folds, (k, k)."""
        return Weighted(self._together(self.curved), self._together(self.pulled))

    def _together(self, across: Array) -> Array:
        size = across.shape[1]
        mine, theirs = (one.transpose(1, 0, 2).reshape(size, -1) for one in (across @ self.inverse, across))
        return np.asarray(mine @ theirs.T)


def between(before: dict[int, list[Own]], now: dict[int, list[Own]]) -> dict[int, list[Own]]:
    """The runs' own parts held half way between two firmnesses, which would else be overshot in turn."""

    def one(then: Own, now: Own) -> Own:
        if then.firmness.shape != now.firmness.shape:
            return now
        return replace(now, firmness=np.sqrt(then.firmness * now.firmness))

    alike = {i for i, each in now.items() if len(before.get(i, ())) == len(each)}
    return {
        i: [one(*pair) for pair in zip(before[i], each, strict=True)] if i in alike else each
        for i, each in now.items()
    }


def firmness_moved(before: dict[int, list[Own]], now: dict[int, list[Own]]) -> float:
    """By which share the firmness of any part changed most; infinite where there are other parts."""
    pairs = [
        (a.firmness, b.firmness)
        for i, each in now.items()
        for a, b in zip(before.get(i, ()), each, strict=False)
    ]
    count = sum(len(each) for each in now.values())
    if len(pairs) != count or any(a.shape != b.shape for a, b in pairs):
        return float("inf")
    return max((float(np.abs(a / b - 1.0).max()) for a, b in pairs), default=0.0)


def firmness_of(own: Own, told: Array, usual: float) -> Array:
    """How firmly each part of every run is held so that none is more of itself than runs differ by, at most.

    A friction that differs more from run to run follows something that the model lacks. Within the bounds the
    parts of a run are where its misfit is least; one that stands at a bound is held as firmly as what pushes
    it there asks for (the multiplier of the bound), so that the rest of what it would explain pulls at the
    model. That changes smoothly with what the model leaves.

    Args:
        told: the features' coefficients, (k,). usual: how firmly a part is held that stands at no bound.
    """
    size = own.parts.shape[1]
    bend, pull = own.bend + usual * np.eye(size), -(told @ own.pulled)
    found = np.asarray(np.linalg.solve(bend, pull[:, :, None])[:, :, 0])
    firmness = np.full_like(found, usual)
    far = np.flatnonzero(np.abs(found).max(axis=1) > MOST_WANDER)
    if len(far):
        mine = _within_bounds(bend[far], pull[far], found[far])
        pushed = (pull[far] - np.einsum("rij,rj->ri", bend[far], mine)) * np.sign(mine)
        at_bound = np.abs(mine) >= MOST_WANDER * (1.0 - 1e-9)
        firmness[far] += np.where(at_bound, np.maximum(pushed, 0.0) / MOST_WANDER, 0.0)
    return firmness


def _within_bounds(bend: Array, pull: Array, start: Array) -> Array:
    """Where the parts of some runs lie best within their bounds, (runs, parts): one after the other, in turn.

    The misfit of each run is a bowl, whose floor that reaches (Gauss and Seidel's way, projected).
    """
    found = np.clip(start, -MOST_WANDER, MOST_WANDER)
    for _ in range(SWEEPS):
        before = found.copy()
        for k in range(found.shape[1]):
            rest = pull[:, k] - np.einsum("rj,rj->r", bend[:, k], found)
            found[:, k] = np.clip(found[:, k] + rest / bend[:, k, k], -MOST_WANDER, MOST_WANDER)
        if np.abs(found - before).max() < 1e-6:
            break
    return found
