"""Which runs are analysed, which belong together, and which channels contradict the rig or each other.

Runs of one routing and phase are a group: they share moment arms, losses and noise. Within a group, runs that
were told the same motion are one condition. What no model explains of a bench repeats from run to run of one
condition, so more of them are not new evidence about physics; another frequency or amplitude is. A group's
runs are dealt to folds, which are held out of a fit one turn at a time.

A dead sensor, a load cell that reads nothing, degrees in place of radians, mN m in place of N m: each makes a
physical effect of its own, and a confident one. All that is compared here is a ratio that a bench keeps
within a factor of a few, whatever its size; a wrong unit is off by more than fifty.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.settings import (
    ANOTHER_UNIT,
    DEAD_SHARE,
    FOLDS,
    LARGEST_ARM_M,
    LEAST_ARM_M,
    MOST_CHANGES,
    MOST_FOLDS,
    MOVED_DEG,
    OFF_CURRENT,
    OPPOSITE,
    SAME_DIFFERENCE,
    SAME_SHARE,
)
from fingerlab.physics.motion import Motion
from fingerlab.rig.file import INTERVENTION, UNCHANGED, Intervention, Rig, intervention_of
from fingerlab.sessions.model import Array, Run, Session

CHANGE = "number of the change"
"""Attribute of a run in memory: number of its known change, and how many there are."""
TOLD = ("frequency_hz", "amplitude_deg", "offset_deg", "load_torque")
"""What tells one motion from another of its kind."""


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
        if _alike(run.trajectory, other.trajectory) and _same_change(run, other):
            return number
    seen.append(run)
    return len(seen) - 1


def _same_change(one: Run, other: Run) -> bool:
    """Whether the machine was changed alike for both, or for neither."""
    mine, theirs = (intervention_of(run.attributes, run.name) or UNCHANGED for run in (one, other))
    return mine == theirs


def with_changes_told(sessions: Sequence[Session]) -> tuple[Session, ...]:
    """The sessions; where a run was taken with a known change of the machine, all finger runs tell of theirs.

    Their equations then have one form, those of an unchanged machine with nothing added.
    """
    if not any(run.changed for session in sessions for run in session.runs):
        return tuple(sessions)

    seen: list[tuple[str, Intervention]] = []

    def told(run: Run) -> Run:
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

    for change in (told, counted):
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
    return all(_close(one.get(name), other.get(name), SAME_DIFFERENCE[name]) for name in TOLD)


def _close(one: object, other: object, difference: float) -> bool:
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
        if not all(isinstance(run.trajectory.get(name), int | float) for name in TOLD[:2]):
            found.append(None)
            continue
        place = next((k for k, other in enumerate(seen) if _told_the_same(run, other)), len(seen))
        if place == len(seen):
            seen.append(run)
        found.append(place)
    return found


def _told_the_same(one: Run, other: Run) -> bool:
    mine, theirs = ({k: v for k, v in run.trajectory.items() if k not in TOLD} for run in (one, other))
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
    """Those whose channels are all there; all where none has them, for then there is something to be said."""
    whole = [pair for pair in pairs if not missing_channels(pair[1])]
    kinds = {group_key(run) for _, run in whole}
    return [p for p in pairs if p in whole or group_key(p[1]) not in kinds]


def group_key(run: Run) -> GroupKey:
    """Runs of one cable and phase belong together."""
    return (run.cable, kind_of(run.phase))


def kind_of(phase: str) -> str:
    """Second part of a group's key: whether its runs press on something."""
    return "contact" if phase == "contact" else "free"


def deal_runs(runs: Sequence[Run]) -> tuple[dict[GroupKey, list[Fold]], list[int]]:
    """The folds of every group of runs, and for each run which of its group's folds holds it."""
    members: dict[GroupKey, list[int]] = {}
    for number, run in enumerate(runs):
        members.setdefault(group_key(run), []).append(number)
    folds, places = {}, [0] * len(runs)
    for key, mine in members.items():
        folds[key], found = deal([runs[i] for i in mine], FOLDS)
        for i, place in zip(mine, found, strict=True):
            places[i] = place
    return folds, places


LOOK_S = 4.0
"""So much of a run is looked at beside its command and its current, s."""
LOOKED_AT = 2000
"""So many samples tell how far a channel swings."""
PULLS_SHARE = 0.2
"""Of its mean a tension swings by more, where a load cell has to show it; assumed: less may rub away."""
NOT_KNOWN = float("nan")


