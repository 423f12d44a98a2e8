"""Goldens taken by processes with one thread each, so that every sum is made in one order."""

from __future__ import annotations

import json
import multiprocessing
import os
import platform
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from tests.goldens.items import Item

FORMAT = 1
ROOT = Path(__file__).resolve().parents[2]
SESSIONS_AT_A_TIME = 20
"""After so many the processes end and give back what they hold. ``max_tasks_per_child`` would do the same,
but Python 3.11 then waits for ever for a process that it has not started (python/cpython issue 115634)."""
PINNED = {
    **dict.fromkeys(
        (
            "OMP_NUM_THREADS",
            "OPENBLAS_NUM_THREADS",
            "MKL_NUM_THREADS",
            "VECLIB_MAXIMUM_THREADS",
            "NUMEXPR_NUM_THREADS",
            "NUMBA_NUM_THREADS",
        ),
        "1",
    ),
    "MPLBACKEND": "Agg",
    "QT_QPA_PLATFORM": "offscreen",
    # Effects and devices that somebody made for themselves on this machine take no part.
    "FINGERLAB_SETTINGS_DIR": str(ROOT / "tests" / "no-settings"),
    "COLUMNS": "128",
}
"""The environment of every process that takes goldens; it must stand before numpy is imported."""


@dataclass
class Taken:
    """What a process gives back: the golden, or why there is none.

    Attributes:
        content: hashes of the session's channels. anew: those of the same session made once more.
        steps: answers by step. seconds: that each took.
    """

    name: str
    content: dict[str, Any] = field(default_factory=dict)
    anew: dict[str, Any] | None = None
    steps: dict[str, Any] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    failed: str = ""


def take_all(
    work: Sequence[tuple[Item, Sequence[str]]], sessions: Path, jobs: int, made_anew: bool
) -> Iterator[Taken]:
    """Take the steps of each item, as they come.

    Args:
        sessions: folder of the session files, made where they are missing. jobs: processes.
        made_anew: whether each session is made once more, too, to see whether the simulator makes the same.
    """
    for start in range(0, len(work), SESSIONS_AT_A_TIME):
        yield from _some(work[start : start + SESSIONS_AT_A_TIME], sessions, jobs, made_anew)


def _some(
    work: Sequence[tuple[Item, Sequence[str]]], sessions: Path, jobs: int, made_anew: bool
) -> Iterator[Taken]:
    context = multiprocessing.get_context("spawn")
    with _environment(), ProcessPoolExecutor(min(jobs, len(work)), context, _begin) as pool:
        ask = partial(pool.submit, _take)
        tasks = [ask(item, tuple(steps), sessions, made_anew) for item, steps in work]
        try:
            for task in as_completed(tasks):
                yield task.result()
        finally:
            for task in tasks:
                task.cancel()


@contextmanager
def _environment() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in PINNED}
    os.environ.update(PINNED)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _begin() -> None:
    """One core is all that the program is shown: it then starts no second process to share the reading."""
    os.cpu_count = lambda: 1


def _take(item: Item, steps: Sequence[str], sessions: Path, made_anew: bool) -> Taken:
    from tests.goldens.sessions import content, files_of
    from tests.goldens.taking import take

    try:
        paths = files_of(item, sessions)
        found = Taken(item.name, {path.name: content(path) for path in paths})
        if made_anew and item.recording is None:
            found.anew = _made_anew(item, sessions)
        found.steps, found.seconds = take(item, paths, steps)
    except Exception as error:  # the others go on
        return Taken(item.name, failed=f"{type(error).__name__}: {error}")
    return found


def _made_anew(item: Item, sessions: Path) -> dict[str, Any]:
    from tests.goldens.sessions import content, files_of

    folder = sessions / f"{item.name}.anew"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    proposal = sessions / f"{item.name}-proposed.json"
    if proposal.exists():  # the same run is taken, whatever would be proposed now
        shutil.copyfile(proposal, folder / proposal.name)
    try:
        return {path.name: content(path) for path in files_of(item, folder)}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def write(folder: Path, taken: Taken) -> None:
    """Add what was taken to the golden of that name, which appears whole or not at all."""
    path = folder / f"{taken.name}.json"
    known = read(path) or {"steps": {}, "seconds": {}}
    golden = {
        "format": FORMAT,
        "name": taken.name,
        "content": taken.content,
        "steps": {**known["steps"], **taken.steps},
        "seconds": {**known["seconds"], **taken.seconds},
    }
    part = path.with_suffix(".part")
    part.write_text(json.dumps(golden, indent=0, ensure_ascii=False), encoding="utf-8")
    part.replace(path)


def read(path: Path) -> dict[str, Any] | None:
    """A stored golden; None: there is none."""
    if not path.exists():
        return None
    golden: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return golden


def machine() -> dict[str, str]:
    """What the last bits depend on apart from the program: processor, system and libraries."""
    from importlib.metadata import version

    names = ("numpy", "scipy", "h5py", "numba", "matplotlib", "fpdf2", "pypdf", "mujoco")
    libraries = {name: version(name) for name in names}
    return {
        "processor": _processor(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **libraries,
    }


def _processor() -> str:
    told = Path("/proc/cpuinfo")
    if told.exists():
        lines = told.read_text(encoding="utf-8").splitlines()
        return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
    return platform.processor()


def commit() -> str:
    """The commit of the program's code in this place; empty where git does not tell."""
    try:
        done = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip()
