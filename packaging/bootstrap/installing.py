"""Calls ``venv`` and ``pip``, and turns their forty lines into one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from .messages import Log, SetupError
from .places import Places


class PipError(SetupError):
    """pip gave up.

    Attributes:
        untouched: whether it did so before it changed anything: it fetches and checks all packages first.
    """

    untouched = False


NETWORK_SIGNS = (
    "NewConnectionError",
    "Failed to establish a new connection",
    "ConnectTimeoutError",
    "ReadTimeoutError",
    "Read timed out",
    "ProxyError",
    "Temporary failure in name resolution",
    "Name or service not known",
    "getaddrinfo failed",
    "nodename nor servname",
    "Network is unreachable",
    "Connection refused",
    "Connection reset by peer",
    "Connection aborted",
    "RemoteDisconnected",
    "IncompleteRead",
)
"""What pip and urllib3 print when the index is out of reach or the line is cut."""


def child_environment() -> dict[str, str]:
    """This process's environment without what would lead another Python astray.

    A ``PYTHONPATH`` (as robot middleware sets it) would put other versions before the locked ones; pip's
    settings for other targets would install elsewhere than into the environment; what lies in the current
    folder, maybe beside a stranger's sessions, would be imported.
    """
    astray = {"PYTHONPATH", "PYTHONHOME", "PIP_TARGET", "PIP_PREFIX", "PIP_REQUIRE_HASHES", "PIP_QUIET"}
    kept = {name: value for name, value in os.environ.items() if name.upper() not in astray}
    kept["PIP_USER"] = "0"
    kept["PYTHONSAFEPATH"] = "1"
    return kept


def make_venv(places: Places, log: Log) -> None:
    """Make an empty environment in ``.venv``.

    Raises:
        SetupError: Python's ``venv`` failed.
    """
    python = sys.executable
    if Path(sys.prefix) == places.venv:
        python = getattr(sys, "_base_executable", sys.executable)
    command = [python, "-m", "venv", str(places.venv)]
    if _logged(command, log) != 0:
        raise SetupError(
            f"Python could not make the environment {places.venv}; {log.path} says why. "
            "A Python from python.org or from the system's packages can."
        )


def install_locked(places: Places, tools: str, log: Log) -> None:
    """Install the locked dependencies of ``tools`` and the project itself into ``.venv``.

    Raises:
        PipError: the package index was not reached, or anything else that pip did not get over.
    """
    pip = [str(places.python), "-m", "pip", "install", "--no-input", "--disable-pip-version-check"]
    # Without a retry pip does not say that the index was out of reach; its own five take long.
    pip += ["--retries", "3"]
    # The lock is complete, so pip needs neither to look for dependencies nor to build anything.
    locked = ["--require-hashes", "--no-deps", "--only-binary=:all:", "-r", str(places.locked(tools))]
    project = ["--no-build-isolation", "--no-deps", "--editable", str(places.root)]
    for what in (locked, project):
        if _logged([*pip, *what], log, progress=True) != 0:
            said = log.path.read_text(encoding="utf-8", errors="replace")
            said = said.rpartition("\n$ ")[2]  # the last command's words
            obstacle = PipError(explain(said, log.path))
            obstacle.untouched = "Installing collected packages" not in said
            raise obstacle


def _logged(command: Sequence[str], log: Log, progress: bool = False) -> int:
    """Run ``command``, write what it prints to the log, and return its exit code."""
    log.add(f"$ {' '.join(command)}\n")
    show = progress and sys.stderr.isatty()
    collected = 0
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        errors="replace",
        env=child_environment(),
        close_fds=os.name == "nt",  # elsewhere the lock of `only_one` is to be inherited
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            log.add(line)
            if show and line.startswith(("Collecting ", "Installing ")):
                collected += line.startswith("Collecting ")
                note = line.split("==")[0].strip()[:60]
                print(f"\r\x1b[K  {collected}  {note}", end="", file=sys.stderr, flush=True)
    if show:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)
    return process.returncode


def explain(text: str, log: Path) -> str:
    """The one sentence for what pip printed before it failed.

    Args:
        text: what pip printed.
        log: the file that holds it, to be named.
    """
    where = f"pip's own words are in {log}."
    if "No space left on device" in text or "not enough space" in text:
        return f"The disk is full: FingerLab's environment takes about 1.5 GB; {where}"
    if "CERTIFICATE_VERIFY_FAILED" in text or "certificate verify failed" in text:
        return (
            "The package index cannot be trusted, because its certificate is not known to this machine "
            f"(often a company proxy: set PIP_CERT to its certificate); {where}"
        )
    if any(sign in text for sign in NETWORK_SIGNS):
        return (
            "The network is missing: the package index could not be reached, so nothing was installed; "
            f"connect and start again (behind a proxy set HTTPS_PROXY); {where}"
        )
    if "DO NOT MATCH THE HASHES" in text:
        return f"A downloaded package is not the one that was locked, so it was refused; {where}"
    if "No matching distribution found" in text:
        package = text.split("No matching distribution found for ")[-1].split()[0]
        version = f"{sys.version_info[0]}.{sys.version_info[1]}"
        bits = 64 if sys.maxsize > 2**32 else 32
        return (
            f"There is no ready-made package of {package} for this {bits}-bit Python {version}; "
            f"a 64-bit Python 3.11 to 3.14 has them all; {where}"
        )
    errors = [line for line in text.splitlines() if line.lower().startswith("error")]
    reason = errors[-1].split(":", 1)[-1].strip().rstrip(".") if errors else "it gave no reason"
    return f"The dependencies could not be installed: {reason}; {where}"
