"""What a trajectory is called in one line."""

from __future__ import annotations

from fingerlab.sessions.trajectory import trajectory_words


def test_a_few_numbers_of_a_list_are_told_with_their_unit() -> None:
    told = {"kind": "multisine", "amplitude_deg": 14, "frequency_hz": 1, "frequencies_hz": [0.4, 0.9, 2.3]}
    assert trajectory_words(told) == "multisine, 14°, 1 Hz, frequencies 0.4, 0.9, 2.3 Hz"


def test_a_long_list_is_cut() -> None:
    words = trajectory_words({"kind": "multisine", "ratios": [1.5] * 40})
    assert words.startswith("multisine, ratios [1.5, ")
    assert words.endswith("...")
    assert len(words) < 70
