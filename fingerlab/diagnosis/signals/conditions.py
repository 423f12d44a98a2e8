"""Which runs are analysed, and which belong together.

Runs of one routing and phase are a group: they share moment arms, losses and noise. Within a group, runs that
were told the same motion are one condition. What no model explains of a bench repeats from run to run of one
condition, so more of them are not new evidence about physics; another frequency or amplitude is. A group's
runs are dealt to folds, which are held out of a fit one split at a time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.settings import FOLDS, MOST_CHANGES, MOST_FOLDS, SAME_DIFFERENCE, SAME_SHARE
from fingerlab.rig.file import INTERVENTION, UNCHANGED, Intervention, intervention_of
from fingerlab.sessions.model import Run, Session

CHANGE = "number of the change"
"""Attribute of a run in memory: number of its known change, and how many there are."""
COMPARED = ("frequency_hz", "amplitude_deg", "offset_deg", "load_torque")
"""What tells one motion from another of its kind."""


@dataclass(frozen=True)
class Fold:
    """Runs that are held out together.

    Attributes:
        condition: number of the motion that they were told, within the group.
        split: folds of one split, of all groups, are left out at the same time.
    """

    condition: int
    split: int


def folds_of(runs: Sequence[Run], most: int) -> tuple[list[Fold], list[int]]:
    """The folds of a group, and the fold of each of its runs.

    Args:
        runs: of one routing and phase. most: folds of one condition, and splits.
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
        if _alike(run.trajectory, other.trajectory) and _same_change(run, other):
            return number
    seen.append(run)
    return len(seen) - 1


def _same_change(one: Run, other: Run) -> bool:
    """Whether the machine was changed alike for both, or for neither."""
    mine, theirs = (intervention_of(run.attributes, run.name) or UNCHANGED for run in (one, other))
    return mine == theirs


def with_interventions(sessions: Sequence[Session]) -> tuple[Session, ...]:
    """The sessions; where a run was taken with a known change of the machine, all finger runs tell of theirs.

    Their equations then have one form, those of an unchanged machine with nothing added.
    """
    if not any(run.changed for session in sessions for run in session.runs):
        return tuple(sessions)

    seen: list[tuple[str, Intervention]] = []

    def numbered(run: Run) -> Run:
        change = intervention_of(run.attributes, run.name) or UNCHANGED
        one = run.cable, change
        if change != UNCHANGED and one not in seen:
            seen.append(one)
        number = seen.index(one) + 1 if one in seen else 0
        return replace(
            run, attributes={INTERVENTION: "{}", **run.attributes, CHANGE: min(number, MOST_CHANGES)}
        )

    def counted(run: Run) -> Run:
        count = min(len(seen), MOST_CHANGES)
        return replace(run, attributes={**run.attributes, CHANGE: (run.attributes[CHANGE], count)})

    for change in (numbered, counted):
        sessions = [
            replace(s, runs=tuple(change(r) if r.cable_sign else r for r in s.runs)) for s in sessions
        ]
    return tuple(sessions)


def changed_pairs(runs: Sequence[Run]) -> list[tuple[int, int]]:
    """Numbers of runs of one motion, before a known change of the machine and with it; the last before each.

    About which angle a finger presses is found anew after a change: there the offset does not count.
    """
    found = []
    for number, run in enumerate(runs):
        if not run.cable_sign or intervention_of(run.attributes, run.name) in (None, UNCHANGED):
            continue
        same = [
            k
            for k, other in enumerate(runs)
            if group_key(other) == group_key(run) and _alike(_shape(other), _shape(run))
            and intervention_of(other.attributes, other.name) in (None, UNCHANGED)
        ]  # fmt: skip
        if same:
            found.append((max([k for k in same if k < number], default=same[0]), number))
    return found


def _shape(run: Run) -> Mapping[str, Any]:
    """What a run was told, as far as it tells a pair's motion."""
    pressed = run.phase == "contact"
    return {k: v for k, v in run.trajectory.items() if not (pressed and k == "offset_deg")}


