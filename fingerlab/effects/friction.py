"""Friction in the joints: torque against the direction of joint motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fingerlab.effects.base import Effect, Gain, Row, Shape, Term
from fingerlab.effects.closer import FINE_OCTAVE, HALF_OCTAVE, OCTAVE, either, every, rubbing, times
from fingerlab.effects.hysteresis import dahl_states, friction_state, slip_states, with_grid
from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array

STICKING_TRAVELS_DEG = (0.06, 0.085, 0.12, 0.17, 0.24, 0.34, 0.48)
"""Travel over which a Coulomb joint reverses 63 % of its friction, degrees: from the sensor's 0.04 degrees
(KMA210 data sheet), so that noise does not flip the sign of a joint at rest, to the least that is called
presliding; assumed."""
SPEED_FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)
PRESLIDING_TRAVELS_DEG = (1.0, 2.0, 4.0, 8.0)
"""The same of presliding, degrees at the joint; assumed."""
STRIBECK_SPEEDS = (0.2, 0.6)
"""Speeds by which the excess of breakaway has fallen to 37 %, rad/s; assumed: from where a hinge of polymer
slides for certain to a third of the thesis' fastest motion."""

COULOMB_GAIN = Gain(
    "N m", 0.0, 0.05, 0.005, title="friction torque", varies_between_runs=True, holds_at_rest=True
)
VISCOUS_GAIN = Gain("N m s/rad", 0.0, 0.02, 0.002, title="viscous coefficient", varies_between_runs=True)


def joint_terms(gain: str, mcp: Array, pip: Array) -> list[Term]:
    """A torque in both joints, each with a gain of its own: ``gain_mcp`` and ``gain_pip``."""
    return [Term(Row.MCP, f"{gain}_mcp", mcp, "joint"), Term(Row.PIP, f"{gain}_pip", pip, "joint")]


def both(name: str, gain: Gain) -> dict[str, Gain]:
    """The same kind of gain for MCP and PIP."""
    return {f"{name}_mcp": gain, f"{name}_pip": gain}


def _viscous(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    return joint_terms("viscous", joints.mcp_velocity, joints.pip_velocity)


def _states(motion: Motion, shape: Shape) -> tuple[Array, Array]:
    _, joints = motion.finger_and_joints
    return _state(motion, "mcp", joints.mcp, shape), _state(motion, "pip", joints.pip, shape)


def _state(motion: Motion, name: str, angle: Array, shape: Shape) -> Array:
    travel_deg, sharpness = shape["travel_deg"], shape.get("sharpness", 0.0)
    if sharpness > 0.0:
        way = float(np.radians(travel_deg))
        key = ("sticking", name, travel_deg, sharpness)
        return motion.remember(key, lambda: friction_state(angle, way, sharpness))
    travels = with_grid(travel_deg, STICKING_TRAVELS_DEG)
    keys = [("sticking", name, travel) for travel in travels]
    return motion.remember_each(keys[0], keys, lambda: slip_states(angle, np.radians(travels)))


def _coulomb(motion: Motion, shape: Shape) -> list[Term]:
    return joint_terms("coulomb", *_states(motion, shape))


def _stribeck(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    mcp, pip = _states(motion, shape)
    speed = shape["stribeck_speed"]
    return joint_terms("coulomb", mcp, pip) + joint_terms(
        "extra",
        mcp * np.exp(-((joints.mcp_velocity / speed) ** 2)),
        pip * np.exp(-((joints.pip_velocity / speed) ** 2)),
    )


def _presliding(motion: Motion, shape: Shape) -> list[Term]:
    _, joints = motion.finger_and_joints
    if shape.get("masing"):
        return joint_terms("dahl", *_states(motion, shape))

    def state(name: str, angle: Array) -> Array:
        travels = with_grid(shape["travel_deg"], PRESLIDING_TRAVELS_DEG)
        keys = [("dahl", name, travel) for travel in travels]
        return motion.remember_each(keys[0], keys, lambda: dahl_states(angle, np.radians(travels)))

    return joint_terms("dahl", state("mcp", joints.mcp), state("pip", joints.pip))


def dahl_or_masing(shape: Shape) -> list[Shape]:
    masing = either("masing", (1.0,))
    return [
        *times("travel_deg", HALF_OCTAVE)(shape),
        *every(masing, rubbing(OCTAVE[1:-1], (0.0,)))(shape),
        *every(masing, rubbing(FINE_OCTAVE, (0.5,)))(shape),
    ]


EFFECTS = (
    Effect(
        id="viscous_friction",
        title="Viscous joint friction",
        acts_on=("joint_torque",),
        gains=both("viscous", VISCOUS_GAIN),
        columns=_viscous,
        coordinate="joint speed",
        equation=Row.PIP,
        explanation="The missing torque grows in proportion to joint speed and changes sign with it.",
        reveal="sines at two frequencies, 0.5 and 2 Hz, with the same amplitude",
    ),
    Effect(
        id="coulomb_friction",
        title="Coulomb joint friction",
        acts_on=("joint_torque",),
        gains=both("coulomb", COULOMB_GAIN),
        columns=_coulomb,
        coordinate="joint speed",
        equation=Row.PIP,
        explanation="The missing torque flips sign with joint speed and has one size on each side.",
        reveal="slow sines with full reversals",
        shapes=tuple({"travel_deg": travel} for travel in STICKING_TRAVELS_DEG),
        shape_units={"travel_deg": "deg"},
        closer=rubbing(),
    ),
    Effect(
        id="stribeck_friction",
        title="Stribeck joint friction",
        acts_on=("joint_torque",),
        gains=both("coulomb", COULOMB_GAIN)
        | {f"extra_{j}": replace(COULOMB_GAIN, excess_of=f"coulomb_{j}") for j in ("mcp", "pip")},
        columns=_stribeck,
        coordinate="joint speed",
        equation=Row.PIP,
        explanation="The missing torque flips sign with joint speed and is larger when the joint is slow.",
        reveal="a chirp from 0.2 to 3 Hz",
        # Neighbours in the grid differ in one number: the travels up at one speed, down at the next.
        shapes=tuple(
            {"stribeck_speed": speed, "travel_deg": travel}
            for speed, travels in zip(
                STRIBECK_SPEEDS, (STICKING_TRAVELS_DEG[:5], STICKING_TRAVELS_DEG[4::-1]), strict=True
            )
            for travel in travels
        ),
        shape_units={"stribeck_speed": "rad/s", "travel_deg": "deg"},
        closer=every(times("stribeck_speed", SPEED_FACTORS), rubbing(sharpnesses=(0.0, 1.0))),
    ),
    Effect(
        id="presliding_hysteresis",
        title="Presliding hysteresis (Dahl)",
        acts_on=("joint_torque",),
        gains=both("dahl", COULOMB_GAIN),
        columns=_presliding,
        coordinate="joint speed",
        equation=Row.PIP,
        explanation="After each reversal the missing torque builds up over a small travel of the joint.",
        reveal="sines of small amplitude, 2 to 5 degrees",
        shapes=tuple({"travel_deg": travel} for travel in PRESLIDING_TRAVELS_DEG),
        shape_units={"travel_deg": "deg"},
        closer=dahl_or_masing,
    ),
)