@dataclass(frozen=True)
class Facts:
    """What one run says of its channels, in numbers without a unit; NaN where it says nothing.

    Attributes:
        current: motor_torque over what motor_current and the rig's constants make it.
        command: travel of the motor over that of its command; agrees: their correlation.
        still: channels that do not move while another one says that they should.
        arm: moment arm (m) that both joints together would need to follow the cable.
        spring: moment arm (m) that the springs' torque has by the swing of the tension.
        force: the load cell's force over what the cable's tension is good for; swing: that of its swing.
    """

    run: str
    on_bench: bool
    current: float = NOT_KNOWN
    command: float = NOT_KNOWN
    agrees: float = NOT_KNOWN
    still: tuple[str, ...] = ()
    arm: float = NOT_KNOWN
    spring: float = NOT_KNOWN
    force: float = NOT_KNOWN
    swing: float = NOT_KNOWN


def facts_of(run: Run, motion: Motion, rig: Rig) -> Facts:
    """Of the first stretch of a run."""
    inner = slice(motion.lead, None)
    wound = motion.radius * motion.position[inner]
    current, command, agrees = _beside(run, rig)
    still = [] if np.ptp(wound) > 0 else ["motor_position"]
    if np.ptp(motion.torque[inner]) == 0:
        still.append("motor_torque")
    if motion.joints is None or rig.finger is None:
        return Facts(run.name, True, current, command, agrees, tuple(still))
    q = motion.joints
    mcp, pip = _swing(q.mcp[inner]), _swing(q.pip[inner])
    pull = motion.tension[inner]
    if motion.force is not None:
        force = motion.force[inner]
        # A fingertip's lever is a phalanx, the cable's an arm.
        lever = 2.0 * rig.finger.distal_half_length
        newton = _usual_arm(rig) / lever if lever > 0 else NOT_KNOWN
        mean, varies = max(float(np.mean(pull)), 0.0), _swing(pull)
        share = float(np.mean(force)) / (newton * mean) if mean > 0 else NOT_KNOWN
        swing = _swing(force) / (newton * varies) if varies > PULLS_SHARE * mean > 0 else NOT_KNOWN
        return Facts(run.name, False, current, command, agrees, tuple(still), force=share, swing=swing)
    moved = np.radians(MOVED_DEG)
    for name, mine, other in (("mcp_angle", mcp, pip), ("pip_angle", pip, mcp)):
        if other > moved and mine < DEAD_SHARE * other:
            still.append(name)
    arm = _swing(wound) / (mcp + pip) if mcp + pip > 0 else NOT_KNOWN
    torque = float(np.hypot(rig.finger.mcp_stiffness * mcp, rig.finger.pip_stiffness * pip))
    swing = _swing(pull)
    spring = torque / swing if swing > 0 and max(mcp, pip) > moved else NOT_KNOWN
    return Facts(
        run.name, False, current, command, agrees, tuple(still), arm if max(mcp, pip) > moved else NOT_KNOWN,
        spring,
    )  # fmt: skip


def _beside(run: Run, rig: Rig) -> tuple[float, float, float]:
    """Torque over current, travel over command, and their agreement, from the samples as they are."""
    names = [n for n in ("motor_current", "motor_torque", "motor_position", "motor_command") if run.has(n)]
    first = run.length // 10  # the ramp from rest
    samples = run.load(names, first, first + int(LOOK_S * run.sample_rate_hz))
    gain = rig.motor.torque_constant * rig.motor.gear_ratio
    current = command = agrees = NOT_KNOWN
    if "motor_current" in samples and gain > 0:
        amperes = samples["motor_current"]
        large = np.abs(amperes) > np.median(np.abs(amperes))
        if large.any() and np.isfinite(amperes).all():
            current = float(np.median(samples["motor_torque"][large] / amperes[large])) / gain
    if "motor_command" in samples and np.isfinite(samples["motor_command"]).all():
        told, done = samples["motor_command"], samples["motor_position"]
        if _swing(told) > np.radians(MOVED_DEG) and _swing(done) > 0:
            command = _swing(done) / _swing(told)
            agrees = float(np.corrcoef(told, done)[0, 1])
    return current, command, agrees


