"""Products of signals by groups of runs, with the constants that each run has of its own.

A sensor that was clamped anew, or an amplifier that drifts, adds a constant to a channel for a whole run.
What that adds to the equations is nearly a constant, too: an angle acts through its spring and its moment
arm, a torque through the pulley, a motor's zero through the cable alone. They are random effects with one
spread for each kind of channel, the same in every model, and a fit never sees them: they are integrated out
of the products that it is shown. Products of a feature with a constant are sums of the feature over a run.

A signal may stand in several equations (the tension in all three), so that far fewer signals than features
need to be filtered and multiplied. What an equation sees of them depends on the cable: the cable equation
says nothing at moments when the cable may be slack.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from fingerlab.diagnosis.equations.features import IntArray, Layout, Pick
from fingerlab.diagnosis.equations.model import Model
from fingerlab.diagnosis.signals.channel_checks import ChannelRatios
from fingerlab.diagnosis.signals.conditions import Fold, GroupKey
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.diagnosis.signals.segments import ChannelSigns
from fingerlab.effects.base import Row
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import CABLE_NAMES, Array

FloorFrom = Literal["cycles", "runs", "state law"]
"""Repeated cycles, these and repeated commands, or what a law of the measured state leaves."""

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
        spreads: one standard deviation of each source, (4,); zero: it does not move.
        shares: residual of the equations for each unit of each source, (5, 4) over ``Row``, by group.
        by_averages: found, for want of repeated runs, by what a model misses on the averages of runs.
    """

    spreads: Array
    shares: Mapping[GroupKey, Array]
    by_averages: bool = False

    @cached_property
    def key(self) -> tuple[bytes, ...]:
        """What tells them from others."""
        return self.spreads.tobytes(), *(share.tobytes() for _, share in sorted(self.shares.items()))

    def scaled(self, key: GroupKey) -> Array:
        """What one standard deviation of each source adds to the equations of a group, (5, 4)."""
        return np.asarray(self.shares[key] * self.spreads)

    def pull(self, key: GroupKey, totals: Sequence[RunTotals], pick: Pick, weights: EquationWeights) -> Array:
        """Weighted products of features with one standard deviation of each source, (runs, k, 4)."""
        return np.asarray(with_constants(totals, pick, weights) @ self.scaled(key))

    def posterior_covariance(
        self, key: GroupKey, totals: Sequence[RunTotals], weights: EquationWeights
    ) -> Array:
        """Posterior covariance of the sources in units of their standard deviations, (runs, 4, 4)."""
        share = self.scaled(key)
        information = share.T @ of_constants(totals, weights) @ share
        return np.asarray(np.linalg.inv(np.eye(len(SOURCES)) + information))


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


