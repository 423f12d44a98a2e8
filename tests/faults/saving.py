"""Kills while a project is written, counted in ``docs/faults.md``.

``python -m tests.faults.saving [KILLS] [SEED]``; 50 and 1 by default, a second and a half each.
A process writes a project over and over, each with its number in the notes, and says each number once it is
kept; it is killed at a random moment of that. What lies there then has to be one whole project, and no older
than the last one that was said to be kept.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from fingerlab.models.file import load_project
from fingerlab.sessions import open_session
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.session import write_session
from tests.faults.sweep import PAGE, with_part

LETTERS = 200_000
"""Of a project's notes, which make writing it long enough to fall into."""
WITHIN_S = 0.01
"""From a saving that was said on, of the kill: some savings long."""
WRITE = f"""
import sys, itertools
from pathlib import Path
from fingerlab.models.file import Project, save_project
print("ready", flush=True)
for number in itertools.count(1):
    notes = f"{{number}} " + "x" * {LETTERS}
    save_project(Project(("day.h5",), notes=notes), Path(sys.argv[1]))
    print(number, flush=True)
"""


@dataclass(frozen=True)
class Kill:
    """``said``: number of the last project that was said to be kept. ``found``: of that which lies there.

    ``whole``: it is one project from its first letter to its last. ``midway``: a half-written file lay beside
    it, which is what the kill fell into.
    """

    said: int
    found: int
    whole: bool
    midway: bool


def kill_saving(place: Path, chance: random.Random) -> Kill:
    """Kill a process at a random moment of its saving; ``place``: where it keeps its project."""
    process = subprocess.Popen([sys.executable, "-c", WRITE, str(place)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while (line := process.stdout.readline()) in ("", "ready\n"):
        assert process.poll() is None
    time.sleep(chance.random() * WITHIN_S)
    process.kill()
    said = [int(word) for word in (line, *process.communicate()[0].split("\n")) if word.strip().isdigit()]
    halves = list(place.parent.glob(f"{place.name}.*.part"))
    notes = json.loads(place.read_text(encoding="utf-8"))["notes"]
    number = notes.split()[0]
    for half in halves:
        half.unlink()
    return Kill(said[-1], int(number), notes == f"{number} " + "x" * LETTERS, bool(halves))


def main() -> None:
    """Take the kills and write their row."""
    kills, seed = (int(given) for given in (*sys.argv[1:], "50", "1")[:2])
    chance, taken = random.Random(seed), []
    with tempfile.TemporaryDirectory() as folder:
        session = Path(folder) / "day.h5"
        wave = {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0, "duration_s": 3.0}
        write_session(
            session, load_preset("practice"), "short", [RunPlan("on_air", "extension", wave)], {}, 1
        )
        opened = 0
        for _ in range(kills):
            taken.append(kill_saving(session.with_name("day.project.json"), chance))
            opened += load_project([open_session(session)]) is not None
    row = (
        f"| {kills} | {sum(kill.midway for kill in taken)} | {opened} | "
        f"{sum(kill.whole for kill in taken)} | {sum(kill.found < kill.said for kill in taken)} |"
    )
    PAGE.write_text(with_part(PAGE.read_text(encoding="utf-8"), "kills of a saving", [row]), encoding="utf-8")


if __name__ == "__main__":
    main()
