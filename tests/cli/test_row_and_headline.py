"""The one row of a motor alone and the headline: where they are far apart, why is said, with true numbers.

The machines are laws written down here; their noise is known.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.cli.calling import run_main

RATE, PERIOD, CYCLES = 250.0, 4.0, 6
NOISE, FRICTION = 0.004, 0.1
"""N m."""
BAND_HZ = 8.0
"""What a diagnosis looks at; white noise of so many samples a second leaves its share in it."""


def session(folder: Path, capsys: pytest.CaptureFixture[str], runs: list[tuple[np.ndarray, ...]]) -> Path:
    """Runs of position and torque, as a session."""
    files, random = [], np.random.default_rng(7)
    for number, (position, torque) in enumerate(runs):
        time = np.arange(len(position)) / RATE
        table = np.stack((time, position, torque + NOISE * random.standard_normal(len(time))), axis=1)
        files.append(folder / f"{number}.csv")
        header = "time (s),position (rad),torque (N m)"
        np.savetxt(files[-1], table, "%.7f", delimiter=",", header=header, comments="")
    made = folder / "axis.h5"
    code, _, err = run_main(["import", "--axis", *files, "--out", made], capsys)
    assert code == 0, err
    return made


def told(made: Path, capsys: pytest.CaptureFixture[str], *options: object) -> tuple[str, float, float, float]:
    """What ``diagnose`` prints, put together; headline, rms of the row (N m), and the row's multiple."""
    code, out, err = run_main(["diagnose", made, *options], capsys)
    assert code == 0, err
    said = " ".join(out.split())
    headline = float(re.search(r"runs left out of the fit: ([\d.]+) times", said)[1])
    rms, unit, times = re.search(r"Motor torque ([\d.]+) [\d.]+ (m?)N m ([\d.]+)", said).groups()
    return said, headline, float(rms) * (1e-3 if unit else 1.0), float(times)


def test_one_floor_serves_row_and_headline_and_what_is_added(tmp_path, capsys):
    """Friction that flips a little earlier or later in every cycle: a steep law must not call that its noise.

    What is foretold of an effect is then what is read once it is in the model.
    """
    random, runs = np.random.default_rng(3), []
    for amplitude in (0.3, 0.5, 0.7):
        late = np.interp(
            np.arange(0.0, PERIOD * CYCLES, 1 / RATE),
            np.arange(2 * CYCLES + 1) * PERIOD / 2,
            0.03 * random.standard_normal(2 * CYCLES + 1),
        )
        phase = 2 * np.pi * (np.arange(len(late)) / RATE + late) / PERIOD
        position = amplitude * np.sin(phase)
        runs.append((position, FRICTION * np.tanh(np.gradient(position) * RATE / 0.05)))
    made = session(tmp_path, capsys, runs)
    said, headline, _, row = told(made, capsys)
    assert row == pytest.approx(headline, rel=0.1)
    assert "and the row's" not in said
    foretold = float(re.search(r"falls from [\d.]+ to ([\d.]+) times", said)[1])
    code, out, err = run_main(["diagnose", made, "--add", "motor_coulomb_friction"], capsys)
    assert code == 0, err
    got = float(re.search(r"([\d.]+) times the floor", " ".join(out.split()))[1])
    assert got == pytest.approx(foretold, rel=0.05)


def test_a_motor_that_sticks_is_said_to_be_hardly_counted(tmp_path, capsys):
    """At every end it stands for a second, and the torque goes from one side of the friction to the other."""
    runs = []
    for amplitude in (0.3, 0.5, 0.7):
        turn = np.linspace(0.0, np.pi, int(RATE * PERIOD / 4))
        there, hold = -amplitude * np.cos(turn), np.full(int(RATE * PERIOD / 4), amplitude)
        position = np.tile(np.concatenate((there, hold, -there, -hold)), CYCLES)
        over = np.linspace(FRICTION, -FRICTION, len(hold))
        moves = np.full(len(there), FRICTION)
        torque = np.tile(np.concatenate((moves, over, -moves, -over)), CYCLES)
        runs.append((position, torque))
    said, headline, _, row = told(session(tmp_path, capsys, runs), capsys, "--add", "motor_coulomb_friction")
    assert row > 1.5 * headline
    assert "the row counts in full the moments at which the motor sticks" in said


def test_nothing_is_said_where_both_agree(tmp_path, capsys):
    """A spring: it misses the same in every cycle."""
    time = np.arange(0.0, PERIOD * CYCLES, 1 / RATE)
    runs = [(q, 0.5 * q) for q in (a * np.sin(2 * np.pi * time / PERIOD) for a in (0.3, 0.5, 0.7))]
    said, headline, _, row = told(session(tmp_path, capsys, runs), capsys)
    assert row == pytest.approx(headline, rel=0.3)
    assert "and the row's" not in said
