"""The main job without a window: a practice session, its diagnosis, and the page to hand on."""

from __future__ import annotations

import secrets
import subprocess
from collections.abc import Sequence

from .installing import child_environment
from .places import Places


def practise(places: Places, reason: str) -> int:
    """Simulate a session with a hidden effect, diagnose it, and write the report page.

    Files that are there from an earlier start are used again, never overwritten.

    Args:
        reason: why no window is opened.

    Returns:
        Exit code of the first command that failed, or 0.
    """
    session = places.output / "practice.h5"
    page = places.output / "practice.html"
    print(
        f"FingerLab: {reason}, so no window is opened; "
        "the same job runs here from the command line, on a practice session with a hidden effect.",
        flush=True,
    )
    places.output.mkdir(exist_ok=True)
    steps: list[list[str]] = []
    if session.exists():
        print(f"The session {session} is there from an earlier start and is used again.", flush=True)
    else:
        seed = str(secrets.randbelow(100_000))
        simulate = ["simulate", "--protocol", "thesis", "--practice", "--seed", seed, "--out", str(session)]
        steps.append(simulate)
    steps.append(["diagnose", str(session)])
    if not page.exists():
        steps.append(["report", str(session), "--out", str(page)])
    for step in steps:
        code = _show_and_run(places, step)
        if code != 0:
            return code
    print(f"\nThe report page: {page}")
    print(f"Put what was found into the model: python start.py diagnose {_quoted(str(session))} --add EFFECT")
    print(f"The hidden effect: python start.py reveal {_quoted(str(session))}")
    print("With recordings of your own: python start.py diagnose FILE, or python start.py import --help")
    print("With a display, python start.py opens the window; its Model lab does the same by hand.")
    print(f"Remove {places.output} to practise on another session.", flush=True)
    return 0


def _show_and_run(places: Places, step: Sequence[str]) -> int:
    print(f"\n$ fingerlab {' '.join(_quoted(word) for word in step)}", flush=True)
    command = [str(places.python), "-m", "fingerlab", *step]
    return subprocess.run(command, env=child_environment(), check=False).returncode


def _quoted(word: str) -> str:
    return f'"{word}"' if " " in word else word
