"""Remake the lock files: ``python packaging/lock.py`` (needs ``uv``, which is no dependency of FingerLab).

Writes ``requirements/app.txt``, ``test.txt`` and ``bundle.txt`` from ``pyproject.toml``: exact versions with
hashes for Windows, macOS and Linux and every Python from 3.11 on. The build backend is in the first two, so
that the project itself installs without building in isolation; the last holds only what makes a packaged
program. What is locked already stays unless it has to change;
``--upgrade`` takes the newest of everything.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CONSTRAINTS = "packaging/lock-constraints.txt"


def main(arguments: list[str]) -> int:
    """Remake the files; further ``arguments`` go to ``uv pip compile``."""
    uv = shutil.which("uv") or shutil.which("uv", path=str(Path(sys.executable).parent))
    if uv is None:
        print("lock.py: uv is not installed; 'pip install uv' brings it.", file=sys.stderr)
        return 1
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    backend = "\n".join(project["build-system"]["requires"])
    bundler = "\n".join(project["project"]["optional-dependencies"]["bundle"])
    same = ["--constraints", "requirements/test.txt"]
    for name, asked, extra in (
        ("test", backend, ["pyproject.toml", "--extra", "test"]),
        ("app", backend, ["pyproject.toml", *same]),
        ("bundle", bundler, same),
    ):
        command = [
            *(uv, "pip", "compile", "--universal", "--generate-hashes", "--python-version", "3.11"),
            *("--quiet", "--no-annotate", "--no-emit-index-url", "--no-emit-find-links"),
            *("--custom-compile-command", "python packaging/lock.py"),
            *("--constraints", CONSTRAINTS, *extra, *arguments),
            *("--output-file", f"requirements/{name}.txt", "-"),
        ]
        done = subprocess.run(command, cwd=ROOT, input=asked, text=True, encoding="utf-8", check=False)
        if done.returncode != 0:
            return done.returncode
        print(f"requirements/{name}.txt")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
