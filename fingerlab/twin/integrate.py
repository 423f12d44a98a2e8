"""Time stepping of the plant under its position loop. Compiled.

Staggered (leapfrog) steps: positions stand half a step ahead of velocities, so that one evaluation
of the forces a step gives second order where the forces are smooth; velocity-dependent forces use
the velocity extrapolated by half a step. Tests halve the step and watch the recording converge.
"""

from __future__ import annotations

import math
from typing import Any

from fingerlab.twin.layout import MCP, MOTOR, PIP
from fingerlab.twin.mechanics import (
    Pose,
    Record,
    cable_path,
    compiled,
    dry_friction,
    finger_bias,
    finger_mass,
    fingertip,
    joint_elastic,
    moment_arms,
    pose,
    slide,
)


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
    return float(max(plant.cable_stiffness * elongation + plant.cable_damping * rate, 0.0))


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
    resist = rub + plant.motor_viscous * omega + plant.motor_spring * state.theta
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
    """What there is to see now, in the order of ``layout.OUTPUTS``, to ``row``; ``half`` a step in s."""
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
