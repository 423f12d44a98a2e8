"""Hundreds of kills at random moments, counted in ``docs/faults.md``.

``python -m tests.faults.sweep [KILLS] [SEED] [--keep FILE]`` (500 and 1 by default; some five seconds each).
With ``--keep`` a sweep can be taken in pieces: outcomes are added to the file and counted as a whole; with
no kills the page alone is written anew.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.injected import table
from tests.faults.killing import VICTIMS, kill_once
from tests.faults.stops import section_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "faults.md"
LIMIT_MS, LIMIT_S = 50.0, 0.25


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kills", nargs="?", type=int, default=500)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="JSON lines of outcomes: added to, and counted as a whole")
    parser.add_argument("--victim", choices=VICTIMS, help="only this one; each in its turn without it")
    options = parser.parse_args()
    chance = random.Random(options.seed)
    outcomes: list[dict[str, Any]] = []
    if options.keep and options.keep.exists():
        outcomes = [json.loads(line) for line in options.keep.read_text(encoding="utf-8").splitlines()]
    for number in range(options.kills):
        with tempfile.TemporaryDirectory() as folder:
            victim = options.victim or VICTIMS[number % len(VICTIMS)]
            outcome = asdict(kill_once(Path(folder), victim, chance.uniform(0.05, 2.0)))
        outcomes.append(outcome)
        if options.keep:
            with options.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(outcome) + "\n")
        print(number + 1, outcome, file=sys.stderr)
    with tempfile.TemporaryDirectory() as folder:
        injected = list(table(Path(folder)))
    PAGE.write_text(page(outcomes, injected), encoding="utf-8")


HEAD = (
    "killed",
    "kills",
    "zero and low",
    "motor driven at the kill",
    "plant ms, median",
    "plant ms, most",
    "over 50 ms",
    "clock ms, median",
    "clock ms, most",
    "s lost, most",
    "over 0.25 s",
    "flushed samples lost",
    "wrong",
)


def page(outcomes: list[dict[str, Any]], injected: list[str]) -> str:
    """The counts as a page of documentation."""
    rows = []
    for victim in VICTIMS:
        mine = [o for o in outcomes if o["victim"] == victim]
        if not mine:
            continue
        plant, clock = [o["plant_ms"] for o in mine], [o["clock_ms"] for o in mine]
        lost = [o["lost_s"] for o in mine]
        rows.append(
            f"| {victim} | {len(mine)} | {sum(o['zero'] for o in mine)} | {sum(o['moving'] for o in mine)} | "
            f"{np.median(plant):.0f} | {max(plant):.0f} | {sum(p > LIMIT_MS for p in plant)} | "
            f"{np.median(clock):.0f} | {max(clock):.0f} | {max(lost):.3f} | "
            f"{sum(s > LIMIT_S for s in lost)} | {sum(o['flushed_lost'] for o in mine)} | "
            f"{sum(o['wrong'] for o in mine)} |"
        )
    return TEXT.format(
        kills=len(outcomes),
        head=f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}",
        rows="\n".join(rows),
        injected="\n".join(injected),
        stops=section_of(PAGE.read_text(encoding="utf-8")),
        machine=f"{platform.system()}, {platform.machine()}, {os.cpu_count()} cores",
    )


TEXT = """# Faults, counted

What happens to motor and recording when something dies or breaks. `python -m tests.faults.sweep 500 SEED`
(in pieces: `45 SEED --keep FILE`) takes the kills and writes this page; a handful of
them, and every other fault, run with the test suite.

## Killed processes

A bench runs a sine under position control in real time and records it. One of its processes is killed
(SIGKILL) at a random moment of the first two seconds of the recording: {kills} kills on {machine},
which other programs shared. "Window" is the process that plays its part: it has opened the bench, begun the
run and shows that it is alive. The bench's output stands outside of all these processes, as that of hardware
does.

Plant time is counted in the bench's own cycles (1 ms), from before the kill is sent to zero volts with
enable low; a bench waits for a program that the machine holds up, hence the same by the machine's clock
stands beside it. After the death of the loop, with which the cycles end, both are the machine's clock.

{head}
{rows}

"Lost" are samples that the loop had published before the kill and that the session, opened afterwards (and
repaired where it was cut), does not hold: those that were not yet flushed. "Wrong" are samples that differ
from what was published.

A killed process keeps its pipes open until the system has taken its memory back, which took up to 200 ms
here; the loop and the guardian therefore look at the process itself (Linux), and elsewhere at the pipe.

A loop that hangs without dying, as in a driver that does not return (held by SIGSTOP in
`tests/faults/test_hangs.py`): the guardian takes its place when it has made no cycle for 0.2 s with the
amplifier on, ten times the lateness at which the loop stops by itself. A loop that then wakes up drives no
more.

## STOP, whatever stands open

{stops}

## Other faults

Each in full motion on a virtual clock, where the recorder takes its turn every 20 ms
(`tests/faults/injected.py`; limits on each in `test_injected.py`). Output and enable stay at zero until the
operator resets, initialises and enables. Lost are samples from the start of the run to the stop that the
session lacks; a cycle that nobody saw counts.

| fault | zero after | s lost | the session says | the operator reads |
|---|---|---|---|---|
{injected}

A folder that vanished is looked for four times a second. A sensor counts as stuck after half a second without
any change to the last bit while what moves it moves; a resting sensor is no fault. Further, in
`tests/acquisition/test_faults_in_the_loop.py`: window or recorder alive but silent, zero after 0.5 s and 1 s;
a blocked motor, zero after 30 to 100 ms; every limit (current, torque, position, speed, tension rise, joint
angle, force), zero in the very sample that is beyond it.

Time is the sample index, and cycle times are taken from clocks that nobody can set (`perf_counter`,
`monotonic`): the machine's clock may be set to any hour while a run is recorded. A monotonic clock that leaps
says that the machine has slept: the motor is then stopped as after a late cycle.
"""


if __name__ == "__main__":
    main()
