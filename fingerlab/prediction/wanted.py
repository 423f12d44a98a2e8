"""A wanted endpoint force over time: sine, ramp and hold, steps, or from a file.

The shapes are those of the motor's trajectories (:mod:`fingerlab.acquisition.trajectories`), in newtons.

=================  ==========================================================================
key                meaning (default)
=================  ==========================================================================
``kind``           ``sine``, ``ramp_hold``, ``steps`` or ``file``
``amplitude_n``    half of the range, N
``mean_n``         middle of the range, N
``frequency_hz``   of the sine; ramps or steps a second (0.5)
``rise_s``         time from one step to the next (0.3)
``seed``           which sequence of steps (0)
``duration_s``     length of the profile (20; of a file: its last time)
``file``           text table of time (s) and force (N); or two lists, ``time_s`` and ``force_n``
=================  ==========================================================================
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.acquisition.trajectories import WAVES
from fingerlab.acquisition.trajectory_points import FORCE, with_points
from fingerlab.core.errors import UserError
from fingerlab.diagnosis.bandwidth import WIDE_RATE_HZ
from fingerlab.sessions.model import Array

KINDS = ("sine", "ramp_hold", "steps", "file")
DEFAULTS = {"frequency_hz": 0.5, "rise_s": 0.3, "duration_s": 20.0}
SHORTEST_S, LONGEST_S = 1.0, 300.0


@dataclass(frozen=True)
class WantedForce:
    """``force``: N at the load cell, (n,), at ``time`` (s from its own start, (n,), 250 a second)."""

    settings: Mapping[str, Any]
    time: Array
    force: Array


def wanted_force(source: str | Mapping[str, Any], where: str = "The wanted force") -> WantedForce:
    """A wanted force from JSON text, the object that it holds, or a path to a text table or JSON file.

    Raises:
        UserError: it is none of them, a number is missing or impossible, or the force would have to pull.
    """
    settings = _object(source, where)
    kind = settings.get("kind")
    if kind not in KINDS:
        raise UserError(f"{where} has the kind {kind!r}; it should be one of {', '.join(KINDS)}.")
    if kind == "file":
        settings = with_points(settings, where, FORCE)
    settings = {**DEFAULTS, **settings}
    seconds = _number(settings, "duration_s", where)
    if not SHORTEST_S <= seconds <= LONGEST_S:
        raise UserError(
            f"{where} lasts {seconds:g} s; it should last from {SHORTEST_S:g} to {LONGEST_S:g} s."
        )
    time = np.arange(round(seconds * WIDE_RATE_HZ)) / WIDE_RATE_HZ
    if kind == "file":
        force = np.interp(time, settings["time_s"], settings[FORCE.key])
    else:
        amplitude, mean = (_number(settings, name, where) for name in ("amplitude_n", "mean_n"))
        force = mean + amplitude * WAVES[kind](settings, seconds, where)(time)
    if force.min() < 0.0:
        raise UserError(
            f"{where} falls to {force.min():.3g} N; a fingertip can only press, so that it should stay at "
            "0 N or more."
        )
    return WantedForce(settings, time, np.asarray(force))


def _object(source: str | Mapping[str, Any], where: str) -> Mapping[str, Any]:
    if isinstance(source, Mapping):
        return source
    if not source.lstrip().startswith("{"):
        path = Path(source)
        if path.suffix.lower() != ".json":
            return {"kind": "file", "file": source}
        try:
            source = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(
                f"{where} cannot be read from {path} ({error}); name a file that exists."
            ) from None
    try:
        found = json.loads(source)
    except ValueError as error:
        raise UserError(
            f'{where} is not JSON ({error}); it should look like {{"kind": "sine", "mean_n": 1, '
            f'"amplitude_n": 0.5, "frequency_hz": 0.5}}.'
        ) from None
    if not isinstance(found, Mapping):
        raise UserError(f"{where} is not a JSON object with 'kind', 'mean_n' and the like.")
    return found


def _number(settings: Mapping[str, Any], name: str, where: str) -> float:
    value = settings.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise UserError(f"{where} has {name!r} = {value!r}; it should be a finite number.")
    return float(value)
