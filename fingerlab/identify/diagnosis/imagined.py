"""Motion that a run would show, as far as the fitted model can tell before it is taken.

The finger is taken as quasi-static: at each moment springs, gravity and cable are in balance. That is
enough to know where a column of an effect is large, and costs milliseconds.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fingerlab.acquisition.trajectories import read_trajectory
from fingerlab.identify.diagnosis.bandwidth import WIDE_RATE_HZ
from fingerlab.identify.diagnosis.model import CABLE_NAMES
from fingerlab.identify.diagnosis.stretches import SETTLING_S
from fingerlab.physics import nominal
from fingerlab.physics.effects.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig import Finger, Rig
from fingerlab.sessions.model import Array

DURATION_S = 20.0
BALANCE_STEPS = 12
BALANCED_RAD = 1e-6
STIFFEST_COMPLIANCE = 5e-6
"""Cable compliance that is assumed at least, m/N: a contact run would else be infinitely stiff."""


def commanded(trajectory: Mapping[str, object]) -> tuple[Array, Array]:
    """Time (s) and motor angle (rad) of a trajectory after its ramp, shapes (n,)."""
    time = np.arange(0.0, DURATION_S, 1.0 / WIDE_RATE_HZ)
    position = read_trajectory({**trajectory, "duration_s": DURATION_S}).command(time)
    settled = time >= SETTLING_S
    return time[settled], position[settled]


def bench_motion(rig: Rig, trajectory: Mapping[str, object], load: float) -> Motion:
    """Motor alone against a constant load (N m)."""
    time, position = commanded(trajectory)
    velocity, acceleration = _derivatives(position)
    inertia = rig.motor.inertia or 0.0
    return Motion(
        phase="motor_bench", cable_sign=0, sample_rate_hz=WIDE_RATE_HZ, time=time, position=position,
        velocity=velocity, acceleration=acceleration, torque=inertia * acceleration + load, motor=rig.motor,
        load=np.full_like(time, load),
    )  # fmt: skip


def finger_motion(
    rig: Rig,
    cable_sign: int,
    trajectory: Mapping[str, object],
    values: Mapping[str, float],
    touching_from: float | None,
) -> Motion | None:
    """Finger on a cable, free, or pressing from the MCP angle ``touching_from`` (rad); None: it goes slack.

    ``values`` are the fitted unknowns by key.
    """
    finger, motor = rig.finger, rig.motor
    if finger is None or motor.pulley_radius is None:
        return None
    time, position = commanded(trajectory)
    routing = CABLE_NAMES[cable_sign]
    a, b = values[f"arm_mcp@{routing}"], values[f"arm_pip@{routing}"]
    wound = motor.pulley_radius * position - values.get(f"offset@{routing}", 0.0)
    mcp, pip, pull = _balance(finger, cable_sign, a, b, wound)
    force = None
    if touching_from is not None:
        mcp, pip, pull, force = _pressing(
            finger, cable_sign, (a, b), wound, (mcp, pip, pull), touching_from, values
        )
    if np.min(pull) < 0.1 or np.max(pull) > 60.0:
        return None
    velocity, acceleration = _derivatives(position)
    joints = JointMotion(mcp, pip, *_pairwise(mcp, pip))
    torque = motor.pulley_radius * pull + (motor.inertia or 0.0) * acceleration
    return Motion(
        phase="on_air" if force is None else "contact", cable_sign=cable_sign, sample_rate_hz=WIDE_RATE_HZ,
        time=time, position=position, velocity=velocity, acceleration=acceleration, torque=torque,
        motor=motor, finger=finger, joints=joints, force=force,
    )  # fmt: skip


def _derivatives(values: Array) -> tuple[Array, Array]:
    first = np.gradient(values, 1.0 / WIDE_RATE_HZ)
    return first, np.gradient(first, 1.0 / WIDE_RATE_HZ)


def _pairwise(mcp: Array, pip: Array) -> tuple[Array, Array, Array, Array]:
    (v1, a1), (v2, a2) = _derivatives(mcp), _derivatives(pip)
    return v1, v2, a1, a2


def _balance(finger: Finger, sign: int, a: float, b: float, wound: Array) -> tuple[Array, Array, Array]:
    """Angles (rad) and tension (N) where springs and gravity balance the cable, by fixed-point iteration.

    With gravity held all is linear: s (a t1 + b t2) = wound, K1 t1 = s a T - g1, K2 t2 = s b T - g2.
    """
    k1, k2 = finger.mcp_stiffness, finger.pip_stiffness
    mcp, pip = np.zeros_like(wound), np.zeros_like(wound)
    pull = np.zeros_like(wound)
    zero = np.zeros_like(wound)
    for _ in range(BALANCE_STEPS):
        still = JointMotion(mcp, pip, zero, zero, zero, zero)
        g1, g2 = nominal.mcp_torque(finger, still).gravity, nominal.pip_torque(finger, still).gravity
        pull = (wound + sign * (a * g1 / k1 + b * g2 / k2)) / (a * a / k1 + b * b / k2)
        before = mcp
        mcp, pip = (sign * a * pull - g1) / k1, (sign * b * pull - g2) / k2
        if np.max(np.abs(mcp - before)) < BALANCED_RAD:
            break
    return mcp, pip, pull


def _pressing(
    finger: Finger,
    sign: int,
    arms: tuple[float, float],
    wound: Array,
    free: tuple[Array, Array, Array],
    touching_from: float,
    values: Mapping[str, float],
) -> tuple[Array, Array, Array, Array]:
    """Beyond the touching angle the joints stand still, and more cable becomes tension and force."""
    mcp, pip, pull = free
    touching = sign * mcp > sign * touching_from
    if not touching.any():
        return mcp, pip, pull, np.zeros_like(wound)
    first = int(np.argmax(touching))
    compliance = max(values.get("cable_compliance", 0.0), STIFFEST_COMPLIANCE)
    extra = np.where(touching, np.maximum(wound - wound[first], 0.0) / compliance, 0.0)
    mcp, pip = np.where(touching, mcp[first], mcp), np.where(touching, pip[first], pip)
    pull = np.where(touching, pull[first], pull) + extra
    force = np.where(touching, sign * arms[1] * extra / nominal.contact_lever_pip(finger, mcp, pip), 0.0)
    return mcp, pip, pull, force
