"""Seconds until an added effect is judged, and of a whole diagnosis, beside those of an earlier revision.

    python -m benchmarks.added_effect BASE [--session S.h5] [--effect ID] [--repeats 5]

BASE is a git worktree of the earlier revision that its own Python can run (``BASE/.venv`` or this one). Both
programs take turns in processes of their own, so that what else the machine does strikes both alike; the
quickest of each is told. Processor time is kept beside wall time for the same reason. Writes its section of
docs/benchmarks.md.

An addition is what the window does after a first diagnosis of the same sessions, curves and proposal
included: until the new bar stands there, and until all is told. ``diagnose`` is the command with its start.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.machine import ADDED, BUSY_LOAD, code_words, load_average, machine_words, with_section

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "benchmarks.md"
MEASURING = """
import inspect, json, sys, time
from fingerlab import diagnosis
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.sessions import open_session

def now():
    return time.perf_counter(), time.process_time()

def since(then):
    return [b - a for a, b in zip(then, now())]

def asked(**options):  # an earlier revision is asked with keywords of its own
    if hasattr(diagnosis, "DiagnosisOptions"):
        return {"options": diagnosis.DiagnosisOptions(**options)}
    return {name: value for name, value in options.items() if name in inspect.signature(diagnose).parameters}

sessions, seen = (open_session(sys.argv[1]),), []
kept = Reduction(sessions)
then = now()
diagnose(sessions, **asked(kept=kept))
told = {"whole": since(then)}
then = now()
first = lambda look: seen.append(since(then))
diagnose(sessions, (sys.argv[2],), **asked(kept=kept, first=first))
told["added"] = since(then)
told["look"] = seen[0] if seen else told["added"]
print(json.dumps(told))
"""
"""Run in either program; an earlier one may tell nothing before all is told."""
STEPS = {
    "look": "an effect added: the bar falls",
    "added": "an effect added: all is told",
    "whole": "the first diagnosis in the window",
    "command": "`fingerlab diagnose`",
}
Seconds = tuple[float, float]
"""On the wall and of the processor."""


def python_of(root: Path) -> str:
    """The interpreter of a worktree, or this one."""
    own = root / ".venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    return str(own) if own.exists() else sys.executable


def run(root: Path, words: list[str]) -> str:
    """Standard output of Python with these words in a worktree."""
    done = subprocess.run(
        [python_of(root), *words], cwd=root, check=True, capture_output=True, text=True, encoding="utf-8"
    )
    return done.stdout


def measured(root: Path, session: Path, effect: str) -> dict[str, Seconds]:
    """All steps once."""
    found = {
        name: tuple(seconds)
        for name, seconds in json.loads(run(root, ["-c", MEASURING, str(session), effect])).items()
    }
    wall, processor = time.perf_counter(), os.times()
    run(root, ["-m", "fingerlab", "diagnose", str(session), "--json", "-"])
    spent = [after - before for before, after in zip(processor, os.times(), strict=True)]
    return {**found, "command": (time.perf_counter() - wall, spent[2] + spent[3])}


def quickest(turns: list[dict[str, Seconds]], step: str) -> Seconds:
    """The least of each; what else the machine does only ever takes time."""
    return min(one[step][0] for one in turns), min(one[step][1] for one in turns)


def section(pairs: list[tuple[dict[str, Seconds], dict[str, Seconds]]], head: str) -> str:
    """The measurements as Markdown."""
    lines = [
        head,
        "",
        "| step | wall before, s | wall, s | processor before, s | processor, s | share of it |",
    ]
    lines.append("|---|---|---|---|---|---|")
    for step, title in STEPS.items():
        before, after = (quickest([pair[k] for pair in pairs], step) for k in (0, 1))
        cells = before[0], after[0], before[1], after[1], after[1] / before[1]
        lines.append(f"| {title} | " + " | ".join(f"{cell:.2f}" for cell in cells) + " |")
    return "\n".join([*lines, ""])


def main() -> None:
    """Measure both in turns and write a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("base", type=Path)
    parser.add_argument("--session", type=Path)
    parser.add_argument("--effect", default="coulomb_friction")
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    base, load = asked.base.resolve(), load_average()
    with tempfile.TemporaryDirectory() as folder:
        session = (asked.session or simulated(Path(folder), asked.effect)).resolve()
        pairs = []
        for _ in range(asked.repeats):
            before = measured(base, session, asked.effect)
            pairs.append((before, measured(ROOT, session, asked.effect)))
    what = session.name if asked.session else f"a simulated session of the thesis' size with {asked.effect}"
    head = (
        f"Made with `python -m benchmarks.added_effect` on {machine_words()}, load average {load:.1f} "
        f"before, {load_average():.1f} after; {code_words()}, in turns with {code_words(base)}, on {what}: "
        f"{asked.effect} is added after a first diagnosis. The quickest of {asked.repeats} turns."
        + (" Other programs shared the machine: compare the processor's times." if load >= BUSY_LOAD else "")
    )
    text = section(pairs, head)
    print(text)
    PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8"), ADDED, text), encoding="utf-8")


def simulated(folder: Path, effect: str) -> Path:
    """A session of the thesis' size with the effect."""
    path = folder / "thesis.h5"
    words = ["simulate", "--protocol", "thesis", "--effect", effect, "--seed", "3", "--out", str(path)]
    run(ROOT, ["-m", "fingerlab", *words])
    return path


if __name__ == "__main__":
    main()
