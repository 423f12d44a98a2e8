"""From the truth to what a recording holds: noise, steps of the converters, and sensors that are wrong."""

from __future__ import annotations

import math

import numpy as np

from .bench import NOMINAL, Bench
from .simulate import Truth
from .trajectories import RATE_HZ

ANGLE_STEP, ANGLE_NOISE = math.radians(0.04), math.radians(0.05)  # KMA210 resolution; noise assumed
FORCE_STEP, FORCE_NOISE = 0.005, 0.015  # N; assumed
CURRENT_STEP, CURRENT_NOISE = 0.005, 0.020  # A; assumed


def read(bench: Bench, truth: Truth, command: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The channels of a session's run, SI, from what really happened."""
    time = np.arange(len(command)) / RATE_HZ
    angles = {"mcp_angle": truth.mcp, "pip_angle": truth.pip}
    size, phase = bench.sensor_harmonic
    angles = {name: true + size * np.sin(2 * true + phase) for name, true in angles.items()}
    warm = 1.0 - np.exp(-time / (0.6 * time[-1]))  # warms up in each run and cools between them
    angles["mcp_angle"] = angles["mcp_angle"] + bench.drift * warm / warm[-1]
    late = {**angles, "endpoint_force": truth.force * bench.force_gain}
    late = {name: np.interp(time - bench.delay, time, values) for name, values in late.items()}

    def convert(values: np.ndarray, noise: float, step: float) -> np.ndarray:
        noisy = values + noise * rng.standard_normal(len(values))
        return np.round(noisy / step) * step

    current = convert(truth.current, CURRENT_NOISE, CURRENT_STEP)
    motor = NOMINAL["motor"]
    return {
        "motor_command": command,
        "motor_position": truth.motor,
        "motor_current": current,
        "motor_torque": motor["torque_constant"] * motor["gear_ratio"] * current,
        "mcp_angle": convert(late["mcp_angle"], ANGLE_NOISE, ANGLE_STEP),
        "pip_angle": convert(late["pip_angle"], ANGLE_NOISE, ANGLE_STEP),
        "endpoint_force": convert(late["endpoint_force"], FORCE_NOISE, FORCE_STEP),
    }
