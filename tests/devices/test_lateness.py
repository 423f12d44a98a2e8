"""Lateness without knowing when the card began, against clocks that differ and clocks that are set."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.devices.protocol import LatenessMeter


def test_jitter_is_measured_against_the_most_punctual_cycle() -> None:
    rng = np.random.default_rng(1)
    late = rng.exponential(5e-5, 5000)
    late[3000] = 0.004
    meter = LatenessMeter(1000.0)
    seen = np.array([meter.late_by(k, 17.0 + k / 1000 + late[k]) for k in range(5000)])
    assert (seen >= 0).all()
    np.testing.assert_allclose(seen[1000:], late[1000:], atol=2e-5)
    assert seen[3000] == pytest.approx(0.004, abs=2e-5)


@pytest.mark.parametrize("ppm", [-100, 100])
def test_clocks_that_differ_do_not_add_up_to_lateness(ppm: float) -> None:
    """An hour at 100 ppm would be 360 ms."""
    meter = LatenessMeter(1000.0)
    seen = [meter.late_by(k, k / 1000 * (1 + ppm * 1e-6)) for k in range(0, 3_600_000, 10)]
    assert max(seen) < 1e-5


def test_lost_cycles_are_not_lateness() -> None:
    meter = LatenessMeter(1000.0)
    for k in range(100):
        meter.late_by(k, k / 1000)
    assert meter.late_by(150, 0.150) == pytest.approx(0.0, abs=2e-5)


@pytest.mark.parametrize("step", [-3600.0, 3600.0])
def test_a_clock_that_is_set_disturbs_one_cycle_at_most(step: float) -> None:
    meter = LatenessMeter(1000.0)
    seen = [meter.late_by(k, k / 1000 + (step if k >= 50 else 0.0)) for k in range(100)]
    assert max(seen[:50]) == 0.0
    assert max(seen[51:]) == 0.0
    assert seen[50] == pytest.approx(max(step, 0.0), abs=1e-4)
