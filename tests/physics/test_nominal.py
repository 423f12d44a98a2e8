"""The nominal equations against a derivation of their own: Lagrange's equations, by sympy, at test time."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from fingerlab.core.errors import UserError
from fingerlab.physics import nominal
from fingerlab.rig.file import Finger, Motor

FINGER = Finger(
    proximal_mass=0.013,
    distal_mass=0.017,
    proximal_half_length=0.021,
    distal_half_length=0.026,
    proximal_inertia=3.1e-6,
    distal_inertia=4.7e-6,
    mcp_stiffness=0.11,
    pip_stiffness=0.07,
    wrist_angle=0.27,
)

t = sp.symbols("t")
q1, q2 = sp.Function("q1")(t), sp.Function("q2")(t)
m1, m2, l1, l2, i1, i2, k1, k2, alpha, g = sp.symbols("m1 m2 l1 l2 i1 i2 k1 k2 alpha g")
PARAMETERS = {
    m1: FINGER.proximal_mass,
    m2: FINGER.distal_mass,
    l1: FINGER.proximal_half_length,
    l2: FINGER.distal_half_length,
    i1: FINGER.proximal_inertia,
    i2: FINGER.distal_inertia,
    k1: FINGER.mcp_stiffness,
    k2: FINGER.pip_stiffness,
    alpha: FINGER.wrist_angle,
    g: FINGER.gravity,
}
STATE = sp.symbols("a1 a2 v1 v2 w1 w2")


def _positions() -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """Centres of mass, thesis (3.8) and (3.11), and the fingertip; x forward, y up."""
    knuckle = 2 * l1 * sp.Matrix([sp.cos(alpha - q1), sp.sin(alpha - q1)])
    along = sp.Matrix([sp.cos(q1 + q2 - alpha), -sp.sin(q1 + q2 - alpha)])
    return knuckle / 2, knuckle + l2 * along, knuckle + 2 * l2 * along


def _lagrange(q: sp.Function) -> sp.Expr:
    r1, r2, _ = _positions()
    speed = [sp.diff(r, t) for r in (r1, r2)]
    kinetic = (m1 * speed[0].dot(speed[0]) + m2 * speed[1].dot(speed[1])) / 2
    kinetic += (i1 * sp.diff(q1, t) ** 2 + i2 * sp.diff(q2, t) ** 2) / 2  # (3.6)
    potential = g * (m1 * r1[1] + m2 * r2[1]) + (k1 * q1**2 + k2 * q2**2) / 2  # (3.7)
    lagrangian = kinetic - potential
    return sp.diff(sp.diff(lagrangian, sp.diff(q, t)), t) - sp.diff(lagrangian, q)


def _numeric(expression: sp.Expr, *extra: sp.Symbol):
    values = {
        sp.diff(q1, t, 2): STATE[4],
        sp.diff(q2, t, 2): STATE[5],
        sp.diff(q1, t): STATE[2],
        sp.diff(q2, t): STATE[3],
        q1: STATE[0],
        q2: STATE[1],
    }
    for old, new in values.items():  # second derivatives first: they hold the first ones
        expression = expression.subs(old, new)
    return sp.lambdify((*STATE, *extra), expression.subs(PARAMETERS), "numpy")


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    random = np.random.default_rng(3)
    scale = np.array([1.2, 1.2, 8.0, 8.0, 90.0, 90.0])[:, None]
    return random.uniform(-1, 1, (6, 200)) * scale


def _motion(states: np.ndarray) -> nominal.JointMotion:
    return nominal.JointMotion(*states)


@pytest.mark.parametrize(
    ("joint", "function"), [(q1, nominal.mcp_torque), (q2, nominal.pip_torque)], ids=["mcp", "pip"]
)
def test_joint_torque_is_what_lagrange_gives(states: np.ndarray, joint: sp.Function, function) -> None:
    ours = function(FINGER, _motion(states)).total
    np.testing.assert_allclose(ours, _numeric(_lagrange(joint))(*states), rtol=1e-9, atol=1e-12)


def test_parts_of_the_torque_are_what_they_are_called(states: np.ndarray) -> None:
    """At rest nothing is inertial; without gravity and springs nothing else is left."""
    rest = states.copy()
    rest[2:] = 0.0
    for function, stiffness, angle in (
        (nominal.mcp_torque, FINGER.mcp_stiffness, rest[0]),
        (nominal.pip_torque, FINGER.pip_stiffness, rest[1]),
    ):
        parts = function(FINGER, _motion(rest))
        np.testing.assert_array_equal(parts.inertial, 0.0)
        np.testing.assert_allclose(parts.spring, stiffness * angle)
    horizontal = np.array([[FINGER.wrist_angle], [0.0], [0.0], [0.0], [0.0], [0.0]])
    weight = nominal.pip_torque(FINGER, _motion(horizontal)).gravity[0]
    assert weight == pytest.approx(-0.017 * 9.81 * 0.026)  # the distal body's weight on its half length


@pytest.mark.parametrize("lean", [0.0, 0.35, -0.6])
def test_contact_levers_by_virtual_work(states: np.ndarray, lean: float) -> None:
    """The work of a force on the fingertip, pushing up with axial part 1 and leaning by an angle."""
    tip = _positions()[2]
    force = sp.Matrix([sp.tan(sp.Float(lean)), 1])
    for joint, function in ((q1, nominal.contact_lever_mcp), (q2, nominal.contact_lever_pip)):
        torque = force.dot(sp.diff(tip, joint))
        lever = function(FINGER, states[0], states[1], lean)
        # The reaction extends the joints: torque is -lever times the force.
        np.testing.assert_allclose(-lever, _numeric(torque)(*states), rtol=1e-12, atol=1e-15)


def test_vertical_contact_lever_is_the_thesis_own() -> None:
    """(3.18): 2 l2 cos(theta1 + theta2 - alpha)."""
    lever = nominal.contact_lever_pip(FINGER, np.array([0.4]), np.array([0.5]))
    assert lever[0] == pytest.approx(2 * 0.026 * np.cos(0.4 + 0.5 - 0.27))


@pytest.mark.parametrize("sign", [1, -1])
def test_moment_arms_of_torque_and_cable_are_one(sign: int) -> None:
    """Virtual work: the cable's tension on its own travel does the work of the joint torques."""
    a, b, tension = 0.0093, 0.0074, 3.7
    mcp, pip, step = np.array([0.3]), np.array([-0.2]), 1e-6

    def length(mcp: np.ndarray, pip: np.ndarray) -> np.ndarray:
        return sign * (a * mcp + b * pip)  # that the joints call for

    at = length(mcp, pip)
    work_mcp = tension * (length(mcp + step, pip) - at) / step
    work_pip = tension * (length(mcp, pip + step) - at) / step
    torque_mcp = nominal.endpoint_force(np.zeros(1), sign, a, 0.0, np.array([tension]), np.ones(1))
    torque_pip = nominal.endpoint_force(np.zeros(1), sign, b, 0.0, np.array([tension]), np.ones(1))
    np.testing.assert_allclose(work_mcp, torque_mcp, rtol=1e-8)
    np.testing.assert_allclose(work_pip, torque_pip, rtol=1e-8)


