"""The cable between pulley and finger: slack, stretch, play, moment arms, sheath friction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fingerlab.effects.base import Effect, Gain, Row, Shape, Term
from fingerlab.effects.closer import HALF_OCTAVE, either, every, times
from fingerlab.effects.hysteresis import (
    first_order_lags,
    friction_state,
    rubbing_forces,
    slip_states,
    stop_operators,
    with_grid,
)
from fingerlab.effects.motion import Motion
from fingerlab.physics import nominal
from fingerlab.sessions.model import Array

STICKING_TRAVELS_DEG = (0.15, 0.21, 0.3, 0.42, 0.6, 0.84)
"""Travel over which friction of motor or sheath reverses by 63 %, degrees at the pulley: from a few steps of
the encoder to the wind-up of a gearbox; assumed."""
USUAL_STICKING_DEG = 0.3
HELD_TRAVELS_DEG = (0.1, 0.2)
"""Travel over which a cable that is held in its sheath slides at a tension of REFERENCE_PULL_N, degrees at
the pulley; assumed: what a stiff cable of 2e-5 m/N stretches under its friction on a pulley of 10 to 15 mm. A
gearbox, whose friction also grows with the load, winds up by more."""
REFERENCE_PULL_N = 5.0
"""Tension at which the travel of a friction that grows with the load is told, N: what sticks has one spring,
so that it slides over twice the travel at twice the load. Assumed; only a scale."""
LAGS_S = (0.004, 0.008, 0.016, 0.032)
"""Time constants of a damper beside the cable's spring, s; assumed."""
GAPS_DEG = (0.5, 1.0, 2.0, 4.0)
"""Play between gearbox and pulley, degrees at the pulley; assumed."""


def winding_state(motion: Motion, travel_deg: float = USUAL_STICKING_DEG, sharpness: float = 0.0) -> Array:
    """Direction of cable travel with sticking, in [-1, 1], shape (n,); +1 winding in."""
    way = float(np.radians(travel_deg))

    if sharpness > 0.0:
        key = ("winding", travel_deg, sharpness)
        return motion.remember(key, lambda: friction_state(motion.position, way, sharpness))
    travels = with_grid(travel_deg, STICKING_TRAVELS_DEG)
    keys = [("winding", travel) for travel in travels]
    return motion.remember_each(keys[0], keys, lambda: slip_states(motion.position, np.radians(travels)))


def pull_terms(gain: str, pull: Array) -> list[Term]:
    """Tension (N) that the motor gives and the cable never sees: not in the joints, not in the stretch."""
    return [Term(Row.MCP, gain, pull), Term(Row.PIP, gain, pull), Term(Row.CABLE, gain, pull, "compliance")]


def _no_columns(motion: Motion, shape: Shape) -> list[Term]:
    return []


def _lagging_stretch(motion: Motion, shape: Shape) -> list[Term]:
    """What a damper beside the cable's spring takes from the stretch: the tension lags by the time constant.

    The stretch itself is the compliance that every model carries, set free; these terms replace the tension
    in it by the lagging one.
    """
    time_constant = shape["time_constant"]
    if time_constant == 0:
        return []

    constants = with_grid(time_constant, LAGS_S)

    def change(name: str, values: Array) -> Array:
        keys = [("lag", name, constant) for constant in constants]
        lagging = motion.remember_each(
            keys[0], keys, lambda: first_order_lags(values, constants, motion.sample_rate_hz)
        )
        return lagging - values

    inertia = motion.motor.inertia or 0.0
    return [
        Term(Row.CABLE, "", change("tension", motion.tension), "compliance", constant=-1.0),
        Term(Row.CABLE, "", change("pull", motion.inertial_pull), "compliance", constant=inertia),
    ]


def _backlash(motion: Motion, shape: Shape) -> list[Term]:
    gaps = with_grid(shape["gap_deg"], GAPS_DEG)
    keys = [("gap", gap) for gap in gaps]
    state = motion.remember_each(
        keys[0], keys, lambda: stop_operators(motion.position, 0.5 * np.radians(gaps))
    )
    return [Term(Row.CABLE, "half_gap", motion.radius * state)]


def _varying_arm(motion: Motion, shape: Shape) -> list[Term]:
    """a(theta1) = a (1 + p theta1), b(theta2) = b (1 + q theta2).

    The growth has a part that is the same for both routings, and a part that turns with the side on which
    the cable runs. The tension carries 1/a: its second order in p has a gain of its own, because p is not
    small (0.4/rad over 0.6 rad takes a quarter of the arm).
    """
    f, q = motion.finger_and_joints
    contact_mcp, contact_pip = motion.contact_torques
    mcp = nominal.mcp_torque(f, q).total + contact_mcp
    pip = nominal.pip_torque(f, q).total + contact_pip
    terms = [
        Term(Row.MCP, "bend_mcp", mcp * q.mcp**2, "joint"),
        Term(Row.PIP, "bend_pip", pip * q.pip**2, "joint"),
    ]
    for name, sign in (("growth", 1.0), ("turn", float(motion.cable_sign))):
        terms += [
            Term(Row.MCP, f"{name}_mcp", -sign * mcp * q.mcp, "joint"),
            Term(Row.PIP, f"{name}_pip", -sign * pip * q.pip, "joint"),
            Term(Row.CABLE, f"{name}_mcp", 0.5 * sign * q.mcp**2, "arm_mcp"),
            Term(Row.CABLE, f"{name}_pip", 0.5 * sign * q.pip**2, "arm_pip"),
        ]
    return terms


