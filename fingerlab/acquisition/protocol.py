"""A protocol of runs: first a plain list of steps, then a driver that takes them one by one on any bench."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from fingerlab.acquisition.bench import Bench
from fingerlab.acquisition.board import Slot
from fingerlab.acquisition.commands import (
    Approach,
    Command,
    Disable,
    Enable,
    Finish,
    Initialise,
    SetUp,
    Start,
    Tare,
)
from fingerlab.acquisition.machine import Mode
from fingerlab.acquisition.recording import RunInfo
from fingerlab.acquisition.reference import STOP_S
from fingerlab.acquisition.trajectories import read_trajectory
from fingerlab.errors import UserError

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


class RunPlan(Protocol):
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
    """Record a run; ``number`` of ``count``."""

    number: int
    count: int
    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    load_torque: float = 0.0
    attributes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Rest:
    """Let the bench rest, s."""

    seconds: float


Step = Change | Find | Lift | Record | Rest


def plan_steps(runs: Sequence[RunPlan], contact_force: float, rest_s: float = REST_S) -> tuple[Step, ...]:
    """The steps of a protocol.

    Args:
        contact_force: N, mean force of contact runs that name no offset.

    Raises:
        UserError: a run would set the known load down on its support.
    """
    return tuple(_steps(runs, contact_force, rest_s))


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


def _steps(runs: Sequence[RunPlan], contact_force: float, rest_s: float) -> Iterator[Step]:
    before: SetUp | None = None
    for number, run in enumerate(runs, start=1):
        now = SetUp(run.phase, run.cable, run.load_torque)
        if now != before:
            yield Change(now, prompt_of(now))
        elif number > 1:
            yield Rest(rest_s)
        if run.phase == "contact" and _goes_about_contact(run.trajectory) and now != before:
            yield Find(contact_force)
        before = now
        if run.load_torque and run.trajectory.get("kind") != "torque":
            yield Lift(_lift(run.trajectory, run.load_torque))
        yield Record(number, len(runs), run.phase, run.cable, run.trajectory, run.load_torque, run.attributes)


def lifting(step: Lift) -> Start:
    """The command that lifts the known load; after ``LIFT_S`` a run can begin."""
    hold = {"kind": "blocked", "offset_deg": step.degrees, "ramp_s": LIFT_RAMP_S}
    return Start(hold, endless=True)


def _goes_about_contact(trajectory: Mapping[str, Any]) -> bool:
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
    if not set_up.load_torque:
        return f"{CABLE_WORDS[set_up.cable]} {PHASE_WORDS[set_up.phase]}"
    turns = "forwards" if set_up.load_torque > 0 else "backwards"
    return (
        f"{CABLE_WORDS[set_up.cable]} Hang the known load of {1e3 * abs(set_up.load_torque):.4g} mN m on the "
        f"pulley: now it rests on its support, the thread slack by less than {LIFT_DEG:g}°, and it "
        f"is lifted where the motor turns {turns}."
    )


class ProtocolDriver:
    """Takes the steps on a bench whose recorder has a session open.

    Args:
        ask_operator: shown a sentence, returns when the operator has done it.
        report: called with the share done (0 to 1) and what is being done.
        initial: to which values the sensors are set after each change of the bench.
        between: called again and again while the driver waits, in its own thread: for what else is to be
            asked of the bench meanwhile.

    Attributes:
        samples: recorded so far. step_left_s: of the run or rest that goes on, s.
        left_s: of the whole protocol as planned, s, without the operator and without finding the contact.
    """

    def __init__(
        self,
        bench: Bench,
        ask_operator: Callable[[str], None],
        report: Callable[[float, str], None] | None = None,
        initial: Initialise | None = None,
        between: Callable[[], None] | None = None,
    ) -> None:
        self._bench, self._ask_operator = bench, ask_operator
        self._report = report or (lambda share, what: None)
        self._initial = initial or Initialise()
        self._between = between or (lambda: None)
        self._offset_deg: float | None = None
        self._share = self._later_s = 0.0
        self.samples = 0
        self.left_s = self.step_left_s = 0.0

    def report_to(self, report: Callable[[float, str], None]) -> None:
        """Report to another function from now on."""
        self._report = report

    def take(self, steps: Sequence[Step]) -> None:
        """Take all steps, then switch the amplifier off.

        Raises:
            UserError: the bench refused or stopped, or the recorder failed; the motor has no current then.
        """
        try:
            for number, step in enumerate(steps):
                self._later_s = plan_seconds(steps[number + 1 :])
                self._take(step)
            self._off()
        except BaseException:
            self._bench.stop()
            raise

    def _take(self, step: Step) -> None:
        if isinstance(step, Change):
            self._change(step)
        elif isinstance(step, Find):
            self._find(step)
        elif isinstance(step, Lift):
            self._lift(step)
        elif isinstance(step, Record):
            self._record(step)
        else:
            self._wait(step.seconds, "rest")

    def _until(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        def looked() -> bool:
            self._between()
            return condition()

        self._bench.wait_until(looked, seconds, what)

    def _wait(self, seconds: float, words: str) -> None:
        start, rate = self._bench.board[Slot.INDEX], self._bench.rate_hz

        def over() -> bool:
            left = seconds - (self._bench.board[Slot.INDEX] - start) / rate
            self._tell(self._share, words, left)
            return left <= 0.0

        self._until(over, math.inf, "")

    def _tell(self, share: float, words: str, step_left_s: float, after_s: float = 0.0) -> None:
        self._share, self.step_left_s = share, max(step_left_s, 0.0)
        self.left_s = self.step_left_s + after_s + self._later_s
        self._report(share, words)

    def _off(self) -> None:
        if self._bench.status().enabled:
            self._bench.ask(Disable())

    def _change(self, step: Change) -> None:
        bench = self._bench
        self._off()
        self._ask_operator(step.prompt)
        self._offset_deg = None
        commands: list[Command] = [self._initial]
        if step.set_up.phase == "contact":
            commands.append(Tare())
        bench.ask(step.set_up)
        self._wait(SETTLE_S, "settling")
        for command in [*commands, Enable()]:
            bench.ask(command)

    def _find(self, step: Find) -> None:
        bench = self._bench
        bench.ask(Approach(step.force, APPROACH_SPEED, APPROACH_LIMIT))
        seconds = APPROACH_LIMIT / APPROACH_SPEED + 5.0
        self._tell(self._share, "finding the load cell", 0.0)
        self._until(lambda: bench.approached() is not None, seconds, "Finding the load cell")
        reached = bench.approached()
        if reached is None or math.isnan(reached):
            raise UserError(
                f"The fingertip does not press the load cell with {step.force:g} N before "
                f"{math.degrees(APPROACH_LIMIT):g}° at the pulley; move the load cell nearer."
            )
        self._offset_deg = round(math.degrees(reached), 2)
        bench.ask(Finish())
        self._wait_for_rest()

    def _lift(self, step: Lift) -> None:
        self._bench.ask(lifting(step))
        self._wait(LIFT_S, "lifting the load")

    def _record(self, step: Record) -> None:
        bench = self._bench
        settings = dict(step.trajectory)
        if self._offset_deg is not None and _goes_about_contact(settings):
            settings["offset_deg"] = self._offset_deg
        trajectory = read_trajectory(settings)
        count = round(trajectory.duration * bench.rate_hz)
        bench.ask(Start(settings))
        start = bench.status().run_start
        done = bench.board[Slot.RECORDED_RUNS]
        bench.recorder.begin(
            RunInfo(
                step.phase,
                step.cable,
                bench.rate_hz,
                trajectory.settings,
                start,
                start + count,
                step.load_torque,
                step.attributes,
            )
        )
        words = f"run {step.number} of {step.count}"

        def recorded() -> bool:
            share = min(max(bench.board[Slot.INDEX] - start, 0) / count, 1.0)
            left = (1.0 - share) * trajectory.duration
            self._tell((step.number - 1 + share) / step.count, words, left, STOP_S)
            return bench.board[Slot.RECORDED_RUNS] > done

        self._until(recorded, trajectory.duration + 30.0, f"Recording {words}")
        self.samples += count
        self._wait_for_rest()

    def _wait_for_rest(self) -> None:
        bench = self._bench
        self._until(lambda: bench.status().mode is Mode.ENABLED, STOP_S + 5.0, "Coming to rest")
