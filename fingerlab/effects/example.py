"""An example in an effect's file: a motion in round numbers, and what the columns are in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from fingerlab.physics.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.constants import Finger, Motor
from fingerlab.sessions.model import Array

FINGER = Finger(0.01, 0.01, 0.02, 0.02, 1e-6, 2e-6, 0.1, 0.05, wrist_angle=0.0, gravity=10.0)
MOTOR = Motor(pulley_radius=0.01, inertia=1e-4)
JOINTS = tuple(field.name for field in fields(JointMotion))

Signal = float | Sequence[float] | Array


@dataclass(frozen=True)
class Example:
    """What an effect's columns are at one point of its shapes.

    Attributes:
        shape: point of the grid, or between.
        signals: of the motion, SI, by their names in ``Motion`` and ``JointMotion``; a number holds all the
            time, and what is not named is zero.
        expected: column by "EQUATION gain", as ``"PIP viscous_pip"``; empty where the effect has no column.
        on_bench: whether the motor is alone, without the finger.
        sample_rate_hz: of the signals.
    """

    shape: Mapping[str, float]
    signals: Mapping[str, Signal]
    expected: Mapping[str, Signal]
    on_bench: bool = False
    sample_rate_hz: float = 1000.0

    def motion(self) -> Motion:
        """The motion of the example: round constants (``FINGER``, ``MOTOR``) and the extension cable."""
        length = max((np.size(signal) for signal in self.signals.values()), default=1)

        def signal(name: str) -> Array:
            return np.broadcast_to(np.asarray(self.signals.get(name, 0.0), float), length).copy()

        force = signal("force") if "force" in self.signals else None
        return Motion(
            phase="motor_bench" if self.on_bench else "on_air" if force is None else "contact",
            cable_sign=0 if self.on_bench else -1,
            sample_rate_hz=self.sample_rate_hz,
            time=signal("time"),
            position=signal("position"),
            velocity=signal("velocity"),
            acceleration=signal("acceleration"),
            torque=signal("torque"),
            motor=MOTOR,
            finger=None if self.on_bench else FINGER,
            joints=None if self.on_bench else JointMotion(*map(signal, JOINTS)),
            force=force,
            load=signal("load") if self.on_bench else None,
        )
