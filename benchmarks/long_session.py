"""A session of hours without recording for hours: one piece of a run, written over and over."""

from __future__ import annotations

import json
import math
import zlib
from pathlib import Path

import h5py
import numpy as np

from fingerlab.rig.file import default_rig

CHUNK = 32_768
"""Samples a chunk, as recordings have them."""
RATE_HZ = 1000.0

CHANNELS = {
    "motor_command": ("rad", 0.26, 0.38, 0.0),
    "motor_position": ("rad", 0.26, 0.38, 1e-4),
    "motor_current": ("A", 0.2, 0.3, 0.01),
    "motor_torque": ("N m", 0.026, 0.039, 1e-3),
    "mcp_angle": ("rad", 0.15, -0.1, 2e-3),
    "pip_angle": ("rad", 0.26, -0.3, 2e-3),
    "endpoint_force": ("N", 0.4, 0.8, 0.01),
}
"""Channel -> unit, amplitude, middle and noise (one standard deviation): a sine of 1 Hz."""


def write_long_session(path: Path, *hours: float) -> None:
    """A session file in the project's format, a run of each length; but for time, all chunks are the same."""
    random = np.random.default_rng(0)
    phase = 2 * math.pi * np.arange(CHUNK) / RATE_HZ
    with h5py.File(path, "w") as file:
        file.attrs.update(
            {
                "format": "fingerlab-session",
                "format_version": "1",
                "created": "2026-11-01T09:00:00+01:00",
                "title": "Hours of a sine",
                "rig": default_rig().to_json(),
            }
        )
        for number, length in enumerate(hours, start=1):
            samples = round(length * 3600 * RATE_HZ)
            group = file.create_group(f"runs/{number:03d}")
            group.attrs.update({"phase": "contact", "cable": "flexion", "sample_rate_hz": RATE_HZ})
            group.attrs["trajectory"] = json.dumps(
                {"kind": "sine", "amplitude_deg": 15, "frequency_hz": 1.0, "offset_deg": 22}
            )
            _repeat(group, "time", "s", samples, None)
            for name, (unit, amplitude, middle, noise) in CHANNELS.items():
                piece = middle + amplitude * np.sin(phase) + noise * random.standard_normal(CHUNK)
                _repeat(group, name, unit, samples, piece)


def _repeat(group: h5py.Group, name: str, unit: str, samples: int, piece: np.ndarray | None) -> None:
    """A channel of so many samples: ``piece`` again and again, packed once; or the time, not packed."""
    options = {} if piece is None else {"compression": "gzip"}
    dataset = group.create_dataset(name, (samples,), "f8", chunks=(CHUNK,), **options)
    dataset.attrs["units"] = unit
    packed = b"" if piece is None else zlib.compress(np.ascontiguousarray(piece).tobytes(), 1)
    for start in range(0, samples, CHUNK):
        chunk = packed or (np.arange(start, start + CHUNK) / RATE_HZ).tobytes()
        dataset.id.write_direct_chunk((start,), chunk)
