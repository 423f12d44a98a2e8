"""What the steps of a check see of the bench, may do with it, and say: the very bench that records.

Every sample comes from the ring, every current through the control loop with its limits, its watchdogs and
its guardian. No step has a device of its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import fingerlab
from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import (
    Command,
    Disable,
    Enable,
    HoldDeadMan,
    Initialise,
    Mode,
    MoveByHand,
    SetUp,
    Start,
)
from fingerlab.acquisition.control.motion import Gains
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Input, Slot
from fingerlab.core.errors import UserError
from fingerlab.devices.protocol import LINES, RAW_CHANNELS
from fingerlab.rig.daq import plain_section
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array

YES, NO, SKIP = "yes", "no", "skip"
CONFIRMED, FAILED, SKIPPED, NOTED, NOT_HERE = "confirmed", "failed", "skipped", "noted", "not applicable"


@dataclass(frozen=True)
class Outcome:
    """One question: what was asked, what was answered, what was measured (SI), and what follows."""

    id: str
    title: str
    state: str
    sentence: str
    question: str = ""
    answer: str = ""
    measured: dict[str, Any] = field(default_factory=dict)

    @property
    def open(self) -> bool:
        """Whether it failed or was left out: the bench is not known to be what its rig file says."""
        return self.state in (FAILED, SKIPPED)


class Operator(Protocol):
    """Whoever stands at the bench, or answers in their place."""

    def tell(self, text: str) -> None: ...

    def found(self, outcome: Outcome) -> None:
        """A step has come to this."""
        ...

    def ask(self, step: str, question: str) -> str:
        """``yes``, ``no`` or ``skip``. Raises BenchFailed where the bench was stopped meanwhile."""
        ...


@dataclass(frozen=True)
class CheckProtocol:
    """Everything that was confirmed or not, ready for a file."""

    device: str
    date: str
    rig: Rig
    rig_source: str
    outcomes: tuple[Outcome, ...]
    bench: str = ""

    @property
    def all_confirmed(self) -> bool:
        """Whether no step failed and none was left out."""
        return not any(outcome.open for outcome in self.outcomes)

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``; values in SI."""
        return {
            "schema": 1,
            "kind": "check-rig",
            "date": self.date,
            "software": f"FingerLab {fingerlab.__version__}",
            "device": self.device,
            "rig_file": self.rig_source,
            "bench": self.bench,
            "daq": plain_section(self.rig.daq),
            "limits": plain_section(self.rig.limits),
            "all_confirmed": self.all_confirmed,
            "steps": [asdict(outcome) for outcome in self.outcomes],
        }


def write_protocol(protocol: CheckProtocol, path: Path) -> None:
    """Write the protocol as JSON to a new file.

    Raises:
        UserError: the file is there already or cannot be written.
    """
    text = json.dumps(finite(protocol.to_json()), indent=1, allow_nan=False)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text + "\n")
    except FileExistsError:
        raise UserError(f"{path} exists already and is not overwritten; choose another name.") from None
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}); choose another folder.") from None


def finite(value: Any) -> Any:
    """JSON knows no NaN: what was not measured is null."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


TEST_CURRENT = 0.3
"""A; twice what motor and gearbox need to turn at all (RE40 no-load current 137 mA). The loop sends no more
in the whole of a check, whatever the encoder says."""

FARTHEST = math.radians(90.0)
"""Beyond it the loop stops a motor that is under check, unless the rig file does earlier (assumed)."""

RAW = slice(COLUMN[f"raw/{RAW_CHANNELS[0]}"], COLUMN[f"raw/{RAW_CHANNELS[0]}"] + len(RAW_CHANNELS))

LINE_SLOTS = dict(zip(LINES, (Slot.EMERGENCY_STOP, Slot.AMPLIFIER_READY), strict=True))


def check_settings(rig: Rig) -> LoopSettings:
    """What the control loop is told for a check: the rig's own limits, or narrower ones.

    Raises:
        UserError: the rig holds impossible ones.
    """
    limits = rig.limits
    limits = replace(
        limits,
        position_low=max(limits.position_low, -FARTHEST),
        position_high=min(limits.position_high, FARTHEST),
    )
    # No brake: it would take away the current that is to be measured, and drive on where the encoder's sense
    # is wrong. Current, travel, speed and time are limited without it.
    gains = Gains(derivative=0.0, current_limit=TEST_CURRENT)
    return LoopSettings(BenchUnits.from_rig(rig), limits, gains, proves_drive=True)


class BenchFailed(Exception):
    """The bench stopped, refused or was lost; the text is its sentence."""


@dataclass(frozen=True)
class Driven:
    """What a motor did under the test current.

    Attributes:
        rows: of the ring, shape (n, columns). fault: why the loop stopped it; empty where it did not.
        held_at: first sample at whose command the dead-man's line was inverted no more; infinite for none.
    """

    rows: Array
    fault: str
    held_at: float = math.inf

    def column(self, name: str) -> Array:
        """One of the ring's columns, shape (n,)."""
        return self.rows[:, COLUMN[name]]


