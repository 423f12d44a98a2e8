"""The plant of one run as the compiled code reads it, and what an effect may change in it.

Records (numpy structured scalars) keep the names readable in compiled code without an argument list
of ninety numbers. Joints are numbered 1 (MCP) and 2 (PIP) as in ``docs/theory.md``.

Strengths are chosen so that an effect matters on a bench whose joints carry some 0.04 N m, whose cable
carries some 5 N and whose motor sees some 0.07 N m. Ranges are what such an effect could plausibly
have on a printed finger with an RE40 drive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.physics.parameter import Parameter

SPREAD_ELEMENTS = 8
"""Spring-slider pairs that share one presliding friction."""

MCP, PIP, MOTOR = 0, 1, 2
"""Places with a dry friction of their own: index into the friction records."""

PLANT = np.dtype(
    [
        (name, np.float64)
        for name in (
            # Finger: kg, m, kg m^2 about the centres of mass, rad, m/s^2.
            "proximal_mass",
            "distal_mass",
            "proximal_half_length",
            "distal_half_length",
            "proximal_inertia",
            "distal_inertia",
            "knuckle_mass",  # kg at the PIP axis: screws, magnet, cover
            "hung_mass",  # kg, fixed to the distal link on purpose
            "hung_at",  # m beyond the PIP axis
            "distal_rotation",  # 0: distal body turns with the relative speed (thesis), 1: absolute
            "tilt",  # rad, wrist angle as it really is
            "tilt_cos",  # set from tilt by ``place_bench``
            "tilt_sin",
            "gravity",
            # Joint springs: N m/rad, N m/rad^3; relaxing branch N m/rad and s.
            "stiffness_1",
            "stiffness_2",
            "cubic_1",
            "cubic_2",
            "coupling",
            "relaxing_1",
            "relaxing_2",
            "relaxation_time",
            "viscous_1",  # N m s/rad
            "viscous_2",
            "stop_angle",  # rad, PIP, end of travel in extension
            "stop_stiffness",  # N m/rad^1.5
            "stop_damping",  # s, damping torque as a share of the elastic one, per rad/s
            # Cable: +1 flexion, -1 extension, 0 none.
            "cable_sign",
            "arm_1",  # m, moment arm at zero angle
            "arm_2",
            "arm_slope_1",  # 1/rad, relative change of the arm with the sine of the angle
            "arm_slope_2",
            "path_at_rest",  # m, cable path of the joints at the start
            "cable_stiffness",  # N/m
            "cable_stiffening",  # 1/N, over what it pulls as it stiffens
            "cable_damping",  # N s/m
            "slack",  # m, dead travel before the cable pulls
            "wrap",  # friction coefficient times wrap angle of the sheath
            "sheath_stiffness",  # N/m of the stuck cable in the sheath
            # Motor, at the gearbox output.
            "pulley_radius",
            "torque_constant",  # N m/A at the output, gear ratio included
            "inertia",  # kg m^2
            "motor_viscous",  # N m s/rad
            "motor_drag",  # N m s^2/rad^2, by the square of the speed
            "motor_spring",  # N m/rad
            "ripple",  # N m
            "ripple_order",  # per revolution of the output
            "ripple_phase",  # rad
            "play",  # rad between gearbox and pulley, total
            "current_lag",  # s, time constant of the servo amplifier's current loop
            "load_torque",  # N m, known load in place of the finger, or beside it
            # Contact.
            "cell_x",  # m, a point of the contact plane
            "cell_y",
            "contact_angle",  # rad, normal of the contact plane against the load cell's axis
            "normal_x",  # that normal, set from contact_angle by ``place_bench``
            "normal_y",
            "contact_stiffness",  # N/m
            "contact_damping",  # s/m, Hunt-Crossley
            "tip_friction",  # coefficient
            "tip_stiffness",  # N/m, tangential, while the tip sticks
            "tip_damping",  # N s/m, tangential
        )
    ]
)

FRICTION = np.dtype(
    [
        ("forward", np.float64),  # N m, sliding level against positive speed
        ("backward", np.float64),  # N m, against negative speed
        ("load_share", np.float64),  # friction per transmitted torque (motor only)
        ("breakaway", np.float64),  # N m by which the level at rest exceeds the sliding one
        ("stribeck_speed", np.float64),  # rad/s at which half of the excess is left
        ("travel", np.float64),  # rad of elastic travel before it slides
        ("spread", np.float64),  # N m, level of the friction that builds up gradually
        ("spread_travel", np.float64),  # rad over which it builds up
        ("damping", np.float64),  # s, damping of the elastic travel
    ]
)

CONTROL = np.dtype(
    [
        ("proportional", np.float64),  # A/rad
        ("integral", np.float64),  # A/(rad s)
        ("derivative", np.float64),  # A s/rad
        ("derivative_cutoff", np.float64),  # rad/s
        ("current_limit", np.float64),  # A
        ("count", np.float64),  # rad of output a count of the encoder
    ]
)

STATE = np.dtype(
    [
        (name, np.float64)
        for name in (
            "theta",  # rad, motor at the output
            "omega",  # rad/s
            "current",  # A
            "pulley",  # rad
            "q1",  # rad
            "q2",
            "w1",  # rad/s
            "w2",
            "relaxed_1",  # rad, relaxing branch's own spring position
            "relaxed_2",
            "elongation",  # m, of the last step, for its rate
            "sheath",  # N, force in the stuck cable
            "tip",  # N, tangential force while the tip sticks
            "tip_slide",  # m, tangential position of the last step
            "alpha",  # rad/s^2 of the last step: motor, MCP, PIP
            "a1",
            "a2",
            "integral",  # A
            "rate",  # rad/s, filtered for the derivative action
            "last_error",  # rad
        )
    ]
)

BRISTLES = (3, 1 + SPREAD_ELEMENTS)
"""Shape of the friction memory: place by element, the first element being the sharp one; N m."""

OUTPUTS = ("theta", "omega", "current", "q1", "q2", "w1", "w2", "force", "tension", "pulley_tension")
"""Columns of what a run returns: rad, rad/s, A, rad, rad, rad/s, rad/s, N, N, N."""


ON_AIR, CONTACT, MOTOR_BENCH = "on_air", "contact", "motor_bench"

Values = Mapping[str, float]
"""Parameter -> value, SI."""


@dataclass(frozen=True)
class Truth:
    """What one bench really is, drawn once a session; nothing of it is told to the rig file.

    Attributes:
        factors: true over nominal value, by rig constant.
        arms: (MCP, PIP) moment arms in m, by cable. pretravel: m of cable left loose, by cable.
        posture: (MCP, PIP), rad, where the finger meets the load cell.
        sign: +1 or -1 for effects whose direction is chance. phase: rad, of periodic effects.
    """

    factors: dict[str, float]
    arms: dict[str, tuple[float, float]]
    pretravel: dict[str, float]
    posture: tuple[float, float]
    sign: float
    phase: float


@dataclass
class Sensors:
    """What stands between the plant and the recording; SI units."""

    angle_step: float
    angle_noise: float
    force_step: float
    force_noise: float
    current_step: float
    current_noise: float
    delay: float = 0.0  # s, joint angles and force against the motor's channels
    bridge_offset: float = 0.0  # relative offset of the angle sensors' bridges
    bridge_mismatch: float = 0.0  # relative amplitude mismatch of the two bridges
    drift: float = 0.0  # rad over a run, MCP sensor
    force_gain: float = 1.0


@dataclass
class Plant:
    """The plant of one run, ready to be changed by effects and then simulated."""

    plant: Any  # record of PLANT
    friction: Any  # array (3,) of FRICTION
    control: Any  # record of CONTROL
    sensors: Sensors
    truth: Truth
    cable: str


@dataclass(frozen=True)
class Nominal:
    """What a found value is told against: stiffness of the joint springs (MCP, PIP), N m/rad, with what a
    model found of them; compliance of the bench's own cable and contact, m/N."""

    stiffness: tuple[float, float]
    cable_compliance: float
    contact_compliance: float


