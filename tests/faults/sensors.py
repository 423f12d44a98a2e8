"""Sensors that lie, in the simulated rig on a virtual clock: each is refused or stopped, with its sentence.

``python -m tests.faults.sensors [TRIES] [SEED]`` (20 and 1 by default; some three seconds each) writes the
table into ``docs/faults.md``. Half of the tries have the fault before anything is switched on, the other
half in full motion; a wrong sense, swapped cables and a slack cable are there from the beginning.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.check_rig.look import FAILED, Outcome, check_settings
from fingerlab.acquisition.check_rig.walk import STEPS, check_rig
from fingerlab.acquisition.control.machine import (
    Approach,
    Command,
    Enable,
    Finish,
    Initialise,
    Mode,
    SetUp,
    Start,
    TakeUp,
    Tare,
)
from fingerlab.acquisition.protocols.steps import APPROACH_LIMIT, APPROACH_SPEED
from fingerlab.acquisition.status import Number, Slot
from fingerlab.devices.faults import Faults, SensorFault
from fingerlab.devices.simulated import SimulatedRig, Simulation
from fingerlab.rig.file import default_rig
from tests.acquisition.driving import Driven
from tests.faults.sweep import PAGE, with_part

AIR = {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0, "offset_deg": 22.0, "duration_s": 12.0}
PRESS = {"kind": "sine", "amplitude_deg": 4.0, "frequency_hz": 1.0, "duration_s": 8.0}
MOVING = (5.0, 9.0)
"""s after the start within which a fault comes in full motion."""

FORCE, MCP, PIP, CURRENT, ENCODER = "force_volts", "mcp_volts", "pip_volts", "current_volts", "encoder_counts"
WORDS = {
    FORCE: "load cell",
    MCP: "MCP sensor",
    PIP: "PIP sensor",
    CURRENT: "current monitor",
    ENCODER: "encoder",
}


@dataclass(frozen=True)
class Lie:
    """One fault: its name, the sensor, and how it is put in at a cycle by chance."""

    name: str
    sensor: str
    put: Callable[[int, random.Random], Faults]
    from_start: bool = False
    slack: float = 0.0
    by_check: bool = False

    @property
    def contact(self) -> bool:
        """Whether the finger has to press for it to be seen."""
        return WORDS[FORCE] in self.sensor


@dataclass(frozen=True)
class Seen:
    """``how``: refused, stopped or passed. ``after_s``: s from the fault to the stop. ``sentence``."""

    how: str
    after_s: float
    sentence: str


def _one(name: str, channel: str, how: Callable[[random.Random], dict[str, Any]], start: bool = False) -> Lie:
    def put(cycle: int, chance: random.Random) -> Faults:
        return Faults(sensors=(SensorFault(channel, cycle, **how(chance)),))

    return Lie(name, WORDS[channel], put, start)


def _off(chance: random.Random) -> dict[str, Any]:
    return {"level": 0.0, "noise": chance.uniform(1e-3, 2e-2)}


def _noise(chance: random.Random) -> dict[str, Any]:
    return {"stuck": True, "noise": chance.uniform(1e-3, 1e-2)}


def _drift(slowest: float, chance: random.Random) -> dict[str, Any]:
    return {"drift": chance.choice((-1, 1)) * chance.uniform(slowest, 5.0 * slowest)}


def _swapped(one: str, other: str, by_check: bool = False) -> Lie:
    sensor, faults = f"{WORDS[one]} and {WORDS[other]}", Faults(swapped=((one, other),))
    return Lie("cables swapped", sensor, lambda *_: faults, from_start=True, by_check=by_check)


def _lies() -> Iterator[Lie]:
    analog = (FORCE, MCP, PIP, CURRENT)
    for channel in analog:
        yield _one("wire off: 0 V", channel, _off)
    yield _one("both wires off", ENCODER, lambda chance: {"stuck": True})
    yield _one("one wire off", ENCODER, lambda chance: {"stuck": True, "noise": 0.6})
    for channel in analog[:3]:
        yield _one("short to 5 V", channel, lambda chance: {"level": 5.0, "noise": 1e-3})
    yield _one("short to 12 V", CURRENT, lambda chance: {"level": 10.0})
    for channel in analog:
        yield _one("noise only", channel, _noise)
    for channel, slowest in ((FORCE, 5e-5), (MCP, 1e-4), (PIP, 1e-4), (CURRENT, 1e-4)):
        yield _one("drift", channel, partial(_drift, slowest))
    for channel in (*analog, ENCODER):
        yield _one("wrong sense", channel, lambda chance: {"turned": True}, True)
    for one, other in ((FORCE, MCP), (FORCE, PIP), (FORCE, CURRENT), (MCP, CURRENT)):
        yield _swapped(one, other)
    yield _swapped(MCP, PIP, by_check=True)
    yield Lie("slack of 40° to 90°", "cable", lambda *_: Faults(), from_start=True, slack=1.0)


LIES = tuple(_lies())


def try_once(lie: Lie, seed: int) -> Seen:
    """The protocol's way: references, enable, approach where it presses, a run, and back to rest."""
    chance = random.Random(f"{lie.name} {lie.sensor} {seed}")
    at = 0.0 if lie.from_start or seed % 2 == 0 else chance.uniform(*MOVING)
    faults = lie.put(round(1000.0 * at), chance)
    travel = math.radians(chance.uniform(40.0, 90.0)) * 0.015 if lie.slack else 0.0
    effects = {"cable_slack": {"travel": travel}} if travel else {}
    device = SimulatedRig(simulation=Simulation(seed=seed, effects=effects), faults=faults)
    if lie.by_check:
        return _checked(device)
    bench = Driven(device)
    told = _taken(bench, lie)
    if bench.fault:
        return Seen("stopped", bench.board[Slot.INDEX] / 1000.0 - at, bench.fault)
    return Seen("refused" if told else "passed", math.nan, told)


