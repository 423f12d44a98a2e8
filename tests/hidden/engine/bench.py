"""What the simulated bench is made of: what it knows of itself, and what it really is.

Frames: x points away from the palm, z up, both in the frame of the base. With all angles at zero the
finger points ``wrist_angle`` above x; flexion turns it down. SI units throughout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

NOMINAL = {
    "finger": {
        "proximal_mass": 0.0118,  # kg; assumed: 46 mm printed phalanx with magnet
        "distal_mass": 0.0136,  # kg; assumed: middle and distal phalanx as one body
        "proximal_half_length": 0.0230,  # m
        "distal_half_length": 0.0245,  # m
        "proximal_inertia": 2.15e-6,  # kg m^2 about the centre of mass; rod with its width
        "distal_inertia": 2.80e-6,
        "mcp_stiffness": 0.118,  # N m/rad; assumed
        "pip_stiffness": 0.061,
        "wrist_angle": math.radians(15.0),  # thesis section 3.1
        "gravity": 9.81,
    },
    "motor": {
        "torque_constant": 0.0302,  # N m/A; Maxon RE40 148867
        "gear_ratio": 4.3,  # Maxon GP 42C 203144
        "pulley_radius": 0.015,  # m
        "inertia": 2.9e-4,  # kg m^2 at the output; RE40 138 g cm^2 times 4.3 squared, gearbox, pulley
    },
    "tolerance": {
        "proximal_mass": 0.05,
        "distal_mass": 0.05,
        "proximal_inertia": 0.10,
        "distal_inertia": 0.10,
        "mcp_stiffness": 0.06,
        "pip_stiffness": 0.06,
        "inertia": 0.20,
    },
}
"""The rig text of the session: constants and their relative tolerances (one standard deviation)."""

OTHER_TOLERANCE = 0.02  # of every constant that the rig text says nothing about (session format)
EXACT = ("wrist_angle", "gravity", "gear_ratio")
TRUNCATION = 2.0  # parts further off than so many tolerances are rejected


@dataclass
class Bench:
    """The true bench. Effects change it before the model is built; nothing of it is told to the file.

    Attributes:
        finger, motor: true constants, keys as in ``NOMINAL``.
        arms: (MCP, PIP) moment arms, m, by cable. pretravel: m of cable left loose, by cable.
        cubic: N m/rad^3, by joint. viscous: N m s/rad. dry: N m, by joint.
        stribeck: (excess of breakaway over sliding, speed in rad/s) by place.
        stick: rad of elastic wind-up before friction slides, joints and motor; 0 sticks hard.
        wander: relative standard deviation of all friction from run to run.
        sheath: share of the tension lost in the sheath, by direction of travel.
        spread: (torque, travel) of friction that builds up, by joint, N m and rad.
        relaxing: (stiffness in N m/rad, time in s) of the branch that relaxes, by joint.
    """

    finger: dict[str, float]
    motor: dict[str, float]
    arms: dict[str, tuple[float, float]]
    pretravel: dict[str, float]
    cubic: list[float] = field(default_factory=lambda: [0.0, 0.0])
    viscous: list[float] = field(default_factory=lambda: [6e-5, 4e-5])
    dry: list[float] = field(default_factory=lambda: [0.0, 0.0])
    motor_viscous: float = 5e-5
    motor_dry: float = 0.0
    motor_bias: float = 0.0  # N m, constant against winding in: friction that differs by direction
    motor_load_share: float = 0.0  # of the cable's torque lost in the gears
    motor_spring: float = 0.0  # N m/rad
    ripple: tuple[float, float, float] = (0.0, 1.0, 0.0)  # N m, periods a turn, phase in rad
    stribeck: dict[str, tuple[float, float]] = field(default_factory=dict)
    stick: dict[str, float] = field(default_factory=lambda: {"joint": 0.0, "motor": 0.0})
    wander: float = 0.03
    sheath: float = 0.0
    spread: tuple[float, float, float] = (0.0, 0.0, 0.1)  # MCP and PIP in N m, travel in rad
    relaxing: tuple[float, float, float] = (0.0, 0.0, 1.0)  # MCP and PIP in N m/rad, time in s
    coupling: float = 0.0  # N m/rad between the joints
    stop: tuple[float, float] | None = None  # rad of PIP in extension, s of a quarter swing on it
    absolute_spin: float = 0.0  # share of the distal inertia that turns with the absolute rate
    screws: float = 0.0  # kg at the middle of the distal body
    tilt: float = 0.0  # rad, base against the wrist angle
    cable_stiffness: float = 4.5e4  # N/m; assumed: half a millimetre of steel cable and its crimps
    cable_damping: float = 40.0  # N s/m
    tip_friction: float = 0.03  # assumed: a polished button, oiled; more of it jams and sticks
    lean: float = 0.0  # rad, normal of the pressed face against the load cell's axis
    cell_stiffness: float = 3.0e4  # N/m; assumed
    cell_sideways: float = 1.5e4  # N/m, pad and button along the face; assumed
    cell_damping: float = 25.0  # N s/m, half of critical
    delay: float = 0.0  # s, joint angles and force against the motor's channels
    drift: float = 0.0  # rad over a run, MCP sensor
    sensor_harmonic: tuple[float, float] = (0.0, 0.0)  # rad, phase in rad; second harmonic of both sensors
    force_gain: float = 1.0


def draw_bench(rng: np.random.Generator) -> Bench:
    """A bench within the tolerances of its own rig text."""

    def spread(scale: float) -> float:
        return float(np.clip(rng.standard_normal(), -TRUNCATION, TRUNCATION)) * scale

    def true(section: str) -> dict[str, float]:
        tolerance = NOMINAL["tolerance"]
        return {
            key: value * (1.0 + (0.0 if key in EXACT else spread(tolerance.get(key, OTHER_TOLERANCE))))
            for key, value in NOMINAL[section].items()
        }

    return Bench(
        finger=true("finger"),
        motor=true("motor"),
        arms={
            "extension": (0.0102 * (1 + spread(0.07)), 0.0083 * (1 + spread(0.07))),
            # Arms with which pressing drags the fingertip little: in the thesis the joints all but stop then.
            "flexion": (0.0125 * (1 + spread(0.04)), 0.0061 * (1 + spread(0.04))),
        },
        pretravel={"extension": abs(spread(2.5e-4)), "flexion": abs(spread(2.5e-4))},
        tip_friction=float(rng.uniform(0.01, 0.05)),
        # Assumed: hinges wind up by hundredths to tenths of a degree, a gearbox by three times as much.
        stick={"joint": 6e-4 * 5 ** rng.random(), "motor": 1.8e-3 * 5 ** rng.random()},
    )
