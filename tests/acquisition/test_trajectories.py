"""Motor commands: closed forms, and one sentence for each impossible request."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fingerlab.acquisition.control.trajectories import WAVES, read_trajectory
from fingerlab.core.errors import UserError
from fingerlab.sessions.trajectory import trajectory_words

TIME = np.arange(0.0, 20.0, 1e-3)


def test_sine_after_the_ramp_is_the_sine() -> None:
    wave = read_trajectory('{"kind": "sine", "amplitude_deg": 15, "frequency_hz": 1, "offset_deg": 22}')
    expected = np.radians(22 + 15 * np.sin(2 * np.pi * TIME))
    np.testing.assert_allclose(wave.command(TIME)[1500:], expected[1500:], atol=1e-12)
    assert wave.duration == 20.0


@pytest.mark.parametrize("kind", sorted(set(WAVES) - {"blocked", "file", "torque"}))
def test_starts_at_rest_and_stays_within_its_range(kind: str) -> None:
    wave = read_trajectory({"kind": kind, "amplitude_deg": 10.0, "frequency_hz": 0.8, "offset_deg": 22.0})
    command = np.degrees(wave.command(TIME))
    assert command[0] == 0.0
    assert abs(command[1]) < 1e-3
    assert command[1500:].min() >= 12.0 - 1e-2
    assert command[1500:].max() <= 32.0 + 1e-2
    assert np.ptp(command[1500:]) > 12.0


def test_chirp_passes_its_frequencies_at_their_times() -> None:
    settings = {"kind": "chirp", "amplitude_deg": 10.0, "frequency_hz": 0.5, "end_frequency_hz": 3.0}
    command = read_trajectory(settings).command(TIME)[1500:]
    rising = np.flatnonzero((command[:-1] < 0) & (command[1:] >= 0)) / 1000 + 1.5
    for time, period in zip(rising[1:], np.diff(rising), strict=True):
        middle = time - period / 2
        assert 1 / period == pytest.approx(0.5 + 2.5 * middle / 20.0, rel=0.03)


def test_multisine_has_its_lines_and_no_others() -> None:
    lines = [0.4, 0.9, 1.5]
    wave = read_trajectory({"kind": "multisine", "amplitude_deg": 8.0, "frequencies_hz": lines, "ramp_s": 0})
    spectrum = np.abs(np.fft.rfft(wave.command(TIME)))
    frequency = np.fft.rfftfreq(len(TIME), 1e-3)
    strongest = np.sort(frequency[np.argsort(spectrum)[-3:]])
    np.testing.assert_allclose(strongest, lines, atol=1e-9)
    assert np.sort(spectrum)[-4] < 1e-6 * spectrum.max()


def test_steps_hold_their_levels_and_depend_on_the_seed_alone() -> None:
    settings = {"kind": "steps", "amplitude_deg": 10.0, "frequency_hz": 0.5, "offset_deg": 20.0, "seed": 4}
    one, same = read_trajectory(settings).command(TIME), read_trajectory(settings).command(TIME)
    other = read_trajectory({**settings, "seed": 5}).command(TIME)
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    assert np.ptp(one[2200:3900]) == 0.0
    levels = {round(math.degrees(v), 6) for v in one[3900::2000]}
    assert len(levels) == 9


def test_ramp_and_hold_moves_at_constant_speed_and_rests() -> None:
    wave = read_trajectory({"kind": "ramp_hold", "amplitude_deg": 10.0, "frequency_hz": 0.25})
    speed = np.degrees(np.gradient(wave.command(TIME), 1e-3))[4010:8000]
    assert speed[100:900] == pytest.approx(20.0, rel=1e-9)
    assert speed[1100:1900] == pytest.approx(0.0, abs=1e-9)
    assert speed[2100:2900] == pytest.approx(-20.0, rel=1e-9)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("not json", "not JSON"),
        ("[1]", "JSON object"),
        ({"kind": "sine"}, "amplitude_deg"),
        ({"kind": "sine", "amplitude_deg": math.nan}, "finite"),
        ({"kind": "sine", "amplitude_deg": True}, "finite"),
        ({"kind": "sine", "amplitude_deg": 3, "frequency_hz": 0}, "greater than zero"),
        ({"kind": "sine", "amplitude_deg": 3, "ramp_s": -1}, "ramp_s"),
        ({"kind": "multisine", "amplitude_deg": 3, "frequencies_hz": []}, "positive numbers"),
        ({"kind": "multisine", "amplitude_deg": 3, "frequencies_hz": [1] * 101}, "100 at most"),
        ({"kind": "steps", "amplitude_deg": 3, "frequency_hz": 10}, "rise_s"),
        ({"amplitude_deg": 3}, "kind"),
    ],
)
def test_impossible_trajectories_are_refused(source: Any, words: str) -> None:
    with pytest.raises(UserError, match=words):
        read_trajectory(source)


def test_a_blocked_motor_goes_to_its_angle_and_stays() -> None:
    wave = read_trajectory({"kind": "blocked", "offset_deg": 30.0, "duration_s": 5.0})
    command = np.degrees(wave.command(TIME))
    assert command[0] == 0.0
    np.testing.assert_allclose(command[1500:], 30.0)
    with pytest.raises(UserError, match="blocked motor"):
        read_trajectory({"kind": "blocked", "offset_deg": 30.0, "amplitude_deg": 5.0})


def test_a_trajectory_from_a_file_is_what_the_file_says(tmp_path: Path) -> None:
    path = tmp_path / "move.txt"
    path.write_text("time\tangle\n0\t0\n2\t20\n4\t10\n8\t10\n", encoding="utf-8")
    wave = read_trajectory({"kind": "file", "file": str(path), "ramp_s": 0.0})
    np.testing.assert_allclose(np.degrees(wave.command(np.array([1.0, 2.0, 3.0, 6.0]))), [10, 20, 15, 10])
    assert wave.duration == 8.0
    assert wave.settings["file"] == "move.txt"
    again = read_trajectory(dict(wave.settings))
    np.testing.assert_allclose(again.command(TIME), wave.command(TIME))


@pytest.mark.parametrize(
    ("text", "words"),
    [("1\t2\n", "two rows"), ("1\n2\n", "no row of two numbers"), ("0\t1\n0\t2\n", "does not increase")],
)
def test_a_file_that_is_no_trajectory_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "bad.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=words):
        read_trajectory({"kind": "file", "file": str(path)})
    with pytest.raises(UserError, match="'file'"):
        read_trajectory({"kind": "file"})


@pytest.mark.parametrize("kind", ["chirp", "steps"])
def test_until_stopped_it_goes_on_behind_its_pattern_without_a_jump(kind: str) -> None:
    told = {"kind": kind, "amplitude_deg": 10.0, "frequency_hz": 1.0, "end_frequency_hz": 2.3}
    endless = {name: value for name, value in told.items() if kind == "chirp" or name != "end_frequency_hz"}
    motion = read_trajectory({**endless, "until_stopped": True, "pattern_s": 7.0, "ramp_s": 0.5})
    time = np.arange(0.0, 60.0, 1e-3)
    command = np.degrees(motion.command(time))
    late = command[time > 40.0]
    assert np.ptp(late) > 15.0  # five patterns later it still moves
    # A sine of 2.3 Hz and 10 degrees moves by 0.145 degrees in 1 ms, a step of 20 in 0.15 s by 0.21.
    assert np.abs(np.diff(command)).max() < 0.22
    within = time < 7.0
    once = read_trajectory({**endless, "duration_s": 7.0, "ramp_s": 0.5}).command(time[within])
    np.testing.assert_allclose(command[within], np.degrees(once), atol=1e-9)


def test_until_stopped_is_told_in_words_and_nothing_else() -> None:
    with pytest.raises(UserError, match="should be true or false"):
        read_trajectory({"kind": "sine", "amplitude_deg": 5, "until_stopped": "yes"})
    assert trajectory_words({"kind": "sine", "until_stopped": True}).endswith("until stopped")
