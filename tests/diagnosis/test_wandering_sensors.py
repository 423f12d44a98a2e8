"""Sensors that wander slowly are no unknown law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from fingerlab.diagnosis import diagnose
from fingerlab.sessions.model import Array, Run, Session

from . import closed_form as made

WANDER_RAD, REMEMBERS_S = 5e-4, 2.0
"""One standard deviation of an angle's slow error, and its time constant; some 0.03 degrees."""


def with_angle_errors(run: Run, mcp: Array, pip: Array) -> Run:
    channels = run.load()
    channels["mcp_angle"] = channels["mcp_angle"] + mcp
    channels["pip_angle"] = channels["pip_angle"] + pip
    return Run.from_arrays(
        channels, name=run.name, phase=run.phase, cable=run.cable, sample_rate_hz=run.sample_rate_hz,
        trajectory=run.trajectory,
    )  # fmt: skip


def wandering(rng: np.random.Generator, run: Run) -> Array:
    """A first-order Gauss-Markov process of one run, rad, (n,)."""
    kept = float(np.exp(-1.0 / (REMEMBERS_S * run.sample_rate_hz)))
    steps = WANDER_RAD * np.sqrt(1.0 - kept**2) * rng.standard_normal(run.length)
    steps[0] = WANDER_RAD * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -kept], steps))


def wandered(seed: int) -> Session:
    rng, plain = np.random.default_rng(seed), made.session(made.Bench())
    runs = tuple(with_angle_errors(run, wandering(rng, run), wandering(rng, run)) for run in plain.runs)
    return replace(plain, runs=runs)


@pytest.mark.parametrize("seed", [1, 3])
def test_a_plain_bench_whose_sensors_wander_lacks_nothing(seed: int) -> None:
    """Much of such noise is a constant of each run, which no cycle tells; it had left 1.25 and 1.3 floors."""
    said = diagnose([wandered(seed)], with_curves=False)
    assert said.verdict == "nothing_missing"
    assert said.score < 1.15
    assert said.constants is not None
    assert 0.2 * WANDER_RAD < said.constants.spreads[0] < WANDER_RAD
