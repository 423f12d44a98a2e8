"""A protocol of runs as a plain list of steps; ``driver.py`` takes them one by one on any bench."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Protocol

import numpy as np

from fingerlab.acquisition.control.machine import SetUp, Start
from fingerlab.acquisition.control.motion import STOP_S
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.core.errors import UserError
from fingerlab.core.text import amount
from fingerlab.rig.file import INTERVENTION, read_intervention
from fingerlab.sessions.model import Run

REST_S = 2.0
"""Rest between runs (assumed): the spring finger has come to rest."""

SETTLE_S = 1.5
"""After a change of cable, before the sensors are set (assumed)."""

APPROACH_SPEED = math.radians(12.0)
APPROACH_LIMIT = math.radians(150.0)
"""rad/s, rad: the approach to the load cell, as an operator winds (assumed; as in a simulated session)."""

LIFT_DEG = 3.0
LIFT_RAMP_S = 0.5
LIFT_S = 1.0
"""How far and how softly a known load is lifted off its support before a run, and when the run begins:
from its first sample on it is to carry the whole load (assumed; the slack of its thread is to be less)."""

CABLE_WORDS = {
    "extension": "Fix the extension cable to the pulley, and take the flexion cable off.",
    "flexion": "Fix the flexion cable to the pulley, and take the extension cable off.",
    "none": "Take both cables off the pulley.",
}
PHASE_WORDS = {
    "on_air": "Move the load cell out of the finger's way.",
    "contact": "Put the load cell under the fingertip, without touching it.",
    "motor_bench": "Leave the motor alone, with nothing on it.",
    "free": "Let the finger hang free.",
}


class PlannedRun(Protocol):
    """What a protocol says of a run; :class:`fingerlab.twin.protocols.RunPlan` is one."""

    @property
    def phase(self) -> str: ...

    @property
    def cable(self) -> str: ...

    @property
    def trajectory(self) -> Mapping[str, Any]: ...

    @property
    def load_torque(self) -> float: ...

    @property
    def attributes(self) -> Mapping[str, Any]: ...


@dataclass(frozen=True)
class Change:
    """Change the bench: the amplifier goes off, the operator is asked, the sensors are set anew."""

    set_up: SetUp
    prompt: str


@dataclass(frozen=True)
class Find:
    """Find where the fingertip presses the load cell with ``force`` (N); contact runs go about there."""

    force: float


@dataclass(frozen=True)
class Lift:
    """Lift the known load off its support and hold it at ``degrees``: a run carries it from there."""

    degrees: float


@dataclass(frozen=True)
class Record:
    """Record a run; ``number`` of ``count``.

    ``later`` gives its trajectory and further attributes when it begins, where runs before decide; the
    ``trajectory`` here then says how long it is.
    """

    number: int
    count: int
    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    load_torque: float = 0.0
    attributes: Mapping[str, Any] = field(default_factory=dict)
    later: Callable[[], tuple[Mapping[str, Any], Mapping[str, Any]]] | None = None


@dataclass(frozen=True)
class Rest:
    """Let the bench rest, s."""

    seconds: float


@dataclass(frozen=True)
class WorkOut:
    """With the amplifier off, work out of the run before what the coming ones are to do; then enable again.

    Attributes:
        words: what is worked out. work: is given that run; what it raises ends the recording.
        ask: then gives the sentence that the operator answers before it goes on; None: nobody is asked.
    """

    words: str
    work: Callable[[Run], None]
    ask: Callable[[], str] | None = None


Step = Change | Find | Lift | Record | Rest | WorkOut


def plan_steps(runs: Sequence[PlannedRun], contact_force: float, rest_s: float = REST_S) -> tuple[Step, ...]:
    """The steps of a protocol.

    Args:
        contact_force: N, mean force of contact runs that name no offset.

    Raises:
        UserError: a run would set the known load down on its support.
    """
    return tuple(_steps(runs, contact_force, rest_s))


def steps_from(steps: Sequence[Step], first: int) -> tuple[Step, ...]:
    """The steps from run ``first`` on, with what puts the bench there: its set-up, and where the contact is.

    Raises:
        UserError: there is no such run.
    """
    if first == 1:
        return tuple(steps)
    numbers = [step.number for step in steps if isinstance(step, Record)]
    if first not in numbers:
        raise UserError(f"There is no run {first}; the protocol has the runs 1 to {max(numbers, default=0)}.")
    before: list[Step] = []
    for place, step in enumerate(steps):
        if isinstance(step, Change):
            before = [step]
        elif isinstance(step, Find):
            before = [*before, step]
        elif isinstance(step, Record) and step.number == first:
            lift = [one for one in steps[max(place - 1, 0) : place] if isinstance(one, Lift)]
            return (*before, *lift, *steps[place:])
    raise AssertionError(first)


def plan_seconds(steps: Sequence[Step]) -> float:
    """How long the steps take without the operator and without finding the contact, s."""
    seconds = 0.0
    for step in steps:
        if isinstance(step, Record):
            seconds += read_trajectory({**step.trajectory}).duration + STOP_S
        elif isinstance(step, Rest):
            seconds += step.seconds
        elif isinstance(step, Lift):
            seconds += LIFT_S
        elif isinstance(step, Change):
            seconds += SETTLE_S
    return seconds


def _steps(runs: Sequence[PlannedRun], contact_force: float, rest_s: float) -> Iterator[Step]:
    before: SetUp | None = None
    for number, run in enumerate(runs, start=1):
        now = SetUp(run.phase, run.cable, run.load_torque, str(run.attributes.get(INTERVENTION, "")))
        if now != before:
            yield Change(now, prompt_of(now))
        elif number > 1:
            yield Rest(rest_s)
        if run.phase == "contact" and goes_about_contact(run.trajectory) and now != before:
            yield Find(contact_force)
        before = now
        if run.load_torque and run.trajectory.get("kind") != "torque":
            yield Lift(_lift(run.trajectory, run.load_torque))
        yield Record(number, len(runs), run.phase, run.cable, run.trajectory, run.load_torque, run.attributes)


def countdown(seconds: float) -> str:
    """Minutes and seconds that are left, as ``1:38``."""
    whole = math.ceil(seconds)
    return f"{whole // 60}:{whole % 60:02d}"


def lifting(step: Lift) -> Start:
    """The command that lifts the known load; after ``LIFT_S`` a run can begin."""
    hold = {"kind": "blocked", "offset_deg": step.degrees, "ramp_s": LIFT_RAMP_S}
    return Start(hold, endless=True)


def goes_about_contact(trajectory: Mapping[str, Any]) -> bool:
    """Whether a contact run's middle is where the fingertip presses: it names none, and is no torque."""
    return "offset_deg" not in trajectory and trajectory.get("kind") != "torque"