def _taken(bench: Driven, lie: Lie) -> str:
    """The first refusal; empty where there was none, or a fault came first."""
    bench.ask(SetUp("contact", "flexion") if lie.contact else SetUp())
    bench.cycles(1500)
    commands: list[Command] = [Initialise(), *([Tare()] if lie.contact else []), Enable()]
    for command in commands:
        refused = bench.ask(command)
        if refused:
            return refused
    motion: dict[str, Any] = AIR
    if lie.contact:
        for wound in (TakeUp(or_held=True), Approach(1.0, APPROACH_SPEED, APPROACH_LIMIT)):
            bench.ask(wound)
            bench.cycles(20000, lambda: bool(bench.board[Slot.APPROACHED]) or _over(bench))
            if bench.board[Slot.APPROACHED] == -1:
                return "The fingertip does not press the load cell; move it nearer."
        middle = math.degrees(bench.board.number(Number.APPROACH))
        bench.ask(Finish())
        bench.cycles(5000, lambda: _over(bench))
        motion = {**PRESS, "offset_deg": middle}
    if not bench.fault:
        bench.ask(Start(motion))
        bench.cycles(20000, lambda: _over(bench))
        bench.cycles(1500, lambda: bool(bench.fault))
    return ""


def _over(bench: Driven) -> bool:
    return bench.loop.machine.mode in (Mode.ENABLED, Mode.FAULT)


def _checked(device: SimulatedRig) -> Seen:
    rig = default_rig()
    steps = [step for step in STEPS if step.name in ("rest", "moved")]
    bench = InlineBench(device, check_settings(rig), Path("not used"))
    try:
        protocol = check_rig(bench, rig, _Yes(), "test", steps=steps)
    finally:
        bench.close()
    failed = [outcome for outcome in protocol.outcomes if outcome.state == FAILED]
    if not failed:
        return Seen("passed", math.nan, "")
    return Seen("refused", math.nan, f"check-rig: {failed[0].sentence}")


class _Yes:
    def tell(self, text: str) -> None: ...

    def found(self, outcome: Outcome) -> None: ...

    def ask(self, step: str, question: str) -> str:
        return "yes"


def rows(tries: int, seed: int) -> Iterator[str]:
    """Rows of the table in ``docs/faults.md``."""
    for lie in LIES:
        seen = [try_once(lie, seed + k) for k in range(tries)]
        count = Counter(one.how for one in seen)
        after = [one.after_s for one in seen if one.how == "stopped"]
        times = f"{max(np.median(after), 0.0):.2f} | {max(after):.2f}" if after else "- | -"
        common = Counter(_without_numbers(one.sentence) for one in seen).most_common(1)[0][0]
        sentence = next(one.sentence for one in seen if _without_numbers(one.sentence) == common)
        row = (
            f"| {lie.name} | {lie.sensor} | {count['refused']} | {count['stopped']} | {times} | "
            f"{count['passed']} | {sentence} |"
        )
        print(row, file=sys.stderr, flush=True)
        yield row


def _without_numbers(sentence: str) -> str:
    return "".join(letter for letter in sentence if not (letter.isdigit() or letter in "-.e+"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tries", nargs="?", type=int, default=20)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    options = parser.parse_args()
    told = list(rows(options.tries, options.seed))
    PAGE.write_text(with_part(PAGE.read_text(encoding="utf-8"), "sensors", told), encoding="utf-8")


if __name__ == "__main__":
    main()
