"""Motor and gearbox: torque that never reaches the cable."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fingerlab.effects.base import Effect, Gain, Row, Shape, Term
from fingerlab.effects.cable import (
    STICKING_TRAVELS_DEG,
    USUAL_STICKING_DEG,
    pull_terms,
    winding_state,
)
from fingerlab.effects.closer import OCTAVE, every, plus, rubbing, times
from fingerlab.effects.friction import SPEED_FACTORS, dahl_or_masing
from fingerlab.effects.hysteresis import dahl_states, friction_state, rubbing_forces, with_grid
from fingerlab.effects.motion import Motion
from fingerlab.physics.parameter import LOSS
from fingerlab.sessions.model import Array

PRESLIDING_TRAVELS_DEG = (1.0, 2.0, 4.0, 8.0)
"""Travel over which what winds up before it slides lets go, degrees at the pulley; assumed."""
REFERENCE_LOAD_NM = 0.1
"""Load at which the travel of a friction that grows with it is told, N m; assumed, only a scale."""
FRICTION = Gain(
    "N m", 0.0, 0.1, 0.005, title="friction torque at the gearbox output",
    varies_between_runs=True, holds_at_rest=True,
)  # fmt: skip


def drive_terms(motion: Motion, gain: str, torque: Array) -> list[Term]:
    """A torque on the motor side (N m): in both joint equations as a tension, or in the bench equation."""
    if motion.finger is None:
        return [Term(Row.BENCH, gain, torque)]
    return pull_terms(gain, torque / motion.radius)


def _coulomb_terms(motion: Motion, shape: Shape) -> list[Term]:
    travel, sharpness = shape["travel_deg"], shape.get("sharpness", 0.0)
    if motion.finger is None:
        return drive_terms(motion, "coulomb", winding_state(motion, travel, sharpness))
    key = ("coulomb pull", travel, sharpness)  # one signal for Coulomb and Stribeck friction
    return pull_terms(
        "coulomb",
        motion.remember(key, lambda: winding_state(motion, travel, sharpness) / motion.radius),
    )


def _coulomb(motion: Motion, shape: Shape) -> list[Term]:
    return _coulomb_terms(motion, shape)


def _viscous(motion: Motion, shape: Shape) -> list[Term]:
    return drive_terms(motion, "viscous", motion.velocity)


def _inertia(motion: Motion, shape: Shape) -> list[Term]:
    if motion.finger is None:
        return drive_terms(motion, "inertia", motion.acceleration)
    return pull_terms("inertia", motion.inertial_pull)


def _stribeck(motion: Motion, shape: Shape) -> list[Term]:
    rubbing = {"travel_deg": USUAL_STICKING_DEG, **shape}
    state = winding_state(motion, rubbing["travel_deg"], rubbing.get("sharpness", 0.0))
    slow = np.exp(-((motion.velocity / shape["stribeck_speed"]) ** 2))
    return _coulomb_terms(motion, rubbing) + drive_terms(motion, "extra", state * slow)


def _presliding(motion: Motion, shape: Shape) -> list[Term]:
    if shape.get("masing"):
        winding = winding_state(motion, shape["travel_deg"], shape.get("sharpness", 0.0))
        return drive_terms(motion, "dahl", winding)
    travels = with_grid(shape["travel_deg"], PRESLIDING_TRAVELS_DEG)
    keys = [("dahl", travel) for travel in travels]
    state = motion.remember_each(keys[0], keys, lambda: dahl_states(motion.position, np.radians(travels)))
    return drive_terms(motion, "dahl", state)


def _asymmetric(motion: Motion, shape: Shape) -> list[Term]:
    """Friction of its own size in each direction: Coulomb friction of their mean, and half their difference.

    What sticks knows no zero between the two sizes, so that the difference is a constant torque at all times.
    """
    one = motion.remember("constant drag", lambda: np.full_like(motion.position, 1.0 / motion.radius))
    constant = (
        drive_terms(motion, "difference", one) if motion.finger is None else pull_terms("difference", one)
    )
    return _coulomb_terms(motion, shape) + constant


def _load_dependent(motion: Motion, shape: Shape) -> list[Term]:
    """A tooth that slides at a share of the load: what sticks is not let go when the load rises.

    It is held by one spring, whatever the load, so that it slides over a travel in proportion to the load.
    """
    inertia = motion.motor.inertia or 0.0
    load = np.abs(motion.torque - inertia * motion.acceleration if motion.load is None else motion.load)

    def stops(position: Array, reaches: Array) -> Array:
        return rubbing_forces(position, load, REFERENCE_LOAD_NM / reaches)

    way, sharpness = float(np.radians(shape["travel_deg"])), shape.get("sharpness", 0.0)
    return drive_terms(motion, "share", friction_state(motion.position, way, sharpness, stops))


def _spring(motion: Motion, shape: Shape) -> list[Term]:
    return drive_terms(motion, "stiffness", motion.position)


def _ripple(motion: Motion, shape: Shape) -> list[Term]:
    """A torque with the period of the order, and its double: no mesh or commutator makes a pure sine."""
    order = shape["order"]

    def column(gain: str, of: float, part: str) -> list[Term]:
        pull = motion.remember(
            ("ripple", of, part), lambda: getattr(_turning(motion, of), part) / motion.radius
        )
        return drive_terms(motion, gain, pull) if motion.finger is None else pull_terms(gain, pull)

    return [
        *column("sine", order, "imag"),
        *column("cosine", order, "real"),
        *column("double_sine", 2 * order, "imag"),
        *column("double_cosine", 2 * order, "real"),
    ]


def _turning(motion: Motion, order: float) -> Any:
    """exp(i order position), complex (n,); from the order two below, which costs a tenth of a sine."""
    if order <= RIPPLE_ORDERS[0] or order % 2:
        return motion.remember(("turning", order), lambda: np.exp(1j * order * motion.position))
    step = motion.remember(("turning", 2), lambda: np.exp(2j * motion.position))
    return motion.remember(("turning", order), lambda: _turning(motion, order - 2) * step)


RIPPLE_ORDERS = (*range(4, 41, 2), *range(44, 61, 4))
"""Periods a turn of the pulley that are tried; between two of them a travel of 30 degrees shifts the phase by
a quarter of a radian at most. 4.3:1 gearing puts the motor's 13 commutator segments at 56."""
RIPPLE = Gain("N m", -0.05, 0.05, 0.003, title="ripple amplitude")
DOUBLE = Gain("N m", -0.02, 0.02, 0.001, title="ripple amplitude at twice the order")


