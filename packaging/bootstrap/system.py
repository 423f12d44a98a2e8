"""What only the system's package manager supplies: Qt's libraries, and ``venv``, which Debian splits off."""

from __future__ import annotations

import importlib
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence

from . import libraries
from .installing import child_environment
from .messages import Log, SetupError, say

APT = ["apt-get", "-o", "DPkg::Lock::Timeout=120", "-y"]
"""An unattended upgrade may hold the package database for a while after a boot."""


def lacks_venv() -> bool:
    """Whether this Python cannot make environments (Debian ships that part separately)."""
    importlib.invalidate_caches()
    return any(importlib.util.find_spec(name) is None for name in ("venv", "ensurepip"))


def venv_package() -> str:
    """Debian's and Ubuntu's package of ``venv`` for the running Python."""
    return f"python{sys.version_info[0]}.{sys.version_info[1]}-venv"


def supply(platform: str, need_venv: bool, log: Log) -> None:
    """See to it that Qt's libraries for ``platform`` are there, and ``venv`` where it is needed.

    Args:
        platform: Qt platform, or an empty text where no window is to be opened.
        need_venv: whether an environment will be made.

    Raises:
        SetupError: something is missing that may not or could not be installed; says what to do.
    """
    wanted = libraries.needed(platform) if platform else {}
    absent = libraries.missing(wanted)
    no_venv = need_venv and lacks_venv()
    if not absent and not no_venv:
        return
    packages = sorted({wanted[name] for name in absent}) + ([venv_package()] if no_venv else [])
    what = _what_is_missing(absent, no_venv)
    if not shutil.which("apt-get"):
        raise SetupError(f"This machine lacks {what}; install the packages of your system that hold them.")
    command = f"apt-get install -y {' '.join(packages)}"
    prefix = _privilege()
    if prefix is None:
        raise SetupError(f"This machine lacks {what}; run: sudo {command}")
    say(f"this machine lacks {what}; installing the system packages {', '.join(packages)}.")
    _apt_install(prefix, packages, log)
    absent = libraries.missing(wanted)
    no_venv = need_venv and lacks_venv()
    if absent or no_venv:
        raise SetupError(
            f"This machine still lacks {_what_is_missing(absent, no_venv)} after '{command}'; see {log.path}."
        )


def _what_is_missing(absent: Sequence[str], no_venv: bool) -> str:
    parts = []
    if absent:
        kind = "library" if len(absent) == 1 else "libraries"
        parts.append(f"Qt's system {kind} {', '.join(absent)}")
    if no_venv:
        parts.append("Python's venv module")
    return " and ".join(parts)


def _privilege() -> list[str] | None:
    """What to put before a command so that it runs as root: nothing, sudo, or None where neither works."""
    if sys.platform == "win32":
        return None
    if os.geteuid() == 0:
        return []
    if shutil.which("sudo") is None:
        return None
    asked = subprocess.run(["sudo", "-n", "true"], capture_output=True, check=False)
    return ["sudo", "-n"] if asked.returncode == 0 else None


def _apt_install(prefix: Sequence[str], packages: Sequence[str], log: Log) -> None:
    """Install ``packages``; where that fails bring the package lists up to date and try once more."""
    apt = [*prefix, "env", "DEBIAN_FRONTEND=noninteractive", *APT]
    install = [*apt, "install", "--no-install-recommends", *packages]
    if _run(install, log) == 0:
        return
    _run([*apt, "update"], log)
    _run(install, log)


def _run(command: Sequence[str], log: Log) -> int:
    log.add(f"$ {' '.join(command)}\n")
    done = subprocess.run(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=child_environment(),
        check=False,
    )
    log.add(done.stdout)
    return done.returncode
