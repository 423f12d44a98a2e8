"""How far a found torque is to be trusted after practice, and up to which frequency a motion is followed."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.prediction.feed_forward import best_share, motion_cutoff, smooth
from fingerlab.prediction.inverse import solved_torque
from fingerlab.prediction.target import wanted_force

TIME = np.arange(2000) / 250.0  # s
WAVE, OTHER = np.sin(np.pi * TIME), np.sin(7.0 * np.pi * TIME)


def test_a_found_torque_that_misses_nothing_is_sent_whole() -> None:
    assert best_share(0.05 * WAVE + 0.02, np.zeros(2000)) == pytest.approx(1.0)


def test_one_that_misses_as_much_the_other_way_is_sent_by_half() -> None:
    assert best_share(0.05 * WAVE, -0.05 * WAVE + 0.1) == pytest.approx(0.5)  # a constant is trimmed away


def test_one_that_only_adds_an_error_of_its_own_is_not_sent() -> None:
    assert best_share(0.05 * WAVE, 0.05 * WAVE + 0.05 * OTHER) == pytest.approx(0.0)


def test_one_that_hardly_helps_is_not_sent() -> None:
    assert best_share(0.05 * WAVE, 0.046 * WAVE) == 0.0  # 8 % less
    assert best_share(0.05 * WAVE, 0.04 * WAVE) == pytest.approx(1.0)  # 20 % less


def test_a_motion_is_followed_up_to_harmonics_of_what_is_wanted() -> None:
    sine = {"kind": "sine", "mean_n": 1.0, "amplitude_n": 0.4, "duration_s": 8.0}
    assert motion_cutoff(wanted_force({**sine, "frequency_hz": 0.3})) == 5.0
    assert motion_cutoff(wanted_force({**sine, "frequency_hz": 3.0})) == 8.0
    swing = smooth(np.sin(2.0 * np.pi * 9.2 * TIME), 5.0)  # of a soft cable
    assert np.abs(swing[500:1500]).max() < 0.01
    asked = smooth(np.sin(2.0 * np.pi * 0.5 * TIME), 5.0)
    assert asked[500:1500] == pytest.approx(np.sin(2.0 * np.pi * 0.5 * TIME)[500:1500], abs=2e-3)


def test_a_torque_is_found_beside_a_kink_and_not_where_nothing_presses() -> None:
    def force(torque: np.ndarray) -> np.ndarray:
        return np.where(torque < 0.05, 4.0 * torque, 0.2 + 14.0 * (torque - 0.05))

    wished = np.linspace(0.1, 1.5, 50)
    torque, _ = solved_torque(force, wished, "M.json", 1.0)
    assert force(torque) == pytest.approx(wished, abs=1e-4)
    with pytest.raises(UserError, match=r"presses with the wanted force \(0\.5 N are missing\)"):
        solved_torque(lambda torque: np.minimum(10.0 * torque, 1.0), wished, "M.json", 1.0)
