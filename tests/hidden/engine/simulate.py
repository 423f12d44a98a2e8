"""One run: MuJoCo steps the bench, a position loop at 1 kHz turns it, and the truth is kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from .bench import Bench
from .model import TIMESTEP, BuiltModel, settle
from .trajectories import RATE_HZ

SUBSTEPS = round(1.0 / RATE_HZ / TIMESTEP)
COUNT = 2 * math.pi / 8600  # rad of the pulley: 500 lines, four edges, 4.3:1
PROPORTIONAL, INTEGRAL, DERIVATIVE = 13.0, 60.0, 0.22  # A/rad, A/(rad s), A s/rad
SPEED_SMOOTHING = 0.3  # share of the newest encoder difference: about 60 Hz
CURRENT_LIMIT = 5.0  # A; RE40 nominal is 6


@dataclass(frozen=True)
class Truth:
    """What really happened, one value a millisecond, SI; angles and force without any sensor."""

    motor: np.ndarray  # rad, as the encoder counts it
    current: np.ndarray  # A
    mcp: np.ndarray
    pip: np.ndarray
    force: np.ndarray  # N along the load cell's axis, compression positive
    tension: np.ndarray  # N at the pulley


def run(bench: Bench, built: BuiltModel, cable: str, command: np.ndarray, wear: float) -> Truth:
    """Drive one run from rest.

    Args:
        command: rad at the pulley, one value a millisecond. wear: factor on all friction of this run.
    """
    model, data = built.model, settle(built)
    hang_cable(bench, built, data, cable)
    data.qfrc_applied[built.motor] = -bench.motor_bias * wear
    state = np.empty((len(command), model.nq))
    current, tension, plate_speed = (np.empty(len(command)) for _ in range(3))
    gain = bench.motor["torque_constant"] * bench.motor["gear_ratio"]
    loop = _loop()
    updates = updates_of(bench, built, wear)
    position, speed, control, pull = data.qpos, data.qvel, data.ctrl, data.actuator_force
    motor, drive, rope = built.motor, built.drive, built.cable
    for index, wanted in enumerate(command.tolist()):
        state[index] = position
        plate_speed[index] = speed[built.plate]
        amperes = loop(wanted, float(position[motor]))
        current[index] = amperes
        control[drive] = gain * amperes
        if updates:
            for _ in range(SUBSTEPS):
                for update in updates:
                    update(data)
                mujoco.mj_step(model, data)
        else:
            mujoco.mj_step(model, data, nstep=SUBSTEPS)
        tension[index] = -pull[rope]
    if not np.isfinite(state).all():
        raise RuntimeError("the simulation ran away")
    counted = np.floor(state[:, motor] / COUNT + 0.5) * COUNT
    force = -bench.cell_stiffness * state[:, built.plate] - bench.cell_damping * plate_speed
    return Truth(counted, current, state[:, built.mcp], state[:, built.pip], force, tension)


def hang_cable(bench: Bench, built: BuiltModel, data: mujoco.MjData, cable: str) -> None:
    """The cable is just loose by its pretravel where the finger hangs; it pulls, it never pushes."""
    mujoco.mj_forward(built.model, data)
    rest = float(data.actuator_length[built.cable]) + bench.pretravel[cable]
    stiffness, damping = bench.cable_stiffness, bench.cable_damping
    built.model.actuator_biasprm[built.cable, :3] = (stiffness * rest, -stiffness, -damping)


def _loop() -> Callable[[float, float], float]:
    """Position loop over the current: PI on the encoder's counts, damping by their smoothed differences."""
    integral = speed = before = 0.0

    def step(wanted: float, true: float) -> float:
        nonlocal integral, speed, before
        seen = math.floor(true / COUNT + 0.5) * COUNT
        speed += SPEED_SMOOTHING * ((seen - before) * RATE_HZ - speed)
        before = seen
        error = wanted - seen
        amperes = PROPORTIONAL * error + integral - DERIVATIVE * speed
        limited = min(max(amperes, -CURRENT_LIMIT), CURRENT_LIMIT)
        if limited == amperes:
            integral += INTEGRAL * error / RATE_HZ
        return limited

    return step


Update = Callable[[mujoco.MjData], None]


def updates_of(bench: Bench, built: BuiltModel, wear: float) -> list[Update]:
    """What MuJoCo has no constant for, renewed at each step: friction by speed or load, and torque ripple."""
    model, updates = built.model, []
    dry = {"mcp": bench.dry[0], "pip": bench.dry[1], "motor": bench.motor_dry}
    for place, (excess, speed) in bench.stribeck.items():
        moving = {"mcp": built.mcp, "pip": built.pip, "motor": built.motor}[place]
        updates.append(_stribeck(model, built.rubs[place], moving, dry[place] * wear, excess, speed))
    if bench.sheath > 0:
        share = bench.sheath * wear

        def sheath(data: mujoco.MjData) -> None:
            model.dof_frictionloss[built.rubs["sheath"]] = share * -data.actuator_force[built.cable]

        updates.append(sheath)
    if bench.motor_load_share > 0:
        lever = bench.motor_load_share * wear * bench.motor["pulley_radius"]

        def gears(data: mujoco.MjData) -> None:
            model.dof_frictionloss[built.rubs["motor"]] = lever * -data.actuator_force[built.cable]

        updates.append(gears)
    if bench.ripple[0] > 0:
        torque, order, phase = bench.ripple

        def ripple(data: mujoco.MjData) -> None:
            data.qfrc_applied[built.motor] = -torque * math.sin(order * data.qpos[built.motor] + phase)

        updates.append(ripple)
    return updates


def _stribeck(
    model: mujoco.MjModel, place: int, moving: int, sliding: float, excess: float, speed: float
) -> Update:
    """By the speed of what moves, as in LuGre: by its own a slider without a mass jumps back and forth."""

    def update(data: mujoco.MjData) -> None:
        ratio = float(data.qvel[moving]) / speed
        model.dof_frictionloss[place] = sliding * (1.0 + excess * math.exp(-ratio * ratio))

    return update
