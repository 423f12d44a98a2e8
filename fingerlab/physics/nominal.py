"""The nominal equations, each defined once: joint torques, contact, cable, motor.

Signs and symbols follow ``docs/theory.md``: joint angles are flexion positive, cable tension T >= 0,
contact force F >= 0 on the load cell, cable sign s = +1 for flexion and -1 for extension, moment
arms a, b > 0. Sources are the thesis' equations (3.16) to (3.18), with accelerations where the
print shows single dots and centre-of-mass moments of inertia for I1 and I2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.rig.file import Finger, Motor
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class JointTorque:
    """Left-hand side of one joint's equation by cause; each of shape (n,), N m."""

    inertial: Array  # inertia and Coriolis
    gravity: Array
    spring: Array

    @property
    def total(self) -> Array:
        """LHS of (3.16) or (3.17), N m."""
        return self.inertial + self.gravity + self.spring


@dataclass(frozen=True)
class JointMotion:
    """Joint angles and their derivatives, each of shape (n,): rad, rad/s, rad/s^2."""

    mcp: Array
    pip: Array
    mcp_velocity: Array
    pip_velocity: Array
    mcp_acceleration: Array
    pip_acceleration: Array


def mcp_torque(finger: Finger, motion: JointMotion) -> JointTorque:
    """Left-hand side of the MCP equation (3.16)."""
    m1, m2 = finger.proximal_mass, finger.distal_mass
    l1, l2 = finger.proximal_half_length, finger.distal_half_length
    cos2, sin2 = np.cos(motion.pip), np.sin(motion.pip)
    coupling = 2.0 * m2 * l1 * l2
    inertial = (
        (finger.proximal_inertia + m1 * l1**2 + 4.0 * m2 * l1**2 + m2 * l2**2 + 2.0 * coupling * cos2)
        * motion.mcp_acceleration
        + (m2 * l2**2 + coupling * cos2) * motion.pip_acceleration
        - coupling * sin2 * motion.pip_velocity * (2.0 * motion.mcp_velocity + motion.pip_velocity)
    )
    gravity = mcp_gravity(finger, motion.mcp, motion.pip)
    return JointTorque(inertial, gravity, finger.mcp_stiffness * motion.mcp)


def mcp_gravity(finger: Finger, mcp: Array, pip: Array) -> Array:
    """What gravity adds to the left-hand side of the MCP equation (3.16), N m, shape (n,)."""
    m1, m2 = finger.proximal_mass, finger.distal_mass
    l1, l2 = finger.proximal_half_length, finger.distal_half_length
    return np.asarray(
        -finger.gravity
        * (
            (m1 + 2.0 * m2) * l1 * np.cos(finger.wrist_angle - mcp)
            + m2 * l2 * np.cos(mcp + pip - finger.wrist_angle)
        )
    )


def pip_torque(finger: Finger, motion: JointMotion) -> JointTorque:
    """Left-hand side of the PIP equation (3.17)."""
    m2 = finger.distal_mass
    l1, l2 = finger.proximal_half_length, finger.distal_half_length
    coupling = 2.0 * m2 * l1 * l2
    inertial = (
        (m2 * l2**2 + coupling * np.cos(motion.pip)) * motion.mcp_acceleration
        + (m2 * l2**2 + finger.distal_inertia) * motion.pip_acceleration
        + coupling * np.sin(motion.pip) * motion.mcp_velocity**2
    )
    gravity = pip_gravity(finger, motion.mcp, motion.pip)
    return JointTorque(inertial, gravity, finger.pip_stiffness * motion.pip)


def pip_gravity(finger: Finger, mcp: Array, pip: Array) -> Array:
    """What gravity adds to the left-hand side of the PIP equation (3.17), N m, shape (n,)."""
    weight = finger.distal_mass * finger.gravity
    return np.asarray(-weight * finger.distal_half_length * np.cos(mcp + pip - finger.wrist_angle))


def contact_lever_pip(finger: Finger, mcp: Array, pip: Array, contact_angle: float = 0.0) -> Array:
    """Lever of the contact force about the PIP joint, m, shape (n,); multiplies F (3.18).

    ``contact_angle`` (rad) leans the force from the load cell's axis, thesis figure 5.1. F is the
    component that the load cell reads, so a leaning force of axial part F is F / cos(contact_angle).
    """
    distal = mcp + pip - finger.wrist_angle
    lever = 2.0 * finger.distal_half_length * (np.cos(distal) + np.tan(contact_angle) * np.sin(distal))
    return np.asarray(lever)


def contact_lever_mcp(finger: Finger, mcp: Array, pip: Array, contact_angle: float = 0.0) -> Array:
    """Lever of the contact force about the MCP joint, m, shape (n,). The thesis leaves it out."""
    proximal = finger.wrist_angle - mcp
    lever = 2.0 * finger.proximal_half_length * (np.cos(proximal) - np.tan(contact_angle) * np.sin(proximal))
    return np.asarray(lever) + contact_lever_pip(finger, mcp, pip, contact_angle)


def tension(motor: Motor, motor_torque: Array, motor_acceleration: Array) -> Array:
    """Cable tension at the pulley, N, shape (n,): T = (torque - J * acceleration) / r.

    The inertia J is subtracted only where the rig gives it; the thesis subtracts nothing.
    """
    radius = _pulley_radius(motor)
    inertial = 0.0 if motor.inertia is None else motor.inertia * motor_acceleration
    return np.asarray((motor_torque - inertial) / radius)


def cable_wound(motor: Motor, motor_position: Array) -> Array:
    """Cable wound on the pulley x_m = r * theta_m, m, shape (n,)."""
    return _pulley_radius(motor) * motor_position


def endpoint_force(
    joint_lhs: Array, cable_sign: int, moment_arm: float, loss: float, cable_tension: Array, lever: Array
) -> Array:
    """Contact force that one joint's balance implies, N, shape (n,): (s a T + L - LHS) / lever.

    Used with the PIP quantities (3.18) or with the MCP quantities; the two must agree.

    Args:
        joint_lhs: LHS of the joint, N m. cable_sign: s. moment_arm: a or b, m. loss: L, N m.
        cable_tension: T, N. lever: of the contact force about the joint, m.
    """
    return (cable_sign * moment_arm * cable_tension + loss - joint_lhs) / lever


def _pulley_radius(motor: Motor) -> float:
    if motor.pulley_radius is None:
        raise UserError(
            "The rig gives no pulley radius; 'motor.pulley_radius' (m) is needed to find the cable tension."
        )
    return motor.pulley_radius
