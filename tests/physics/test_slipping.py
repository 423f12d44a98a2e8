"""A fingertip whose sideways force follows the normal one: the closed form of its loop."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.settings import SLIP_STIFFNESSES
from fingerlab.physics.friction_states import rubbing_forces
from fingerlab.physics.motion import Motion
from fingerlab.rig.file import Motor

STIFFNESS = 6.0


def pressed(force: np.ndarray | None) -> Motion:
    zero = np.zeros(1 if force is None else len(force))
    return Motion("contact", 1, 250.0, zero, zero, zero, zero, zero, Motor(1.0, 1.0, 0.015), force=force)


def test_it_slides_while_the_load_rises_and_turns_round_on_the_way_down() -> None:
    up, down = np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.2, 81)
    force = np.concatenate((up, down[1:]))
    sideways = rubbing_forces(force, force, [STIFFNESS])[0]
    # Pressed from nothing it slides at once; let go by x it has 1 - 6 x, until that reaches -(1 - x).
    assert sideways[:101] == pytest.approx(up)
    let_go = 1.0 - down[1:]
    assert sideways[101:] == pytest.approx(np.maximum(1.0 - STIFFNESS * let_go, -(1.0 - let_go)))
    assert let_go[np.argmax(sideways[101:] <= -(1 - let_go) + 1e-9)] == pytest.approx(2 / 7, abs=0.01)


def test_no_contact_rubs_nothing() -> None:
    assert pressed(None).tip_slip_force(STIFFNESS) == pytest.approx([0.0])
    assert pressed(np.full(9, 0.5)).tip_slip_force(STIFFNESS) == pytest.approx(np.zeros(9))
    assert pressed(np.array([0.5, -0.1, 0.0])).tip_slip_force(STIFFNESS)[1:] == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("stiffness", SLIP_STIFFNESSES)
def test_it_leaves_the_mean_to_a_force_that_leans(stiffness: float) -> None:
    force = 0.8 + 0.3 * np.sin(np.linspace(0, 12 * np.pi, 3000))
    column = pressed(force).tip_slip_force(stiffness)
    assert column.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(column) > 0.2
