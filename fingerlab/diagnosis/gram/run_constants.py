"""Constants that each run has of its own, and what they add to the products of its signals.

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

from fingerlab.diagnosis.equations.features import FeatureSet
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects.base import Row
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import CABLE_NAMES, Array

SOURCES = ("mcp_angle", "pip_angle", "motor_torque", "motor_position", "endpoint_force")
"""Channels whose zero may be another one in every run; rad, rad, N m, rad, N."""
OF_TORQUE = SOURCES.index("motor_torque")
"""Place of the motor's torque among them."""
KINDS = ((0, 1), (2,), (3,), (4,))
"""Sources that scatter alike: whoever clamps one joint's sensor anew does so with the other."""
OF_CABLE = (0, 2)
"""Kinds that the cable's way tells of."""


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
class EquationWeights:
    """Inverse covariance of the equations' residuals, (5, 5) over ``Row``, and what comes on top of it.

    Attributes:
        everywhere: at every moment. at_rest: on top where the motor stands; None: nothing does.
        where_slack: on top where the cable is slack; takes all weight from its equation.
    """

    everywhere: Array
    where_slack: Array
    at_rest: Array | None = None

    @classmethod
    def of(cls, weights: Array, at_rest: Array | None = None) -> EquationWeights:
        """Those of equations of which the cable's says nothing while the cable is slack.

        What it tells elsewhere of the noise that all share, the tension's above all, is not known at such
        moments: there the others weigh as they do without it, by the Schur complement.
        """
        own = weights[Row.CABLE, Row.CABLE]
        if own <= 0.0:  # of a motor alone
            return cls(weights, np.zeros_like(weights), at_rest)
        return cls(weights, -np.outer(weights[:, Row.CABLE], weights[Row.CABLE]) / own, at_rest)

    def on_average(self, slack: float) -> Array:
        """Of products over samples of which this share is slack, (5, 5); the cable's are of the others."""
        less = self.where_slack.copy()
        less[Row.CABLE], less[:, Row.CABLE] = 0.0, 0.0
        return np.asarray(self.everywhere + slack * less)

    @classmethod
    def alike(cls) -> EquationWeights:
        """Of products of residuals as they are; of a slack cable's there are none."""
        ones = np.ones((len(Row), len(Row))) / EFFECTIVE_SHARE
        cable = np.arange(len(Row)) == Row.CABLE
        return cls(ones, -ones * np.logical_or.outer(cable, cable))


@dataclass(frozen=True)
class RunConstants:
    """How far the zeros scatter from run to run, and what one unit of each adds to the equations.

    Attributes:
        spreads: one standard deviation of each source, (5,); zero: it does not move.
        shares: residual of the equations for each unit of each source, (5, 5) over ``Row``, by group.
        by_averages: found, for want of repeated runs, by what a model misses on the averages of runs.
    """

    spreads: Array
    shares: Mapping[GroupKey, Array]
    by_averages: bool = False

    @property
    def move_torque(self) -> bool:
        """Whether the torque's zero is another one in every run."""
        return bool(self.spreads[OF_TORQUE] > 0.0)

    @cached_property
    def key(self) -> tuple[bytes, ...]:
        """What tells them from others."""
        return self.spreads.tobytes(), *(share.tobytes() for _, share in sorted(self.shares.items()))

    def scaled(self, key: GroupKey) -> Array:
        """What one standard deviation of each source adds to the equations of a group, (5, 5)."""
        return np.asarray(self.shares[key] * self.spreads)

    def pull(
        self, key: GroupKey, totals: Sequence[RunTotals], pick: FeatureSet, weights: EquationWeights
    ) -> Array:
        """Weighted products of features with one standard deviation of each source, (runs, k, 5)."""
        return np.asarray(with_constants(totals, pick, weights) @ self.scaled(key))

    def posterior_covariance(
        self, key: GroupKey, totals: Sequence[RunTotals], weights: EquationWeights
    ) -> Array:
        """Posterior covariance of the sources in units of their standard deviations, (runs, 5, 5)."""
        share = self.scaled(key)
        information = share.T @ of_constants(totals, weights) @ share
        return np.asarray(np.linalg.inv(np.eye(len(SOURCES)) + information))


