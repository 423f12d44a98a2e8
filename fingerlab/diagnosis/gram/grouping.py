"""Runs dealt to groups and their folds, and what of their noise is a trend that all have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.equations.features import Layout
from fingerlab.diagnosis.gram.sums import Group, RunSums, add_among, empty, finer_of
from fingerlab.diagnosis.signals.conditions import Fold, group_key
from fingerlab.sessions.model import Array, Run


def shared_motions(motions: Sequence[int | None]) -> list[int | None]:
    """Those that several runs were told, for each run; None: no other was."""
    return [motion if motions.count(motion) > 1 else None for motion in motions]


def empty_group(run: Run, layout: Layout, dealt: list[Fold]) -> Group:
    size = layout.signal_count
    folds = [empty(size) for _ in dealt]
    return Group(group_key(run), run.cable_sign, folds, np.zeros((size, size)), dealt=dealt)


def add_few(
    group: Group, found: Sequence[tuple[int, RunSums]], places: Sequence[int], motions: Sequence[int | None]
) -> None:
    """Add the few runs of a group, by their numbers: where no motion comes again, by parts."""
    group.in_parts = all(part.noise is None for _, sums in found for part in sums.parts)
    conditions, size = [fold.condition for fold in group.dealt], len(group.noise)
    if group.in_parts:
        splits = sorted({part.split for _, sums in found for part in sums.parts})
        group.dealt = [Fold(c, split) for c in sorted(set(conditions)) for split in splits]
        group.folds = [empty(size) for _ in group.dealt]
    for number, sums in found:
        add_run(group, places[number], sums, number, motions[number], conditions[places[number]])


def add_run(
    group: Group, k: int, found: RunSums, number: int, motion: int | None, condition: int | None = None
) -> None:
    """Add the run of this number to fold ``k`` of its group, or its parts to those of its ``condition``."""
    if group.in_parts:
        for fold, dealt in zip(group.folds, group.dealt, strict=True):
            if dealt.condition == condition:
                found.add_to(fold, number, dealt.split)
    else:
        found.add_to(group.folds[k], number)
    for part in found.parts:
        if part.noise is not None:
            add_among(group.noise, part.noise, part.live)
            group.noise_samples += part.noise_samples
    for number, (live, trend) in enumerate(found.trends):
        whole = np.zeros((len(group.noise), trend.shape[1]))
        whole[live] = trend
        group.trends.setdefault((group.dealt[k].condition, number), []).append(whole)
    for cycle in found.cycles if motion is not None else ():
        group.cycles.setdefault((motion, cycle.stretch), []).append(cycle)
    group.encoder_variance = finer_of(group.encoder_variance, found.encoder_variance)
    group.encoder_noise = tuple(map(finer_of, group.encoder_noise, found.encoder_noise))
    group.state_products += [found.state_products] if found.state_products else []


def remove_common_trend(group: Group) -> None:
    """Takes out of a group's noise the slow trend that the runs of a condition have in common.

    A trend (a sensor that warms up, a spring that creeps) is no noise if it comes again in every run: it can
    be explained. Its noise is what it differs by from run to run. Only in free motion: how a tip settles on
    the load cell comes again, too, and no law here tells it.
    """
    for trends in _comparable(group):
        count = len(trends)
        if count < 2 or group.in_contact:
            continue
        runs = np.stack(trends)  # (runs, signals, degrees)
        mean = runs.mean(axis=0)
        apart = (runs - mean).transpose(1, 0, 2).reshape(mean.shape[0], -1)
        group.noise += apart @ apart.T / (count - 1) - count * mean @ mean.T
    group.trends.clear()


def _comparable(group: Group) -> list[list[Array]]:
    """Trends of runs that can be compared: those of one condition, and of all conditions with one run."""
    repeated = [trends for trends in group.trends.values() if len(trends) > 1]
    alone: dict[int, list[Array]] = {}
    for (_, stretch), trends in group.trends.items():
        if len(trends) == 1:
            alone.setdefault(stretch, []).extend(trends)
    return [*repeated, *alone.values()]
