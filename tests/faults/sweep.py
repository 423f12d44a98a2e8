"""Hundreds of kills at random moments, counted in ``docs/faults.md``.

``python -m tests.faults.sweep [KILLS] [SEED] [--keep FILE]`` (500 and 1 by default; some five seconds each).
With ``--keep`` a sweep can be taken in pieces: outcomes are added to the file and counted as a whole.
"""

from __future__ import annotations

import argparse
import json
import platform
import random
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.killing import VICTIMS, kill_once

PAGE = Path(__file__).resolve().parents[2] / "docs" / "faults.md"
LIMIT_MS, LIMIT_S = 50.0, 0.25


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kills", nargs="?", type=int, default=500)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="JSON lines of outcomes: added to, and counted as a whole")
    options = parser.parse_args()
    chance = random.Random(options.seed)
    outcomes: list[dict[str, Any]] = []
    if options.keep and options.keep.exists():
        outcomes = [json.loads(line) for line in options.keep.read_text(encoding="utf-8").splitlines()]
    for number in range(options.kills):
        with tempfile.TemporaryDirectory() as folder:
            victim = VICTIMS[number % len(VICTIMS)]
            outcome = asdict(kill_once(Path(folder), victim, chance.uniform(0.05, 2.0)))
        outcomes.append(outcome)
        if options.keep:
            with options.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(outcome) + "\n")
        print(number + 1, outcome, file=sys.stderr)
    PAGE.write_text(page(outcomes), encoding="utf-8")


def page(outcomes: list[dict[str, Any]]) -> str:
    """The counts as a page of documentation."""
    rows = []
    for victim in VICTIMS:
        mine = [o for o in outcomes if o["victim"] == victim]
        if not mine:
            continue
        plant, lost = [o["plant_ms"] for o in mine], [o["lost_s"] for o in mine]
        rows.append(
            f"| {victim} | {len(mine)} | {sum(o['zero'] for o in mine)} | {np.median(plant):.0f} | "
            f"{max(plant):.0f} | {sum(p > LIMIT_MS for p in plant)} | {max(lost):.3f} | "
            f"{sum(s > LIMIT_S for s in lost)} | {sum(o['wrong'] for o in mine)} |"
        )
    return TEXT.format(
        kills=len(outcomes), rows="\n".join(rows), machine=f"{platform.system()}, {platform.machine()}"
    )


TEXT = """# Faults, counted

What happens to motor and recording when something dies or breaks. `python -m tests.faults.sweep` takes the
kills again and writes this page; a handful of them, and every other fault, run with the test suite.

## Killed processes

A bench runs a sine under position control in real time and records it. One of its processes is killed
(SIGKILL) at a random moment of the first two seconds of the recording: {kills} kills on {machine}.
The bench's output stands outside of all these processes, as that of hardware does. Time is counted in the
bench's own cycles (1 ms); after the death of the loop, with which the cycles end, by the machine's clock from
the kill to the zero that the guardian wrote.

| killed | kills | zero and low | ms, median | ms, most | over 50 ms | s lost, most | over 0.25 s | wrong |
|---|---|---|---|---|---|---|---|---|
{rows}

"Lost" are samples that the loop had published before the kill and that the session, opened afterwards (and
repaired where it was cut), does not hold. "Wrong" are samples that differ from what was published.

## Other faults

Each on a virtual clock, in full motion, in `tests/acquisition/test_faults_in_the_loop.py`: zero output and
enable low within 50 ms of plant time and for good, until the operator resets, initialises and enables.

| fault | zero after |
|---|---|
| any sensor gives no number | the same cycle |
| encoder jumps | the same cycle |
| device gone, device error | the same cycle |
| 30 cycles lost, 30 ms late | the cycle that tells it |
| late 50 times in a row | 50 cycles |
| encoder stuck under current | 30 ms under 1.5 A |
| angle sensor or load cell stuck to the last bit | 0.5 s, with motion (a resting sensor is no fault) |
| motor blocked or more than 25° from its command | 30 to 100 ms |
| window silent, recorder silent (alive, but hung) | 0.5 s, 1 s |

A wall clock that is set changes nothing: time is the sample index. Disk full, little room left, and a folder
that vanishes are in `tests/acquisition/test_recorder.py`: one sentence, the motor stopped, and no flushed
sample lost.
"""


if __name__ == "__main__":
    main()
