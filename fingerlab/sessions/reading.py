"""Opening a session file. (First cut: the checks of the contract come with the sessions module.)"""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np

from fingerlab.rig import Rig
from fingerlab.sessions.model import Array, Run, Session


def open_session(path: str | Path) -> Session:
    """Open a session without reading its samples."""
    path = Path(path)
    runs = []
    with h5py.File(path, "r") as file:
        for name in sorted(file["runs"]):
            group = file["runs"][name]
            units = {k: str(d.attrs["units"]) for k, d in group.items() if isinstance(d, h5py.Dataset)}

            def read(channel: str, start: int, stop: int, group_name: str = f"runs/{name}") -> Array:
                with h5py.File(path, "r") as again:
                    return np.asarray(again[group_name][channel][start:stop], dtype=np.float64)

            runs.append(
                Run(
                    name,
                    str(group.attrs["phase"]),
                    str(group.attrs["cable"]),
                    float(group.attrs["sample_rate_hz"]),
                    json.loads(group.attrs["trajectory"]),
                    len(group["time"]),
                    units,
                    read,
                )
            )
        return Session(
            path,
            str(file.attrs["title"]),
            str(file.attrs["created"]),
            Rig.from_json(file.attrs["rig"]),
            tuple(runs),
        )
