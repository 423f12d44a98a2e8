"""What five lines of least squares make of an axis: the measure that a diagnosis has to reach.

Inertia, offset and load, then speed, its sign and more; fitted to all runs but one and judged on that one.
Channels are low-passed at 8 Hz, or at the band that the diagnosis looks at, by a filter of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import butter, sosfiltfilt

from fingerlab.sessions.model import Array, Run, Session

CUTOFF_HZ = 8.0
"""Of a machine of the thesis' pace."""
SETTLING = 0.1
"""Share of a run at either end that is left out: ramp and ends of the filter."""

NOMINAL = ("inertia", "offset", "load")
LAWS: Mapping[str, tuple[str, ...]] = {
    "nominal": NOMINAL,
    "Coulomb": (*NOMINAL, "direction"),
    "Coulomb and viscous": (*NOMINAL, "direction", "speed"),
    "Coulomb, viscous, load": (*NOMINAL, "direction", "speed", "load times direction"),
}


def columns(run: Run, cutoff: float = CUTOFF_HZ) -> tuple[dict[str, Array], Array]:
    """The regressors of a run, (n,) each, and its torque, N m, (n,), some samples a cycle of the cutoff."""
    rate = run.sample_rate_hz
    load = run.channel("load_torque") if run.has("load_torque") else np.zeros(run.length)
    channels = np.stack((run.channel("motor_position"), run.channel("motor_torque"), load))
    position, torque, load = sosfiltfilt(butter(2, cutoff, fs=rate, output="sos"), channels)
    speed = np.gradient(position, 1.0 / rate)
    found = {
        "inertia": np.gradient(speed, 1.0 / rate),
        "offset": np.ones_like(speed),
        "load": load,
        "speed": speed,
        "direction": np.sign(speed),
        "load times direction": np.abs(load) * np.sign(speed),
    }
    cut = int(SETTLING * run.length)
    part = slice(cut, run.length - cut, max(int(rate / (4.0 * cutoff)), 1))
    return {name: values[part] for name, values in found.items()}, torque[part]


def left_out_error(session: Session, law: Sequence[str], cutoff: float = CUTOFF_HZ) -> float:
    """Root mean square of what the torque misses on runs left out, N m, below ``cutoff``, Hz."""
    parts = [columns(run, cutoff) for run in session.runs]
    tables = [np.stack([found[name] for name in law], axis=1) for found, _ in parts]
    squares = samples = 0.0
    for k, (_, torque) in enumerate(parts):
        others = [i for i in range(len(parts)) if i != k] or [k]
        known = np.concatenate([tables[i] for i in others])
        scale = np.maximum(np.linalg.norm(known, axis=0), 1e-300)
        told = np.concatenate([parts[i][1] for i in others])
        values = np.linalg.lstsq(known / scale, told, rcond=None)[0] / scale
        squares += float(np.sum((torque - tables[k] @ values) ** 2))
        samples += len(torque)
    return float(np.sqrt(squares / samples))


def baselines(session: Session, cutoff: float = CUTOFF_HZ) -> dict[str, float]:
    """Error of each law on runs left out, N m, below ``cutoff``, Hz."""
    return {name: left_out_error(session, law, cutoff) for name, law in LAWS.items()}
