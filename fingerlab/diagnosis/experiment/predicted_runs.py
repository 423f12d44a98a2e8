"""The runs that the rig can do, and the motion that they would show as far as the fitted model can tell.

A free finger is taken as quasi-static: at each moment springs, gravity and cable are in balance. A pressing
one is taken to move as it was seen to move when it pressed. That is enough to know where a column of an
effect is large, and costs milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.acquisition.control.trajectories import WAVES, read_trajectory
from fingerlab.diagnosis.experiment.seen_limits import SeenLimits, seen_limits
from fingerlab.diagnosis.gram.sums import Reduced
from fingerlab.diagnosis.settings import (
    BALANCE_STEPS,
    BALANCED_RAD,
    BENCH_LOADS_NM,
    DURATION_S,
    LEAST_PROPOSED_CYCLES,
    LEAST_PROPOSED_SHARE,
    LEAST_PULL_N,
    MOST_CHANGES,
    MOST_PULL_N,
    SETTLING_S,
    WIDE_RATE_HZ,
)
from fingerlab.diagnosis.signals.filters import decimate
from fingerlab.diagnosis.signals.scales import SI, Scales, reduced_change, scaled_change, scaled_trajectory
from fingerlab.diagnosis.signals.segments import is_fragmented, segments_of
from fingerlab.physics import nominal
from fingerlab.physics.motion import Motion, added_body
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.file import UNCHANGED, Finger, Intervention, Rig
from fingerlab.sessions.model import CABLE_NAMES, Array, Run, Session


@dataclass(frozen=True)
class Proposal:
    """A run from the menu: what the rig would be told, and the motion that the model expects.

    ``motion`` lasts ``DURATION_S``, the run ``seconds``. ``before``: for a run with a known ``change`` of the
    machine, the same motion without it.
    """

    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    motion: Motion
    seconds: float = DURATION_S
    change: Intervention = UNCHANGED
    before: Motion | None = None

    def to_json(self, separates: list[str], expected: float, scales: Scales = SI) -> dict[str, Any]:
        """As in ``diagnose --json``, in SI, with the two answers that it separates and by how much."""
        change = scaled_change(self.change, scales).to_json()
        changed = {name: float(f"{value:.6g}") for name, value in change.items()}
        return {
            "trajectory": scaled_trajectory({**self.trajectory, "duration_s": self.seconds}, scales),
            "phase": self.phase,
            "cable": self.cable,
            **({"intervention": changed} if changed else {}),
            "separates": separates,
            "expected_separation": float(expected),
        }


def _wave(kind: str, frequency: float, amplitude: float, **more: float) -> dict[str, Any]:
    return {"kind": kind, "frequency_hz": frequency, "amplitude_deg": amplitude, **more}


FREE = (
    ("sine", 0.2, 1.0, 0.0), ("sine", 0.5, 0.3, 0.0), ("sine", 1.0, 0.25, 0.0), ("sine", 2.0, 0.9, 0.0),
    ("sine", 3.0, 0.5, 0.0), ("chirp", 0.3, 0.8, 0.0), ("steps", 0.4, 1.0, 0.0), ("ramp_hold", 0.2, 1.0, 0.0),
    ("multisine", 1.0, 1.0, 0.0), ("sine", 0.5, 0.5, -0.5), ("sine", 0.5, 0.5, 0.5),
)  # fmt: skip
"""Kind, frequency (Hz), share of the amplitude and shift of the offset (in amplitudes) of the free runs on
the menu. All stay within the angles that were recorded: what the rig did once it can do again."""
FREE_ROOM = {-1: (14.0, 22.0), 1: (9.0, 15.0)}
"""Amplitude and offset of free runs, degrees at the pulley, by cable, where none were recorded: those of the
rich protocol."""
PRESSED = (
    ("sine", 0.25, 1.0),
    ("sine", 1.0, 0.5),
    ("sine", 2.5, 0.8),
    ("steps", 0.5, 1.0),
    ("chirp", 0.3, 0.8),
)
"""The same for pressing runs; the amplitude is a share of the one that was recorded."""


BENCH = (("sine", 0.5, 30.0), ("sine", 2.0, 20.0), ("ramp_hold", 0.2, 60.0))
"""The motor alone: kind, frequency (Hz), amplitude (degrees at the pulley)."""


def menu(sessions: Sequence[Session], reduced: Reduced, values: Mapping[str, float]) -> Iterator[Proposal]:
    """Runs that the rig can do: free ones on each known routing, pressing ones, and the motor alone.

    Beside a finger's runs a bench needs no known load: one is only proposed where there is nothing else.
    ``values`` are the fitted unknowns by key.
    """
    rig = sessions[0].rig
    if reduced.on_bench:
        yield from bench_menu(rig, BENCH_LOADS_NM, seen_limits(sessions))
        return
    signs = sorted({g.cable_sign for g in reduced.groups if g.cable_sign})
    for sign in signs:
        amplitude, offset = _room(sessions, sign)
        for kind, frequency, share, shift in FREE:
            about = round(offset + amplitude * shift, 2)
            trajectory = _wave(kind, frequency, round(amplitude * share, 2), offset_deg=about)
            motion = finger_motion(rig, sign, trajectory, values)
            if motion is not None:
                yield Proposal("on_air", CABLE_NAMES[sign], trajectory, motion)
    press = seen_press(sessions)
    if press is not None and 1 in signs:
        yield from _pressing_menu(rig, press)
    yield from _changed_menu(sessions, reduced, values)
    # Last: taking the finger off its cable is worth it only where no run with it tells as much.
    yield from bench_menu(rig, BENCH_LOADS_NM[:1])


def _room(sessions: Sequence[Session], sign: int) -> tuple[float, float]:
    """Amplitude and offset, degrees at the pulley, of the widest free run on a cable."""
    seen = [
        (float(amplitude), float(run.trajectory.get("offset_deg", 0.0)))
        for session in sessions
        for run in session.runs
        if run.cable_sign == sign and run.phase == "on_air"
        and isinstance(amplitude := run.trajectory.get("amplitude_deg"), int | float)
    ]  # fmt: skip
    return max(seen, default=FREE_ROOM[sign])


def _pressing_menu(rig: Rig, press: Press) -> Iterator[Proposal]:
    for kind, frequency, share in PRESSED:
        trajectory = _wave(kind, frequency, round(share * press.commanded_deg, 2))
        motion = pressing_motion(rig, 1, trajectory, press)
        if motion is not None:
            yield Proposal("contact", "flexion", trajectory, motion)


def usual_changes(rig: Rig, pull: float) -> Iterator[Intervention]:
    """Known changes of a machine that are worth trying, each of a size that shows and does no harm.

    A mass as heavy as the distal link at its tip, half as much again on the motor as the cable takes, half of
    a joint's spring beside it, and a guide of the cable that is wider by a fifth; all assumed.

    Args:
        pull: usual tension of the cable, N.
    """
    finger, radius = rig.finger, rig.motor.pulley_radius
    if finger is None or radius is None:
        return
    yield Intervention(added_mass=finger.distal_mass, added_mass_at=2.0 * finger.distal_half_length)
    yield Intervention(load_torque=0.5 * radius * pull)
    yield Intervention(mcp_stiffness=0.5 * finger.mcp_stiffness)
    yield Intervention(pip_stiffness=0.5 * finger.pip_stiffness)
    yield Intervention(mcp_arm=1.2)
    yield Intervention(pip_arm=1.2)


def _changed_menu(
    sessions: Sequence[Session], reduced: Reduced, values: Mapping[str, float]
) -> Iterator[Proposal]:
    """The widest free motion on each cable that was recorded on the machine as it is, with a known change.

    A tip that presses sticks, and is set down anew where the machine is changed: of such a pair no difference
    could be believed.
    """
    rig, scales = sessions[0].rig, reduced.layout.scales
    widest: dict[int, Run] = {}
    changes: set[Intervention] = set()
    for run in (run for session in sessions for run in session.runs if run.cable_sign):
        change = reduced_change(run) or UNCHANGED
        changes |= {change} - {UNCHANGED}
        amplitude = run.trajectory.get("amplitude_deg")
        if change != UNCHANGED or run.phase == "contact" or not isinstance(amplitude, int | float):
            continue
        if run.trajectory.get("kind") not in WAVES:  # of another program: nobody here could drive it again
            continue
        known = widest.setdefault(run.cable_sign, run)
        if amplitude > float(known.trajectory["amplitude_deg"]):
            widest[run.cable_sign] = run
    number = min(len(changes) + 1, MOST_CHANGES)
    for sign, run in widest.items():
        own = {k: v for k, v in run.trajectory.items() if k not in ("duration_s", "sha256", "file")}
        before = finger_motion(rig, sign, own, values)
        if before is None:
            continue
        plain = replace(before, intervention=UNCHANGED, change=(0, number))
        for usual in usual_changes(rig, float(np.mean(before.tension))):
            made = _rounded(usual, scales)
            after = finger_motion(rig, sign, own, values, made)
            if after is not None:
                after = replace(after, change=(number, number))
                cable = CABLE_NAMES[sign]
                yield Proposal("on_air", cable, own, after, change=made, before=plain)


def _rounded(change: Intervention, scales: Scales) -> Intervention:
    """The change with numbers that a person would choose, two digits in SI."""
    rounded = {name: float(f"{value:.2g}") for name, value in scaled_change(change, scales).to_json().items()}
    return scaled_change(Intervention(**rounded), scales, -1)


def bench_menu(rig: Rig, loads: Sequence[float], seen: SeenLimits | None = None) -> Iterator[Proposal]:
    """Runs of the motor alone against known ``loads``, N m; within what was ``seen``, if that is told."""
    for load in loads:
        for kind, frequency, usual in BENCH:
            amplitude, middle = seen.within(usual) if seen is not None else (usual, None)
            for tried in [(frequency, amplitude)] if seen is None else _gentler(frequency, amplitude):
                about = tried[1] + 5.0 if middle is None else middle
                reach = math.floor(100.0 * tried[1]) / 100.0  # no further than it was
                trajectory = _wave(kind, tried[0], reach, offset_deg=round(about, 2))
                motion = bench_motion(rig, trajectory, load)
                if seen is not None and not seen.allows(motion, load):
                    continue
                loaded = {**trajectory, "load_torque": load} if load else trajectory
                yield Proposal("motor_bench", "none", loaded, motion)
                break


def _gentler(frequency: float, amplitude: float) -> Iterator[tuple[float, float]]:
    """A motion as it is on the menu, then slower and slower (Hz), then smaller and smaller (degrees).

    Slower first: a travel shows more than a quick little motion, and takes less torque.
    """
    yield frequency, amplitude
    least = LEAST_PROPOSED_CYCLES / DURATION_S
    slower = [round(frequency * s, 3) for s in _SHARES if frequency * s >= least]
    yield from ((one, amplitude) for one in slower)
    for share in (s for s in _SHARES if s >= LEAST_PROPOSED_SHARE):
        yield from ((one, round(amplitude * share, 2)) for one in (frequency, *slower))


_SHARES = tuple(float(f"{2.0 ** (-k / 2):.2g}") for k in range(1, 13))
"""Half octaves downwards, to two digits."""


def commanded(trajectory: Mapping[str, object]) -> tuple[Array, Array]:
    """Time (s) and motor angle (rad) of a trajectory after its ramp, shapes (n,)."""
    time = np.arange(0.0, DURATION_S, 1.0 / WIDE_RATE_HZ)
    position = read_trajectory({**trajectory, "duration_s": DURATION_S}).command(time)
    settled = time >= SETTLING_S
    return time[settled], position[settled]


def bench_motion(rig: Rig, trajectory: Mapping[str, object], load: float) -> Motion:
    """Motor alone against a constant load (N m)."""
    time, position = commanded(trajectory)
    velocity, acceleration = _derivatives(position)
    inertia = rig.motor.inertia or 0.0
    return Motion(
        phase="motor_bench", cable_sign=0, sample_rate_hz=WIDE_RATE_HZ, time=time, position=position,
        velocity=velocity, acceleration=acceleration, torque=inertia * acceleration + load, motor=rig.motor,
        load=np.full_like(time, load),
    )  # fmt: skip


def finger_motion(
    rig: Rig,
    cable_sign: int,
    trajectory: Mapping[str, object],
    values: Mapping[str, float],
    change: Intervention = UNCHANGED,
) -> Motion | None:
    """Free finger on a cable; None: the cable would hang loose, or pull too hard, or nothing balances it.

    ``values`` are the fitted unknowns by key. With a known ``change`` it hangs at rest in another posture,
    about which the motor's zero is set anew.
    """
    finger, radius = rig.finger, rig.motor.pulley_radius
    if finger is None or radius is None:
        return None
    time, position = commanded(trajectory)
    routing = CABLE_NAMES[cable_sign]
    a, b = values[f"arm_mcp@{routing}"], values[f"arm_pip@{routing}"]
    wound = radius * position - values.get(f"offset@{routing}", 0.0)
    if change != UNCHANGED:
        usual, moved = _rest(finger, UNCHANGED), _rest(finger, change)
        wound = wound - cable_sign * (a * usual[0] + b * usual[1])
        a, b = change.mcp_arm * a, change.pip_arm * b
        wound = wound + cable_sign * (a * moved[0] + b * moved[1])
    balance = _balance(finger, cable_sign, a, b, wound, change)
    if balance is None:
        return None
    mcp, pip, pull = balance
    if np.min(pull) < LEAST_PULL_N or np.max(pull) > MOST_PULL_N:
        return None
    return _motion(rig, cable_sign, time, position, pull, (mcp, pip), None, change)


@dataclass(frozen=True)
class Press:
    """How a finger was seen to press in a contact run: means, and changes with the motor's angle.

    Attributes:
        commanded_deg: amplitude that the motor was told, degrees at the pulley.
        follows: share of it by which the motor moved: against a load cell its loop gives way.
        mean: motor (rad), cable tension (N), force (N), MCP and PIP (rad); (5,).
        slopes: change of the last four for each rad of the motor, (4,).
    """

    commanded_deg: float
    follows: float
    mean: Array
    slopes: Array


def seen_press(sessions: Sequence[Session]) -> Press | None:
    """How the finger pressed in the first contact run that moved; None where there is none."""
    for session in sessions:
        for run in session.runs:
            amplitude = run.trajectory.get("amplitude_deg")
            if run.phase != "contact" or not isinstance(amplitude, int | float) or amplitude <= 0:
                continue
            if is_fragmented(run):
                continue
            press = _press(next(iter(segments_of(run, session.rig))), float(amplitude))
            if press is not None:
                return press
    return None


def _press(motion: Motion, commanded_deg: float) -> Press | None:
    joints, force, inertia = motion.joints, motion.force, motion.motor.inertia or 0.0
    if joints is None or force is None:
        return None
    pull = motion.tension - inertia * motion.inertial_pull
    # A pressing finger hardly moves: at the wide bandwidth the motion would be half noise.
    seen = decimate(np.stack((motion.position, pull, force, joints.mcp, joints.pip))[:, motion.lead :])
    mean = seen.mean(axis=1)
    around = seen - mean[:, None]
    square = float(around[0] @ around[0])
    if square <= 0:
        return None
    reach = float(np.sqrt(2.0 * square / around.shape[1]))  # of the sine that moves as much
    return Press(commanded_deg, reach / np.radians(commanded_deg), mean, around[1:] @ around[0] / square)


def pressing_motion(
    rig: Rig, cable_sign: int, trajectory: Mapping[str, object], press: Press
) -> Motion | None:
    """Finger that presses about where it was seen to; None: its cable would hang loose.

    The trajectory needs no offset: the operator's approach finds it.
    """
    time, about = commanded({**trajectory, "offset_deg": 0.0})
    about = press.follows * about
    pull, force, mcp, pip = press.mean[1:, None] + press.slopes[:, None] * about
    if np.min(pull) < LEAST_PULL_N:
        return None
    return _motion(rig, cable_sign, time, press.mean[0] + about, pull, (mcp, pip), np.maximum(force, 0.0))


def _motion(
    rig: Rig,
    cable_sign: int,
    time: Array,
    position: Array,
    pull: Array,
    angles: tuple[Array, Array],
    force: Array | None,
    change: Intervention = UNCHANGED,
) -> Motion:
    velocity, acceleration = _derivatives(position)
    torque = (rig.motor.pulley_radius or 1.0) * pull + (rig.motor.inertia or 0.0) * acceleration
    torque = torque + change.load_torque
    return Motion(
        phase="on_air" if force is None else "contact", cable_sign=cable_sign, sample_rate_hz=WIDE_RATE_HZ,
        time=time, position=position, velocity=velocity, acceleration=acceleration, torque=torque,
        motor=rig.motor, finger=rig.finger, joints=JointMotion(*angles, *_pairwise(*angles)), force=force,
        intervention=None if change == UNCHANGED else change,
    )  # fmt: skip


def _derivatives(values: Array) -> tuple[Array, Array]:
    first = np.gradient(values, 1.0 / WIDE_RATE_HZ)
    return first, np.gradient(first, 1.0 / WIDE_RATE_HZ)


def _pairwise(mcp: Array, pip: Array) -> tuple[Array, Array, Array, Array]:
    (v1, a1), (v2, a2) = _derivatives(mcp), _derivatives(pip)
    return v1, v2, a1, a2


def _rest(finger: Finger, change: Intervention) -> tuple[float, float]:
    """Angles (rad) of MCP and PIP at which the finger hangs without a cable."""
    mcp, pip, zero = np.zeros(1), np.zeros(1), np.zeros(1)
    for _ in range(BALANCE_STEPS):
        g1, g2 = _weights(finger, change, JointMotion(mcp, pip, zero, zero, zero, zero))
        mcp = -g1 / (finger.mcp_stiffness + change.mcp_stiffness)
        pip = -g2 / (finger.pip_stiffness + change.pip_stiffness)
    return float(mcp[0]), float(pip[0])


def _weights(finger: Finger, change: Intervention, still: JointMotion) -> tuple[Array, Array]:
    """Gravity's torques about MCP and PIP, N m, with what a change has added."""
    bodies = (finger, added_body(finger, change)) if change.added_mass else (finger,)
    return (
        np.asarray(sum(nominal.mcp_torque(body, still).gravity for body in bodies)),
        np.asarray(sum(nominal.pip_torque(body, still).gravity for body in bodies)),
    )