class NotCarriedError(ValueError):
    """A found value that the plant has nothing for; the text says what, as the end of a sentence."""


Found = Callable[[Values, Nominal], Values]
"""Values that a diagnosis found, SI, shapes as they are named there -> the plant's, beyond its defaults.

It may name ``sign`` and ``phase``, too, which are chance else.
"""


@dataclass(frozen=True)
class PlantEffect:
    """An effect as a change of the plant, which the first lines of its file say in words.

    Attributes:
        id: the effect's in ``fingerlab/effects``.
        parameters: the first is the strength; the others shape it.
        phases: phases of a session in which the effect acts.
        apply: changes the bench of one run in place, before the finger is hung and the load cell placed.
        found: the plant's parameters by the values that a diagnosis found; None: those tell too little.
        expected: what a fit should find of the plant's parameters, by the fit's names, in either sense; None:
            simulator and fit describe it otherwise.
        practised: hidden by a first practice: named first in all five blind trials of the rich and of the
            thesis' protocol (docs/hidden-effects.md), so that whoever looks finds it.
    """

    id: str
    parameters: tuple[Parameter, ...]
    phases: frozenset[str]
    apply: Callable[[Plant, Values], None]
    found: Found | None = None
    expected: Callable[[Values], Values] | None = None
    practised: bool = False

    def defaults(self) -> dict[str, float]:
        """Default value of every parameter, SI."""
        return {p.name: p.default for p in self.parameters}


