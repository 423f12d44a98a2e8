"""Conditions: runs of one routing and phase that were told the same motion.

What no model explains of a bench repeats from run to run of one condition, so more of them are not new
evidence about physics; another frequency or amplitude is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fingerlab.sessions.model import Run

TOLD = ("frequency_hz", "amplitude_deg", "offset_deg", "load_torque")
"""What tells one motion from another of its kind."""
SAME_SHARE = 0.15
"""Numbers that differ by less than this share are the same condition; an approach is never found twice."""
SAME_DIFFERENCE = {"frequency_hz": 0.02, "amplitude_deg": 1.0, "offset_deg": 3.0, "load_torque": 0.002}
"""... or by less than this (Hz, degrees at the pulley, N m)."""
MOST_FOLDS = 30
"""Folds of a group, whatever the number of its conditions: beyond, conditions share folds."""


@dataclass(frozen=True)
class Fold:
    """Runs that are held out together.

    Attributes:
        condition: number of the motion that they were told, within the group.
        turn: folds of one turn, of all groups, are left out at the same time.
    """

    condition: int
    turn: int


def deal(runs: Sequence[Run], most: int) -> tuple[list[Fold], list[int]]:
    """The folds of a group, and the fold of each of its runs.

    Args:
        runs: of one routing and phase. most: folds of one condition, and turns.
    """
    seen: list[Run] = []
    conditions = [_condition(run, seen) for run in runs]
    totals = Counter(conditions)
    folds: list[Fold] = []
    own: dict[int, list[int]] = {}
    met: Counter[int] = Counter()
    places = []
    for condition in conditions:
        mine = own.setdefault(condition, [])
        if len(mine) < min(most, totals[condition]) and len(folds) < MOST_FOLDS:
            mine.append(len(folds))
            folds.append(Fold(condition, len(folds) % most))
        place = mine[met[condition] % len(mine)] if mine else (condition + met[condition]) % len(folds)
        met[condition] += 1
        places.append(place)
    return folds, places


def _condition(run: Run, seen: list[Run]) -> int:
    """Which of the motions ``seen`` the run was told; a new one is appended."""
    for number, other in enumerate(seen):
        if _alike(run.trajectory, other.trajectory):
            return number
    seen.append(run)
    return len(seen) - 1


def _alike(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    if one.get("kind") != other.get("kind"):
        return False
    return all(_close(one.get(name), other.get(name), SAME_DIFFERENCE[name]) for name in TOLD)


def _close(one: object, other: object, difference: float) -> bool:
    if not isinstance(one, int | float) or not isinstance(other, int | float):
        return one == other
    return abs(one - other) <= max(difference, SAME_SHARE * max(abs(one), abs(other)))
