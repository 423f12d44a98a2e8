"""A motor command given point by point: from a text table of time and angle, or from two lists."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.errors import UserError
from fingerlab.sessions.model import Array
from fingerlab.sessions.text_table import inspect_table, read_blocks

INLINE_POINTS = 400
"""Longer lists are not kept in a run's attributes, which HDF5 limits to 64 kB; the channel has it all."""


def with_points(settings: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Settings of kind ``file`` with ``time_s``, ``angle_deg``, and the amplitude and offset that follow.

    Raises:
        UserError: the table cannot be read, holds fewer than two rows, or its time does not increase.
    """
    if "time_s" in settings or "angle_deg" in settings:
        time, angle = _listed(settings, where)
        found = dict(settings)
    else:
        time, angle, found = *_table(settings, where), dict(settings)
        path = Path(str(settings["file"]))
        found |= {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    if len(time) < 2 or len(time) != len(angle):
        raise UserError(
            f"{where} has {len(time)} times and {len(angle)} angles; it should have two rows or more."
        )
    if not (np.isfinite(time).all() and np.isfinite(angle).all() and (np.diff(time) > 0).all()):
        raise UserError(f"{where} has a time that does not increase or a value that is not a number.")
    low, high = float(angle.min()), float(angle.max())
    found.setdefault("duration_s", float(time[-1]))
    return found | {
        "time_s": time.tolist(),
        "angle_deg": angle.tolist(),
        "amplitude_deg": (high - low) / 2,
        "offset_deg": (high + low) / 2,
    }


def unit_shape(settings: Mapping[str, Any]) -> tuple[Array, Array]:
    """Times (s) and the shape of the motion within -1 to 1, each of shape (n,)."""
    angle = np.asarray(settings["angle_deg"], dtype=np.float64)
    half = float(settings["amplitude_deg"])
    shape = (angle - float(settings["offset_deg"])) / half if half else np.zeros_like(angle)
    return np.asarray(settings["time_s"], dtype=np.float64), shape


def without_long_lists(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as they are stored with a run."""
    if len(settings.get("time_s", ())) <= INLINE_POINTS:
        return dict(settings)
    return {key: value for key, value in settings.items() if key not in ("time_s", "angle_deg")}


def _listed(settings: Mapping[str, Any], where: str) -> tuple[Array, Array]:
    try:
        time = np.asarray(settings["time_s"], dtype=np.float64).reshape(-1)
        angle = np.asarray(settings["angle_deg"], dtype=np.float64).reshape(-1)
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{where} should have two lists of numbers, 'time_s' and 'angle_deg'.") from None
    return time, angle


def _table(settings: Mapping[str, Any], where: str) -> tuple[Array, Array]:
    if not isinstance(settings.get("file"), str):
        raise UserError(
            f"{where} is of kind 'file'; it should name a text table of time and angle in 'file'."
        )
    table = inspect_table(settings["file"])
    if table.columns < 2:
        raise UserError(f"{table.path} has one column; it should have two, time in s and angle in degrees.")
    rows = np.concatenate(list(read_blocks(table)))
    return rows[:, 0], rows[:, 1]