def schur_complement(left: Array, posterior_covariance: Array, right: Array) -> Array:
    """What the constants of all runs take up of weighted products of features, (k, n).

    Args:
        left, right: of the features with the sources, (runs, k, 4) and (runs, n, 4).
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


def with_constants(totals: Sequence[RunTotals], pick: Pick, weights: EquationWeights) -> Array:
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


@dataclass
class Sums:
    """Products of signals over some samples.

    ``products`` (signals, signals) counts all samples, ``loose`` those where the cable may be slack (None:
    there are none), ``rest`` those where the motor stands and the cable is taut: ``rest_samples`` of them, in
    so many ``standstills``.
    """

    products: Array
    loose: Array | None = None
    taut_samples: int = 0
    slack_samples: int = 0
    rest: Array | None = None
    rest_samples: int = 0
    standstills: int = 0
    runs: list[str] = field(default_factory=list)  # names of the runs that hold the samples
    totals: list[RunTotals] = field(default_factory=list)  # of every one of them

    @property
    def samples(self) -> int:
        return self.taut_samples + self.slack_samples

    def add(self, other: Sums, live: IntArray | None = None) -> None:
        """Count the samples of ``other`` too; it may hold the products of the signals ``live`` alone."""
        add_among(self.products, other.products, live)
        if other.loose is not None:
            if self.loose is None:
                self.loose = np.zeros_like(self.products)
            add_among(self.loose, other.loose, live)
        if other.rest is not None:
            if self.rest is None:
                self.rest = np.zeros_like(self.products)
            add_among(self.rest, other.rest, live)
        self.rest_samples += other.rest_samples
        self.standstills += other.standstills
        self.taut_samples += other.taut_samples
        self.slack_samples += other.slack_samples
        self.runs += other.runs
        self.totals += other.totals

    def of(self, pick: Pick, noise: Array | None = None, taut_noise: Array | None = None) -> Array:
        """Products of features, (k, k), as the equations see them: none of the cable at slack moments.

        Args:
            noise: what it adds to the features' products at one sample, (k, k), to be taken away.
            taut_noise: the same at a taut moment; None: no other.
        """
        found = pick.among(self.products)
        if self.loose is not None:
            found -= pick.among(self.loose) * pick.in_cable
        if noise is not None:
            taut = noise if taut_noise is None else taut_noise
            found -= np.where(pick.in_cable, self.taut_samples * taut, self.samples * noise)
        return found

    def slack(self, pick: Pick) -> Array | None:
        """Products of the cable equation's features at slack moments, (k, k); None: there are none."""
        return None if self.loose is None else pick.among(self.loose) * pick.both_cable

    def at_rest(self, pick: Pick, noise: Array | None = None) -> Array | None:
        """Products of features where the motor stands, (k, k), less noise; None: it never does."""
        if self.rest is None:
            return None
        found = pick.among(self.rest)
        return found if noise is None else found - self.rest_samples * noise

    def taut(self) -> Array:
        """Products where the cable is taut, (signals, signals)."""
        return self.products if self.loose is None else self.products - self.loose

    def without(self, noise: Array) -> Sums:
        """The sums less what noise adds to one sample, (signals, signals)."""
        added = self.samples * noise
        loose = None if self.loose is None else self.loose - self.slack_samples * noise
        rest = None if self.rest is None else self.rest - self.rest_samples * noise
        return replace(self, products=self.products - added, loose=loose, rest=rest)

    def across(self, left: Array, pick: Pick, weights: EquationWeights, other: Pick) -> Array:
        """Weighted products of combinations of features with single ones, (m, n).

        Args:
            left: combinations, (m, k), of the features ``pick``. other: the single features, n of them.
        """
        result = np.zeros((len(left), len(other.rows)))
        for row in np.unique(other.rows):
            here = other.rows == row
            found = (left * weights.everywhere[pick.rows, row]) @ self.products[pick.signals]
            if self.loose is not None:
                found += (left * weights.where_slack[pick.rows, row]) @ self.loose[pick.signals]
            if weights.at_rest is not None and self.rest is not None:
                found += (left * weights.at_rest[pick.rows, row]) @ self.rest[pick.signals]
            result[:, here] = found[:, other.signals[here]]
        return result

    def among(self, pick: Pick, weights: EquationWeights) -> Array:
        """Weighted products of features with each other, (k, k), without what comes on top at rest."""
        found = pick.among(self.products) * feature_weights(weights.everywhere, pick.rows)
        if self.loose is not None:
            found += pick.among(self.loose) * feature_weights(weights.where_slack, pick.rows)
        return np.asarray(found)


def feature_weights(weights: Array, rows: IntArray) -> Array:
    """Weight of each product of features, (k, k)."""
    return weights.take(rows, axis=0).take(rows, axis=1)


def finer_of(one: float, other: float) -> float:
    """The smaller of what two stretches say of an encoder's step, which is one for all; 0 says nothing."""
    return min(one, other) if one > 0 and other > 0 else max(one, other)


def add_among(whole: Array, part: Array, live: IntArray | None) -> None:
    """Add products of the signals ``live`` alone, or of all, to those of all, (signals, signals), in place.

    By whole rows, of which most are zero then: numpy adds to scattered columns five times as slowly.
    """
    if live is None:
        whole += part
        return
    rows = np.zeros((len(live), len(whole)))
    rows[:, live] = part
    whole[live] += rows


