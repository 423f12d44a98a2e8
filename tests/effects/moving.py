"""A finger that moves in sines, so that every derivative is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fingerlab.effects.base import Row, Term
from fingerlab.physics.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.file import Finger, Motor

RATE = 250.0
FINGER = Finger(0.012, 0.014, 0.0225, 0.024, 2.1e-6, 2.9e-6, 0.12, 0.06, wrist_angle=np.radians(15.0))
MOTOR = Motor(pulley_radius=0.015, inertia=3e-4)


def wave(time, middle: float, amplitude: float, frequency: float, phase: float):
    """A sine with its first and second derivative."""
    omega = 2 * np.pi * frequency
    turn = omega * time + phase
    return (
        middle + amplitude * np.sin(turn),
        amplitude * omega * np.cos(turn),
        -amplitude * omega**2 * np.sin(turn),
    )


def moving(seconds: float = 4.0, sign: int = -1, force: float | None = None, **changes) -> Motion:
    """Joints and motor in sines of 1, 0.5 and 0.75 Hz: whole cycles in four seconds, no two alike."""
    time = np.arange(round(seconds * RATE)) / RATE
    mcp, pip = wave(time, 0.2, 0.25, 1.0, 0.3), wave(time, 0.15, 0.35, 0.5, 1.1)
    position, velocity, acceleration = wave(time, 0.5, 0.4, 0.75, 0.8)
    motion = Motion(
        phase="on_air" if force is None else "contact",
        cable_sign=sign,
        sample_rate_hz=RATE,
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        torque=0.05 + 0.02 * np.sin(2 * np.pi * 0.25 * time),
        motor=MOTOR,
        finger=FINGER,
        joints=JointMotion(mcp[0], pip[0], mcp[1], pip[1], mcp[2], pip[2]),
        force=None if force is None else force + 0.3 * np.sin(2 * np.pi * time),
    )
    return replace(motion, **changes)


def bench(**changes) -> Motion:
    """The motor alone with the same motion."""
    return moving(phase="motor_bench", sign=0, finger=None, joints=None, **changes)


def column(terms: list[Term], row: Row, gain: str | None = None) -> np.ndarray:
    """Sum of the columns that stand in an equation, of one gain or of all."""
    chosen = [t.values for t in terms if t.row == row and gain in (None, t.gain)]
    assert chosen, f"no term in {row.name} for {gain}"
    return np.sum(chosen, axis=0)
