"""Forces of the plant, and its time stepping under the position loop. Compiled.

The finger is derived here from its own Lagrangian (point masses and bodies placed by their centres),
in the form ``M(q) q'' + c(q, q') = Q``; tests check it against sympy. Dry friction is a spring-slider
(return mapping): while the force stays below the level the joint is held by a spring and does not
creep, as in Dahl's and the elastoplastic models, but with an exact stick. Presliding friction is a
row of such pairs that let go one after another (Iwan 1966). Levels fall with speed as in Hess and
Soom 1990. None of these is a smooth function of the speed's sign.

Staggered (leapfrog) steps: positions stand half a step ahead of velocities, so that one evaluation
of the forces a step gives second order where the forces are smooth; velocity-dependent forces use
the velocity extrapolated by half a step. Tests halve the step and watch the recording converge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba

from fingerlab.twin.plant import MCP, MOTOR, PIP, SPREAD_ELEMENTS

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
    return (plant.arm_1 * (1.0 + plant.arm_slope_1 * at[1]), plant.arm_2 * (1.0 + plant.arm_slope_2 * at[3]))


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


@compiled
def cable_tension(plant: Record, state: Record, at: Pose, step: float) -> float:
    """Tension on the finger's side of the sheath, N; never pushes. Remembers the elongation."""
    half = 0.5 * plant.play
    state.pulley = min(max(state.pulley, state.theta - half), state.theta + half)
    taken_in = plant.cable_sign * (cable_path(plant, state.q1, state.q2, at) - plant.path_at_rest)
    elongation = plant.pulley_radius * state.pulley - plant.slack - taken_in
    rate = (elongation - state.elongation) / step
    state.elongation = elongation
    if elongation <= 0.0:
        return 0.0
    pull = plant.cable_stiffness * elongation
    pull *= 1.0 + plant.cable_stiffening * pull
    return float(max(pull + plant.cable_damping * rate, 0.0))


@compiled
def sheath_loss(plant: Record, state: Record, tension: float, wound: float) -> float:
    """What the sheath adds to the tension at the pulley, N, after ``wound`` metres of cable travel.

    Pulling in, the pulley feels at most ``tension * exp(wrap)``, paying out at least
    ``tension * exp(-wrap)``; in between the cable sticks.
    """
    if plant.wrap <= 0.0:
        return 0.0
    gain = math.exp(plant.wrap)
    high, low = tension * (gain - 1.0), tension * (1.0 / gain - 1.0)
    state.sheath = slide(state.sheath, plant.sheath_stiffness * wound, low, high)
    return float(state.sheath)


@compiled
def contact(
    plant: Record, state: Record, at: Pose, w1: float, w2: float, step: float
) -> tuple[float, float, float]:
    """Contact torques on MCP and PIP (N m, flexion positive) and the load cell's axial force (N).

    The fingertip meets a plane whose normal leans by ``contact_angle`` from the load cell's axis
    (towards the fingertip's side); normal force after Hunt and Crossley 1975, tangential force a
    spring-slider at the friction coefficient.
    """
    x, y, x1, x2, y1, y2 = fingertip(plant, at)
    nx, ny = plant.normal_x, plant.normal_y
    depth = (plant.cell_x - x) * nx + (plant.cell_y - y) * ny
    along = (x - plant.cell_x) * ny - (y - plant.cell_y) * nx
    moved = along - state.tip_slide
    state.tip_slide = along
    if depth <= 0.0:
        state.tip = 0.0
        return 0.0, 0.0, 0.0
    closing = -((x1 * w1 + x2 * w2) * nx + (y1 * w1 + y2 * w2) * ny)
    normal = max(plant.contact_stiffness * depth * (1.0 + plant.contact_damping * closing), 0.0)
    limit = plant.tip_friction * normal
    before = state.tip
    state.tip = slide(before, -plant.tip_stiffness * moved, -limit, limit)
    rate = (state.tip - before) / (plant.tip_stiffness * step)
    tangent = min(max(state.tip + plant.tip_damping * rate, -limit), limit)
    fx = normal * nx + tangent * ny
    fy = normal * ny - tangent * nx
    return x1 * fx + y1 * fy, x2 * fx + y2 * fy, fy


@compiled
def advance_finger(
    plant: Record, friction: Any, memory: Any, state: Record, at: Pose, tension: float, step: float
) -> float:
    """One step of the two joints; returns the load cell's axial force, N."""
    w1, w2 = state.w1 + 0.5 * step * state.a1, state.w2 + 0.5 * step * state.a2
    push1, push2, force = contact(plant, state, at, w1, w2, step)
    arm1, arm2 = moment_arms(plant, at)
    pull = plant.cable_sign * tension
    bias1, bias2 = finger_bias(plant, at, w1, w2)
    spring1, spring2 = joint_elastic(plant, state.q1, state.q2, w2, state.relaxed_1, state.relaxed_2)
    rub1 = dry_friction(friction, memory, MCP, step * state.w1, w1, 0.0, step)
    rub2 = dry_friction(friction, memory, PIP, step * state.w2, w2, 0.0, step)
    f1 = pull * arm1 + push1 - bias1 - spring1 - rub1 - plant.viscous_1 * w1
    f2 = pull * arm2 + push2 - bias2 - spring2 - rub2 - plant.viscous_2 * w2
    m11, m12, m22 = finger_mass(plant, at)
    determinant = m11 * m22 - m12 * m12
    state.a1 = (m22 * f1 - m12 * f2) / determinant
    state.a2 = (m11 * f2 - m12 * f1) / determinant
    state.w1 += step * state.a1
    state.w2 += step * state.a2
    if plant.relaxing_1 > 0.0 or plant.relaxing_2 > 0.0:
        share = step / (plant.relaxation_time + 0.5 * step)
        state.relaxed_1 += share * (state.q1 - state.relaxed_1)
        state.relaxed_2 += share * (state.q2 - state.relaxed_2)
    state.q1 += step * state.w1
    state.q2 += step * state.w2
    return force