def _lift(trajectory: Mapping[str, Any], load_torque: float) -> float:
    """Degrees to which the load is lifted, to the side where it hangs; the run has to stay beyond them.

    Raises:
        UserError: it does not.
    """
    side = math.copysign(1.0, load_torque)
    moved = read_trajectory(trajectory)
    time = np.arange(0.0, min(moved.duration, 600.0), 2e-3)
    lowest = math.degrees(float((side * (moved.offset + moved.amplitude * moved.wave(time))).min()))
    if lowest < LIFT_DEG:
        raise UserError(
            f"The run comes to {side * lowest:.3g}°, where the known load rests on its support; choose an "
            f"offset that keeps it beyond {side * LIFT_DEG:g}°."
        )
    return side * LIFT_DEG


def prompt_of(set_up: SetUp) -> str:
    """What the operator does to the bench for a set-up."""
    if set_up.intervention:
        change = read_intervention(set_up.intervention, "The run's 'intervention'").words()
        usual = prompt_of(replace(set_up, intervention=""))
        return f"{usual} For this run change the machine: it is taken {change}."
    if not set_up.load_torque:
        return f"{CABLE_WORDS[set_up.cable]} {PHASE_WORDS[set_up.phase]}"
    turns = "forwards" if set_up.load_torque > 0 else "backwards"
    load = amount(abs(set_up.load_torque), "N m", 4)
    return (
        f"{CABLE_WORDS[set_up.cable]} Hang the known load of {load} on the pulley: now it rests on its "
        f"support, the thread slack by less than {LIFT_DEG:g}°, and it is lifted where the motor turns "
        f"{turns}."
    )


@dataclass(frozen=True)
class OwnRun:
    """One run of it; see :class:`fingerlab.acquisition.protocols.steps.PlannedRun`."""

    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    load_torque: float = 0.0
    attributes: Mapping[str, Any] = field(default_factory=dict)


def in_contact(run: PlannedRun, amplitude_deg: float) -> OwnRun:
    """The same motion in contact: with the flexion cable, about where the load cell is pressed."""
    press = {name: value for name, value in run.trajectory.items() if name != "offset_deg"}
    return OwnRun("contact", "flexion", {**press, "amplitude_deg": amplitude_deg}, 0.0, run.attributes)


def own_runs(
    motion: Mapping[str, Any], count: int, on_air: bool, contact_amplitude_deg: float | None
) -> list[OwnRun]:
    """``count`` runs of a motion on air, or in contact, or both.

    Args:
        contact_amplitude_deg: of the runs in contact; None for none.
    """
    air = OwnRun("on_air", "extension", motion)
    runs = [air] * count if on_air else []
    return (
        runs if contact_amplitude_deg is None else [*runs, *[in_contact(air, contact_amplitude_deg)] * count]
    )


def scan_runs(motion: Mapping[str, Any], scans: Mapping[str, Sequence[float]]) -> list[OwnRun]:
    """Runs of a motion on air over a grid: every value of each number with every one of the others.

    Raises:
        UserError: one of them is no motion.
    """
    motions = [{**motion, **dict(zip(scans, values, strict=True))} for values in product(*scans.values())]
    for one in motions:
        read_trajectory(one)
    return [OwnRun("on_air", "extension", one) for one in motions]
