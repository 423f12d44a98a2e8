"""The three things that ``start.py`` does: open the application, run the tests, pass a command on."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from .display import qt_platform, why_none
from .environment import prepare
from .installing import child_environment
from .messages import SetupError
from .places import Places, here
from .practice import practise

USAGE = """\
python start.py                 open FingerLab (without a display: practise from the command line)
python start.py FILE...         open it with these session files
python start.py test [ARGS]     run every test, or what pytest's ARGS choose
python start.py COMMAND [ARGS]  run a command, as 'fingerlab COMMAND'; --help after it explains it

The first start makes .venv and installs the locked dependencies; later starts install nothing."""

EVERY_TEST = ("-n", "2", "--dist", "loadfile", "--no-loadscope-reorder")
"""The whole suite runs in two processes, a file at a time; what somebody picks by hand runs in one. In the
order of their names, for files with few tests hold the longest: last, they leave one process waiting."""


def main(arguments: Sequence[str]) -> int:
    """Do what the command line asks for and return its exit code."""
    try:
        return _run(here(), list(arguments))
    except SetupError as obstacle:
        print(f"FingerLab: {obstacle}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return 130


def _run(places: Places, arguments: list[str]) -> int:
    if arguments in (["-h"], ["--help"]):
        print(USAGE)
        return 0
    if arguments[:1] == ["test"]:
        prepare(places, "test", "offscreen")
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
        os.chdir(places.root)
        return _become(places, ["-m", "pytest", *(arguments[1:] or EVERY_TEST)])
    files = bool(arguments) and Path(arguments[0]).suffix.lower() == ".h5" and Path(arguments[0]).is_file()
    if arguments and not files:
        prepare(places, "app", "")
        return _become(places, ["-m", "fingerlab", *arguments])
    platform = qt_platform()
    if files and not platform:
        raise SetupError(
            f"{why_none()}, so that no window can show {arguments[0]}; "
            f"'python start.py diagnose {arguments[0]}' says what is missing from its model."
        )
    prepare(places, "app", platform)
    if not platform:
        return practise(places, why_none())
    return _become(places, ["-m", "fingerlab", *arguments])


def _become(places: Places, arguments: list[str]) -> int:
    """Hand over to the environment's Python; returns only where the system cannot replace a process."""
    command = [str(places.python), *arguments]
    environment = child_environment()
    if "pytest" in arguments:  # tests start modules of the folder of tests
        del environment["PYTHONSAFEPATH"]
    if sys.platform != "win32":
        sys.stdout.flush()
        sys.stderr.flush()
        os.execve(command[0], command, environment)
    with subprocess.Popen(command, env=environment) as process:
        while True:
            try:
                return process.wait()
            except KeyboardInterrupt:
                continue  # Ctrl-C reached the child as well; it decides how to end.