@compiled
def advance_motor(
    plant: Record, friction: Any, memory: Any, state: Record, load: float, command: float, step: float
) -> None:
    """One step of amplifier, rotor, gearbox and pulley against the torque ``load`` (N m)."""
    omega = state.omega + 0.5 * step * state.alpha
    lag = step / (plant.current_lag + 0.5 * step)
    before = state.current
    state.current += lag * (command - before)
    drive = plant.torque_constant * 0.5 * (before + state.current)
    rub = dry_friction(friction, memory, MOTOR, step * state.omega, omega, load, step)
    resist = rub + (plant.motor_viscous + plant.motor_drag * abs(omega)) * omega
    resist += plant.motor_spring * state.theta
    if plant.ripple > 0.0:
        angle = plant.ripple_order * state.theta + plant.ripple_phase
        resist += plant.ripple * (math.sin(angle) + 0.3 * math.sin(2.0 * angle))
    state.alpha = (drive - load - resist) / plant.inertia
    state.omega += step * state.alpha
    state.theta += step * state.omega


@compiled
def advance(
    plant: Record, friction: Any, memory: Any, state: Record, command: float, steps: int, step: float
) -> tuple[float, float, float]:
    """``steps`` steps of ``step`` s at a constant current command (A).

    Returns:
        Load cell's axial force, tension at the finger, tension at the pulley, all N, at the end.
    """
    force = tension = at_pulley = 0.0
    for _ in range(steps):
        if plant.cable_sign == 0.0:
            advance_motor(plant, friction, memory, state, plant.load_torque, command, step)
            continue
        wound = state.pulley
        at = pose(plant, state.q1, state.q2)
        tension = cable_tension(plant, state, at, step)
        wound = plant.pulley_radius * (state.pulley - wound)
        at_pulley = tension + sheath_loss(plant, state, tension, wound)
        load = plant.pulley_radius * at_pulley + plant.load_torque
        advance_motor(plant, friction, memory, state, load, command, step)
        force = advance_finger(plant, friction, memory, state, at, tension, step)
    return force, tension, at_pulley


@compiled
def position_loop(control: Record, state: Record, theta: float, reference: float, period: float) -> float:
    """Current command (A) of the bench's PID position loop, once a sample, from encoder counts.

    ``theta`` and ``reference`` are the motor's true and wanted angle at the output, rad.
    """
    measured = math.floor(theta / control.count) * control.count
    error = reference - measured
    share = 1.0 - math.exp(-control.derivative_cutoff * period)
    state.rate += share * ((error - state.last_error) / period - state.rate)
    state.last_error = error
    command = control.proportional * error + control.derivative * state.rate + state.integral
    limited = min(max(command, -control.current_limit), control.current_limit)
    if command == limited:  # the integral stands still while the amplifier is at its limit
        state.integral += control.integral * error * period
    return limited


@compiled
def observe(state: Record, half: float, force: float, tension: float, at_pulley: float, row: Any) -> None:
    """What there is to see now, in the order of ``plant.OUTPUTS``, to ``row``; ``half`` a step in s."""
    row[0] = state.theta - half * state.omega
    row[1] = state.omega
    row[2] = state.current
    row[3] = state.q1 - half * state.w1
    row[4] = state.q2 - half * state.w2
    row[5] = state.w1
    row[6] = state.w2
    row[7] = force
    row[8] = tension
    row[9] = at_pulley


@compiled
def run_sample(
    plant: Any, friction: Any, memory: Any, state: Any, command: float, steps: int, period: float, row: Any
) -> None:
    """One sample of ``period`` s at the current ``command`` (A), from where the last call left off.

    ``plant`` and ``state`` are arrays of one record, which cost less to hand over than a record; ``row``
    (shape (outputs,)) has what there is to see at the end.
    """
    step = period / steps
    force, tension, at_pulley = advance(plant[0], friction, memory, state[0], command, steps, step)
    observe(state[0], 0.5 * step, force, tension, at_pulley, row)


@compiled
def run_loop(
    plant: Record,
    friction: Any,
    control: Record,
    memory: Any,
    state: Record,
    reference: Any,
    steps: int,
    period: float,
    out: Any,
) -> None:
    """A run under the position loop: ``reference`` (rad, shape (n,)) to ``out`` (shape (n, outputs)).

    ``steps`` internal steps a sample of ``period`` s. Positions are set back by half a step, to
    the time of the velocities and of the sample.
    """
    step = period / steps
    force = tension = at_pulley = 0.0
    for k in range(len(reference)):
        observe(state, 0.5 * step, force, tension, at_pulley, out[k])
        command = position_loop(control, state, out[k, 0], reference[k], period)
        force, tension, at_pulley = advance(plant, friction, memory, state, command, steps, step)