def constant(
    name: str, unit: str, default: float, low: float, high: float, source: str = "assumed"
) -> Parameter:
    """One number of an effect in the plant; its default is what is put in where nothing else is said."""
    return Parameter(unit, low, high, default, source, name=name, default=default)


FINGER = frozenset({ON_AIR, CONTACT})
DRIVE = frozenset({ON_AIR, CONTACT, MOTOR_BENCH})
TOUCH = frozenset({CONTACT})

RATIO = constant("pip_ratio", "", 0.6, 0.3, 1.0, "assumed: smaller hinge")
WIND_UP = constant("travel", "rad", 1.5e-3, 5e-4, 5e-3, "assumed: elastic wind-up before it slides")
GEAR_WIND_UP = constant("travel", "rad", 4e-3, 1e-3, 1e-2, "assumed: gearbox wind-up before it slides")


def per_joint(bench: Plant, field: str, value: float, ratio: float) -> None:
    """Add a value to a constant of the MCP, and its share to that of the PIP."""
    bench.plant[field + "_1"] += value
    bench.plant[field + "_2"] += value * ratio


def both_joints(mcp: float, pip: float) -> dict[str, float]:
    """A value of the MCP and the PIP's share of it; a joint that was found without any has next to none."""
    mcp = mcp if abs(mcp) > LEAST else LEAST
    return {"mcp": mcp, "pip_ratio": pip / mcp}


def gains_of_joints(gain: str, v: Values, share: float = 1.0) -> dict[str, float]:
    """The inverse: what a fit should find at each joint, times a share."""
    levels = {"mcp": v["mcp"], "pip": v["mcp"] * v["pip_ratio"]}
    return {f"{gain}_{joint}": level * share for joint, level in levels.items()}


LEAST = 1e-9
"""Stands for nothing where something is told as a share of it, SI."""


def winding(v: Values) -> dict[str, float]:
    """The travel over which a friction builds up from nothing, rad; that of the plant where none was found.

    Found is the way behind a reversal, which for one contact (sharpness 1) is twice as long; where the PIP
    joint was found to have another one than the MCP joint, the twin's joints have what lies between.
    """
    mcp = v.get("travel_deg", 0.0)
    way = math.radians(math.sqrt(mcp * v.get("pip_travel_deg", mcp))) / (1.0 + v.get("sharpness", 0.0))
    return {"travel": way} if way > 0.0 else {}


def half_speed(v: Values) -> float:
    """Speed at which half of a breakaway's excess is left, where exp(-(speed/v)^2) of it is, rad/s."""
    return v["stribeck_speed"] * math.sqrt(math.log(2.0))


def dry(bench: Plant, place: int, level: float, travel: float) -> None:
    """Friction that sticks: a level (N m) either way, over a travel (rad) before it slides."""
    law = bench.friction[place]
    law["forward"] += level
    law["backward"] += level
    law["travel"] = travel


def breaking_away(bench: Plant, places: dict[int, float], v: Values, level: float) -> None:
    """The same at each place by its share of the level (N m), higher by the excess where it breaks away."""
    for place, share in places.items():
        dry(bench, place, level * share, v["travel"])
        bench.friction[place]["breakaway"] += level * share * v["excess"]
        bench.friction[place]["stribeck_speed"] = v["speed"]


def spread(bench: Plant, place: int, level: float, travel: float) -> None:
    """Friction that builds up gradually to a level (N m) over a travel (rad)."""
    bench.friction[place]["spread"] += level
    bench.friction[place]["spread_travel"] = travel


def numbers_of_fit(wound: bool = False, **names: str) -> Found:
    """Of an effect whose numbers here are those of the fit, by the fit's names.

    Args:
        wound: the friction also has its travel from the fit (:func:`winding`).
    """

    def found(v: Values, nominal: Nominal) -> Values:
        return {own: v[name] for own, name in names.items()} | (winding(v) if wound else {})

    return found


def numbers_for_fit(**names: str) -> Callable[[Values], Values]:
    """The inverse of :func:`numbers_of_fit`."""
    return lambda v: {name: v[own] for own, name in names.items()}


def joints_of_fit(gain: str, wound: bool = False) -> Found:
    """Of an effect at both joints whose gain in the fit has this name; ``wound`` as there."""

    def found(v: Values, nominal: Nominal) -> Values:
        return both_joints(v[f"{gain}_mcp"], v[f"{gain}_pip"]) | (winding(v) if wound else {})

    return found
