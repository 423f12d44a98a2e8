"""The fingertip on the load cell, from its coordinates written out again."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from fingerlab.effects.sensor_drift import STEADY_S
from fingerlab.physics.motion import pressed, tip_depth, tip_reach, while_pressed
from fingerlab.physics.nominal import JointMotion

from .moving import FINGER, column, moving


def place(mcp: np.ndarray, pip: np.ndarray) -> np.ndarray:
    """Tip as a complex number: forward, and up; both phalanges hang from the wrist's angle."""
    first = np.exp(-1j * (mcp - FINGER.wrist_angle)) * 2 * FINGER.proximal_half_length
    return first + np.exp(-1j * (mcp + pip - FINGER.wrist_angle)) * 2 * FINGER.distal_half_length


def misread(motion, mcp: float, pip: float) -> JointMotion:
    """The same motion as two sensors show it that read too much by so many rad."""
    q = motion.joints
    zero = np.zeros_like(q.mcp)
    return JointMotion(q.mcp + mcp, q.pip + pip, zero, zero, zero, zero)


def test_depth_and_reach_are_the_tips_coordinates() -> None:
    motion = moving(force=1.0)
    tip = place(motion.joints.mcp, motion.joints.pip)
    assert tip_reach(motion) == pytest.approx(tip.real, abs=1e-15)
    assert tip_depth(motion) == pytest.approx(-tip.imag, abs=1e-15)


def test_only_what_changes_while_the_tip_presses_is_seen() -> None:
    motion = moving(force=0.1)  # 0.1 N and a sine of 0.3 N: now on the cell, now off
    share = pressed(motion)
    assert share.min() == 0.0
    assert share.max() == 1.0
    seen = while_pressed(motion, 7.0 + motion.position)
    assert not seen[share == 0.0].any()
    assert float(share @ seen) == pytest.approx(0.0, abs=1e-10)
    assert seen == pytest.approx(while_pressed(motion, motion.position), abs=1e-12)
    assert not while_pressed(moving(), motion.position).any()


def test_wrong_angles_move_the_tip_as_its_coordinates_say() -> None:
    """To first order, the depth that a small error of either sensor adds; the drift is 1 rad/s here."""
    motion = moving(force=1.0)
    terms = CATALOGUE["sensor_drift"].columns(motion, {"time_constant": STEADY_S})
    small = 1e-7
    for joint, error in (("mcp", (small, 0.0)), ("pip", (0.0, small))):
        wrong = misread(motion, *error)
        added = -(place(wrong.mcp, wrong.pip) - place(motion.joints.mcp, motion.joints.pip)).imag / small
        expected = while_pressed(motion, added * motion.time)
        assert column(terms, Row.TIP, f"rate_{joint}") == pytest.approx(expected, rel=1e-2, abs=1e-5)


def test_a_leaning_face_guides_the_tip_at_right_angles_to_its_force() -> None:
    """A frictionless face of slope tan: the force on the tip does no work as the tip slides along it."""
    motion = moving(force=1.0)
    tangent = 0.4
    depth = tangent * tip_reach(motion)  # what the joint angles show of a tip that slides on the face
    terms = CATALOGUE["contact_angle"].columns(motion, {})
    assert tangent * column(terms, Row.TIP) == pytest.approx(while_pressed(motion, depth), abs=1e-12)
    # Up is 1, forward is the tangent; the way along the face is forward 1 and down the tangent.
    assert 1.0 * -tangent + tangent * 1.0 == 0.0
    forward = column(terms, Row.PIP, "lean") / motion.force  # lever that takes torque off a flexing joint
    joints = motion.joints
    small = 1e-7
    wrong = misread(motion, 0.0, small)
    travel = (place(wrong.mcp, wrong.pip) - place(joints.mcp, joints.pip)) / small
    assert forward == pytest.approx(-travel.real, abs=1e-6)


@pytest.mark.parametrize(("turn_deg", "angle_deg"), [(0.0, 2.0), (-16.0, -16.0), (16.0, 18.0)])
def test_a_turned_cell_turns_the_force_that_it_reads(turn_deg: float, angle_deg: float) -> None:
    """Torques of the same force along the turned axis in place of the upright one, from coordinates.

    To first order about the turn: two degrees beside it the cosine is off by 0.6 per thousand.
    """
    motion = moving(force=1.0)
    terms = CATALOGUE["contact_angle"].columns(motion, {"cell_turns": 1.0, "turn_deg": turn_deg})
    angle, q = np.radians(angle_deg), motion.joints
    tip = place(q.mcp, q.pip)
    knuckle = np.exp(-1j * (q.mcp - FINGER.wrist_angle)) * 2 * FINGER.proximal_half_length
    change = motion.force * (np.sin(angle) + 1j * np.cos(angle) - 1j)
    for row, arm in ((Row.MCP, tip), (Row.PIP, tip - knuckle)):
        found = np.tan(angle) * column(terms, row, "lean")
        found = found + sum(t.values for t in terms if t.row == row and t.constant == 1.0)
        taken_off = (np.conj(arm) * change).imag  # flexion turns to minus
        assert found == pytest.approx(taken_off, abs=1e-3 * np.abs(arm * motion.force).max())


def test_a_soft_tip_rubs_with_less_than_its_friction_before_it_slides() -> None:
    """Sideways force never beyond the normal one, and a spring of the given stiffness while it is small."""
    motion = moving(force=1.0)
    one = CATALOGUE["contact_compliance"]
    for shape in one.shapes:
        torque, levers = column(one.columns(motion, shape), Row.PIP), CATALOGUE["contact_angle"]
        lever = column(levers.columns(motion, {}), Row.PIP, "lean") / motion.force
        force = -torque / lever
        assert np.all(np.abs(force) <= motion.force + 1e-9)
        travel = shape["sideways"] * (tip_reach(motion)[:2] - tip_reach(motion)[0])
        assert force[:2] == pytest.approx(np.clip(travel, -motion.force[:2], motion.force[:2]), rel=1e-6)