def _swing(values: Array) -> float:
    """From nearly the lowest value to nearly the highest, which no spike moves."""
    some = np.sort(values[:: max(len(values) // LOOKED_AT, 1)])
    edge = len(some) // 50
    return float(some[-1 - edge] - some[edge]) if len(some) else 0.0


def _usual_arm(rig: Rig) -> float:
    return float(np.sqrt(LEAST_ARM_M * LARGEST_ARM_M))


def check_channels(seen: Sequence[Facts]) -> None:
    """Refuse recordings whose channels contradict the rig, geometry or each other in every run that tells.

    Raises:
        UserError: with the channel, by how much, and what would be right.
    """
    for wrong in (_dead, _units, _force):
        sentence = wrong(seen)
        if sentence:
            raise UserError(sentence)


def _dead(seen: Sequence[Facts]) -> str:
    for channel in ("motor_position", "motor_torque", "mcp_angle", "pip_angle"):
        those = [f for f in seen if not (channel.endswith("angle") and np.isnan(f.arm))]
        if those and all(channel in f.still for f in those):
            beside = "" if channel.startswith("motor") else " while the other joint does"
            return (
                f"Channel '{channel}' does not move in any run{beside} (run {those[0].run}, for one); its "
                "sensor is dead or not connected: mend it and record again."
            )
    return ""


def _units(seen: Sequence[Facts]) -> str:
    told = _known(seen, lambda f: f.current)
    if told and (min(v for _, v in told) > OFF_CURRENT or max(v for _, v in told) < 1.0 / OFF_CURRENT):
        run, value = told[0]
        turned = "turn its sign" if value < 0 else "write it in N m at the gearbox output"
        return (
            f"Channel 'motor_torque' is {value:.3g} times what motor_current and the rig's torque constant "
            f"and gear ratio make it (run {run}, for one); {turned}, or correct the rig."
        )
    told = _known(seen, lambda f: f.agrees)
    if told and max(v for _, v in told) < -OPPOSITE:
        return (
            f"Channel 'motor_position' turns against its command in every run (run {told[0][0]}, for one); "
            "turn the sign of one of them."
        )
    told = _known(seen, lambda f: f.command)
    if told and (min(v for _, v in told) > ANOTHER_UNIT or max(v for _, v in told) < 1.0 / ANOTHER_UNIT):
        return (
            f"Channel 'motor_position' moves {told[0][1]:.3g} times as far as its command in run "
            f"{told[0][0]}; write both in rad at the pulley."
        )
    told = _known(seen, lambda f: f.arm)
    if told and not LEAST_ARM_M < np.median([v for _, v in told]) < LARGEST_ARM_M:
        far = np.median([v for _, v in told]) > LARGEST_ARM_M
        contrary = "much further than the joints turn" if far else "next to nothing while the joints turn"
        return (
            f"The cable moves {contrary} (run {told[0][0]}, for one); write all angles in rad, the motor's "
            "at the pulley, and the pulley's radius in m."
        )
    told = _known(seen, lambda f: f.spring)
    middle = float(np.median([v for _, v in told])) if told else NOT_KNOWN
    if middle * ANOTHER_UNIT < LEAST_ARM_M or middle > ANOTHER_UNIT * LARGEST_ARM_M:
        times = "more" if middle < LEAST_ARM_M else "less"
        return (
            f"Channel 'motor_torque' swings by far {times} than the joints' springs take (run {told[0][0]}, "
            "for one); write it in N m at the gearbox output, or correct the rig's stiffnesses."
        )
    return ""


def _force(seen: Sequence[Facts]) -> str:
    told = _known(seen, lambda f: f.force)
    if not told:
        return ""
    run, values = told[0][0], np.array([v for _, v in told])
    if (np.abs(values) < 1.0 / ANOTHER_UNIT).all():
        return (
            f"Channel 'endpoint_force' reads next to nothing in every contact run (run {run}, for one) while "
            "the cable pulls; the load cell is dead, not connected, or not in N."
        )
    moves = _known(seen, lambda f: f.swing)
    if moves and max(v for _, v in moves) < 1.0 / ANOTHER_UNIT:
        return (
            f"Channel 'endpoint_force' stands still in every contact run (run {moves[0][0]}, for one) while "
            "the cable's tension swings; the load cell is stuck or not connected: mend it and record again."
        )
    if (values < 0).all():
        return (
            f"Channel 'endpoint_force' is negative in every contact run (run {run}, for one); turn its sign, "
            "compression is positive."
        )
    if (values > ANOTHER_UNIT).all():
        return (
            f"Channel 'endpoint_force' is far more than the cable's tension is good for in every contact run "
            f"(run {run}, for one); write it in N."
        )
    return ""


def _known(seen: Sequence[Facts], what: Callable[[Facts], float]) -> list[tuple[str, float]]:
    """Runs that tell a number, and the number."""
    return [(f.run, what(f)) for f in seen if np.isfinite(what(f))]