def test_either_equation_gives_the_force_that_went_in(states: np.ndarray) -> None:
    """A finger pressed with a known force: joint balances by sympy, force back by our equations."""
    force, lean, s = 1.7, 0.2, 1
    tip = _positions()[2]
    push = sp.Matrix([force * sp.tan(sp.Float(lean)), force])
    a, b, loss1, loss2 = 0.011, 0.008, -0.002, 0.001
    needed = [_numeric(_lagrange(q) - push.dot(sp.diff(tip, q)))(*states) for q in (q1, q2)]
    for lhs, arm, loss, torque, lever in (
        (nominal.mcp_torque, a, loss1, needed[0], nominal.contact_lever_mcp),
        (nominal.pip_torque, b, loss2, needed[1], nominal.contact_lever_pip),
    ):
        tension = (torque - loss) / (s * arm)  # what the cable has to pull for this motion
        back = nominal.endpoint_force(
            lhs(FINGER, _motion(states)).total,
            s,
            arm,
            loss,
            tension,
            lever(FINGER, states[0], states[1], lean),
        )
        np.testing.assert_allclose(back, force, rtol=1e-6)


def test_tension_subtracts_inertia_only_where_the_rig_gives_it() -> None:
    torque, acceleration = np.array([0.06]), np.array([50.0])
    plain = Motor(pulley_radius=0.015)
    assert nominal.tension(plain, torque, acceleration)[0] == pytest.approx(4.0)
    heavy = Motor(pulley_radius=0.015, inertia=3e-4)
    assert nominal.tension(heavy, torque, acceleration)[0] == pytest.approx(3.0)


def test_missing_pulley_radius_is_told() -> None:
    with pytest.raises(UserError, match=r"motor\.pulley_radius"):
        nominal.tension(Motor(), np.zeros(1), np.zeros(1))


def test_winding() -> None:
    # One turn of a 15 mm pulley winds its circumference.
    assert nominal.cable_wound(Motor(pulley_radius=0.015), np.array([2 * np.pi]))[0] == pytest.approx(
        np.pi * 0.03
    )
