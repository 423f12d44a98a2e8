"""Where the packaged program begins: as ``python -m fingerlab`` does, and two things that only it is asked.

``FingerLab SESSION.h5 ...`` opens the window with these sessions: so Windows and Linux hand over a file that
was dropped on the program or opened with it (macOS does not; drop it on the window there).
``FingerLab --self-check SESSION.h5`` opens a session and ends.
"""

from __future__ import annotations

import multiprocessing
import sys
from importlib import import_module
from pathlib import Path

SESSION_ENDINGS = (".h5", ".hdf5")


def are_sessions(arguments: list[str]) -> bool:
    """Whether the arguments name files to open and no command."""
    return bool(arguments) and all(
        Path(a).suffix.lower() in SESSION_ENDINGS and Path(a).is_file() for a in arguments
    )


def begin(arguments: list[str]) -> int:
    """Do what the arguments ask for; returns the exit code."""
    if arguments[:1] == ["--self-check"]:
        return int(import_module("fingerlab.ui.self_check").main(arguments[1:]))
    if are_sessions(arguments):
        return int(import_module("fingerlab.ui.app.application").run(arguments))
    from fingerlab.cli import main

    main(arguments)  # ends the process itself
    return 0


if __name__ == "__main__":
    multiprocessing.freeze_support()  # a spawned worker of a packaged program starts here too
    sys.exit(begin(sys.argv[1:]))
