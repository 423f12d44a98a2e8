"""The position loop's margins, computed from the plant alone, and what its feed-forward learns."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.linalg import expm

from fingerlab.acquisition.control.motion import GAIN_RANGES, LARGEST_SLOPE, FeedForward, Gains, slowed

PER_AMP = 0.0302 * 4.3  # N m/A at the output: maxon's data sheets of motor and gearbox
BENCHES = tuple(itertools.product((2.6e-4, 4.0e-4), (0.0, 0.08, 0.15)))  # kg m^2, N m/rad at the output
LAG_S, VISCOUS = 5e-4, 5e-5  # current loop of 300 Hz; N m s/rad


def plant(inertia: float, stiffness: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle, speed and current after ``seconds`` of a held command: transition and input."""
    rates = np.zeros((4, 4))
    rates[0, 1] = 1.0
    rates[1, :3] = np.array([-stiffness, -VISCOUS, PER_AMP]) / inertia
    rates[2, 2], rates[2, 3] = -1.0 / LAG_S, 1.0 / LAG_S
    moved = expm(rates * seconds)
    return moved[:3, :3], moved[:3, 3]


def closed(gains: Gains, period: float, inertia: float, stiffness: float) -> tuple[float, float]:
    """Largest root of the closed loop, and the most by which it multiplies a disturbance.

    A command acts a sample (1 ms) after the newest sample that it was computed from.
    """
    whole, _ = plant(inertia, stiffness, period)
    rest, now = plant(inertia, stiffness, period - 1e-3)
    before = rest @ plant(inertia, stiffness, 1e-3)[1]
    share = 1.0 - math.exp(-2.0 * math.pi * gains.derivative_cutoff_hz * period)
    rate = gains.derivative * share / period
    # Angle, speed, current; the last command, the integral, the rate (A), the last angle.
    roots = np.zeros((7, 7))
    command = np.array([-gains.proportional - rate, 0, 0, 0, 1.0, 1.0 - share, rate])
    roots[:3, :3], roots[:3, 3] = whole, before
    roots[:3] += np.outer(now, command)
    roots[3] = command
    roots[4, 4], roots[4, 0] = 1.0, -gains.integral * period
    roots[5, 5], roots[5, 0], roots[5, 6] = 1.0 - share, -rate, rate
    roots[6, 0] = 1.0
    z = np.exp(1j * np.geomspace(0.5, math.pi / period * 0.9999, 1000) * period)
    slope = rate * (1.0 - 1.0 / z) / (1.0 - (1.0 - share) / z)
    control = gains.proportional + slope + gains.integral * period / (z - 1.0)
    steps = np.linalg.inv(z[:, None, None] * np.eye(3) - whole)[:, 0, :]
    motion = steps @ now + (steps @ before) / z
    return float(np.abs(np.linalg.eigvals(roots)).max()), float(np.abs(1.0 / (1.0 + control * motion)).max())


def corners() -> list[Gains]:
    return [
        Gains(*three) for three in itertools.product(*((low, high) for low, high, _ in GAIN_RANGES.values()))
    ]


@pytest.mark.parametrize("cycles", [1, 5, 10])
def test_wherever_the_gains_may_stand_the_loop_is_steady_with_margins(cycles: int) -> None:
    """Sensitivity below 2.5: a phase margin of 23 degrees and a gain margin of 1.67 at least."""
    for gains, most in [*((corner, 2.5) for corner in corners()), (Gains(), 2.1)]:
        used = gains if cycles == 1 else slowed(gains, cycles)
        for inertia, stiffness in BENCHES:
            root, sensitivity = closed(used, 1e-3 * cycles, inertia, stiffness)
            assert root < 1.0 + 1e-9  # exactly 1: an integral without gain
            assert sensitivity < most, (gains, inertia, stiffness)


def test_the_feed_forward_learns_what_a_spring_and_a_mass_ask_for_and_no_more() -> None:
    period, inertia = 0.01, 0.002
    time = np.arange(0.0, 20.0, period)
    angle = 0.4 + 0.25 * np.sin(2.0 * np.pi * time)
    acceleration = -((2.0 * np.pi) ** 2) * 0.25 * np.sin(2.0 * np.pi * time)

    def learned(stiffness: float) -> tuple[float, np.ndarray]:
        feed, needed = FeedForward(period, inertia), stiffness * angle + inertia * acceleration + 0.3
        more = [
            feed.more(angle[k], needed[k], angle[k + 1], acceleration[k + 1]) for k in range(len(time) - 1)
        ]
        return feed.slope, np.array(more) - np.diff(needed)

    slope, miss = learned(0.8)
    assert slope == pytest.approx(0.8, rel=0.01)
    assert np.abs(miss[-200:]).max() < 0.01 * 2.0 * np.pi * 0.25 * 0.8 * period
    assert learned(-0.5)[0] == 0.0
    assert learned(50.0)[0] == LARGEST_SLOPE
    still = FeedForward(period, 0.0)
    rng = np.random.default_rng(0)
    for _ in range(2000):  # counts of the encoder and noise of the current tell nothing of a spring
        still.more(math.radians(0.042) * rng.integers(0, 2), 0.02 * rng.standard_normal(), 0.0, 0.0)
    assert still.slope < 0.3
