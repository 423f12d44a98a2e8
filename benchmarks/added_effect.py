"""Seconds until an added effect is judged, and of a whole diagnosis, beside those of an earlier revision.

    python -m benchmarks.added_effect BASE [--session S.h5] [--effect ID] [--repeats 5]

BASE is a git worktree of the earlier revision that its own Python can run (``BASE/.venv`` or this one). Both
programs take turns in processes of their own, so that what else the machine does strikes both alike; ratios
of the quickest are told. Processor time is kept beside wall time for the same reason.

``add`` is what the window does after a first diagnosis of the same sessions, curves and proposal included;
``diagnose`` is the command, with and without ``--add``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.machine import load_average, machine_words

ROOT = Path(__file__).resolve().parent.parent
ADDING = """
import json, sys, time
from fingerlab.sessions import open_session
try:
    from fingerlab.diagnosis import diagnose
except ImportError:
    from fingerlab.identify.diagnosis import diagnose
sessions = (open_session(sys.argv[1]),)
known = {}
try:
    from fingerlab.diagnosis.gram.reduction import Reduction
    known["kept"] = Reduction(sessions)
except ImportError:
    pass
diagnose(sessions, **known)
wall, processor = time.perf_counter(), time.process_time()
diagnose(sessions, (sys.argv[2],), **known)
print(json.dumps([time.perf_counter() - wall, time.process_time() - processor]))
"""
"""Run in either program; the earlier one keeps nothing of a session between two diagnoses."""


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


def added(root: Path, session: Path, effect: str) -> tuple[float, float]:
    """Wall and processor time of an added effect after a first diagnosis, s."""
    wall, processor = json.loads(run(root, ["-c", ADDING, str(session), effect]))
    return wall, processor


def diagnosed(root: Path, session: Path, *more: str) -> tuple[float, float]:
    """Wall time of the command by its own account, s, twice: its processes are not looked at."""
    said = json.loads(run(root, ["-m", "fingerlab", "diagnose", str(session), *more, "--json", "-"]))
    return said["seconds"], said["seconds"]


def main() -> None:
    """Measure both in turns and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("base", type=Path)
    parser.add_argument("--session", type=Path)
    parser.add_argument("--effect", default="coulomb_friction")
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        session = (asked.session or simulated(Path(folder), asked.effect)).resolve()
        steps = {
            "add": lambda root: added(root, session, asked.effect),
            "diagnose": lambda root: diagnosed(root, session),
            "diagnose --add": lambda root: diagnosed(root, session, "--add", asked.effect),
        }
        print(f"{machine_words()}, load {load_average():.1f} at the start")
        print("| step | before, s | after, s | ratio | ratio of processor time |\n|---|---|---|---|---|")
        for name, step in steps.items():
            pairs = [(step(asked.base.resolve()), step(ROOT)) for _ in range(asked.repeats)]
            before, after = (min(pair[k][0] for pair in pairs) for k in (0, 1))
            share = min(pair[1][1] for pair in pairs) / min(pair[0][1] for pair in pairs)
            print(f"| {name} | {before:.2f} | {after:.2f} | {after / before:.2f} | {share:.2f} |", flush=True)


def simulated(folder: Path, effect: str) -> Path:
    """A session of the thesis' size with the effect."""
    path = folder / "thesis.h5"
    words = ["simulate", "--protocol", "thesis", "--effect", effect, "--seed", "3", "--out", str(path)]
    run(ROOT, ["-m", "fingerlab", *words])
    return path


if __name__ == "__main__":
    main()
