"""Sensors that are late, bent or adrift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fingerlab.effects.base import Effect, Gain, Row, Shape, Term
from fingerlab.effects.cable import _no_columns
from fingerlab.effects.closer import FINE_OCTAVE, either, times
from fingerlab.effects.motion import Motion
from fingerlab.effects.tip import misread_tip
from fingerlab.physics import nominal
from fingerlab.sessions.model import Array

SMALL_TURN_RAD = 1e-3
"""Step over which slopes with an angle are taken; they bend by a millionth of themselves over it."""


ANGLES = ("mcp", "pip")


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


def _angle_error_terms(motion: Motion, gain: str, mcp: Array, pip: Array) -> list[Term]:
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
        *misread_tip(motion, gain, mcp, pip),
    ]


def _nonlinearity(motion: Motion, shape: Shape) -> list[Term]:
    """A harmonic of the angle, and in another law twice that harmonic beside it.

    A magnetoresistive bridge turns twice as fast as the magnet: its offset shows as the second harmonic of
    the angle, its unequal amplitudes as the fourth, and an error that is large, seen over the angle that it
    falsifies, has the double of its own harmonic in it.
    """
    _, joints = motion.finger_and_joints
    harmonics = {"": shape["harmonic"]}
    if shape.get("double"):
        harmonics["double_"] = 2.0 * shape["harmonic"]
    terms: list[Term] = []
    for prefix, n in harmonics.items():
        for name, wave in (("sine", np.sin), ("cosine", np.cos)):
            terms += _angle_error_terms(motion, f"{prefix}{name}", wave(n * joints.mcp), wave(n * joints.pip))
    return terms


def _drift(motion: Motion, shape: Shape) -> list[Term]:
    """A sensor that warms up since the run began: fast at first and ever slower, with a time constant (s)."""
    warm = shape["time_constant"]
    drifted = -warm * np.expm1(-motion.time / warm)
    return _angle_error_terms(motion, "rate", drifted, drifted)


STEADY_S = 1e4
"""A sensor that warms up so slowly drifts steadily, s."""


def _warming_closer(shape: Shape) -> Sequence[Shape]:
    """Finer time constants; of a steady drift there are none."""
    return [shape] if shape["time_constant"] == STEADY_S else times("time_constant", FINE_OCTAVE)(shape)


def _force_gain(motion: Motion, shape: Shape) -> list[Term]:
    mcp, pip = motion.contact_torques
    return [Term(Row.MCP, "gain", mcp, "joint"), Term(Row.PIP, "gain", pip, "joint")]


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


HARMONIC = Gain(
    "rad", -0.05, 0.05, 0.01, source="KMA210 data sheet: +-1 degree linearity", title="harmonic error"
)

EFFECTS = (
    Effect(
        id="transport_delay",
        title="Late recording of joint angles and force",
        acts_on=("joint_torque", "cable_kinematics"),
        gains={"delay": Gain("s", 0.0, 0.19, 0.02, title="delay")},
        columns=_no_columns,
        coordinate="motor speed",
        equation=Row.CABLE,
        explanation="Angles and force follow the motor's own channels after a constant time.",
        reveal="a chirp, in which a delay grows with frequency",
        special="delay",
    ),
    Effect(
        id="angle_sensor_nonlinearity",
        title="Harmonic error of the angle sensors",
        acts_on=("joint_torque", "cable_kinematics"),
        gains={
            f"{prefix}{part}_{joint}": replace(HARMONIC, title=title)
            for prefix, title in (("", HARMONIC.title), ("double_", "error of the double harmonic"))
            for part in ("sine", "cosine")
            for joint in ANGLES
        },
        columns=_nonlinearity,
        coordinate="joint angle",
        equation=Row.CABLE,
        explanation="Torque and cable length miss what an angle error with a harmonic would cause.",
        reveal="slow steps over the whole travel",
        shapes=tuple({"harmonic": float(n)} for n in (2, 4, 8)),
        shape_units={"harmonic": "1/turn"},
        closer=either("double", (0.0, 1.0)),
    ),
    Effect(
        id="sensor_drift",
        title="Drift of an angle sensor",
        acts_on=("joint_torque", "cable_kinematics"),
        gains={
            f"rate_{joint}": Gain(
                "rad/s", -0.01, 0.01, 0.0005, source="KMA210 data sheet: 0.64 degree", title="drift rate"
            )
            for joint in ("mcp", "pip")
        },
        columns=_drift,
        coordinate="time",
        equation=Row.CABLE,
        explanation="The misfit grows over each run, whatever the motion.",
        reveal="a run of several minutes at rest",
        shapes=tuple({"time_constant": value} for value in (5.0, 10.0, 20.0, 40.0, STEADY_S)),
        shape_units={"time_constant": "s"},
        closer=_warming_closer,
    ),
    Effect(
        id="load_cell_gain",
        title="Span error of the load cell",
        acts_on=("endpoint_force",),
        gains={"gain": Gain("1", -0.3, 0.3, 0.05, title="force that the load cell leaves out, as a share")},
        columns=_force_gain,
        coordinate="force",
        equation=Row.PIP,
        explanation="In contact both joints miss a torque in proportion to the force that was read.",
        reveal="a calibration of the load cell with known weights",
        phases=("contact",),
    ),
)
