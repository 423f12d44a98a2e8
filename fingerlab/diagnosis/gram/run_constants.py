"""Constants that every run has of its own: the zeros of its sensors and the offset of the amplifier.

A sensor that was clamped anew, or an amplifier that drifts, adds a constant to a channel for a whole run.
What that adds to the equations is nearly a constant, too: an angle acts through its spring and its moment
arm, a torque through the pulley, a motor's zero through the cable alone. They are random effects with one
spread for each kind of channel, the same in every model, and a fit never sees them: they are integrated out
of the products that it is shown. Products of a feature with a constant are sums of the feature over a run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fingerlab.diagnosis.equations.coefficients import CABLE_NAMES
from fingerlab.diagnosis.equations.features import Pick
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Row
from fingerlab.rig.constants import Rig
from fingerlab.sessions.model import Array

SOURCES = ("mcp_angle", "pip_angle", "motor_torque", "motor_position")
"""Channels whose zero may be another one in every run; rad, rad, N m, rad."""
KINDS = ((0, 1), (2,), (3,))
"""Sources that scatter alike: whoever clamps one joint's sensor anew does so with the other."""


@dataclass(frozen=True)
class RunTotals:
    """Sums of signals, not of products, over one run: their products with a constant of the run's own.

    ``number`` is the run's among those that are analysed. ``values`` (3, signals) count all samples, those
    where the cable may be slack, and those where the motor stands and the cable is taut; ``counts`` (3,) are
    the numbers of these samples.
    """

    number: int
    values: Array
    counts: Array


@dataclass(frozen=True)
class RunConstants:
    """How far the zeros scatter from run to run, and what one unit of each adds to the equations.

    Attributes:
        spreads: one standard deviation of each source, (4,); zero: it does not move.
        shares: residual of the equations for each unit of each source, (5, 4) over ``Row``, by group.
    """

    spreads: Array
    shares: Mapping[GroupKey, Array]

    @cached_property
    def key(self) -> tuple[bytes, ...]:
        """What tells them from others."""
        return self.spreads.tobytes(), *(share.tobytes() for _, share in sorted(self.shares.items()))

    def scaled(self, key: GroupKey) -> Array:
        """What one standard deviation of each source adds to the equations of a group, (5, 4)."""
        return np.asarray(self.shares[key] * self.spreads)

    def pull(
        self, key: GroupKey, totals: Sequence[RunTotals], pick: Pick, weights: Array, at_rest: Array | None
    ) -> Array:
        """Weighted products of features with one standard deviation of each source, (runs, k, 4).

        Args:
            weights: of the equations, (5, 5); ``at_rest`` comes on top of them where the motor stands.
        """
        return np.asarray(with_constants(totals, pick, weights, at_rest) @ self.scaled(key))

    def grip(
        self, key: GroupKey, totals: Sequence[RunTotals], weights: Array, at_rest: Array | None
    ) -> Array:
        """Posterior covariance of the sources in units of their standard deviations, (runs, 4, 4)."""
        share = self.scaled(key)
        told = share.T @ of_constants(totals, weights, at_rest) @ share
        return np.asarray(np.linalg.inv(np.eye(len(SOURCES)) + told))


@dataclass(frozen=True)
class Offsets:
    """What the constants of some runs are thought to be.

    Attributes:
        numbers: of the runs.
        sources: by how much each channel reads too high, (runs, 4); SI. spreads: one standard deviation.
        rows: what that adds to the equations' residuals, (runs, 5).
    """

    numbers: tuple[int, ...]
    sources: Array
    spreads: Array
    rows: Array

    def taken_off(self, products: Array, model: Model, told: Array, totals: Sequence[RunTotals]) -> Array:
        """Sums of residual products, (5, 5), over these runs, with the constants taken off the residuals.

        Args:
            told: coefficients of the model's active features, (k,).
        """
        alike = np.ones((len(Row), len(Row))) / EFFECTIVE_SHARE
        spread = np.zeros((len(Row), len(told)))
        spread[model.rows, np.arange(len(told))] = told
        cross = (spread @ with_constants(totals, model.pick, alike, None)) * self.rows[:, None, :]
        square = of_constants(totals, alike, None) * self.rows[:, :, None] * self.rows[:, None, :]
        return np.asarray(products + (square - cross - cross.transpose(0, 2, 1)).sum(axis=0))


def taken_up(left: Array, grip: Array, right: Array) -> Array:
    """What the constants of all runs take up of weighted products of features, (k, n).

    Args:
        left, right: of the features with the sources, (runs, k, 4) and (runs, n, 4).
    """
    runs, size, sources = left.shape
    flat = (left @ grip).transpose(1, 0, 2).reshape(size, runs * sources)
    return np.asarray(flat @ right.transpose(1, 0, 2).reshape(right.shape[1], runs * sources).T)


def taken_up_by_folds(grip: Array, pull: Array, folds: Sequence[Any]) -> Array:
    """The same of a group's features among each other, by the runs of each of its folds, (folds, k, k).

    Args:
        folds: index of every fold's runs, fold after fold.
    """
    if all(len(runs) == 1 for runs in folds):
        return np.asarray(pull @ grip @ pull.transpose(0, 2, 1))
    return np.stack([taken_up(pull[runs], grip[runs], pull[runs]) for runs in folds])


def with_constants(totals: Sequence[RunTotals], pick: Pick, weights: Array, at_rest: Array | None) -> Array:
    """Weighted products of features with a constant in every equation, (runs, k, 5)."""
    values = np.stack([t.values for t in totals])[:, :, pick.signals, None]
    unseen = np.repeat(pick.cable[:, None], len(Row), axis=1)  # a slack cable says nothing of its length
    unseen[:, Row.CABLE] = True
    found = (values[:, 0] - values[:, 1] * unseen) * weights[pick.rows]
    if at_rest is not None:
        found += values[:, 2] * at_rest[pick.rows]
    return np.asarray(EFFECTIVE_SHARE * found)


def of_constants(totals: Sequence[RunTotals], weights: Array, at_rest: Array | None) -> Array:
    """Weighted products of constants in the equations with each other, (runs, 5, 5)."""
    counts = np.stack([t.counts for t in totals])[:, :, None, None]
    cable = np.arange(len(Row)) == Row.CABLE
    found = (counts[:, 0] - counts[:, 1] * np.logical_or.outer(cable, cable)) * weights
    if at_rest is not None:
        found += counts[:, 2] * at_rest
    return np.asarray(EFFECTIVE_SHARE * found)


def share_of_equations(
    cable_sign: int, in_finger: bool, radius: float, values: Mapping[str, float], rig: Rig
) -> Array:
    """What one unit of each source adds to the equations of a group's runs, (5, 4).

    Args:
        in_finger: whether it is no run of the motor alone. radius: of the pulley, m. values: hold the
            moment arms, m, by key.
    """
    share = np.zeros((len(Row), len(SOURCES)))
    if not in_finger or rig.finger is None:
        share[Row.BENCH, 2] = 1.0
        return share
    cable = CABLE_NAMES[cable_sign]
    springs = (rig.finger.mcp_stiffness, rig.finger.pip_stiffness)
    for joint, row in enumerate((Row.MCP, Row.PIP)):
        arm = cable_sign * values[f"{('arm_mcp', 'arm_pip')[joint]}@{cable}"]
        share[row, joint], share[Row.CABLE, joint] = -springs[joint] / arm, -arm
        share[row, 2] = 1.0 / radius
    share[Row.CABLE, 2] = -values.get("cable_compliance", 0.0) / radius
    share[Row.CABLE, 3] = radius
    return share
