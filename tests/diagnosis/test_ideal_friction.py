"""A motor alone whose friction is that of textbooks and simulators: a sign of the speed, or a smooth one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions.model import Array, Run, Session

RATE_HZ, SECONDS, INERTIA, NOISE = 1000.0, 20.0, 0.3, 0.01
TONES_HZ = ((0.5, 0.8), (0.35, 1.1), (0.6, 0.9))
Law = Callable[[Array, Array], Array]
"""Torque beside that of the inertia (N m) by angle (rad) and speed (rad/s)."""


def moved_by(law: Law) -> Session:
    """Three runs of two tones each; angle, speed and acceleration in closed form."""
    time, runs = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ, []
    for number, tones in enumerate(TONES_HZ):
        omega = 2.0 * np.pi * np.array(tones)[:, None]
        angle = 0.25 * np.sin(omega * time + number).sum(axis=0)
        speed = 0.25 * (omega * np.cos(omega * time + number)).sum(axis=0)
        acceleration = -0.25 * (omega**2 * np.sin(omega * time + number)).sum(axis=0)
        noise = NOISE * np.random.default_rng(number).standard_normal(len(time))
        channels = {
            "motor_position": angle,
            "motor_torque": INERTIA * acceleration + law(angle, speed) + noise,
        }
        told = {"phase": "motor_bench", "cable": "none", "sample_rate_hz": RATE_HZ}
        runs.append(Run.from_arrays(channels, name=f"{number:03}", **told))
    return Session(Path("ideal.h5"), "ideal", "", Rig(None, Motor()), tuple(runs))


def stribeck(speed: Array) -> Array:
    return np.asarray(np.sign(speed) * (0.4 + 0.4 * np.exp(-((speed / 0.2) ** 2))))


LAWS: dict[str, tuple[Law, dict[str, dict[str, float]]]] = {
    "sign": (lambda q, v: 0.6 * np.sign(v), {"motor_coulomb_friction": {"coulomb": 0.6}}),
    "smooth": (
        lambda q, v: 0.6 * np.tanh(v / 0.05),
        {"motor_coulomb_friction": {"coulomb": 0.6, "reversal_speed": 0.05}},
    ),
    "very smooth": (
        lambda q, v: 0.6 * np.tanh(v / 0.2),
        {"motor_coulomb_friction": {"coulomb": 0.6, "reversal_speed": 0.2}},
    ),
    "with oil": (
        lambda q, v: 0.6 * np.sign(v) + 0.3 * v,
        {"motor_coulomb_friction": {}, "motor_viscous_friction": {}},
    ),
    "more when slow": (
        lambda q, v: stribeck(v),
        {"motor_stribeck_friction": {"coulomb": 0.4, "extra": 0.4, "stribeck_speed": 0.2}},
    ),
    "on a spring": (
        lambda q, v: 1.5 * q + 0.4 * np.sign(v),
        {"motor_coulomb_friction": {}, "motor_spring": {}},
    ),
    "with a ripple": (
        lambda q, v: 0.1 * np.sin(40.0 * q) + 0.4 * np.sign(v),
        {"motor_coulomb_friction": {}, "torque_ripple": {}},
    ),
}
"""What there is, and the values of the effects that are it; those found beside others are told elsewhere."""


@pytest.mark.parametrize("name", LAWS)
def test_friction_by_the_speed_is_found_with_all_that_stands_beside_it(name: str) -> None:
    law, truth = LAWS[name]
    found = diagnose([moved_by(law)], with_curves=False)
    assert found.verdict == "missing_effect"
    assert set(found.final_model) == set(truth)
    assert found.candidates[0].effect in truth
    assert found.path[-1].score < 1.3
    for effect, values in truth.items():
        told = next(c for c in found.candidates if c.effect == effect).parameters
        for key, value in values.items():
            assert told[key].value == pytest.approx(value, rel=0.05), key


def test_what_is_given_does_not_stand_for_what_is_still_missing() -> None:
    """Alone, a wide tangent takes the oil's part; beside it the sign is a sign, and nothing is exchanged."""
    session = moved_by(LAWS["with oil"][0])
    first = diagnose([session], ["motor_coulomb_friction"], with_curves=False)
    assert first.better is None
    assert first.candidates[0].effect == "motor_viscous_friction"
    assert [step.added for step in first.path] == [None, "motor_viscous_friction"]
    assert first.path[-1].score < 1.3
    both = diagnose([session], ["motor_coulomb_friction", "motor_viscous_friction"], with_curves=False)
    assert both.verdict == "nothing_missing"
    assert both.score == pytest.approx(first.path[-1].score, abs=0.05)
