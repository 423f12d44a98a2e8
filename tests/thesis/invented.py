"""Sessions of a finger without mass, whose regression has a closed form: LHS is the spring's torque alone.

Joint angles follow from the tension, ``K theta = s a T + L``, so that slope and intercept are known.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions.model import ArrayReader, Run, Session

RATE = 1000.0
RADIUS = 0.015
K_MCP, K_PIP = 0.12, 0.06
A, B = 0.010, 0.007
L_MCP, L_PIP = -0.0015, 0.0008

RIG = Rig(
    Finger(0.0, 0.0, 0.0225, 0.024, 0.0, 0.0, K_MCP, K_PIP, wrist_angle=np.radians(15.0)),
    Motor(pulley_radius=RADIUS),
)

Channels = Mapping[str, np.ndarray]


def sine_tension(seconds: float = 20.0, frequency: float = 1.0, phase: float = 0.3) -> np.ndarray:
    """Tension that swings between 1 and 5 N."""
    t = np.arange(round(seconds * RATE)) / RATE
    return 3.0 + 2.0 * np.sin(2 * np.pi * frequency * t + phase)


def late(values: np.ndarray, samples: int) -> np.ndarray:
    """A signal delayed by whole samples; the start repeats its first value."""
    return np.concatenate([np.full(samples, values[0]), values[: len(values) - samples]])


def on_air(tension: np.ndarray, sign: int = -1, delay: int = 0, noise: np.ndarray | float = 0.0) -> Channels:
    """Channels of a run on air; the angles come ``delay`` samples after the tension."""
    seen = late(tension, delay) if delay else tension
    return {
        "motor_position": 0.4 + 0.1 * tension,
        "motor_torque": tension * RADIUS,
        "mcp_angle": (sign * A * seen + L_MCP + noise) / K_MCP,
        "pip_angle": (sign * B * seen + L_PIP + noise) / K_PIP,
    }


def run(
    name: str,
    channels: Channels,
    phase: str = "on_air",
    cable: str = "extension",
    frequency: float | None = 1.0,
    kind: str = "sine",
) -> Run:
    """A run that lives in memory."""
    trajectory: dict[str, Any] = {"kind": kind}
    if frequency is not None:
        trajectory["frequency_hz"] = frequency
    length = len(channels["motor_torque"])
    full = {"time": np.arange(length) / RATE, **channels}
    return Run(name, phase, cable, RATE, trajectory, length, dict.fromkeys(full, "SI"), ArrayReader(full))


def session(*runs: Run, rig: Rig = RIG) -> Session:
    """A session that lives in memory."""
    return Session(Path("invented.h5"), "invented", "2026-11-01T09:00:00+01:00", rig, runs)
