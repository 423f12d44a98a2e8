"""Motor commands of this bench, written out apart from the project's own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

RATE_HZ = 1000.0
RAMP_S = 1.5


def command(trajectory: dict[str, Any], seconds: float) -> np.ndarray:
    """Motor command at the pulley, rad, one value a millisecond; it leads in from rest within 1.5 s."""
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    lead = np.clip(time / RAMP_S, 0.0, 1.0)
    lead = lead * lead * (3.0 - 2.0 * lead)
    wave = _wave(trajectory, time, seconds)
    offset, amplitude = math.radians(trajectory["offset_deg"]), math.radians(trajectory["amplitude_deg"])
    return lead * (offset + amplitude * wave)


def _wave(trajectory: dict[str, Any], time: np.ndarray, seconds: float) -> np.ndarray:
    kind, frequency = trajectory["kind"], trajectory["frequency_hz"]
    if kind == "sine":
        return np.sin(2 * np.pi * frequency * time)
    if kind == "chirp":
        last = trajectory["end_frequency_hz"]
        return np.sin(2 * np.pi * (frequency + 0.5 * (last - frequency) * time / seconds) * time)
    if kind == "multisine":
        parts = [
            np.sin(2 * np.pi * f * time + 2.0 * n * n) for n, f in enumerate(trajectory["frequencies_hz"])
        ]
        total = np.sum(parts, axis=0)
        return total / np.abs(total).max()
    if kind == "steps":
        return _steps(time, frequency, trajectory["seed"])
    raise ValueError(f"unknown kind of trajectory: {kind}")


def _steps(time: np.ndarray, frequency: float, seed: int) -> np.ndarray:
    """Levels at random, each held for a period; from one to the next within a tenth of a second."""
    rng = np.random.default_rng(seed)
    place = np.floor(time * frequency).astype(int)
    levels = rng.uniform(-1.0, 1.0, place[-1] + 2)
    blend = np.clip((time - place / frequency) / 0.1, 0.0, 1.0)
    blend = blend * blend * (3.0 - 2.0 * blend)
    return levels[place] + (levels[place + 1] - levels[place]) * blend
