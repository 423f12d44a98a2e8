"""Moment arms from the cable that the pulley winds, apart from every torque.

While the cable is taut, ``x_m = x0 + s (a theta1 + b theta2)``. By virtual work its a and b are those of the
torque balance; where the two disagree, torque is lost or the cable does not move as its kinematics say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.models.file import ParameterEstimate
from fingerlab.physics.nominal import cable_wound
from fingerlab.rig.constants import Rig
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import usable
from fingerlab.thesis.regression import CONFIDENCE
from fingerlab.thesis.specs import Joint
from fingerlab.thesis.traces import Traces

LARGEST_CONDITION = 1e8
"""Of the normal equations: beyond it the angles move as one and only their sum is known (assumed)."""


@dataclass(frozen=True)
class CableSums:
    """Centred normal equations of one run: ``matrix`` (2, 2), rad^2; ``right`` (2,), rad m."""

    cable: str
    matrix: Array
    right: Array


def cable_sums(traces: Traces, rig: Rig) -> CableSums:
    """Reduce one run. Each run keeps its own x0, because the motor is zeroed anew."""
    signals = traces.signals
    assert signals.mcp is not None
    assert signals.pip is not None
    part = slice(*usable(len(signals), signals.sample_rate_hz))
    angles = signals.cable_sign * np.stack([signals.mcp[part], signals.pip[part]])
    angles = angles - angles.mean(axis=1, keepdims=True)
    wound = cable_wound(rig.motor, signals.motor_position[part])
    return CableSums(traces.cable, angles @ angles.T, angles @ (wound - wound.mean()))


def kinematic_arms(runs: Sequence[CableSums]) -> dict[Joint, ParameterEstimate] | None:
    """Both moment arms of one cable, m, with 90 % intervals.

    The interval is cluster-robust with the runs as clusters (Liang and Zeger 1986), Student's t with runs - 1
    degrees of freedom; NaN bounds for a single run. None where the two angles move as one.
    """
    matrix = sum((run.matrix for run in runs), np.zeros((2, 2)))
    right = sum((run.right for run in runs), np.zeros(2))
    if not runs or not np.linalg.cond(matrix) < LARGEST_CONDITION:
        return None
    inverse = np.linalg.inv(matrix)
    arms = inverse @ right
    half = np.full(2, np.nan)
    if len(runs) > 1:
        scores = np.stack([run.right - run.matrix @ arms for run in runs])
        count = len(runs)
        variance = inverse @ (scores.T @ scores) @ inverse * count / (count - 1.0)
        from scipy.stats import t as student  # slow to import

        half = float(student.ppf(0.5 + CONFIDENCE / 2, count - 1)) * np.sqrt(np.diag(variance))
    joints: tuple[Joint, ...] = ("mcp", "pip")
    return {
        joint: ParameterEstimate(float(arms[i]), "m", float(arms[i] - half[i]), float(arms[i] + half[i]))
        for i, joint in enumerate(joints)
    }