def _balance(
    finger: Finger, sign: int, a: float, b: float, wound: Array, change: Intervention = UNCHANGED
) -> tuple[Array, Array, Array] | None:
    """Angles (rad) and tension (N) where springs and gravity balance the cable, by fixed-point iteration.

    None: springs too weak for the links' weight, among which the iteration finds no balance.
    With gravity held all is linear: s (a t1 + b t2) = wound, K1 t1 = s a T - g1, K2 t2 = s b T - g2.
    """
    k1, k2 = finger.mcp_stiffness + change.mcp_stiffness, finger.pip_stiffness + change.pip_stiffness
    mcp, pip = np.zeros_like(wound), np.zeros_like(wound)
    pull = np.zeros_like(wound)
    zero = np.zeros_like(wound)
    for _ in range(BALANCE_STEPS):
        still = JointMotion(mcp, pip, zero, zero, zero, zero)
        g1, g2 = _weights(finger, change, still)
        pull = (wound + sign * (a * g1 / k1 + b * g2 / k2)) / (a * a / k1 + b * b / k2)
        before = mcp
        mcp, pip = (sign * a * pull - g1) / k1, (sign * b * pull - g2) / k2
        if np.max(np.abs(mcp - before)) < BALANCED_RAD:
            return mcp, pip, pull
    return None
