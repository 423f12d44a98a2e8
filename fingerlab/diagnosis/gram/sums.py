"""Products of signals by groups of runs.

A signal may stand in several equations (the tension in all three), so that far fewer signals than features
need to be filtered and multiplied. What an equation sees of them depends on the cable: the cable equation
says nothing at moments when the cable may be slack.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from fingerlab.diagnosis.equations.features import FeatureSet, Layout
from fingerlab.diagnosis.gram.run_constants import EquationWeights, RunConstants, RunTotals, by_run
from fingerlab.diagnosis.signals.channel_checks import ChannelRatios
from fingerlab.diagnosis.signals.conditions import Fold, GroupKey
from fingerlab.diagnosis.signals.segments import ChannelSigns
from fingerlab.sessions.model import Array, IntArray

FloorFrom = Literal["cycles", "runs", "state law"]
"""Repeated cycles, these and repeated commands, or what a law of the measured state leaves."""


@dataclass
class Sums:
    """Products of signals over some samples.

    ``products`` (signals, signals) counts all samples, ``slack`` those where the cable may be slack (None:
    there are none), ``rest`` those where the motor stands and the cable is taut: ``rest_samples`` of them, in
    so many different ``standstills``: one that comes again in each cycle of a motion is one.
    """

    products: Array
    slack: Array | None = None
    taut_samples: int = 0
    slack_samples: int = 0
    rest: Array | None = None
    rest_samples: int = 0
    standstills: float = 0.0
    runs: list[str] = field(default_factory=list)  # names of the runs that hold the samples
    totals: list[RunTotals] = field(default_factory=list)  # of every one of them

    @property
    def samples(self) -> int:
        return self.taut_samples + self.slack_samples

    def add(self, other: Sums, live: IntArray | None = None) -> None:
        """Count the samples of ``other`` too; it may hold the products of the signals ``live`` alone."""
        add_among(self.products, other.products, live)
        if other.slack is not None:
            if self.slack is None:
                self.slack = np.zeros_like(self.products)
            add_among(self.slack, other.slack, live)
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

    def of(self, pick: FeatureSet, noise: Array | None = None, taut_noise: Array | None = None) -> Array:
        """Products of features, (k, k), as the equations see them: none of the cable at slack moments.

        Args:
            noise: what it adds to the features' products at one sample, (k, k), to be taken away.
            taut_noise: the same at a taut moment; None: no other.
        """
        found = pick.among(self.products)
        if self.slack is not None:
            found -= pick.among(self.slack) * pick.in_cable
        if noise is not None:
            taut = noise if taut_noise is None else taut_noise
            found -= np.where(pick.in_cable, self.taut_samples * taut, self.samples * noise)
        return found

    def slack_cable(self, pick: FeatureSet) -> Array | None:
        """Products of the cable equation's features at slack moments, (k, k); None: there are none."""
        return None if self.slack is None else pick.among(self.slack) * pick.both_cable

    def at_rest(self, pick: FeatureSet, noise: Array | None = None) -> Array | None:
        """Products of features where the motor stands, (k, k), less noise; None: it never does."""
        if self.rest is None:
            return None
        found = pick.among(self.rest)
        return found if noise is None else found - self.rest_samples * noise

    def taut(self) -> Array:
        """Products where the cable is taut, (signals, signals)."""
        return self.products if self.slack is None else self.products - self.slack

    def without(self, noise: Array) -> Sums:
        """The sums less what noise adds to one sample, (signals, signals)."""
        added = self.samples * noise
        slack = None if self.slack is None else self.slack - self.slack_samples * noise
        rest = None if self.rest is None else self.rest - self.rest_samples * noise
        return replace(self, products=self.products - added, slack=slack, rest=rest)

    def across(self, left: Array, pick: FeatureSet, weights: EquationWeights, other: FeatureSet) -> Array:
        """Weighted products of combinations of features with single ones, (m, n).

        Args:
            left: combinations, (m, k), of the features ``pick``. other: the single features, n of them.
        """
        result = np.zeros((len(left), len(other.rows)))
        for row in np.unique(other.rows):
            here = other.rows == row
            found = (left * weights.everywhere[pick.rows, row]) @ self.products[pick.signals]
            if self.slack is not None:
                found += (left * weights.where_slack[pick.rows, row]) @ self.slack[pick.signals]
            if weights.at_rest is not None and self.rest is not None:
                found += (left * weights.at_rest[pick.rows, row]) @ self.rest[pick.signals]
            result[:, here] = found[:, other.signals[here]]
        return result

    def among(self, pick: FeatureSet, weights: EquationWeights) -> Array:
        """Weighted products of features with each other, (k, k), without what comes on top at rest."""
        found = pick.among(self.products) * feature_weights(weights.everywhere, pick.rows)
        if self.slack is not None:
            found += pick.among(self.slack) * feature_weights(weights.where_slack, pick.rows)
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

    ``totals`` (3, live) as in :class:`RunTotals`; ``noise`` is None where nothing repeats. ``split``: in
    which it is left out, where the run it is of is one of few.
    """

    live: IntArray
    sums: Sums
    totals: Array
    noise: Array | None = None
    noise_samples: float = 0.0
    split: int = 0


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
            alike = mine.split == part.split and (mine.noise is None) == (part.noise is None)
            if alike and np.array_equal(mine.live, part.live):
                mine.sums.add(part.sums)
                mine.totals += part.totals
                if mine.noise is not None and part.noise is not None:
                    mine.noise += part.noise
                mine.noise_samples += part.noise_samples
                return
        self.parts.append(part)

    def add_to(self, fold: Sums, number: int, split: int | None = None) -> None:
        """Count in ``fold`` the run, which has this ``number``, or what of it is left out in a ``split``."""
        values, counts = np.zeros((3, len(fold.products))), np.zeros(3)
        parts = [part for part in self.parts if split is None or part.split == split]
        for part in parts:
            fold.add(part.sums, part.live)
            values[:, part.live] += part.totals
            counts += (part.sums.samples, part.sums.slack_samples, part.sums.rest_samples)
        if parts:
            fold.runs.append(self.run)
            fold.totals.append(RunTotals(number, values, counts))


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
    in_parts: bool = False
    """Whether a fold is no run or some, but a part of each of the few runs of a condition."""

    def __post_init__(self) -> None:
        self.dealt = self.dealt or [Fold(0, k) for k in range(len(self.folds))]

    @cached_property
    def whole(self) -> Sums:
        """Sums over all folds; asked for when all runs are in."""
        return total(self.folds)

    @property
    def run_totals(self) -> list[RunTotals]:
        """Sums of the signals over every run, in order."""
        return by_run([one for fold in self.folds for one in fold.totals])

    @property
    def independent_runs(self) -> int:
        """Its runs; of more than are held out one by one, its folds."""
        return len(self.run_totals) if self.in_parts else len(self.dealt)

    @property
    def conditions(self) -> list[int]:
        """The conditions that its runs were recorded under."""
        return sorted({fold.condition for fold in self.dealt})

    def of_split(self, split: int) -> list[int]:
        """Indices of the folds that are left out in this split; none where nothing else would be left."""
        found = [k for k, fold in enumerate(self.dealt) if fold.split == split]
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


@dataclass(frozen=True)
class TorqueNoise:
    """How much of what no law of the state tells of a motor's torque is noise, and what tells the rest.

    Attributes:
        share: of the variance, 0 to 1.
        told_by: a law with ``memory``, or one of each of the ``runs``; "": there is no rest.
    """

    share: float = 1.0
    told_by: Literal["", "memory", "runs"] = ""


ALL_NOISE = TorqueNoise()


@dataclass
class Reduced:
    """All that the diagnosis needs of the sessions; ``on_bench``: all runs are of the motor alone.

    ``constants`` are those that every run has of its own; None: none was found. ``fixed``: values that
    somebody holds unknowns of every model at, by key, SI. ``pairs`` are of runs before a known change of the
    machine and with it. ``torque_noise``: how much is noise of what no law of the state tells of a motor's
    torque.
    ``late_is_no_noise``: whether that law tells what a torque adds which is logged late.
    """

    layout: Layout
    groups: list[Group]
    on_bench: bool
    radius: float  # of the pulley, m; 1 on a bench without one
    constants: RunConstants | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    pairs: tuple[PairSums, ...] = ()
    torque_noise: TorqueNoise = ALL_NOISE
    late_is_no_noise: bool = False

    @property
    def floor_from(self) -> FloorFrom:
        """What the floor rests on, as in ``diagnose --json``; of runs it holds what cycles tell, too."""
        if not all(group.repeats and not group.bounded for group in self.groups):
            return "state law"
        return "runs" if any(group.repeated_cycles for group in self.groups) else "cycles"