@dataclass
class Look:
    """The bench under check and the means to look at it.

    Attributes:
        rig: what is to be confirmed.
        rest: mean raw values at rest, by the first step. rest_spread: their standard deviations.
    """

    bench: Bench
    rig: Rig
    operator: Operator
    rest: Array = field(default_factory=lambda: np.full(len(RAW_CHANNELS), math.nan))
    rest_spread: Array = field(default_factory=lambda: np.full(len(RAW_CHANNELS), math.nan))

    def rows(self, seconds: float, hand: tuple[str, float] | None = None) -> Array:
        """Rows of the ring of so many seconds without any current, shape (n, columns).

        Args:
            hand: channel and amount (SI) that the simulated rig moves by itself, as the operator was asked
                to do on a real one.

        Raises:
            BenchFailed: the bench stopped meanwhile.
        """
        reader = self.bench.ring.reader()
        with as_bench_failed():
            if hand is None:
                self.bench.wait(seconds)
            else:
                self.bench.wait(0.25 * seconds)
                self.bench.ask(MoveByHand(*hand))
                self.bench.wait(0.75 * seconds)
        rows = reader.read().rows
        if hand is not None:
            self.ask(MoveByHand(hand[0], 0.0))
        return rows

    def watch(self, seconds: float, hand: tuple[str, float] | None = None) -> Array:
        """Raw values (V, counts) of :meth:`rows`, shape (n, 5). Raises BenchFailed."""
        return self.rows(seconds, hand)[:, RAW]

    def line(self, name: str, on: bool, seconds: float) -> bool:
        """What the input ``name`` of ``LINES`` tells once a hand has set it ``on``, or after so many seconds.

        That a pressed emergency stop is a fault of the bench is no reason to look away. Raises BenchFailed.
        """
        bench = self.bench
        with as_bench_failed():
            bench.ask(MoveByHand(name, float(on)))
            end = bench.status().index + seconds * bench.rate_hz
            while bench.board[LINE_SLOTS[name]] != (Input.YES if on else Input.NO):
                status = bench.status()
                if status.loop_ended or status.latched:
                    raise BenchFailed(status.fault or "The bench was stopped.")
                if status.index >= end:
                    break
                bench.idle()
        return bench.board[LINE_SLOTS[name]] == Input.YES

    def ask(self, command: Command) -> None:
        """Ask the loop. Raises BenchFailed where it refuses."""
        with as_bench_failed():
            self.bench.ask(command)

    def until(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        """Wait for the bench. Raises BenchFailed."""
        with as_bench_failed():
            self.bench.wait_until(condition, seconds, what)

    def drive(
        self,
        course: Sequence[tuple[float, float]],
        rise: float,
        travel: float,
        line: bool = True,
        held_after: float = math.inf,
    ) -> Driven:
        """Let a current flow until its course is over or the motor has turned so far; off afterwards.

        Args:
            course: the current, A, at moments, s, with straight lines between. rise: s of its soft start.
            travel: rad. line: whether the enable line is raised; without it nothing should happen.
            held_after: s after which the dead-man's line is inverted no more.

        Raises:
            BenchFailed: the bench refused, or was lost or stopped by the operator.
        """
        bench, seconds = self.bench, course[-1][0]
        torque_per_amp = BenchUnits.from_rig(self.rig).torque_per_amp
        for command in (SetUp("motor_bench", "none"), Initialise(position=0.0), Enable(line)):
            self.ask(command)
        reader, fault, held_at = bench.ring.reader(), "", math.inf
        push: dict[str, Any] = {
            "kind": "torque",
            "time_s": [moment for moment, _ in course],
            "torque_n_m": [torque_per_amp * amps for _, amps in course],
            "ramp_s": rise,
        }

        def over() -> bool:
            last = bench.ring.last(1)
            far = len(last) and abs(last[0, COLUMN["motor_position"]]) > travel
            return bool(far) or not bench.status().run_active

        try:
            bench.ask(Start(push))
            if held_after < seconds:
                bench.wait(held_after)
                bench.ask(HoldDeadMan())
                held_at = bench.board[Slot.INDEX]
            bench.wait_until(over, 2.0 * seconds, "The test current")
            bench.ask(Disable())
        except UserError as error:
            status = bench.status()
            if status.mode is not Mode.FAULT or status.loop_ended:
                if not (status.loop_ended or status.latched):
                    self.ask(Disable())
                raise BenchFailed(str(error)) from error
            fault = status.fault or str(error)
        return Driven(reader.read().rows, fault, held_at)


@contextmanager
def as_bench_failed() -> Iterator[None]:
    """Tell what the bench says from what is said to who asked for the check."""
    try:
        yield
    except UserError as error:
        raise BenchFailed(str(error)) from error


def asked(look: Look, step: str, title: str, shown: str, doubt: str, measured: dict[str, Any]) -> Outcome:
    """What only the operator can tell, of what they are ``shown``, which the finding repeats: sentences."""
    question = f"{shown} {doubt}"
    answer = look.operator.ask(step, question)
    state = {YES: CONFIRMED, NO: FAILED, SKIP: SKIPPED}.get(answer, FAILED)
    words = {
        CONFIRMED: "The operator confirms it.",
        FAILED: "The operator says no; correct the rig file and check again.",
        SKIPPED: "The operator left it out.",
    }
    return Outcome(step, title, state, f"{shown} {words[state]}", question, answer, measured)
