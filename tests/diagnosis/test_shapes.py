"""Loops, autocorrelation, spectrum and the full-rate trace, against signals that are known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.answer.error_parts import Comparison
from fingerlab.diagnosis.answer.residual_profiles import (
    angle_loop,
    autocorrelation,
    full_rate,
    spectrum,
    tension_loop,
)
from fingerlab.sessions.model import Array, Run

RATE, SECONDS, LINE_HZ, SIZE, FLOOR = 25.0, 40.0, 1.5, 3e-3, 2e-4


def comparison(residual: Array, time: Array, equation: str = "pip_torque") -> Comparison:
    """A spring of 0.05 N m/rad that swings at 0.5 Hz, and what is missed beside it."""
    angle = 0.3 * np.sin(np.pi * time)
    modelled = 0.05 * angle
    places = {"joint angle pip": angle, "tension": 2.0 + angle}
    return Comparison(
        equation,
        "S.h5",
        "001",
        "on_air",
        time,
        modelled + residual,
        modelled,
        "N m",
        FLOOR,
        coordinates=places,
    )


@pytest.fixture
def time() -> Array:
    return np.arange(0.0, SECONDS, 1.0 / RATE)


def test_the_loops_are_measured_and_modelled_over_their_places(time: Array) -> None:
    one = comparison(SIZE * np.sign(np.cos(np.pi * time)), time)
    found = angle_loop(one)
    assert found is not None
    assert found.across == ("PIP angle", "rad")
    angle, measured = found.curves["measured"]
    _, modelled = found.curves["modelled"]
    middle = np.abs(angle) < 0.05
    # Friction opens the loop by twice its size where the spring is at rest.
    assert np.ptp(measured[middle]) == pytest.approx(2 * SIZE + 0.05 * np.ptp(angle[middle]), rel=0.05)
    assert np.ptp(modelled[middle]) == pytest.approx(0.05 * np.ptp(angle[middle]))
    over = tension_loop(one)
    assert over is not None
    np.testing.assert_allclose(over.curves["measured"][0], 2.0 + angle, rtol=1e-12)
    alone = {name: values for name, values in one.coordinates.items() if not name.startswith("joint")}
    assert tension_loop(replace(one, coordinates=alone)) is None  # of a motor it is the torque over itself


def test_a_line_comes_again_after_its_period_and_noise_does_not(time: Array) -> None:
    periodic = autocorrelation(comparison(SIZE * np.sin(2 * np.pi * LINE_HZ * time), time))
    noise = autocorrelation(comparison(np.random.default_rng(3).normal(0, SIZE, len(time)), time))
    assert periodic is not None
    assert noise is not None
    lag, alike = periodic.curves["residual"]
    assert alike[0] == pytest.approx(1.0)
    # After two periods as at once, less what of the record has no partner; after half of one opposite.
    later = int(np.argmin(np.abs(lag - 2 / LINE_HZ)))
    assert alike[later] == pytest.approx(1.0 - 2 / LINE_HZ / SECONDS, abs=0.03)
    assert alike[int(np.argmin(np.abs(lag - 0.5 / LINE_HZ)))] < -0.9
    assert periodic.chance < 0.2
    assert np.mean(np.abs(noise.curves["residual"][1][5:]) < noise.chance) > 0.95


def test_the_spectrum_has_the_line_with_its_size(time: Array) -> None:
    found = spectrum(comparison(SIZE * np.sin(2 * np.pi * LINE_HZ * time), time))
    assert found is not None
    frequency, density = found.curves["residual"]
    assert frequency[np.argmax(density)] == pytest.approx(LINE_HZ, abs=0.06)
    power = np.trapezoid(density**2, frequency)
    assert power == pytest.approx(SIZE**2 / 2, rel=0.05)  # a sine's mean square
    assert found.curves["floor"][1] == pytest.approx(FLOOR / np.sqrt(8.0))  # white up to 8 Hz
    assert found.up[1] == "N m/√Hz"


def test_too_little_is_told_as_nothing(time: Array) -> None:
    gap = np.where(np.arange(len(time)) % 30 == 0, np.nan, 1e-3)
    assert autocorrelation(comparison(gap, time)) is None
    assert spectrum(comparison(gap, time)) is None


def test_the_full_rate_trace_is_the_channel_times_its_arm(time: Array) -> None:
    fine = np.arange(0.0, SECONDS, 1e-3)
    arm_over_radius, noise = 0.008 / 0.015, np.random.default_rng(1).normal(0, 2e-3, len(fine))
    torque = 0.05 * 0.3 * np.sin(np.pi * fine) / arm_over_radius + noise
    run = Run.from_arrays(
        {"time": fine, "motor_torque": torque, "motor_position": noise}, name="001", phase="on_air",
        cable="flexion", sample_rate_hz=1000.0,
    )  # fmt: skip
    found = full_rate(comparison(np.zeros(len(time)), time), run)
    assert found is not None
    np.testing.assert_allclose(found[0], fine)
    assert float(found[1] @ torque / (torque @ torque)) == pytest.approx(arm_over_radius, rel=0.02)
    # A channel that is not what was measured is not drawn as if it were.
    assert full_rate(comparison(np.zeros(len(time)), time, "cable_kinematics"), run) is None
