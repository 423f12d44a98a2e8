"""One run or two in which no motion comes again: parts of them are left out of the fit, and tell the floor.

The machine is like a real one of which 3.3 s logs are public (lvjonok/mujoco-sysid on GitHub): a geared motor
of 0.046 kg m^2 with 1.1 N m of dry friction, whose torque has some 0.14 N m of noise below 8 Hz.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.diagnosis_words import judged_on, verdict_sentence
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Array, Run, Session

RATE_HZ, SECONDS, INERTIA, COULOMB = 100.0, 3.3, 0.046, 1.1
NOISE = 0.14 * np.sqrt(0.5 * RATE_HZ / 8.0)  # N m over the whole band
FAST, SLOW = ((1.3, 0.9), (2.1, 0.5), (3.4, 0.25)), ((0.3, 0.15), (0.45, 0.1))
"""Frequencies, Hz, and amplitudes, rad, of a run's sines."""


def moved(tones: tuple[tuple[float, float], ...], number: int, friction: float) -> Run:
    """Angle and torque of a motion in closed form."""
    time = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    hz, size = np.array(tones).T[:, :, None]
    omega = 2.0 * np.pi * hz
    phase = omega * time + np.arange(len(tones))[:, None] + number
    speed = (size * omega * np.cos(phase)).sum(axis=0)
    acceleration = -(size * omega**2 * np.sin(phase)).sum(axis=0)
    noise = NOISE * np.random.default_rng(number).standard_normal(len(time))
    torque = INERTIA * acceleration + friction * np.tanh(speed / 0.05) + noise
    channels: dict[str, Array] = {
        "motor_position": (size * np.sin(phase)).sum(axis=0),
        "motor_torque": torque,
    }
    told = {"phase": "motor_bench", "cable": "none", "sample_rate_hz": RATE_HZ}
    return Run.from_arrays(channels, name=f"{number:03}", **told)


def session(*motions: tuple[tuple[float, float], ...], friction: float = COULOMB) -> Session:
    runs = tuple(moved(tones, number, friction) for number, tones in enumerate(motions))
    return Session(Path("few.h5"), "few", "", Rig(None, Motor()), runs)


@cache
def diagnosed(*motions: tuple[tuple[float, float], ...]) -> Diagnosis:
    return diagnose([session(*motions)], with_curves=False)


@pytest.mark.parametrize("motions", [(FAST,), (SLOW,), (FAST, SLOW), (FAST, FAST)])
def test_friction_is_found_by_one_run_and_by_two_that_have_little_in_common(
    motions: tuple[tuple[tuple[float, float], ...], ...],
) -> None:
    """A slow run beside a fast one made the floor ten times the noise: the slow one tells no inertia."""
    found = diagnosed(*motions)
    assert found.verdict == "missing_effect"
    assert found.candidates[0].effect == "motor_coulomb_friction"
    strength = found.candidates[0].parameters["coulomb"]
    assert strength.value == pytest.approx(COULOMB, rel=0.1)
    floor = found.errors["motor_torque"].floor
    assert 0.09 < floor < 0.25
    assert [step.added for step in found.path] == [None, "motor_coulomb_friction"]
    assert found.path[-1].score < 1.3


@pytest.mark.parametrize("motions", [(FAST,), (SLOW,), (FAST, SLOW)])
def test_nothing_is_missing_any_more_with_the_friction_in_the_model(
    motions: tuple[tuple[tuple[float, float], ...], ...],
) -> None:
    """Of a run that the fit had seen, some effect or other always took a few hundredths off what is noise."""
    found = diagnose([session(*motions)], ["motor_coulomb_friction"], with_curves=False)
    assert found.verdict == "nothing_missing"
    assert len(found.path) == 1


def test_it_is_said_that_parts_of_the_runs_were_left_out() -> None:
    one, two = (diagnosed(*motions) for motions in ((FAST,), (FAST, SLOW)))
    assert one.held_out_by_parts
    assert two.held_out_by_parts
    assert judged_on(one) == "parts of the one run left out of the fit"
    assert "the error on parts of the runs left out of the fit falls from" in verdict_sentence(two)
    assert [share.run for share in two.run_shares] == ["000", "001"]
    assert sum(share.share for share in two.run_shares) == pytest.approx(two.score**2)


def test_runs_that_repeat_a_motion_are_still_left_out_whole() -> None:
    """A sine of ten cycles tells its own noise; nothing has to be cut."""
    sine = ((3.0, 0.5),)
    found = diagnose([session(sine, sine)], with_curves=False)
    assert found.repeats
    assert not found.held_out_by_parts
