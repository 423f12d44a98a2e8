"""Noise of runs that do not repeat: what is known of the same sensors from other runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.diagnosis.features import Layout
from fingerlab.diagnosis.groups import Group, Reduced
from fingerlab.diagnosis.shifts import NO_SHIFT
from fingerlab.effects.base import Row


def fill_missing_noise(reduced: Reduced) -> None:
    """Groups without a repeated cycle take the noise of the others with the same equations, per sample.

    A bench that never repeats takes that of the current, which is the same in a finger's runs.
    """
    for on_bench in (False, True):
        alike = [g for g in reduced.groups if g.on_bench == on_bench]
        known = [g for g in alike if g.noise_samples > 0]
        if known:
            total = sum(g.noise_samples for g in known)
            pooled = sum((g.noise for g in known[1:]), known[0].noise) / total
            _give(alike, pooled * total, total)
        elif on_bench and alike:
            variance = torque_noise(reduced)
            signal = _signal(reduced.layout, Row.BENCH, None)
            noise = np.zeros((reduced.layout.signal_count,) * 2)
            noise[signal, signal] = variance
            _give(alike if variance > 0 else [], noise, 1.0)


def torque_noise(reduced: Reduced) -> float:
    """Variance of the motor's torque that does not repeat in a finger's runs, (N m)^2; 0: not known."""
    known = [g for g in reduced.groups if g.noise_samples > 0 and not g.on_bench]
    if not known:
        return 0.0
    signal = _signal(reduced.layout, Row.MCP, NO_SHIFT)
    pull = min(float(g.noise[signal, signal]) / g.noise_samples for g in known)
    return max(pull, 0.0) * reduced.radius**2


def _give(groups: Sequence[Group], noise: np.ndarray, samples: float) -> None:
    for group in groups:
        if group.noise_samples <= 0:
            group.noise, group.noise_samples = noise.copy(), samples


def _signal(layout: Layout, row: Row, shift: int | None) -> int:
    """The signal of the motor's torque as an equation has it."""
    return next(
        int(layout.signals[i])
        for i in layout.base
        if (f := layout.features[i]).row == row and f.constant == -1.0 and f.shift == shift
        and f.scale == "direct"
    )  # fmt: skip
