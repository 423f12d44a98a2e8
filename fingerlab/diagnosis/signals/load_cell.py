"""What a load cell reads with nothing on it, and how late it reads: taken off where runs are read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fingerlab.diagnosis.settings import FIRST_LOOK_S, FORCE_ZERO_RUNS, LEAST_FORCE_ZERO, ZERO_SPREADS
from fingerlab.sessions.model import Array, Run, Session

FORCE_ERROR = "force_error"
"""Attribute of a run: the :class:`LoadCellError` of its load cell."""


class LoadCellError(NamedTuple):
    """The force is ``reading - zero + lag * rate + lag_square * second derivative``; N, s, s^2."""

    zero: float = 0.0
    lag: float = 0.0
    lag_square: float = 0.0


def with_force_error(sessions: Sequence[Session], error: LoadCellError) -> tuple[Session, ...]:
    """The sessions, with an error of the load cell's reading told to their runs."""
    if not any(error):
        return tuple(sessions)

    def told(run: Run) -> Run:
        return replace(run, attributes={**run.attributes, FORCE_ERROR: error})

    return tuple(replace(s, runs=tuple(map(told, s.runs))) for s in sessions)


def zero_in_the_air(runs: Sequence[Run]) -> float | None:
    """What the load cell reads in runs in which nothing touches it, in its unit; None: none of them tells.

    Zero, where that is no more than readings scatter from run to run, or nothing beside those in contact.
    """
    free = _medians([run for run in runs if run.phase == "on_air"])
    if not len(free):
        return None
    zero = float(np.median(free))
    spread = float(np.std(free)) if len(free) > 1 else 0.0
    pressed = _medians([run for run in runs if run.phase == "contact"])
    least = LEAST_FORCE_ZERO * float(np.median(np.abs(pressed - zero))) if len(pressed) else np.inf
    return zero if abs(zero) > max(least, ZERO_SPREADS * spread) else 0.0


def _medians(runs: Sequence[Run]) -> Array:
    """Median reading of some of the runs, evenly among them; without those that hold none."""
    read = [run for run in runs if run.has("endpoint_force")]
    found = []
    for run in read[:: -(-len(read) // FORCE_ZERO_RUNS) or 1]:
        samples = run.load(["endpoint_force"], 0, int(FIRST_LOOK_S * run.sample_rate_hz))["endpoint_force"]
        samples = samples[np.isfinite(samples)]
        found += [float(np.median(samples))] if len(samples) else []
    return np.array(found)
