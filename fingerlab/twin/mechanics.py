"""Forces of the plant: finger, cable, contact, dry friction. Compiled; one call a step each.

The finger is derived here from its own Lagrangian (point masses and bodies placed by their centres),
in the form ``M(q) q'' + c(q, q') = Q``; tests check it against sympy. Dry friction is a spring-slider
(return mapping): while the force stays below the level the joint is held by a spring and does not
creep, as in Dahl's and the elastoplastic models, but with an exact stick. Presliding friction is a
row of such pairs that let go one after another (Iwan 1966). Levels fall with speed as in Hess and
Soom 1990. None of these is a smooth function of the speed's sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba

from fingerlab.twin.layout import SPREAD_ELEMENTS

Record = Any
"""A record of ``layout``; numba sees the fields, mypy does not."""

REFERENCE_LOAD = 0.05
"""N m transmitted, at which load-dependent friction winds up over its travel."""

Pose = tuple[float, float, float, float, float, float, float, float]
"""Cosine and sine of: MCP angle, PIP angle, proximal body's slope, distal body's slope (upwards)."""


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a numeric function to native code on its first call.

    The code is kept beside the source, or in the user's cache folder where the package is read-only
    (numba looks for both). Where neither can be written, or the source is inside an archive, the
    function is compiled anew in each process: slower to start, same numbers.
    """
    try:
        return numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # "no locator available": nowhere to keep the code
        return numba.njit(error_model="numpy")(function)


@compiled
def pose(plant: Record, q1: float, q2: float) -> Pose:
    """Sines and cosines of a posture: MCP, PIP, proximal and distal slope against the horizontal.

    Four calls of the mathematical library instead of fourteen: they are half of a step's time.
    """
    c1, s1, c2, s2 = math.cos(q1), math.sin(q1), math.cos(q2), math.sin(q2)
    cu = plant.tilt_cos * c1 + plant.tilt_sin * s1
    su = plant.tilt_sin * c1 - plant.tilt_cos * s1
    return c1, s1, c2, s2, cu, su, cu * c2 + su * s2, su * c2 - cu * s2


@compiled
def finger_mass(plant: Record, at: Pose) -> tuple[float, float, float]:
    """Mass matrix entries (11, 12, 22), kg m^2."""
    l1, l2 = plant.proximal_half_length, plant.distal_half_length
    m1, m2, mk = plant.proximal_mass, plant.distal_mass, plant.knuckle_mass
    share, spin = plant.distal_rotation, plant.distal_inertia
    cross = 2.0 * l1 * l2 * at[2]
    m11 = plant.proximal_inertia + m1 * l1 * l1 + mk * 4.0 * l1 * l1
    m11 += m2 * (4.0 * l1 * l1 + l2 * l2 + 2.0 * cross) + share * share * spin
    m12 = m2 * (l2 * l2 + cross) + share * spin
    m22 = m2 * l2 * l2 + spin
    if plant.hung_mass > 0.0:
        mh, h = plant.hung_mass, plant.hung_at
        across = 2.0 * l1 * h * at[2]
        m11 += mh * (4.0 * l1 * l1 + h * h + 2.0 * across)
        m12 += mh * (h * h + across)
        m22 += mh * h * h
    return m11, m12, m22


@compiled
def finger_bias(plant: Record, at: Pose, w1: float, w2: float) -> tuple[float, float]:
    """Coriolis and gravity torques on the left-hand side, N m, at joint speeds in rad/s."""
    l1, l2 = plant.proximal_half_length, plant.distal_half_length
    m1, m2, mk, g = plant.proximal_mass, plant.distal_mass, plant.knuckle_mass, plant.gravity
    whirl = 2.0 * m2 * l1 * l2 * at[3]
    distal = g * m2 * l2 * at[6]
    proximal = g * l1 * (m1 + 2.0 * (m2 + mk)) * at[4]
    if plant.hung_mass > 0.0:
        mh, h = plant.hung_mass, plant.hung_at
        whirl += 2.0 * mh * l1 * h * at[3]
        distal += g * mh * h * at[6]
        proximal += 2.0 * g * mh * l1 * at[4]
    return -whirl * w2 * (2.0 * w1 + w2) - proximal - distal, whirl * w1 * w1 - distal


