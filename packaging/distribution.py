"""Make wheel and sdist: ``python packaging/distribution.py [FOLDER]`` in ``.venv``; FOLDER is else ``dist/``.

Both are built from a copy, so that nothing that an earlier build or an editable install left in the checkout
can get into them, and without isolation, so that no network is needed: the lock files hold the build backend.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("fingerlab", "ui", "resources", "docs")
FILES = ("pyproject.toml", "README.md")
OPTIONAL_FILES = ("CHANGELOG.md", "CITATION.cff", "LICENSE", "MANIFEST.in")
LAST_LINES = 15
"""Of what a failed build printed: its reason stands at the end."""
LEAVE_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", "*.nbi", "*.nbc", "*.egg-info")
CALL_BACKEND = (
    "import sys; from setuptools import build_meta; "
    "print('made=' + getattr(build_meta, 'build_' + sys.argv[1])(sys.argv[2]))"
)


def copy_source(target: Path, root: Path = ROOT) -> Path:
    """Copy what a package is made of from ``root`` into the new folder ``target``."""
    target.mkdir(parents=True)
    for folder in FOLDERS:
        shutil.copytree(root / folder, target / folder, ignore=LEAVE_OUT)
    for name in (*FILES, *(n for n in OPTIONAL_FILES if (root / n).exists())):
        shutil.copy(root / name, target / name)
    # The pages that are made from the program, which the packaged one could not make.
    subprocess.run([sys.executable, str(root / "docs" / "generate.py"), str(target / "docs")], check=True)
    return target


def build(kind: str, source: Path, into: Path) -> Path:
    """Build one package from a source folder with the project's own build backend.

    Args:
        kind: ``wheel`` or ``sdist``. source: folder of ``pyproject.toml``; the build leaves files in it.
        into: folder of the package; made where it is absent.

    Raises:
        RuntimeError: the backend failed; holds what it said.
    """
    into.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(
        [sys.executable, "-c", CALL_BACKEND, kind, str(into.resolve())],
        cwd=source,
        capture_output=True,
        text=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
    made = [line.removeprefix("made=") for line in done.stdout.splitlines() if line.startswith("made=")]
    if done.returncode != 0 or not made:
        said = "\n".join((done.stdout + done.stderr).splitlines()[-LAST_LINES:])
        raise RuntimeError(f"The {kind} could not be built:\n{said}")
    return into / made[-1]


def build_both(into: Path) -> tuple[Path, Path]:
    """Wheel and sdist of this checkout, in ``into``."""
    with tempfile.TemporaryDirectory() as folder:
        source = copy_source(Path(folder) / "source")
        return build("wheel", source, into), build("sdist", source, into)


def main(arguments: list[str]) -> int:
    """Build both and say how large they are."""
    for path in build_both(Path(arguments[0]) if arguments else ROOT / "dist"):
        print(f"{path}  {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
