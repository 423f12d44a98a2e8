"""What effects on the joints share: torques, friction, errors of the angles, levers of a force at the tip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from fingerlab.effects.base import REVERSAL_SPEED, Row, Shape, Term
from fingerlab.physics import nominal
from fingerlab.physics.friction_states import friction_state, slip_states, with_grid
from fingerlab.physics.motion import Motion, tip_reach, while_pressed
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

JOINT_TRAVELS_DEG = (0.06, 0.085, 0.12, 0.17, 0.24, 0.34, 0.48)
"""Travel over which a Coulomb joint reverses 63 % of its friction, degrees: from the sensor's 0.04 degrees
(KMA210 data sheet), so that noise does not flip the sign of a joint at rest, to the least that is called
presliding; assumed."""
LEAST_JOINT_SPEED = 0.0075
"""At which a joint's friction by the speed turns round, rad/s: what is far below the noise of its speed (of
0.05 degrees below 8 Hz, some 0.03 rad/s) makes noise of all that it explains; assumed."""
COULOMB = Parameter(
    "N m", 0.0, 0.05, 0.005, title="friction torque", varies_between_runs=True, holds_at_rest=True
)
ANGLES = ("mcp", "pip")
SMALL_TURN_RAD = 1e-3
"""Step over which slopes with an angle are taken; they bend by a millionth of themselves over it."""


def joint_terms(gain: str, mcp: Array, pip: Array) -> list[Term]:
    """A torque in both joints, each with a gain of its own: ``gain_mcp`` and ``gain_pip``."""
    return [Term(Row.MCP, f"{gain}_mcp", mcp, "joint"), Term(Row.PIP, f"{gain}_pip", pip, "joint")]


def both(name: str, gain: Parameter) -> dict[str, Parameter]:
    """The same kind of gain for MCP and PIP."""
    return {f"{name}_mcp": gain, f"{name}_pip": gain}


def friction_of_joints(motion: Motion, shape: Shape) -> tuple[Array, Array]:
    """Direction in which each joint rubs, in [-1, 1], (n,): by its travel, or by its speed."""
    _, joints = motion.finger_and_joints
    if REVERSAL_SPEED in shape:
        width = shape[REVERSAL_SPEED]
        return np.tanh(joints.mcp_velocity / width), np.tanh(joints.pip_velocity / width)
    return _state(motion, "mcp", joints.mcp, shape), _state(motion, "pip", joints.pip, shape)


def _state(motion: Motion, name: str, angle: Array, shape: Shape) -> Array:
    travel_deg, sharpness = shape["travel_deg"], shape.get("sharpness", 0.0)
    if sharpness > 0.0:
        way, start = float(np.radians(travel_deg)), shape.get("start", 1.0)
        key = ("sticking", name, travel_deg, sharpness, start)
        return motion.remember(key, lambda: friction_state(angle, way, sharpness, start=start))
    travels = with_grid(travel_deg, JOINT_TRAVELS_DEG)
    keys = [("sticking", name, travel) for travel in travels]
    return motion.remember_each(keys[0], keys, lambda: slip_states(angle, np.radians(travels)))


def angle_error_terms(motion: Motion, gain: str, mcp: Array, pip: Array) -> list[Term]:
    """What an error of the measured angles (rad) does to the joints' torques and the cable length.

    The sensor reads too much by the gain times the column: what springs, gravity and contact ask for and the
    cable that the joints call for are then too large by as much, and the tip seems to stand elsewhere.
    """
    terms = [
        Term(row, f"{gain}_{ANGLES[k]}", -_slope(motion, j, k) * error, "joint")
        for k, error in enumerate((mcp, pip))
        for j, row in enumerate((Row.MCP, Row.PIP))
    ]
    return [
        *terms,
        Term(Row.CABLE, f"{gain}_mcp", -mcp, "arm_mcp"),
        Term(Row.CABLE, f"{gain}_pip", -pip, "arm_pip"),
        *_misread_tip(motion, gain, mcp, pip),
    ]


def misread(motion: Motion, gain: str, joint: str, error: Array) -> list[Term]:
    """The same for an error (rad) of one measured angle, of joint ``mcp`` or ``pip``."""
    errors = [error if joint == one else np.zeros_like(error) for one in ANGLES]
    every = angle_error_terms(motion, gain, *errors)
    return [replace(term, gain=gain) for term in every if term.gain == f"{gain}_{joint}"]


def _slope(motion: Motion, joint: int, angle: int) -> Array:
    """How the torque that springs, gravity and contact ask of a joint grows with an angle, N m/rad.

    ``joint`` and ``angle`` count in ``ANGLES``. Inertia is left out: an angle error changes it by a product
    of two small numbers.
    """
    f, q = motion.finger_and_joints

    def asked(mcp: Array, pip: Array) -> tuple[Array, Array]:
        one = nominal.mcp_gravity(f, mcp, pip) + f.mcp_stiffness * mcp
        other = nominal.pip_gravity(f, mcp, pip) + f.pip_stiffness * pip
        if motion.force is None:
            return one, other
        return (
            one + motion.force * nominal.contact_lever_mcp(f, mcp, pip),
            other + motion.force * nominal.contact_lever_pip(f, mcp, pip),
        )

    def slopes() -> Iterator[Array]:
        for k in range(len(ANGLES)):
            turned = [SMALL_TURN_RAD * (k == i) for i in range(len(ANGLES))]
            high = asked(q.mcp + turned[0], q.pip + turned[1])
            low = asked(q.mcp - turned[0], q.pip - turned[1])
            yield from ((a - b) / (2.0 * SMALL_TURN_RAD) for a, b in zip(high, low, strict=True))

    keys = [("slope", j, k) for k in range(len(ANGLES)) for j in range(len(ANGLES))]
    return motion.remember_each(("slope", joint, angle), keys, slopes)


def _misread_tip(motion: Motion, gain: str, mcp: Array, pip: Array) -> list[Term]:
    """What angles that read too much by the gain times the column (rad) add to the tip's depth, by joint."""
    f, q = motion.finger_and_joints
    reach = tip_reach(motion)
    distal = motion.remember(
        "distal reach", lambda: reach - 2.0 * f.proximal_half_length * np.cos(f.wrist_angle - q.mcp)
    )
    return [
        Term(Row.TIP, f"{gain}_mcp", while_pressed(motion, reach * mcp)),
        Term(Row.TIP, f"{gain}_pip", while_pressed(motion, distal * pip)),
    ]