def _with_travel(shape: Shape) -> tuple[Shape]:
    return ({"travel_deg": USUAL_STICKING_DEG, **shape},)


STICKING_TRAVELS = tuple({"travel_deg": value} for value in STICKING_TRAVELS_DEG)
SPEEDS = tuple({"stribeck_speed": value} for value in (0.1, 0.3, 0.8, 2.0))

EFFECTS = (
    Effect(
        id="motor_coulomb_friction",
        title="Coulomb friction in motor and gearbox",
        acts_on=("motor_torque",),
        gains={"coulomb": FRICTION},
        columns=_coulomb,
        coordinate="motor speed",
        equation=Row.PIP,
        explanation="Both joints miss the same tension, which flips sign with motor speed.",
        reveal="a motor-bench run without a finger",
        shapes=STICKING_TRAVELS,
        shape_units={"travel_deg": "deg"},
        closer=rubbing(),
        bench=True,
    ),
    Effect(
        id="motor_viscous_friction",
        title="Viscous friction in motor and gearbox",
        acts_on=("motor_torque",),
        gains={
            "viscous": Gain(
                "N m s/rad", 0.0, 0.02, 0.001, title="viscous coefficient", varies_between_runs=True
            )
        },
        columns=_viscous,
        coordinate="motor speed",
        equation=Row.PIP,
        explanation="Both joints miss the same tension, in proportion to motor speed.",
        reveal="a motor-bench run at several speeds",
        bench=True,
    ),
    Effect(
        id="motor_inertia",
        title="Other inertia of rotor, gearbox and pulley",
        acts_on=("motor_torque",),
        gains={"inertia": Gain("kg m^2", -3e-4, 2e-3, 2e-4, title="inertia beyond nominal")},
        columns=_inertia,
        coordinate="motor acceleration",
        equation=Row.PIP,
        explanation="Both joints miss the same tension, in proportion to motor acceleration.",
        reveal="a fast chirp on the motor bench",
        bench="beside a finger",
    ),
    Effect(
        id="motor_stribeck_friction",
        title="Stribeck friction in motor and gearbox",
        acts_on=("motor_torque",),
        gains={"coulomb": FRICTION, "extra": replace(FRICTION, excess_of="coulomb")},
        columns=_stribeck,
        coordinate="motor speed",
        equation=Row.PIP,
        explanation="Both joints miss the same tension; it flips sign with motor speed, larger when slow.",
        reveal="a chirp from 0.1 to 3 Hz on the motor bench",
        shapes=SPEEDS,
        shape_units={"stribeck_speed": "rad/s"},
        closer=every(_with_travel, times("stribeck_speed", SPEED_FACTORS), rubbing(OCTAVE[1:-1], (0.0, 1.0))),
        bench=True,
    ),
    Effect(
        id="motor_presliding",
        title="Presliding on the motor side",
        acts_on=("motor_torque",),
        gains={"dahl": FRICTION},
        columns=_presliding,
        coordinate="motor speed",
        equation=Row.PIP,
        explanation="Both joints miss the same tension; it builds up over a small travel after a reversal.",
        reveal="small sines, 1 to 5 degrees, on the motor bench",
        shapes=tuple({"travel_deg": value} for value in PRESLIDING_TRAVELS_DEG),
        shape_units={"travel_deg": "deg"},
        closer=dahl_or_masing,
        bench=True,
    ),
    Effect(
        id="asymmetric_friction",
        title="Motor friction that differs by direction",
        acts_on=("motor_torque",),
        gains={
            "coulomb": FRICTION,
            "difference": Gain(
                "N m",
                -0.05,
                0.05,
                0.005,
                title="more of it winding in than paying out, half",
                excess_of="coulomb",
                degenerate_with=LOSS,
            ),
        },
        columns=_asymmetric,
        coordinate="motor speed",
        equation=Row.PIP,
        explanation="Both joints miss the same tension, and more of it in one direction of travel.",
        reveal="slow sines on the motor bench",
        shapes=STICKING_TRAVELS,
        shape_units={"travel_deg": "deg"},
        closer=rubbing(),
        bench=True,
    ),
    Effect(
        id="load_dependent_friction",
        title="Friction that grows with load",
        acts_on=("motor_torque",),
        gains={
            "share": Gain(
                "1",
                0.0,
                0.5,
                0.05,
                title="friction as a share of the torque",
                varies_between_runs=True,
                holds_at_rest=True,
            )
        },
        columns=_load_dependent,
        coordinate="tension times direction of travel",
        equation=Row.PIP,
        explanation="The missing tension opposes the travel and grows with the torque transmitted.",
        reveal="a motor bench with two known loads",
        shapes=tuple({"travel_deg": value, "sharpness": 1.0} for value in (0.6, 0.85, 1.2, 1.7)),
        shape_units={"travel_deg": "deg"},
        closer=rubbing(OCTAVE[1:-1]),
        bench=True,
    ),
    Effect(
        id="motor_spring",
        title="Elastic torque on the motor side",
        acts_on=("motor_torque",),
        gains={"stiffness": Gain("N m/rad", -0.05, 0.2, 0.01, title="stiffness")},
        columns=_spring,
        coordinate="motor angle",
        equation=Row.PIP,
        explanation="Both joints miss the same tension, in proportion to the motor angle.",
        reveal="slow steps on the motor bench",
        bench=True,
    ),
    Effect(
        id="torque_ripple",
        title="Torque ripple",
        acts_on=("motor_torque",),
        gains={"sine": RIPPLE, "cosine": RIPPLE, "double_sine": DOUBLE, "double_cosine": DOUBLE},
        columns=_ripple,
        coordinate="motor angle",
        equation=Row.PIP,
        explanation="Both joints miss the same tension, which repeats with the motor angle.",
        reveal="a slow sine of large amplitude on the motor bench",
        shapes=tuple({"order": float(n)} for n in RIPPLE_ORDERS),
        shape_units={"order": "1/turn"},
        closer=plus("order", tuple(k / 2 for k in range(-6, 7))),
        bench=True,
    ),
)
