"""Takes the steps of a protocol one by one, on any bench."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.bench.steering import LoopSettings, Refused, prepare
from fingerlab.acquisition.control.machine import (
    Approach,
    Command,
    Disable,
    Enable,
    Finish,
    Initialise,
    Mode,
    SetUp,
    Start,
    Tare,
)
from fingerlab.acquisition.control.motion import STOP_S
from fingerlab.acquisition.control.plausibility import lacking, sensors_of
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.acquisition.protocols.finding import FINDING, find_contact
from fingerlab.acquisition.protocols.steps import (
    APPROACH_LIMIT,
    APPROACH_SPEED,
    LIFT_S,
    SETTLE_S,
    Change,
    Find,
    Lift,
    Record,
    Step,
    WorkOut,
    goes_about_contact,
    lifting,
    plan_seconds,
)
from fingerlab.acquisition.recording import Level, Lookout, RunInfo, channels_of
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Number, Slot
from fingerlab.core.errors import UserError
from fingerlab.rig.file import INTERVENTION
from fingerlab.sessions.model import Run
from fingerlab.sessions.recording_files import FEED_FORWARD

MOST_LOST = 0.02
"""Share of a run's samples that may be missing when the next one is learned from it (assumed: gaps of some
milliseconds are bridged as in a diagnosis, longer ones end it there)."""

LONGEST_BEFORE_S = 25.0
"""Pre-trigger: well within the shortest ring."""


def gains_of(bench: Bench) -> dict[str, float]:
    """Gains of the position loop as they are now, A/rad, A/(rad s), A s/rad."""
    board = bench.board
    gains = (Number.PROPORTIONAL, Number.INTEGRAL, Number.DERIVATIVE)
    return {number.name.lower(): board.number(number) for number in gains}


def run_to_record(
    bench: Bench,
    set_up: SetUp,
    trajectory: Mapping[str, Any],
    before_s: float = 0.0,
    at: int | None = None,
    stop: int | None = None,
    attributes: Mapping[str, Any] | None = None,
) -> RunInfo:
    """A run that begins ``before_s`` seconds before sample ``at``, the next one where it is None.

    It reaches back to where the sensors' references and the set-up of now began to hold, and with a known
    load to where the load was carried. Its attributes tell of the seconds before (``pre_trigger_s``) and,
    where its time is not the trajectory's own, when that began in it (``trajectory_start_s``), and of the
    position loop's ``gains`` at its beginning.

    Args:
        stop: index after its last sample; None until it is ended. attributes: further ones.
    """
    status = bench.status()
    at = status.index + 1 if at is None else at
    start = max(at - round(before_s * bench.rate_hz), min(bench.board[Slot.SET_AT], at), 0)
    if set_up.load_torque:
        start = max(start, status.run_start)
    further: dict[str, Any] = {"gains": gains_of(bench)}
    if bench.board[Slot.HOLD] > 1:
        further |= {"cycles_per_command": bench.board[Slot.HOLD], FEED_FORWARD: 0.0}
    if at > start:
        further["pre_trigger_s"] = (at - start) / bench.rate_hz
    if status.run_active and status.run_start != start:
        further["trajectory_start_s"] = (status.run_start - start) / bench.rate_hz
    return RunInfo(
        set_up.phase,
        set_up.cable,
        bench.rate_hz,
        trajectory,
        start,
        stop,
        set_up.load_torque,
        {**(attributes or {}), **further},
    )


@dataclass(frozen=True)
class Beginning:
    """Where each run begins: ``before_s`` seconds before its motion, or before the trigger in its motion."""

    before_s: float = 0.0
    trigger: Level | None = None


def refuse_impossible(steps: Sequence[Step], settings: LoopSettings) -> None:
    """Look through a whole protocol before its first run: the loop itself looks at a run when that begins.

    Where the contact is found on the way, a run is looked at about the middle of the motor's range.

    Raises:
        UserError: the bench lacks a sensor, a run has no end of its own, a run or a contact force is beyond
            its limits, or torques are to be found for one that nobody has checked.
    """
    limits = settings.limits
    for set_up in (step.set_up for step in steps if isinstance(step, Change)):
        sentence = lacking(sensors_of(set_up), settings.units)
        if sentence:
            raise UserError(sentence)
    if settings.current_share < 1.0 and any(isinstance(step, WorkOut) for step in steps):
        raise UserError(
            "The torques of a force trial are those of the rig's whole current, of which a bench that was "
            f"not checked gets {settings.current_share:.0%}; confirm it with check-rig first."
        )
    middle = math.degrees(0.5 * (limits.position_low + limits.position_high))
    seen: list[tuple[Mapping[str, Any], str]] = []
    for step in steps:
        command: Command
        if isinstance(step, Find):
            command, where = Approach(step.force, APPROACH_SPEED, APPROACH_LIMIT), ""
        elif isinstance(step, Record) and step.later is None and (step.trajectory, step.cable) not in seen:
            if step.trajectory.get("until_stopped"):
                raise UserError(
                    f"Run {step.number} would go on until it is stopped, for which nobody waits here; give "
                    "its trajectory a 'duration_s' in place of 'until_stopped'."
                )
            seen.append((step.trajectory, step.cable))
            about = step.phase == "contact" and goes_about_contact(step.trajectory)
            command = Start({**step.trajectory, **({"offset_deg": middle} if about else {})})
            where = f"Run {step.number} of {step.count}: "
        else:
            continue
        prepared = prepare(command, settings, isinstance(step, Find) or step.cable != "none")
        if isinstance(prepared, Refused):
            raise UserError(where + prepared.sentence)


class ProtocolDriver:
    """Takes the steps on a bench whose recorder has a session open.

    Args:
        ask_operator: shown a sentence, returns when the operator has done it.
        report: called with the share done (0 to 1) and what is being done.
        initial: to which values the sensors are set after each change of the bench.
        between: called again and again while the driver waits, in its own thread: for what else is to be
            asked of the bench meanwhile.
        beginning: of each run.

    Attributes:
        samples: recorded so far. number, run: of the run that is being recorded or was last; 0, None before.
        completed: number of the last run that was recorded whole.
        set_up: what is on the bench. share: of all runs. doing: what is under way.
        step_left_s: of the run or rest that goes on, s.
        left_s: of the whole protocol as planned, s, without the operator and without finding the contact.
    """

    def __init__(
        self,
        bench: Bench,
        ask_operator: Callable[[str], None],
        report: Callable[[float, str], None] | None = None,
        initial: Initialise | None = None,
        between: Callable[[], None] | None = None,
        beginning: Beginning | None = None,
    ) -> None:
        self.bench, self._ask_operator = bench, ask_operator
        self._report = report or (lambda share, what: None)
        self._initial = initial or Initialise()
        self._between = between or (lambda: None)
        self._beginning = beginning or Beginning()
        self._ending = False
        self.number = self.completed = 0
        self.run: RunInfo | None = None
        self.set_up = SetUp()
        self._offset_deg: float | None = None
        self._later_s = 0.0
        self.share, self.doing = 0.0, ""
        self.samples = 0
        self.left_s = self.step_left_s = 0.0

    @property
    def recording(self) -> bool:
        """Whether a run is being written (or pauses)."""
        return self.bench.board[Slot.RECORDING] > 0

    @property
    def newest(self) -> int:
        """Index of the newest sample."""
        return self.bench.board[Slot.INDEX]

    def report_to(self, report: Callable[[float, str], None]) -> None:
        """Report to another function from now on."""
        self._report = report

    def end(self) -> None:
        """End in order: no further step, the run with its newest sample, the motor softly at rest.

        To be called in ``between``, or while the operator is asked.
        """
        self._ending = True
        status = self.bench.status()
        if status.recording:
            self.bench.recorder.end()
        if status.mode is Mode.RUNNING:
            self.bench.ask(Finish())

    def take(self, steps: Sequence[Step]) -> None:
        """Take all steps, then switch the amplifier off.

        Raises:
            UserError: the bench refused or stopped, or the recorder failed; the motor has no current then.
        """
        try:
            for number, step in enumerate(steps):
                if self._ending:
                    break
                self._later_s = plan_seconds(steps[number + 1 :])
                self._take(step)
            if self.bench.status().mode in (Mode.RUNNING, Mode.STOPPING):  # ended early
                self._wait_for_rest()
            self._off()
        except BaseException as error:
            before = self.bench.status()
            self.bench.stop()
            if isinstance(error, UserError) and before.mode is Mode.FAULT and before.fault:
                raise UserError(before.fault) from error  # not that nothing may be begun in a fault
            raise

    def _take(self, step: Step) -> None:
        if isinstance(step, Change):
            self._change(step)
        elif isinstance(step, Find):
            self._tell(self.share, FINDING.lower(), 0.0)
            pressed = find_contact(self.bench, step.force, self._until, lambda: self._ending)
            if pressed is not None:
                self._offset_deg = round(math.degrees(pressed), 2)
                self.bench.ask(Finish())
            if self.bench.status().enabled:
                self._wait_for_rest()
        elif isinstance(step, Lift):
            self.bench.ask(lifting(step))
            self._wait(LIFT_S, "lifting the load")
        elif isinstance(step, Record):
            self._record(step)
        elif isinstance(step, WorkOut):
            self._work_out(step)
        else:
            self._wait(step.seconds, "rest")

    def _until(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        def looked() -> bool:
            self._between()
            return condition()

        self.bench.wait_until(looked, seconds, what)

    def _wait(self, seconds: float, words: str) -> None:
        start, rate = self.bench.board[Slot.INDEX], self.bench.rate_hz

        def over() -> bool:
            left = seconds - (self.bench.board[Slot.INDEX] - start) / rate
            self._tell(self.share, words, left)
            return left <= 0.0 or self._ending

        self._until(over, math.inf, "")

    def _tell(self, share: float, words: str, step_left_s: float, after_s: float = 0.0) -> None:
        self.share, self.doing, self.step_left_s = share, words, max(step_left_s, 0.0)
        self.left_s = self.step_left_s + after_s + self._later_s
        self._report(share, words)

    def _off(self) -> None:
        if self.bench.status().enabled:
            self.bench.ask(Disable())

    def _change(self, step: Change) -> None:
        bench = self.bench
        self._off()
        self._ask_operator(step.prompt)
        if self._ending:
            return
        self._offset_deg = None
        commands: list[Command] = [self._initial]
        if step.set_up.phase == "contact":
            commands.append(Tare())
        bench.ask(step.set_up)
        self.set_up = step.set_up
        self._wait(SETTLE_S, "settling")
        if self._ending:
            return
        for command in [*commands, Enable()]:
            bench.ask(command)

    def _work_out(self, step: WorkOut) -> None:
        """What takes its time is done without current: no process has to look after the motor meanwhile."""
        if self._ending:
            return
        self._off()
        self._tell(self.share, step.words, 0.0)
        step.work(self._last_run())
        if step.ask is not None:
            self._ask_operator(step.ask())
        if not self._ending:
            self.bench.ask(Enable())

    def _last_run(self) -> Run:
        """The run before, from the ring; a few lost samples are left to whoever looks at it.

        Raises:
            UserError: it is no longer there as a whole.
        """
        info = self.run
        assert info is not None
        assert info.stop is not None
        rows, wanted = self.bench.ring.last(self.newest - info.start + 1), info.stop - info.start
        index = rows[:, COLUMN["index"]]
        rows = rows[(index >= info.start) & (index < info.stop)]
        if (
            len(rows) < (1.0 - MOST_LOST) * wanted
            or rows[0, COLUMN["index"]] > info.start + MOST_LOST * wanted
        ):
            raise UserError(
                f"Run {self.number} cannot be looked at before the next one: samples are missing, or it is "
                "too long; choose a shorter wanted force."
            )
        return Run.from_arrays(
            channels_of(info, rows), name=f"{self.number:03d}", phase=info.phase, cable=info.cable,
            sample_rate_hz=info.sample_rate_hz, trajectory=info.trajectory, attributes=info.attributes,
        )  # fmt: skip

    def _record(self, step: Record) -> None:
        bench = self.bench
        if step.later is not None:
            planned, attributes = step.later()
            step = replace(step, trajectory=planned, attributes={**step.attributes, **attributes})
        settings = dict(step.trajectory)
        if self._offset_deg is not None and goes_about_contact(settings):
            settings["offset_deg"] = self._offset_deg
        trajectory = read_trajectory(settings)
        if not step.load_torque:  # with one, nothing is recorded before the motion
            self._wait_for_what_comes_before()
        if self._ending:  # meanwhile: a motion that began now would not be ended any more
            return
        rows = bench.ring.reader()
        bench.ask(Start(settings))
        start = at = bench.status().run_start
        stop = start + round(trajectory.duration * bench.rate_hz)
        words = f"run {step.number} of {step.count}"
        if self._beginning.trigger is not None:
            at = self._crossed(
                self._beginning.trigger, Lookout(rows, self._beginning.trigger, start), stop, words
            )
        if not self._ending:
            intervention = str(step.attributes.get(INTERVENTION, ""))
            set_up = SetUp(step.phase, step.cable, step.load_torque, intervention)
            before, own = self._beginning.before_s, trajectory.settings
            self.run = run_to_record(bench, set_up, own, before, at, stop, step.attributes)
            self.number = step.number
            self._watch(self.run, step, start, stop)
        self._wait_for_rest()

    def _wait_for_what_comes_before(self) -> None:
        """The seconds before a run are there once the references have held for so long."""
        board, rate = self.bench.board, self.bench.rate_hz
        known = board[Slot.INDEX] + 1 - board[Slot.SET_AT]
        if known < self._beginning.before_s * rate:
            self._wait(self._beginning.before_s - known / rate, "before the motion")

    def _watch(self, run: RunInfo, step: Record, start: int, stop: int) -> None:
        """Record the run until it is over."""
        bench, seconds = self.bench, (stop - start) / self.bench.rate_hz
        words = f"run {step.number} of {step.count}"
        done = bench.board[Slot.RECORDED_RUNS]
        bench.recorder.begin(run)

        def recorded() -> bool:
            share = min(max(bench.board[Slot.INDEX] - start, 0) / (stop - start), 1.0)
            self._tell((step.number - 1 + share) / step.count, words, (1.0 - share) * seconds, STOP_S)
            return bench.board[Slot.RECORDED_RUNS] > done

        self._until(recorded, seconds + 30.0, f"Recording {words}")
        self.completed = step.number
        self.samples += bench.board[Slot.RECORDED]

    def _crossed(self, level: Level, lookout: Lookout, stop: int, words: str) -> int:
        """Index at which the trigger's level was crossed in the motion that goes on until ``stop``.

        Raises:
            UserError: it was not.
        """
        bench, found = self.bench, -1

        def looked() -> bool:
            nonlocal found
            left = (stop - bench.board[Slot.INDEX]) / bench.rate_hz
            self._tell(self.share, f"{words}, until {level.words}", left, STOP_S)
            at = lookout.look()
            found = -1 if at is None else at
            return at is not None or left < 0.0 or self._ending

        self._until(looked, math.inf, "")
        if not self._ending and not 0 <= found < stop:
            raise UserError(
                f"The trigger did not come in {words}: {level.words} was never reached; choose another level."
            )
        return found

    def _wait_for_rest(self) -> None:
        bench = self.bench
        self._until(lambda: bench.status().mode is Mode.ENABLED, STOP_S + 5.0, "Coming to rest")
