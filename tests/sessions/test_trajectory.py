"""What a motor was told: read from its command or its motion, and in words."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.sessions.trajectory import found_frequency, recognised, trajectory_words

RATE = 100.0
TIME = np.arange(0.0, 18.0, 1.0 / RATE)
RNG = np.random.default_rng(11)


@pytest.mark.parametrize("frequency", [0.2, 0.4, 1.0 / 3.0, 1.0, 1.7321, 3.0])
def test_the_cycle_of_a_sine_and_its_overtone_is_found_to_a_millionth_of_a_cycle(frequency: float) -> None:
    """Noise of an encoder: 1e-3 of the amplitude. The Cramer-Rao bound of the frequency is about 2e-7 Hz."""
    phase = 2 * np.pi * frequency * TIME
    motion = np.sin(phase) + 0.5 * np.sin(2 * phase + 0.4) + 1e-3 * RNG.standard_normal(len(TIME))
    found = found_frequency(motion, RATE)
    assert found == pytest.approx(frequency, abs=5e-6)


def test_a_cycle_on_a_slow_drift_is_found() -> None:
    motion = np.sin(2 * np.pi * TIME) + 0.05 * (TIME / 18.0) ** 2
    assert found_frequency(motion, RATE) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    "motion",
    [
        np.sin(2 * np.pi * (0.3 * TIME + 0.05 * TIME**2)),  # a chirp from 0.3 to 2.1 Hz
        np.sin(2 * np.pi * 0.05 * TIME),  # not even one cycle
        np.sin(2 * np.pi * TIME) + np.sin(2 * np.pi * np.sqrt(2.0) * TIME),  # never the same again
        RNG.standard_normal(len(TIME)),
        np.cumsum(RNG.standard_normal(len(TIME))),
        np.zeros(len(TIME)),
    ],
)
def test_what_does_not_come_again_has_no_cycle(motion: np.ndarray) -> None:
    assert found_frequency(motion, RATE) is None


@pytest.mark.parametrize(
    ("frequency", "amplitude", "offset"), [(1.0, 15.0, 22.0), (0.35, 9.0, 15.5), (2.5, 2.0, 0.0)]
)
def test_a_sine_is_recognised_behind_its_ramp(frequency: float, amplitude: float, offset: float) -> None:
    time = np.arange(0.0, 20.0, 1e-3)
    ramp = np.clip(time / 1.5, 0.0, 1.0)
    command = ramp * np.radians(offset + amplitude * np.sin(2 * np.pi * frequency * time))
    told = recognised(command, 1000.0)
    assert told is not None
    assert told.pop("kind") == "sine"
    expected = {"frequency_hz": frequency, "amplitude_deg": amplitude, "offset_deg": offset}
    assert told == pytest.approx(expected, rel=1e-3, abs=1e-6)


def test_steps_that_repeat_are_no_sine() -> None:
    time = np.arange(0.0, 20.0, 1e-3)
    assert recognised(np.sign(np.sin(2 * np.pi * time)), 1000.0) is None


@pytest.mark.parametrize("command", [np.zeros(20000), np.full(20000, np.nan), np.zeros(10), np.zeros(0)])
def test_what_says_nothing_is_not_recognised(command: np.ndarray) -> None:
    assert recognised(command, 1000.0) is None


def test_a_few_numbers_of_a_list_are_told_with_their_unit() -> None:
    told = {"kind": "multisine", "amplitude_deg": 14, "frequency_hz": 1, "frequencies_hz": [0.4, 0.9, 2.3]}
    assert trajectory_words(told) == "multisine, 14°, 1 Hz, frequencies 0.4, 0.9, 2.3 Hz"


def test_a_long_list_is_cut() -> None:
    words = trajectory_words({"kind": "multisine", "ratios": [1.5] * 40})
    assert words.startswith("multisine, ratios [1.5, ")
    assert words.endswith("...")
    assert len(words) < 70


def test_a_linear_axis_moves_by_lengths_and_is_driven_by_forces() -> None:
    """On an arc of 10 mm a radian is 10 mm and 0.01 N m is 1 N."""
    sine = {"kind": "sine", "amplitude_deg": 57.29578, "frequency_hz": 0.5, "offset_deg": 114.59156}
    assert trajectory_words(sine, 0.01) == "sine, 10 mm, 0.5 Hz, about 20 mm"
    read = {**sine, "offset_deg": 4.1e-11}  # what a fit to samples leaves of no offset
    assert trajectory_words(read, 0.01) == "sine, 10 mm, 0.5 Hz"
    assert trajectory_words({**sine, "offset_deg": 0}) == "sine, 57.3°, 0.5 Hz, about 0°"
    torque = {"kind": "torque", "offset_n_m": 0.05, "amplitude_n_m": 0.02}
    assert trajectory_words(torque, 0.01).endswith("3 to 7 N")
    assert trajectory_words({"kind": "ramp", "end_deg": 57.29578}, 0.01) == "ramp, end 10 mm"