def _alike(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    if one.get("kind") != other.get("kind"):
        return False
    return all(_within_tolerance(one.get(name), other.get(name), SAME_DIFFERENCE[name]) for name in COMPARED)


def _within_tolerance(one: object, other: object, difference: float) -> bool:
    if not isinstance(one, int | float) or not isinstance(other, int | float):
        return one == other
    return abs(one - other) <= max(difference, SAME_SHARE * max(abs(one), abs(other)))


def repeated_motions(runs: Sequence[Run]) -> list[int | None]:
    """For each run a number that runs told just the same motion share; None: nothing tells it.

    Stricter than the conditions: all that the trajectories say must agree, not only what usually matters.
    """
    seen: list[Run] = []
    found: list[int | None] = []
    for run in runs:
        if not all(isinstance(run.trajectory.get(name), int | float) for name in COMPARED[:2]):
            found.append(None)
            continue
        place = next((k for k, other in enumerate(seen) if _commanded_alike(run, other)), len(seen))
        if place == len(seen):
            seen.append(run)
        found.append(place)
    return found


def _commanded_alike(one: Run, other: Run) -> bool:
    mine, theirs = ({k: v for k, v in run.trajectory.items() if k not in COMPARED} for run in (one, other))
    same = group_key(one) == group_key(other) and _same_change(one, other)
    return same and mine == theirs and _alike(one.trajectory, other.trajectory)


GroupKey = tuple[str, str]


def runs_to_analyse(sessions: Sequence[Session]) -> tuple[list[tuple[Session, Run]], bool]:
    """Finger runs of all sessions and the motor-bench runs beside them; whether there are only the latter.

    A run that lacks a channel is left aside where others of its kind have it.

    Raises:
        UserError: there is no run at all, or finger runs without the finger's constants.
    """
    every = [(s, r) for s in sessions for r in s.runs]
    bench = [(s, r) for s, r in every if r.phase == "motor_bench"]
    finger = [(s, r) for s, r in every if r.phase != "motor_bench" and r.cable_sign != 0]
    if finger:
        for session, _ in finger:
            if session.rig.finger is None:
                raise UserError(f"{session.path} gives no finger constants; its rig text needs 'finger'.")
        return _with_all_channels(finger) + _with_all_channels(bench), False
    if not bench:
        names = ", ".join(str(s.path) for s in sessions)
        raise UserError(
            f"{names} holds no run with a cable and no motor-bench run; there is nothing to compare."
        )
    return _with_all_channels(bench), True


FINGER_CHANNELS = ("motor_position", "motor_torque", "mcp_angle", "pip_angle")
BENCH_CHANNELS = ("motor_position", "motor_torque")


def needed_channels(run: Run) -> tuple[str, ...]:
    """Channels that a run of its phase cannot be analysed without."""
    if run.phase == "motor_bench":
        return BENCH_CHANNELS
    return (*FINGER_CHANNELS, "endpoint_force") if run.phase == "contact" else FINGER_CHANNELS


def missing_channels(run: Run) -> tuple[str, ...]:
    """Those that a run lacks, or of which nothing was read halfway through it."""
    missing = [name for name in needed_channels(run) if not run.has(name)]
    if run.phase == "contact" and run.has("endpoint_force") and run.length:
        middle = run.length // 2
        if np.isnan(run.channel("endpoint_force", middle, middle + 1)).all():
            missing.append("endpoint_force")
    return tuple(missing)


def _with_all_channels(pairs: list[tuple[Session, Run]]) -> list[tuple[Session, Run]]:
    return usable(pairs, lambda run: not missing_channels(run))


def usable(pairs: Sequence[tuple[Session, Run]], fits: Callable[[Run], bool]) -> list[tuple[Session, Run]]:
    """The runs that fit; of a kind of which none does all of them, for then there is something to be said."""
    fitting = [fits(run) for _, run in pairs]
    kinds = {group_key(run) for (_, run), fit in zip(pairs, fitting, strict=True) if fit}
    return [pair for pair, fit in zip(pairs, fitting, strict=True) if fit or group_key(pair[1]) not in kinds]


def group_key(run: Run) -> GroupKey:
    """Runs of one cable and phase belong together."""
    return (run.cable, kind_of(run.phase))


def kind_of(phase: str) -> str:
    """Second part of a group's key: whether its runs press on something."""
    return "contact" if phase == "contact" else "free"


def folds_of_runs(runs: Sequence[Run]) -> tuple[dict[GroupKey, list[Fold]], list[int]]:
    """The folds of every group of runs, and for each run which of its group's folds holds it."""
    members: dict[GroupKey, list[int]] = {}
    for number, run in enumerate(runs):
        members.setdefault(group_key(run), []).append(number)
    folds, places = {}, [0] * len(runs)
    for key, mine in members.items():
        folds[key], found = folds_of([runs[i] for i in mine], FOLDS)
        for i, place in zip(mine, found, strict=True):
            places[i] = place
    return folds, places
