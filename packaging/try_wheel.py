"""Install the wheel where nothing else is, and try it: ``python packaging/try_wheel.py`` in ``.venv``.

A new environment gets the locked dependencies and the wheel, as on a machine that has never seen the
project; with ``--here`` it borrows the dependencies of the running environment, which takes no network and
seconds. Then, in an empty folder: ``fingerlab --version``, ``simulate``, ``diagnose``, and a window off
screen that opens the session. Ends with 0, or with 1 where something failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Sequence
from pathlib import Path

import distribution
from bundle import TRIAL, BundleError, bare_environment, call

ROOT = Path(__file__).resolve().parents[1]


def make_environment(folder: Path, wheel: Path, here: bool) -> Path:
    """A new environment with the wheel in it; returns its folder of programs.

    Args:
        here: borrow the dependencies of the running environment instead of installing the locked ones.

    Raises:
        BundleError: pip failed.
    """
    venv.EnvBuilder(with_pip=True).create(folder)
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    python = programs / ("python.exe" if os.name == "nt" else "python")
    _pip(python, ["--no-deps", "--no-index", str(wheel)])
    if here:
        _borrow(folder)  # last: pip would take the checkout that lives there for the wheel
    else:
        locked = ["--require-hashes", "--no-deps", "--only-binary=:all:"]
        _pip(python, [*locked, "-r", str(ROOT / "requirements" / "app.txt")])
    return programs


def _borrow(folder: Path) -> None:
    """Let the new environment find the packages of the running one, but not its checkout in place."""
    borrowed = [p for p in sys.path if p.endswith("site-packages")]
    [own] = folder.glob("Lib/site-packages" if os.name == "nt" else "lib/python*/site-packages")
    # A path in a .pth file is searched after the environment's own packages, and its .pth files are not read.
    (own / "borrowed.pth").write_text("\n".join(borrowed) + "\n", encoding="utf-8")


def _pip(python: Path, arguments: Sequence[str]) -> None:
    command = [str(python), "-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet"]
    run = subprocess.run(
        [*command, *arguments], capture_output=True, text=True, errors="replace", check=False
    )
    if run.returncode != 0:
        raise BundleError(f"pip could not install:\n{run.stdout}{run.stderr}")


def try_wheel(programs: Path, folder: Path) -> None:
    """Run the installed program in ``folder`` and print the time that each call took.

    Raises:
        BundleError: a call failed, or the program comes from somewhere else than the environment.
    """
    suffix = ".exe" if os.name == "nt" else ""
    program, python = str(programs / f"fingerlab{suffix}"), str(programs / f"python{suffix}")
    bare = bare_environment(folder)
    _, home = call([python, "-c", "import fingerlab; print(fingerlab.__file__)"], folder, bare)
    if not Path(home.strip()).resolve().is_relative_to(programs.parent.resolve()):
        raise BundleError(f"fingerlab was found at {home.strip()} and not in the new environment.")
    for name, words in TRIAL.items():
        command = [program, *words.split()]
        if "--self-check" in words:
            command = [python, "-m", "fingerlab.ui.self_check", words.split()[-1]]
        seconds, said = call(command, folder, bare)
        lines = [line for line in said.splitlines() if line.strip()]
        print(f"  {name:10} {seconds:5.1f} s  {lines[0] if lines else ''}", flush=True)


def main(arguments: list[str]) -> int:
    """Build, install, try."""
    parser = argparse.ArgumentParser(description="Install the wheel into a new environment and try it.")
    parser.add_argument("--here", action="store_true", help="borrow this environment's dependencies")
    given = parser.parse_args(arguments)
    try:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            place = Path(folder)
            wheel, sdist = distribution.build_both(place / "dist")
            for path in (wheel, sdist):
                print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB", flush=True)
            started = time.perf_counter()
            programs = make_environment(place / "env", wheel, given.here)
            print(f"installed in {time.perf_counter() - started:.0f} s", flush=True)
            (place / "work").mkdir()
            try_wheel(programs, place / "work")
    except (BundleError, RuntimeError) as error:
        print(f"try_wheel.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
