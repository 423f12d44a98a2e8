"""Springs, stops and slow relaxation of the joints."""

from __future__ import annotations

import numpy as np

from fingerlab.effects.base import Effect, Gain, Row, Shape, Term, nothing
from fingerlab.effects.closer import plus, times
from fingerlab.effects.friction import both, joint_terms
from fingerlab.effects.hysteresis import first_order_lags, with_grid
from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array

RELAXING_S = (0.1, 0.2, 0.35, 0.6, 1.1, 1.9, 3.3)
"""Time constants of creep, s; assumed: those that runs of half a minute can show."""


def _hardening(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    return joint_terms("cubic", joints.mcp * joints.mcp * joints.mcp, joints.pip * joints.pip * joints.pip)


def _linear(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    return joint_terms("stiffness", joints.mcp, joints.pip)


def _coupling(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    difference = joints.mcp - joints.pip
    return [
        Term(Row.MCP, "coupling", difference, "joint"),
        Term(Row.PIP, "coupling", -difference, "joint"),
    ]


def _creep(motion: Motion, shape: Shape) -> list[Term]:
    """What a spring in series with a damper still holds: the angle less its lag.

    The lag begins as if the finger had hung there for long; what it had not relaxed of an earlier angle when
    the run began dies away beside it.
    """
    _, joints = motion.finger_and_joints
    constants = with_grid(shape["time_constant"], RELAXING_S)

    def relaxing(name: str, angle: Array) -> Array:
        keys = [("lag", name, constant) for constant in constants]
        rate = motion.sample_rate_hz
        return angle - motion.remember_each(keys[0], keys, lambda: first_order_lags(angle, constants, rate))

    fading = np.exp(-motion.time / shape["time_constant"])
    return [
        *joint_terms("relaxing", relaxing("mcp", joints.mcp), relaxing("pip", joints.pip)),
        *joint_terms("start", fading, fading),
    ]


def _stop(motion: Motion, shape: Shape) -> list[Term]:
    """A stop whose torque grows with the depth or, as of two round faces (Hertz), with its power 1.5.

    The depth counts in units of 1 rad, so that the stiffness is N m/rad under either law. Damped in
    proportion to its torque (Hunt and Crossley 1975).
    """
    _, joints = motion.finger_and_joints
    edge, hertz = float(np.radians(shape["edge_deg"])), bool(shape["hertz"])
    mcp = _pressed(motion, "mcp", edge, hertz, joints.mcp_velocity)
    pip = _pressed(motion, "pip", edge, hertz, joints.pip_velocity)
    names = "stop", "shift", "damp"
    return [t for name, *pair in zip(names, mcp, pip, strict=True) for t in joint_terms(name, *pair)]


def _pressed(motion: Motion, joint: str, edge: float, hertz: bool, velocity: Array) -> list[Array]:
    """Torque of a joint's stop, its change with the edge and its damping, each for a gain of 1; (n,)."""
    side = 1.0 if edge > 0 else -1.0
    angle: Array = getattr(motion.finger_and_joints[1], joint)
    lowest, highest = motion.remember(("reach", joint), lambda: np.array((angle.min(), angle.max())))
    if lowest >= edge if side < 0 else highest <= edge:
        return [nothing(len(angle)) for _ in range(3)]  # three signals, although all are zero here
    depth = motion.remember(("depth", joint, edge), lambda: np.maximum(side * (angle - edge), 0.0))
    slope = np.sqrt(depth) if hertz else (depth > 0).astype(float)
    torque = depth * slope
    # The change is, to first order, what the edge does that lies between two points of the grid.
    return [side * torque, side * slope, torque * velocity]


EFFECTS = (
    Effect(
        id="spring_hardening",
        title="Spring hardening",
        acts_on=("joint_torque",),
        gains=both("cubic", Gain("N m/rad^3", 0.0, 2.0, 0.1, title="cubic stiffness")),
        columns=_hardening,
        coordinate="joint angle",
        equation=Row.PIP,
        explanation="The missing torque grows with the cube of the joint angle.",
        reveal="a sine of larger amplitude and offset",
    ),
    Effect(
        id="stiffness_error",
        title="Other joint stiffness",
        acts_on=("joint_torque",),
        gains=both("stiffness", Gain("N m/rad", -0.06, 0.06, 0.01, title="stiffness beyond nominal")),
        columns=_linear,
        coordinate="joint angle",
        equation=Row.PIP,
        explanation="The missing torque is proportional to the joint angle.",
        reveal="steps over the whole travel",
    ),
    Effect(
        id="joint_coupling",
        title="Stiffness between MCP and PIP",
        acts_on=("joint_torque",),
        gains={"coupling": Gain("N m/rad", 0.0, 0.06, 0.01, title="coupling stiffness")},
        columns=_coupling,
        coordinate="difference of joint angles",
        equation=Row.PIP,
        explanation="MCP and PIP miss equal and opposite torques that follow the difference of the angles.",
        reveal="a chirp, in which the two joints move in different proportion",
    ),
    Effect(
        id="viscoelastic_creep",
        title="Viscoelastic creep",
        acts_on=("joint_torque",),
        gains=both("relaxing", Gain("N m/rad", 0.0, 0.06, 0.01, title="relaxing stiffness"))
        | both("start", Gain("N m", -0.03, 0.03, 0.002, title="torque not yet relaxed at the start")),
        columns=_creep,
        coordinate="time",
        equation=Row.PIP,
        explanation="After a change of angle an extra spring torque appears and dies away.",
        reveal="steps, each held for several seconds",
        shapes=tuple({"time_constant": value} for value in RELAXING_S),
        shape_units={"time_constant": "s"},
        closer=times("time_constant"),
    ),
    Effect(
        id="joint_stop",
        title="Stiff end of travel",
        acts_on=("joint_torque",),
        gains=both("stop", Gain("N m/rad", 0.0, 5.0, 0.2, title="stop stiffness"))
        | both("shift", Gain("N m", -0.05, 0.05, 0.002, title="stop stiffness times shift of the edge"))
        | both("damp", Gain("N m s/rad^2", 0.0, 5.0, 0.1, title="damping of the stop")),
        columns=_stop,
        coordinate="joint angle",
        equation=Row.PIP,
        explanation="Beyond a certain angle the joint is suddenly much stiffer.",
        reveal="a slow sine of larger amplitude",
        shapes=tuple(
            {"edge_deg": 5.0 * k, "hertz": hertz}
            for hertz in (0.0, 1.0)
            for k in (*range(-8, 0), *range(2, 10))
        ),
        shape_units={"edge_deg": "deg"},
        closer=plus("edge_deg", tuple(0.5 * k for k in range(-8, 9))),
    ),
)