def total(parts: Sequence[Sums]) -> Sums:
    """Their sum, one after the other: stacking them first would copy all of them."""
    result = empty(len(parts[0].products))
    for part in parts:
        result.add(part)
    return result


def empty(size: int) -> Sums:
    """Sums over no samples of ``size`` signals."""
    return Sums(np.zeros((size, size)))


@dataclass
class Part:
    """Sums over one or more stretches in which the same signals are ``live``, and of those alone.

    ``totals`` (3, live) as in :class:`RunTotals`; ``noise`` is None where nothing repeats.
    """

    live: IntArray
    sums: Sums
    totals: Array
    noise: Array | None = None
    noise_samples: float = 0.0


@dataclass(frozen=True)
class Cycle:
    """What comes again in a stretch of a run: its mean, and the harmonics of its cycle.

    Attributes:
        stretch: frequency, Hz, first and last sample, s, and number of samples: those of two runs can be
            compared where these agree.
        live: signals that are not all zero. harmonics: of these, orthonormal over the samples, (live, k);
            the first is the mean's.
    """

    stretch: tuple[float, float, float, int]
    live: IntArray
    harmonics: Array

    @property
    def samples(self) -> int:
        """Decimated samples of the stretch."""
        return self.stretch[3]


@dataclass
class RunSums:
    """Sums of signal products over one run.

    ``trends`` holds for each stretch that repeats its live signals and their slow trends, (live, degrees);
    ``senses`` what its free stretches say of the channels' signs; ``repairs`` counts samples that were put
    right, by channel, and ``samples`` all that were read.
    """

    run: str
    parts: list[Part] = field(default_factory=list)
    trends: list[tuple[IntArray, Array]] = field(default_factory=list)
    senses: list[ChannelSigns] = field(default_factory=list)
    facts: ChannelRatios | None = None  # what its channels say of each other; on a first reading
    encoder_variance: float = 0.0
    encoder_noise: tuple[float, ...] = (0.0, 0.0, 0.0)  # variance of angle, speed and acceleration
    state_products: list[Array] = field(default_factory=list)
    """Where no motion comes again: see ``state_law``, one for each block."""
    cycles: list[Cycle] = field(default_factory=list)
    """Of every stretch that repeats."""
    repairs: Counter[tuple[str, str]] = field(default_factory=Counter)
    samples: float = 0.0

    def add(self, part: Part) -> None:
        """Count another stretch; what is alike is added up, so that a long run takes no more room."""
        for mine in self.parts:
            if np.array_equal(mine.live, part.live) and (mine.noise is None) == (part.noise is None):
                mine.sums.add(part.sums)
                mine.totals += part.totals
                if mine.noise is not None and part.noise is not None:
                    mine.noise += part.noise
                mine.noise_samples += part.noise_samples
                return
        self.parts.append(part)

    def run_totals(self, number: int, signals: int) -> RunTotals:
        """Sums of all ``signals`` over the run, which has this ``number``."""
        values, counts = np.zeros((3, signals)), np.zeros(3)
        for part in self.parts:
            values[:, part.live] += part.totals
            counts += (part.sums.samples, part.sums.slack_samples, part.sums.rest_samples)
        return RunTotals(number, values, counts)