def lateral_levers(motion: Motion, gain: str) -> list[Term]:
    """Levers (m) of a force along the load cell's face about both joints."""
    f, q = motion.finger_and_joints

    def distal() -> Array:
        return np.asarray(2.0 * f.distal_half_length * np.sin(q.mcp + q.pip - f.wrist_angle))

    pip = motion.remember("lateral pip", distal)
    mcp = motion.remember(
        "lateral mcp", lambda: pip - 2.0 * f.proximal_half_length * np.sin(f.wrist_angle - q.mcp)
    )
    return [Term(Row.MCP, gain, mcp, "joint"), Term(Row.PIP, gain, pip, "joint")]


def sideways_terms(motion: Motion, gain: str, force: Array) -> list[Term]:
    """Torques of a force (N) along the load cell's face, away from the MCP joint."""
    return [Term(t.row, gain, force * t.values, "joint") for t in lateral_levers(motion, gain)]


PRESSED_TURNS_DEG = tuple(8.0 * k for k in range(-3, 4))
"""Angles of a load cell against the finger about which the torques are taken as straight, each half-way to
the next; what friction does to the tip is within 7 per cent."""

Pair = tuple[Array, Array]


def turned_torques(
    motion: Motion, force: Array | None, angle: float, weighs: bool = True
) -> tuple[Pair, Pair]:
    """What gravity and the force (N) do to MCP and PIP, N m, and its slope with the angle (rad).

    Thesis equations 3.16 to 3.18; the angle comes on top of the wrist angle.

    Args:
        weighs: whether gravity turns as well, as with a tilted base; else the force alone.
    """
    f, q = motion.finger_and_joints
    proximal, distal = f.wrist_angle - q.mcp, q.mcp + q.pip - f.wrist_angle
    sines = {
        name: motion.remember(("tilt", name), partial(wave, at))
        for name, wave, at in (
            ("sin p", np.sin, proximal), ("cos p", np.cos, proximal),
            ("sin d", np.sin, distal), ("cos d", np.cos, distal),
        )
    }  # fmt: skip
    c, s = np.cos(angle), np.sin(angle)
    pressed: Array | float = 0.0 if force is None else force
    near, far = 2.0 * f.proximal_half_length * pressed, 2.0 * f.distal_half_length * pressed
    if weighs:
        weight_near, weight_far = motion.weights
        near, far = near - weight_near, far - weight_far
    pip = far * (c * sines["cos d"] + s * sines["sin d"])
    turn_pip = far * (c * sines["sin d"] - s * sines["cos d"])
    mcp = near * (c * sines["cos p"] - s * sines["sin p"]) + pip
    turn_mcp = turn_pip - near * (c * sines["sin p"] + s * sines["cos p"])
    return (np.asarray(mcp), np.asarray(pip)), (np.asarray(turn_mcp), np.asarray(turn_pip))