@compiled
def joint_elastic(
    plant: Record, q1: float, q2: float, w2: float, relaxed_1: float, relaxed_2: float
) -> tuple[float, float]:
    """Elastic torques of springs, coupling, relaxing branch and end stop on the left-hand side, N m."""
    twist = plant.coupling * (q2 - q1)
    t1 = plant.stiffness_1 * q1 + plant.cubic_1 * q1 * q1 * q1 - twist
    t2 = plant.stiffness_2 * q2 + plant.cubic_2 * q2 * q2 * q2 + twist
    t1 += plant.relaxing_1 * (q1 - relaxed_1)
    t2 += plant.relaxing_2 * (q2 - relaxed_2)
    depth = plant.stop_angle - q2
    if plant.stop_stiffness > 0.0 and depth > 0.0:
        press = plant.stop_stiffness * depth * math.sqrt(depth) * (1.0 - plant.stop_damping * w2)
        t2 -= max(press, 0.0)
    return t1, t2


@compiled
def cable_path(plant: Record, q1: float, q2: float, at: Pose) -> float:
    """Cable that the joints take in by flexing, m; its slopes are the moment arms."""
    first = plant.arm_1 * (q1 + plant.arm_slope_1 * (1.0 - at[0]))
    return float(first + plant.arm_2 * (q2 + plant.arm_slope_2 * (1.0 - at[2])))


@compiled
def moment_arms(plant: Record, at: Pose) -> tuple[float, float]:
    """Moment arms (m) at the present angles: the slopes of ``cable_path``."""
    return (
        plant.arm_1 * (1.0 + plant.arm_slope_1 * at[1]),
        plant.arm_2 * (1.0 + plant.arm_slope_2 * at[3]),
    )


@compiled
def slide(force: float, stretch: float, low: float, high: float) -> float:
    """Force of a spring-slider after a further ``stretch`` (its stiffness times travel)."""
    return min(max(force + stretch, low), high)


@compiled
def dry_friction(
    friction: Any, memory: Any, place: int, travelled: float, speed: float, transmitted: float, step: float
) -> float:
    """Friction torque (N m, positive against positive motion) after ``travelled`` rad in ``step`` s.

    ``friction`` and ``memory`` (N m) have a row for each place; the memory is updated in place.
    """
    law = friction[place]
    total = 0.0
    if law.forward + law.backward + law.breakaway + law.load_share + law.spread == 0.0:
        return total
    ratio = speed / law.stribeck_speed
    extra = law.breakaway / (1.0 + ratio * ratio) + law.load_share * abs(transmitted)
    high, low = law.forward + extra, -(law.backward + extra)
    if high > 0.0 or low < 0.0:
        before = memory[place, 0]
        stiffness = 0.5 * (law.forward + law.backward + 2.0 * law.breakaway) + law.load_share * REFERENCE_LOAD
        after = slide(before, travelled * stiffness / law.travel, low, high)
        memory[place, 0] = after
        total += min(max(after + law.damping * (after - before) / step, low), high)
    if law.spread > 0.0:
        gain = 2.0 * law.spread / (law.spread_travel * SPREAD_ELEMENTS)
        for k in range(SPREAD_ELEMENTS):
            limit = gain * law.spread_travel * (k + 0.5) / SPREAD_ELEMENTS
            memory[place, k + 1] = slide(memory[place, k + 1], gain * travelled, -limit, limit)
            total += memory[place, k + 1]
    return total


@compiled
def fingertip(plant: Record, at: Pose) -> tuple[float, float, float, float, float, float]:
    """Tip position (m, x away from the palm, y up) and its slopes dx/dq1, dx/dq2, dy/dq1, dy/dq2."""
    long1, long2 = 2.0 * plant.proximal_half_length, 2.0 * plant.distal_half_length
    c1, s1, c2, s2 = long1 * at[4], long1 * at[5], long2 * at[6], long2 * at[7]
    return c1 + c2, s1 + s2, s1 + s2, s2, -(c1 + c2), -c2
