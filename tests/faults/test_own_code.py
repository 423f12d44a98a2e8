"""A session's folder is as safe as a picture's: what lies in it is never run, whatever its name is."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import write_plain_session

NAMES = ("signal", "struct", "pickle", "socket", "numpy", "h5py", "matplotlib", "fingerlab_local")
MOTION = json.dumps(
    {"kind": "sine", "amplitude_deg": 5, "frequency_hz": 2, "offset_deg": 22, "duration_s": 0.5}
)


def trapped(folder: Path) -> Path:
    """Modules that tell of themselves when they are run, beside two sessions; where they tell it."""
    told = folder / "told"
    for name in NAMES:
        line = f"open({str(told)!r}, 'a').write('{name} ')\nraise ImportError('a stranger')\n"
        (folder / f"{name}.py").write_text(line, encoding="utf-8")
    (folder / "matplotlibrc").write_text(
        "backend: nothing\nfont.size: many\nfigure.facecolor: red\n", "utf-8"
    )
    for name in ("a.h5", "b.h5"):
        write_plain_session(folder / name, samples=100)
    return told


def run_in(folder: Path, *arguments: str, start: tuple[str, ...]) -> str:
    environment = {key: value for key, value in os.environ.items() if key not in ("MPLBACKEND", "PYTHONPATH")}
    command = [sys.executable, *start, *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=100)
    assert "Traceback" not in done.stderr, done.stderr
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("batch", ".", "--out", "t.parquet", "--jobs", "2"),
        ("record", "--device", "simulated", "--real-time", "--trajectory", MOTION, "--phase", "on_air",
         "--cable", "extension", "--rest", "0", "--yes", "--out", "r.h5"),
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_nothing_beside_a_session_is_run(
    arguments: tuple[str, ...], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """As the installed command starts: a script in another folder."""
    script = tmp_path_factory.mktemp("bin") / "fingerlab-script.py"
    lines = "from fingerlab.cli import main\nif __name__ == '__main__':\n    main()\n"
    script.write_text(lines, encoding="utf-8")
    told = trapped(tmp_path)
    run_in(tmp_path, *arguments, start=(str(script),))
    assert not told.exists(), told.read_text(encoding="utf-8")


def test_figures_have_settings_of_their_own(tmp_path: Path) -> None:
    trapped(tmp_path)
    asks = "import fingerlab.report.figure_style, matplotlib as m; print(m.rcParams['figure.facecolor'])"
    assert run_in(tmp_path, start=("-P", "-c", asks)).strip() == "white"


def test_nor_by_start(tmp_path: Path) -> None:
    told = tmp_path / "told"
    for name in ("fingerlab", "signal"):
        (tmp_path / f"{name}.py").write_text(f"open({str(told)!r}, 'w')", encoding="utf-8")
    sys.path.insert(0, str(Path(__file__).parents[2] / "packaging"))
    from bootstrap.installing import child_environment

    environment = {**child_environment(), "FINGERLAB_SETTINGS_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "fingerlab", "--version"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert not told.exists()
