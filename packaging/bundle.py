"""Make the packaged program, dist/FingerLab, and try it: ``python packaging/bundle.py`` in ``.venv``.

Works the same on Linux, Windows and macOS, and makes a program for the system that it runs on. PyInstaller
comes from ``requirements/bundle.txt`` into ``build/bundle/tools``, and FingerLab as a wheel into
``build/bundle/site``: the environment itself stays as it is. Then the program is tried off screen, in an
empty folder: ``--version``, ``simulate``, ``diagnose``, and a window that opens the session and all tabs.

Ends with 0; with 1 where something failed; with 3 where PyInstaller could not be installed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import distribution

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "bundle"
DIST = ROOT / "dist"
PROGRAM = DIST / "FingerLab"
NO_PYINSTALLER = 3
STEP_LIMIT_S = 600
"""A step of the trial that has not ended by then is stuck."""
TRIAL = {
    "--version": "--version",
    "simulate": "simulate --protocol on-air --effect coulomb_friction --seed 7 --out session.h5",
    "again": "simulate --protocol contact --seed 7 --out contact.h5",
    "diagnose": "diagnose session.h5",
    "window": "--self-check session.h5",
}
"""What a program is tried with. Its second simulation finds the code that the first one compiled."""


class BundleError(Exception):
    """A step failed; says which, and what was printed."""


def install_tools(target: Path) -> str:
    """Put PyInstaller into ``target``; returns what pip said where it could not, else an empty text."""
    locked = ROOT / "requirements" / "bundle.txt"
    done = target.with_name("tools.lock")
    if done.is_file() and done.read_bytes() == locked.read_bytes():
        return ""
    shutil.rmtree(target, ignore_errors=True)
    pip = [sys.executable, "-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet"]
    pip += [
        "--require-hashes",
        "--no-deps",
        "--only-binary=:all:",
        "--target",
        str(target),
        "-r",
        str(locked),
    ]
    run = subprocess.run(pip, capture_output=True, text=True, errors="replace", check=False)
    if run.returncode != 0:
        return (run.stdout + run.stderr).strip()
    shutil.copy(locked, done)
    return ""


def install_fingerlab(target: Path) -> Path:
    """Unpack a fresh wheel of this checkout into ``target``; returns the wheel."""
    shutil.rmtree(target, ignore_errors=True)
    with tempfile.TemporaryDirectory() as folder:
        source = distribution.copy_source(Path(folder) / "source")
        wheel = distribution.build("wheel", source, DIST)
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(target)
    return wheel


def build() -> float:
    """Let PyInstaller make the folder; returns the seconds it took.

    Raises:
        BundleError: it failed.
    """
    paths = os.pathsep.join(str(WORK / name) for name in ("site", "tools"))
    command = [sys.executable, "-m", "PyInstaller", "--noconfirm", "--log-level", "WARN"]
    command += ["--distpath", str(DIST), "--workpath", str(WORK / "work")]
    command += [str(ROOT / "packaging" / "fingerlab.spec")]
    # Before the environment's own packages, so that the wheel is found and not the checkout.
    environment = {**os.environ, "PYTHONPATH": paths, "QT_QPA_PLATFORM": "offscreen"}
    started = time.perf_counter()
    run = subprocess.run(
        command, cwd=WORK, env=environment, capture_output=True, text=True, errors="replace", check=False
    )
    if run.returncode != 0:
        raise BundleError(f"PyInstaller failed:\n{run.stdout[-4000:]}{run.stderr[-4000:]}")
    return time.perf_counter() - started


def size_of(folder: Path) -> int:
    """Bytes of all files below ``folder``; a link counts nothing."""
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file() and not p.is_symlink())


def try_program(program: Path, folder: Path) -> None:
    """Run the packaged program in ``folder`` and print the time that each call took.

    Raises:
        BundleError: a call failed.
    """
    bare = bare_environment(folder)
    for name, words in TRIAL.items():
        seconds, said = call([str(program), *words.split()], folder, bare)
        lines = [line for line in said.splitlines() if line.strip()]
        print(f"  {name:10} {seconds:5.1f} s  {lines[0] if lines else ''}", flush=True)


def bare_environment(home: Path) -> dict[str, str]:
    """An environment in which nothing of this checkout and of this user's settings can be found."""
    kept = {k: v for k, v in os.environ.items() if not k.upper().startswith(("PYTHON", "VIRTUAL_ENV", "QT_"))}
    settings = home / "settings"
    return {**kept, "QT_QPA_PLATFORM": "offscreen", "FINGERLAB_SETTINGS_DIR": str(settings)}


def call(command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> tuple[float, str]:
    """Run a command in ``folder``; returns seconds and what it printed, on standard output if anything.

    Raises:
        BundleError: it ended with something else than 0, or not at all.
    """
    started = time.perf_counter()
    try:
        run = subprocess.run(
            command,
            cwd=folder,
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            encoding="utf-8",
            errors="replace",
            timeout=STEP_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise BundleError(f"{' '.join(command)} did not end within {STEP_LIMIT_S} s.") from None
    if run.returncode != 0:
        raise BundleError(f"{' '.join(command)} ended with {run.returncode}:\n{run.stdout}{run.stderr}")
    return time.perf_counter() - started, run.stdout or run.stderr


def largest_parts(folder: Path, count: int = 8) -> str:
    """The largest folders of the program, in MB, in one line."""
    inside = folder / "_internal"
    parts = [p for p in inside.iterdir() if not p.is_symlink()]
    sizes = {p.name: size_of(p) if p.is_dir() else p.stat().st_size for p in parts}
    best = sorted(sizes.items(), key=lambda item: -item[1])[:count]
    return ", ".join(f"{name} {size / 1e6:.0f}" for name, size in best)


def main(arguments: list[str]) -> int:
    """Build, report the size, and try it."""
    parser = argparse.ArgumentParser(description="Make the packaged program and try it.")
    parser.add_argument("--no-build", action="store_true", help="only try the program that is in dist/")
    given = parser.parse_args(arguments)
    executable = PROGRAM / ("FingerLab.exe" if os.name == "nt" else "FingerLab")
    try:
        if not given.no_build:
            obstacle = install_tools(WORK / "tools")
            if obstacle:
                print(f"bundle.py: PyInstaller cannot be installed here: {obstacle}", file=sys.stderr)
                return NO_PYINSTALLER
            wheel = install_fingerlab(WORK / "site")
            print(f"{wheel.name}: {wheel.stat().st_size / 1000:.0f} kB", flush=True)
            print(f"dist/FingerLab made in {build():.0f} s", flush=True)
        print(f"size {size_of(PROGRAM) / 1e6:.0f} MB ({largest_parts(PROGRAM)})", flush=True)
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            try_program(executable, Path(folder))
    except (BundleError, RuntimeError) as error:
        print(f"bundle.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
