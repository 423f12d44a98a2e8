"""``check-rig``: an operator confirms every channel, sign, limit and assumption; the protocol tells of it.

Whatever can be measured is measured; the operator does what hands have to do and confirms what only eyes
can see. Nothing moves before the operator has said so, and the device is brought to rest after every step.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.devices.clock import Clock, RealClock
from fingerlab.devices.protocol import RAW_CHANNELS, Device, DeviceFault, DeviceLost
from fingerlab.rig.constants import Rig
from fingerlab.rig.daq import plain_section
from fingerlab.sessions.model import Array

YES, NO, SKIP = "yes", "no", "skip"
CONFIRMED, FAILED, SKIPPED, NOTED, NOT_HERE = "confirmed", "failed", "skipped", "noted", "not applicable"


class Operator(Protocol):
    """Whoever stands at the bench, or answers in their place."""

    def tell(self, text: str) -> None: ...

    def ask(self, step: str, question: str) -> str:
        """``yes``, ``no`` or ``skip``."""
        ...


@dataclass(frozen=True)
class Outcome:
    """One step: what was asked, what was answered, what was measured (SI), and what follows."""

    id: str
    title: str
    state: str
    sentence: str
    question: str = ""
    answer: str = ""
    measured: dict[str, Any] = field(default_factory=dict)


@dataclass
class Bench:
    """The device under check and the means to look at it.

    Attributes:
        rig: what is to be confirmed. clock: to measure how the device paces the loop.
        rest: mean raw values at rest, by the first step. rest_spread: their standard deviations.
    """

    device: Device
    rig: Rig
    operator: Operator
    clock: Clock
    rest: Array = field(default_factory=lambda: np.full(len(RAW_CHANNELS), math.nan))
    rest_spread: Array = field(default_factory=lambda: np.full(len(RAW_CHANNELS), math.nan))

    def watch(
        self,
        seconds: float,
        volts: float = 0.0,
        enable: bool = False,
        until: Callable[[tuple[float, ...]], bool] | None = None,
        hand: tuple[str, float] | None = None,
    ) -> Array:
        """Raw values of so many seconds at a constant set value, shape (n, 5); at rest again afterwards.

        Args:
            until: stop earlier where this says so of a sample.
            hand: channel and amount (SI) that the simulated rig moves by itself, as the operator was asked
                to do on a real one.
        """
        self.device.start()
        rows: list[tuple[float, ...]] = []
        count = round(seconds * self.device.rate_hz)
        try:
            self.device.set_enable(enable)
            for k in range(count):
                if hand is not None and k == count // 4:
                    self._move_by_hand(*hand)
                rows.append(self.device.exchange(volts).raw)
                if until is not None and until(rows[-1]):
                    break
        finally:
            safe = self.device.make_safe()
            if hand is not None:
                self._move_by_hand(hand[0], 0.0)
        if not safe:
            raise DeviceLost(
                f"{self.device.name} does not confirm that it is at rest; switch the amplifier off."
            )
        return np.array(rows)

    def _move_by_hand(self, channel: str, amount: float) -> None:
        move = getattr(self.device, "move_by_hand", None)
        if move is not None:
            move(channel, amount)


Step = Callable[[Bench], Iterable[Outcome]]


@dataclass(frozen=True)
class CheckProtocol:
    """Everything that was confirmed or not, ready for a file."""

    device: str
    date: str
    rig: Rig
    rig_source: str
    outcomes: tuple[Outcome, ...]

    @property
    def all_confirmed(self) -> bool:
        """Whether no step failed and none was left out."""
        return not any(o.state in (FAILED, SKIPPED) for o in self.outcomes)

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``; values in SI."""
        return {
            "schema": 1,
            "kind": "check-rig",
            "date": self.date,
            "software": f"FingerLab {fingerlab.__version__}",
            "device": self.device,
            "rig_file": self.rig_source,
            "daq": plain_section(self.rig.daq),
            "limits": plain_section(self.rig.limits),
            "all_confirmed": self.all_confirmed,
            "steps": [asdict(outcome) for outcome in self.outcomes],
        }


def check_rig(
    device: Device,
    rig: Rig,
    operator: Operator,
    rig_source: str,
    clock: Clock | None = None,
    steps: Sequence[Step] | None = None,
) -> CheckProtocol:
    """Walk through all steps; the device is opened, and closed safely whatever happens.

    Args:
        rig_source: the rig file's name, for the protocol.
        clock: to measure pacing; the machine's where it is None.
        steps: those of ``check_steps`` where it is None.

    Raises:
        UserError: the device cannot be opened.
    """
    from fingerlab.devices.check_steps import STEPS

    outcomes: list[Outcome] = []
    bench = Bench(device, rig, operator, clock or RealClock())
    try:
        try:
            device.open()
        except (DeviceLost, DeviceFault) as failure:
            raise UserError(str(failure)) from failure
        for step in STEPS if steps is None else steps:
            outcomes += _guarded(step, bench)
            if outcomes and outcomes[-1].id == LOST:
                break
    finally:
        device.close()
    date = datetime.now().astimezone().isoformat(timespec="seconds")
    return CheckProtocol(device.name, date, rig, rig_source, tuple(outcomes))


LOST = "device-lost"


def _guarded(step: Step, bench: Bench) -> list[Outcome]:
    """A step in which a fault of the device is a finding, not the end; a lost device ends the check."""
    name = getattr(step, "__name__", "step").replace("_", "-")
    try:
        outcomes = list(step(bench))
    except DeviceLost as failure:
        outcomes = [Outcome(LOST, "The device was lost", FAILED, str(failure))]
    except DeviceFault as failure:
        bench.device.make_safe()
        outcomes = [Outcome(name, "The device reported a fault", FAILED, str(failure))]
    for outcome in outcomes:
        bench.operator.tell(f"{outcome.state}: {outcome.title.rstrip('.')}. {outcome.sentence}")
    return outcomes


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