@dataclass
class Group:
    """Runs of one routing and phase: they share moment arms, losses and noise.

    ``noise`` (signals, signals) holds products of what does not repeat from cycle to cycle. ``dealt`` says of
    every fold which runs it holds; empty: every fold has its turn, all runs are of one condition.
    """

    key: GroupKey
    cable_sign: int
    folds: list[Sums]
    noise: Array
    noise_samples: float = 0.0
    encoder_variance: float = 0.0  # m^2 of cable: what a standing encoder's step leaves open
    encoder_noise: tuple[float, ...] = (0.0, 0.0, 0.0)  # variance of angle, speed and acceleration
    """What the step of an encoder that moves makes of its angle, speed and acceleration, squared, SI."""
    dealt: list[Fold] = field(default_factory=list)
    trends: dict[tuple[int, int], list[Array]] = field(default_factory=dict)
    """While runs are read: slow trends by condition and stretch, (signals, degrees) for each run."""
    state_products: list[list[Array]] = field(default_factory=list)
    """Of each run where no motion comes again: see ``state_law``."""
    cycles: dict[Hashable, list[Cycle]] = field(default_factory=dict)
    """Of runs that were told the same motion, by motion and stretch."""
    bounded: bool = False
    """Whether its noise is what no law of the state tells, since no motion comes again: a bound."""

    def __post_init__(self) -> None:
        self.dealt = self.dealt or [Fold(0, k) for k in range(len(self.folds))]

    @cached_property
    def whole(self) -> Sums:
        """Sums over all folds; asked for when all runs are in."""
        return total(self.folds)

    @property
    def conditions(self) -> list[int]:
        """The conditions that its runs were recorded under."""
        return sorted({fold.condition for fold in self.dealt})

    def of_turn(self, turn: int) -> list[int]:
        """Indices of the folds that are left out in this turn; none where nothing else would be left."""
        found = [k for k, fold in enumerate(self.dealt) if fold.turn == turn]
        return found if len(found) < len(self.folds) else []

    def without(self, k: int) -> Group:
        """The group less one of its folds."""
        folds, dealt = list(self.folds), list(self.dealt)
        del folds[k], dealt[k]
        return replace(self, folds=folds, dealt=dealt)

    def of_condition(self, condition: int) -> list[int]:
        """Indices of a condition's folds."""
        return [k for k, fold in enumerate(self.dealt) if fold.condition == condition]

    @property
    def repeats(self) -> bool:
        """Whether anything comes again in these runs or others, so that noise is told from what is missed."""
        return self.noise_samples > 0

    @property
    def repeated_cycles(self) -> list[list[Cycle]]:
        """Those that two runs or more have in common."""
        return [each for each in self.cycles.values() if len(each) > 1]

    @property
    def on_bench(self) -> bool:
        """Whether these are runs of the motor alone, which have the motor's equation and no other."""
        return self.cable_sign == 0

    @property
    def in_contact(self) -> bool:
        """Whether these are runs that press on the load cell."""
        return self.key[1] == "contact"

    @property
    def equations(self) -> int:
        """How many equations its runs have."""
        return 1 if self.on_bench else 3

    @property
    def samples(self) -> int:
        """Decimated samples in the group."""
        return sum(f.samples for f in self.folds)


@dataclass(frozen=True)
class PairSums:
    """Products of signals over two runs of one motion: before a known change, and with it.

    Where the cable is taut and the motor moves in both. The difference is over the root of two, so that it is
    as noisy as one run.

    Attributes:
        before, after: numbers of the two runs. group: that they belong to.
        difference: products of the difference. across: products of the difference with the runs' mean,
            (signals, signals). mean: products of the mean.
    """

    before: int
    after: int
    group: GroupKey
    difference: Sums
    across: Array
    mean: Array


@dataclass
class Reduced:
    """All that the diagnosis needs of the sessions; ``on_bench``: all runs are of the motor alone.

    ``constants`` are those that every run has of its own; None: none was found. ``fixed``: values that
    somebody holds unknowns of every model at, by key, SI. ``pairs`` are of runs before a known change of the
    machine and with it.
    """

    layout: Layout
    groups: list[Group]
    on_bench: bool
    radius: float  # of the pulley, m; 1 on a bench without one
    constants: RunConstants | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    pairs: tuple[PairSums, ...] = ()

    @property
    def floor_from(self) -> FloorFrom:
        """What the floor rests on, as in ``diagnose --json``; of runs it holds what cycles tell, too."""
        if not all(group.repeats and not group.bounded for group in self.groups):
            return "state law"
        return "runs" if any(group.repeated_cycles for group in self.groups) else "cycles"
