"""A motor command given point by point: from a text table of time and angle or torque, or two lists."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Array
from fingerlab.sessions.text_table import inspect_table, read_blocks

INLINE_POINTS = 400
"""Longer lists are not kept in a run's attributes, which HDF5 limits to 64 kB; the channel has it all."""


@dataclass(frozen=True)
class Points:
    """What the points are: key of their list, ending of amplitude and offset, and words for errors."""

    key: str
    ending: str
    words: str
    words_of_table: str


POSITION = Points("angle_deg", "deg", "angles", "angle in degrees")
TORQUE = Points("torque_n_m", "n_m", "torques", "torque in N m")
FORCE = Points("force_n", "n", "forces", "force in N")


def with_points(settings: Mapping[str, Any], where: str, what: Points = POSITION) -> dict[str, Any]:
    """Settings with ``time_s``, the list of points, and the amplitude and offset that follow.

    Raises:
        UserError: the table cannot be read, holds fewer than two rows, or its time does not increase.
    """
    if "time_s" in settings or what.key in settings:
        time, points = _listed(settings, where, what)
        found = dict(settings)
    else:
        time, points, found = *_table(settings, where, what), dict(settings)
        path = Path(str(settings["file"]))
        found |= {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    if len(time) < 2 or len(time) != len(points):
        raise UserError(
            f"{where} has {len(time)} times and {len(points)} {what.words}; it should have two rows or more."
        )
    if not (np.isfinite(time).all() and np.isfinite(points).all() and (np.diff(time) > 0).all()):
        raise UserError(f"{where} has a time that does not increase or a value that is not a number.")
    low, high = float(points.min()), float(points.max())
    found.setdefault("duration_s", float(time[-1]))
    return found | {
        "time_s": time.tolist(),
        what.key: points.tolist(),
        f"amplitude_{what.ending}": (high - low) / 2,
        f"offset_{what.ending}": (high + low) / 2,
    }


def unit_shape(settings: Mapping[str, Any], what: Points = POSITION) -> tuple[Array, Array]:
    """Times (s) and the shape of the motion within -1 to 1, each of shape (n,)."""
    points = np.asarray(settings[what.key], dtype=np.float64)
    half = float(settings[f"amplitude_{what.ending}"])
    middle = float(settings[f"offset_{what.ending}"])
    shape = (points - middle) / half if half else np.zeros_like(points)
    return np.asarray(settings["time_s"], dtype=np.float64), shape


def without_long_lists(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as they are stored with a run."""
    if len(settings.get("time_s", ())) <= INLINE_POINTS:
        return dict(settings)
    return {key: value for key, value in settings.items() if key not in ("time_s", POSITION.key, TORQUE.key)}


def _listed(settings: Mapping[str, Any], where: str, what: Points) -> tuple[Array, Array]:
    try:
        time = np.asarray(settings["time_s"], dtype=np.float64).reshape(-1)
        points = np.asarray(settings[what.key], dtype=np.float64).reshape(-1)
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{where} should have two lists of numbers, 'time_s' and '{what.key}'.") from None
    return time, points


def _table(settings: Mapping[str, Any], where: str, what: Points) -> tuple[Array, Array]:
    if not isinstance(settings.get("file"), str):
        raise UserError(
            f"{where} is of kind '{settings.get('kind')}'; it should name in 'file' a text table of time "
            f"in s and {what.words_of_table}, or hold the lists 'time_s' and '{what.key}'."
        )
    table = inspect_table(settings["file"])
    if table.columns < 2:
        raise UserError(
            f"{table.path} has one column; it should have two, time in s and {what.words_of_table}."
        )
    rows = np.concatenate(list(read_blocks(table)))
    return rows[:, 0], rows[:, 1]
