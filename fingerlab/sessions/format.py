"""Names, units and rules of the session file, version 1 (``session-format.md``). One definition each."""

from __future__ import annotations

from typing import Any

import numpy as np

FORMAT_NAME = "fingerlab-session"
FORMAT_VERSION = "1"
FORMAT_MAJOR = 1

PHASES = ("on_air", "contact", "motor_bench", "free")
CABLES = ("extension", "flexion", "none")

CHANNEL_UNITS = {
    "time": "s",
    "motor_command": "rad",
    "motor_position": "rad",
    "motor_current": "A",
    "motor_torque": "N m",
    "mcp_angle": "rad",
    "pip_angle": "rad",
    "endpoint_force": "N",
    "load_torque": "N m",
}
"""Channels of the contract with their unit, in the contract's order."""

MAY_BE_NAN = frozenset({"endpoint_force"})
"""Channels of the contract in which NaN means "not read"."""

_MOTOR_ONLY = ("time", "motor_position", "motor_torque")
_FINGER = (
    "time",
    "motor_command",
    "motor_position",
    "motor_current",
    "motor_torque",
    "mcp_angle",
    "pip_angle",
)
REQUIRED_CHANNELS = {"on_air": _FINGER, "contact": _FINGER, "motor_bench": _MOTOR_ONLY, "free": _MOTOR_ONLY}
"""Channels without which a run of a phase says nothing; recordings of other machines have no more."""

FINGER_PHASES = frozenset({"on_air", "contact"})
"""Phases in which the rig must know its finger."""

OWN_ROOT_ATTRIBUTES = ("format", "format_version", "created", "title", "rig", "software")
"""Root attributes that whoever writes a session sets itself; all others travel with the runs."""
REQUIRED_ROOT_ATTRIBUTES = ("created", "title", "rig")
REQUIRED_RUN_ATTRIBUTES = ("phase", "cable", "sample_rate_hz", "trajectory")

LEAST_RATE, MOST_RATE = 1e-3, 1e8
"""Hz: no bench is sampled slower than in a quarter of an hour, or faster than any card."""

RATE_TOLERANCE = 0.5
"""A step of time within this share of 1 / sample_rate_hz is regular; a longer one is a gap.

Half a sample: less cannot be a lost sample, more cannot be jitter of a hardware-timed task. Assumed.
"""


def plain(value: Any) -> Any:
    """An HDF5 attribute as a plain Python value: bytes become text, arrays of one element a scalar.

    MATLAB writes text as bytes and numbers as arrays of one element; h5py gives numpy scalars.
    """
    if isinstance(value, np.ndarray):
        if value.size != 1:
            return [plain(item) for item in value.ravel()]
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    if isinstance(value, np.generic):
        return plain(value.item())
    return value


def as_stored(name: str, values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Samples as a session stores them: counts are whole numbers, which single precision would round."""
    return np.rint(values).astype(np.int64) if name.endswith("_counts") else values
