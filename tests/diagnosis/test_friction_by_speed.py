"""A finger whose motor rubs as textbooks and simulators have it: by the hyperbolic tangent of the speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.sessions.model import Array
from tests.diagnosis import closed_form as made

COULOMB, WIDTH, EXCESS, SLOW = 6e-3, 0.05, 6e-3, 0.3  # N m, rad/s, N m, rad/s


def coulomb(speed: Array) -> Array:
    return COULOMB * np.tanh(speed / WIDTH)


def stribeck(speed: Array) -> Array:
    return np.asarray(np.tanh(speed / WIDTH) * (COULOMB + EXCESS * np.exp(-((speed / SLOW) ** 2))))


@pytest.mark.parametrize(
    ("law", "effect", "expected"),
    [
        (coulomb, "motor_coulomb_friction", {"coulomb": COULOMB, "reversal_speed": WIDTH}),
        (
            stribeck,
            "motor_stribeck_friction",
            {"coulomb": COULOMB, "extra": EXCESS, "stribeck_speed": SLOW, "reversal_speed": WIDTH},
        ),
    ],
)
def test_friction_by_the_speed_is_found_beside_a_finger(
    law: Callable[[Array], Array], effect: str, expected: dict[str, float]
) -> None:
    """By the travel alone it left 3 floors, and "not in the catalogue" was said of Coulomb friction."""
    plain = made.session(made.Bench())
    session = replace(plain, runs=tuple(made.with_motor_torque(run, law) for run in plain.runs))
    said = diagnose([session], with_curves=False)
    assert said.verdict == "missing_effect"
    assert said.candidates[0].effect == effect
    assert [step.added for step in said.path] == [None, effect]
    assert said.path[-1].score < 1.3
    told = said.candidates[0].parameters
    for name, value in expected.items():
        assert told[name].value == pytest.approx(value, rel=0.05 if name == "coulomb" else 0.35), name