@dataclass(frozen=True)
class Offsets:
    """What the constants of some runs are thought to be.

    Attributes:
        numbers: of the runs.
        sources: by how much each channel reads too high, (runs, 5); SI. spreads: one standard deviation.
        rows: what that adds to the equations' residuals, (runs, 5).
    """

    numbers: tuple[int, ...]
    sources: Array
    spreads: Array
    rows: Array

    def by_run(self) -> Offsets:
        """The same with what is thought of a run's blocks as one, on their average."""
        numbers, place = np.unique(self.numbers, return_inverse=True)
        if len(numbers) == len(self.numbers):
            return self
        share = (place == np.arange(len(numbers))[:, None]) / np.bincount(place)[:, None]
        means = (share @ one for one in (self.sources, self.spreads, self.rows))
        return Offsets(tuple(map(int, numbers)), *means)

    def taken_off(
        self, products: Array, model: Model, coefficients: Array, totals: Sequence[RunTotals]
    ) -> Array:
        """Sums of residual products, (5, 5), over these runs, with the constants taken off the residuals.

        Args:
            coefficients: of the model's active features, (k,).
        """
        alike = EquationWeights.alike()
        spread = np.zeros((len(Row), len(coefficients)))
        spread[model.rows, np.arange(len(coefficients))] = coefficients
        cross = (spread @ with_constants(totals, model.pick, alike)) * self.rows[:, None, :]
        square = of_constants(totals, alike) * self.rows[:, :, None] * self.rows[:, None, :]
        return np.asarray(products + (square - cross - cross.transpose(0, 2, 1)).sum(axis=0))


def by_run(totals: Sequence[RunTotals]) -> list[RunTotals]:
    """Those of the same run added up, in the order of the runs' numbers."""
    found: dict[int, RunTotals] = {}
    for one in totals:
        before = found.get(one.number)
        values, counts = (one.values, one.counts) if before is None else (
            before.values + one.values, before.counts + one.counts
        )  # fmt: skip
        found[one.number] = RunTotals(one.number, values, counts)
    return [found[number] for number in sorted(found)]


def schur_complement(left: Array, posterior_covariance: Array, right: Array) -> Array:
    """What the constants of all runs take up of weighted products of features, (k, n).

    Args:
        left, right: of the features with the sources, (runs, k, 5) and (runs, n, 5).
    """
    runs, size, sources = left.shape
    flat = (left @ posterior_covariance).transpose(1, 0, 2).reshape(size, runs * sources)
    return np.asarray(flat @ right.transpose(1, 0, 2).reshape(right.shape[1], runs * sources).T)


def taken_up_by_folds(posterior_covariance: Array, pull: Array, folds: Sequence[Any]) -> Array:
    """The same of a group's features among each other, by the runs of each of its folds, (folds, k, k).

    Args:
        folds: index of every fold's runs, fold after fold.
    """
    if all(len(runs) == 1 for runs in folds):
        return np.asarray(pull @ posterior_covariance @ pull.transpose(0, 2, 1))
    return np.stack([schur_complement(pull[runs], posterior_covariance[runs], pull[runs]) for runs in folds])


def with_constants(totals: Sequence[RunTotals], pick: FeatureSet, weights: EquationWeights) -> Array:
    """Weighted products of features with a constant in every equation, (runs, k, 5)."""
    values = np.stack([t.values for t in totals])[:, :, pick.signals, None]
    found = values[:, 0] * weights.everywhere[pick.rows] + values[:, 1] * weights.where_slack[pick.rows]
    if weights.at_rest is not None:
        found += values[:, 2] * weights.at_rest[pick.rows]
    return np.asarray(EFFECTIVE_SHARE * found)


def of_constants(totals: Sequence[RunTotals], weights: EquationWeights) -> Array:
    """Weighted products of constants in the equations with each other, (runs, 5, 5)."""
    counts = np.stack([t.counts for t in totals])[:, :, None, None]
    found = counts[:, 0] * weights.everywhere + counts[:, 1] * weights.where_slack
    if weights.at_rest is not None:
        found += counts[:, 2] * weights.at_rest
    return np.asarray(EFFECTIVE_SHARE * found)


def share_of_equations(
    cable_sign: int,
    in_finger: bool,
    radius: float,
    values: Mapping[str, float],
    rig: Rig,
    levers: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """What one unit of each source adds to the equations of a group's runs, (5, 5).

    Args:
        in_finger: whether it is no run of the motor alone. radius: of the pulley, m. values: hold the
            moment arms, m, by key. levers: of the force at the tip about MCP and PIP, m; 0 in free motion.
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
        share[row, 2], share[row, 4] = 1.0 / radius, -levers[joint] / arm
    share[Row.CABLE, 2] = -values.get("cable_compliance", 0.0) / radius
    share[Row.CABLE, 3] = radius
    return share


def residual_offsets(
    offsets: Sequence[Offsets], runs: Sequence[tuple[str, str]]
) -> dict[tuple[str, str], Array]:
    """What the runs' constants add to the residuals, (5,) over ``Row``, by session and run."""
    return {runs[n]: row for one in offsets for n, row in zip(one.numbers, one.rows, strict=True)}
