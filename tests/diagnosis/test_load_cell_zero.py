"""The load cell's zero where it is seen: in the air, and while a tip that presses is clear of it.

Runs are written down from the finger's geometry: the tip goes up and down in a sine, and the cell reads a
spring's force below its face and its zero above.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from fingerlab.diagnosis.signals.load_cell_zero import (
    SeenZeros,
    zero_while_clear,
    zeros_in_the_air,
    zeros_while_clear,
)
from fingerlab.diagnosis.signals.reading_errors import FORCE, ReadingError
from fingerlab.sessions.model import Run, Session
from tests.effects.moving import FINGER

from . import closed_form as made

RATE, SECONDS = 500.0, 10.0


def pressing(
    zero: float, stiffness: float = 2e4, middle_m: float = 0.0, name: str = "001", noise: float = 0.01
) -> Run:
    """A tip 1 mm up and down about ``middle_m`` below the cell's face, a spring of N/m under it."""
    rng = np.random.default_rng(3)
    time = np.arange(int(RATE * SECONDS)) / RATE
    depth = middle_m + 1e-3 * np.sin(2 * np.pi * time)
    mcp = np.full_like(time, 0.3)
    reach = 2 * FINGER.proximal_half_length * np.sin(0.3 - FINGER.wrist_angle)
    at = 2 * FINGER.distal_half_length * np.sin(0.6 - FINGER.wrist_angle) + reach
    pip = np.arcsin((at + depth - reach) / (2 * FINGER.distal_half_length)) + FINGER.wrist_angle - mcp
    force = zero + stiffness * np.maximum(depth, 0.0) + noise * rng.standard_normal(len(time))
    still = np.zeros_like(time)
    channels = {
        "time": time, "motor_position": still, "motor_torque": still, "mcp_angle": mcp, "pip_angle": pip,
        FORCE: force,
    }  # fmt: skip
    return Run.from_arrays(channels, name=name, phase="contact", cable="flexion", sample_rate_hz=RATE)


def test_a_tip_that_lets_go_shows_the_zero() -> None:
    """Half of the time it is clear: 2,500 readings with a noise of 10 mN."""
    seen = zero_while_clear(pressing(0.12), FINGER)
    assert seen is not None
    assert seen[0] == pytest.approx(0.12, abs=0.002)
    assert seen[1] == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize(("stiffness", "middle_m"), [
    (2e4, 2e-3),  # it presses all along
    (300.0, 2e-3),  # and gives by as much as another one lifts
])  # fmt: skip
def test_one_that_presses_all_along_shows_none(stiffness: float, middle_m: float) -> None:
    assert zero_while_clear(pressing(0.12, stiffness, middle_m), FINGER) is None


def test_a_soft_tip_that_rests_before_it_moves_shows_none() -> None:
    """It rests at its least force, further back than wherever it is certain to press. Seen before: 0.7 N."""
    moving = pressing(0.12, 1300.0, 2e-3)
    rest = 2 * int(RATE)
    low = int(0.75 * RATE)
    channels = {
        name: np.concatenate([np.full(rest, values[low]), values[low:]])
        for name, values in moving.load().items()
    }
    channels["time"] = np.arange(len(channels["mcp_angle"])) / RATE
    noise = 1e-2 * np.random.default_rng(4).standard_normal(rest)
    channels[FORCE][:rest] = 0.12 + 1300.0 * 1e-3 + noise
    soft = Run.from_arrays(channels, name="001", phase="contact", cable="flexion", sample_rate_hz=RATE)
    assert zero_while_clear(soft, FINGER) is None


def _session(*runs: Run) -> Session:
    rig = replace(made.RIG, finger=FINGER)
    return replace(made.session(made.Bench(), contact=0), runs=runs, rig=rig)


def test_zeros_are_told_beside_what_is_taken_off_all_runs() -> None:
    """0.3 N of all runs is known; a share of the span is missing of what is left."""
    session = _session(pressing(1.3, name="001"), pressing(0.2, name="002"))
    found = zeros_while_clear([session], {FORCE: ReadingError(zero=0.3, gain=0.1)})
    each = [found[str(session.path), name][FORCE].zero for name in ("001", "002")]
    assert each == pytest.approx([1.1 * 1.0, 1.1 * -0.1], abs=0.003)


def test_a_cell_that_stands_is_left_as_it_is() -> None:
    assert zeros_while_clear([_session(pressing(0.05), pressing(-0.05, name="002"))], {}) == {}


def _in_the_air(zeros: list[float]) -> list[Run]:
    rng = np.random.default_rng(4)
    found = []
    for zero in zeros:
        channels = pressing(0.0).load()
        channels[FORCE] = zero + 0.01 * rng.standard_normal(len(channels["time"]))
        found.append(
            Run.from_arrays(channels, name="1", phase="on_air", cable="flexion", sample_rate_hz=RATE)
        )
    return found


def test_readings_in_the_air_tell_how_far_the_zero_moves() -> None:
    zeros = [0.05, -0.11, 0.02, 0.2]
    seen = zeros_in_the_air([*_in_the_air(zeros), pressing(0.0, middle_m=2e-3)])
    assert seen is not None
    assert seen.contrasts == 3
    assert seen.square == pytest.approx(3 * np.var(zeros, ddof=1), rel=0.05)
    assert zeros_in_the_air([pressing(0.0)]) is None


def test_the_density_of_what_was_seen_is_a_normal_ones() -> None:
    """Of independent differences, against zeros that stand: the ratio of two normal densities."""
    differences, resolved = np.array([0.04, -0.1, 0.07]), 0.01
    seen = SeenZeros(3, float(np.sum(differences**2)), resolved)
    for spread in (0.0, 0.03, 0.2):
        moved, stands = (
            norm.logpdf(differences, scale=one) for one in (np.hypot(spread, resolved), resolved)
        )
        expected = np.sum(moved - stands)
        assert seen.log_density(spread) == pytest.approx(expected, abs=1e-9)