def _capstan(motion: Motion, shape: Shape) -> list[Term]:
    """The sheath takes its share of the tension in the cable, before or behind what stretches.

    The share follows the tension of the moment or, where ``held``, only as far as what sticks is let go: a
    cable that sticks in its sheath keeps its friction while the tension rises on both ends of it.
    """
    travel, sharpness = shape["travel_deg"], shape.get("sharpness", 0.0)
    held = bool(shape.get("held", 0.0))

    def lost() -> Array:
        cable = motion.tension - (motion.motor.inertia or 0.0) * motion.inertial_pull
        if not held:
            return cable * winding_state(motion, travel, sharpness)
        limit = np.maximum(cable, 0.0)

        def stops(position: Array, reaches: Array) -> Array:
            return rubbing_forces(position, limit, REFERENCE_PULL_N / reaches)

        return friction_state(motion.position, float(np.radians(travel)), sharpness, stops)

    terms = pull_terms("loss", motion.remember(("sheath", travel, sharpness, held), lost))
    return [t for t in terms if shape["stretch_behind"] or t.row != Row.CABLE]


def _sheath(travel: float, stretch_behind: float, held: float = 0.0) -> Shape:
    """What is held is one contact, what follows the tension are many."""
    return {"travel_deg": travel, "stretch_behind": stretch_behind, "held": held, "sharpness": held}


def _sheath_closer(shape: Shape) -> Sequence[Shape]:
    """Around the one found, and where the other law would be looked for."""
    travel = shape["travel_deg"]
    held = _sheath(travel if shape["held"] else HELD_TRAVELS_DEG[0] * 2**0.5, 1.0, held=1.0)
    following = _sheath(USUAL_STICKING_DEG if shape["held"] else travel, 1.0)
    behind = either("stretch_behind", (1.0, 0.0))
    return [
        *every(times("travel_deg"), behind)(held),
        *every(times("travel_deg", HALF_OCTAVE), behind)(following),
    ]


EFFECTS = (
    Effect(
        id="cable_slack",
        title="Cable slack",
        acts_on=("cable_kinematics",),
        gains={},
        columns=_no_columns,
        coordinate="tension",
        equation=Row.CABLE,
        explanation="At about zero tension the motor pays out cable that the joints do not take up.",
        reveal="a sine whose offset is so low that the cable is let out entirely",
        special="slack",
    ),
    Effect(
        id="cable_stretch",
        title="Cable stretch",
        acts_on=("cable_kinematics",),
        gains={},
        columns=_lagging_stretch,
        shapes=tuple({"time_constant": value} for value in (0.0, *LAGS_S)),
        shape_units={"time_constant": "s"},
        closer=times("time_constant"),
        relaxes={
            "cable_compliance": Gain("m/N", 0.0, 1e-3, 1e-4, title="cable compliance"),
            "cable_damping": Gain("m s/N", -2e-5, 2e-5, 2e-6, title="cable damping"),
        },
        coordinate="tension",
        equation=Row.CABLE,
        explanation="The cable that is wound beyond what the joints call for is proportional to the tension.",
        reveal="a contact run, where the tension changes much and the joints hardly move",
    ),
    Effect(
        id="backlash",
        title="Play between gearbox and pulley",
        acts_on=("cable_kinematics",),
        gains={"half_gap": Gain("rad", 0.0, 0.1, 0.01, title="half the play")},
        columns=_backlash,
        coordinate="motor speed",
        equation=Row.CABLE,
        explanation="At each reversal the motor turns through a gap before the cable follows.",
        reveal="slow steps up and down with the cable under tension",
        shapes=tuple({"gap_deg": value} for value in GAPS_DEG),
        shape_units={"gap_deg": "deg"},
        closer=times("gap_deg"),
    ),
    Effect(
        id="varying_moment_arm",
        title="Moment arm that changes with angle",
        acts_on=("joint_torque", "cable_kinematics"),
        gains={
            "growth_mcp": Gain("1/rad", -1.0, 1.0, 0.2, title="growth of a with angle"),
            "growth_pip": Gain("1/rad", -1.0, 1.0, 0.2, title="growth of b with angle"),
            "turn_mcp": Gain("1/rad", -1.0, 1.0, 0.2, title="growth of a that turns with the routing"),
            "turn_pip": Gain("1/rad", -1.0, 1.0, 0.2, title="growth of b that turns with the routing"),
            "bend_mcp": Gain("1/rad^2", 0.0, 1.0, 0.04, title="its square, in the torque"),
            "bend_pip": Gain("1/rad^2", 0.0, 1.0, 0.04, title="its square, in the torque"),
        },
        columns=_varying_arm,
        coordinate="joint angle",
        equation=Row.CABLE,
        explanation="Torque and cable length call for a moment arm that changes with the joint angle.",
        reveal="a slow sine over the whole travel",
    ),
    Effect(
        id="capstan_friction",
        title="Sheath (capstan) friction",
        acts_on=("joint_torque", "motor_torque"),
        gains={
            "loss": Gain(
                "1",
                0.0,
                0.5,
                0.05,
                title="share of the tension lost in the sheath",
                varies_between_runs=True,
                holds_at_rest=True,
            )
        },
        columns=_capstan,
        coordinate="tension times direction of travel",
        equation=Row.PIP,
        explanation="The motor needs more tension winding in, less paying out, in proportion to the tension.",
        reveal="runs at several loads, contact included",
        shapes=(
            *(_sheath(travel, stretch_behind=1.0, held=1.0) for travel in HELD_TRAVELS_DEG),
            *(_sheath(travel, stretch_behind=1.0) for travel in STICKING_TRAVELS_DEG[-2::-2]),
            *(_sheath(travel, stretch_behind=0.0) for travel in STICKING_TRAVELS_DEG[::2]),
        ),
        shape_units={"travel_deg": "deg"},
        closer=_sheath_closer,
    ),
)
