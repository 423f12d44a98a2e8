"""Makes ``.venv``, brings it up to date, and repairs it where a start was killed half-way."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess

from . import libraries, system
from .installing import PipError, child_environment, install_locked, make_venv
from .messages import Log, SetupError, say
from .onlyone import only_one
from .places import Places
from .stamp import Stamp, read_stamp, wanted_stamp, write_stamp


def prepare(places: Places, tools: str, platform: str) -> None:
    """Have everything installed that ``tools`` needs; does nothing where it is.

    Args:
        tools: ``app`` or ``test``.
        platform: Qt platform whose system libraries are needed; empty for none.

    Raises:
        SetupError: an obstacle that the user can remove.
    """
    try:
        wanted = wanted_stamp(places, tools)
    except OSError as error:
        raise SetupError(
            f"{error.filename} is missing or cannot be read, so this copy of FingerLab is not complete; "
            "fetch it anew."
        ) from None
    if _nothing_to_do(places, wanted, platform):
        return
    with only_one(places.root / ".venv.lock"):
        try:
            _set_up(places, wanted, platform)
        except OSError as error:
            raise SetupError(
                f"{error.filename or places.venv} cannot be written ({error.strerror}); "
                "make room, or copy FingerLab to a folder that you may write to."
            ) from None


def _nothing_to_do(places: Places, wanted: Stamp, platform: str) -> bool:
    needed = libraries.needed(platform) if platform else {}
    return _complete(places, wanted) and not libraries.missing(needed)


def _complete(places: Places, wanted: Stamp) -> bool:
    held = read_stamp(places)
    return held is not None and held.serves(wanted) and places.python.exists()


def _set_up(places: Places, wanted: Stamp, platform: str) -> None:
    if _nothing_to_do(places, wanted, platform):
        return  # another start was at it while this one waited
    complete = _complete(places, wanted)
    usable = complete or _usable(places, wanted)
    if not usable:
        _set_aside(places)
        places.venv.mkdir()
        places.unfinished.touch()
    log = Log(places.log)
    system.supply(platform, need_venv=not usable, log=log)
    if complete:
        return
    say(f"installing the locked dependencies into {places.venv}; the first time this takes some minutes.")
    places.unfinished.touch()
    places.stamp.unlink(missing_ok=True)
    try:
        if not usable:
            make_venv(places, log)
        install_locked(places, wanted.tools, log)
    except PipError as obstacle:
        if obstacle.untouched:
            places.unfinished.unlink()
        raise
    if platform:
        _try_qt(places, log)
    write_stamp(places, wanted)
    places.unfinished.unlink()


def _usable(places: Places, wanted: Stamp) -> bool:
    """Whether ``.venv`` can be installed into: not cut short, in its place, of this Python, and with pip."""
    if places.unfinished.exists() or not places.python.exists():
        return False
    question = (
        "import sys, sysconfig, pip; "
        "print('%d.%d' % sys.version_info[:2], sysconfig.get_platform(), sys.prefix, sep='\\n')"
    )
    try:
        answer = subprocess.run(
            [str(places.python), "-c", question],
            capture_output=True,
            text=True,
            encoding="utf-8",
            env={**child_environment(), "PYTHONIOENCODING": "utf-8"},
            check=False,
        )
    except OSError:
        return False
    version, _, place = answer.stdout.strip().partition("\n")
    kind, _, prefix = place.partition("\n")
    return answer.returncode == 0 and f"{version} {kind}" == wanted.python and prefix == str(places.venv)


def _set_aside(places: Places) -> None:
    """Remove an unusable ``.venv``.

    It is renamed first, so that a start killed while removing leaves no environment that looks whole.
    """
    for remains in places.root.glob(".venv-old-*"):
        shutil.rmtree(remains, ignore_errors=True)
    if not places.venv.exists() and not places.venv.is_symlink():
        return
    say(f"{places.venv} is incomplete or of another Python; making it anew.")
    aside = places.root / f".venv-old-{os.getpid()}"
    try:
        places.venv.rename(aside)
    except OSError as error:
        raise SetupError(
            f"{places.venv} cannot be replaced ({error.strerror}); "
            "close every program that runs from it and start again."
        ) from None
    if aside.is_symlink():
        aside.unlink()
    else:
        shutil.rmtree(aside, ignore_errors=True)


def _try_qt(places: Places, log: Log) -> None:
    """Open Qt once, off screen: a library that no list names shows itself here and not in the window.

    Raises:
        SetupError: Qt does not start; names the library where the loader named one.
    """
    question = "from PySide6 import QtSvg, QtWidgets; QtWidgets.QApplication([])"
    tried = subprocess.run(
        [str(places.python), "-c", question],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env={**child_environment(), "QT_QPA_PLATFORM": "offscreen"},
        check=False,
    )
    if tried.returncode == 0:
        return
    log.add(tried.stdout)
    with contextlib.suppress(OSError):
        places.unfinished.unlink()
    last = (tried.stdout.strip().splitlines() or ["it gave no reason"])[-1]
    raise SetupError(f"Qt does not start on this machine: {last.rstrip('.')}; see {log.path}.")
