"""A small checkout to start: the real ``start.py`` and starter, a real pip, and a project of two tiny wheels.

The wheels lie in a folder, so that pip needs no network and a start takes seconds; what would take minutes
(Qt, scipy ...) is replaced, the code under test is not.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

PYPROJECT = """\
[build-system]
requires = ["tinybackend"]
build-backend = "tinybackend"

[project]
name = "fingerlab"
version = "0.1.0"
"""

BACKEND = '''\
"""The least that pip accepts as a build backend: an editable install by a path file."""
import base64, hashlib, os, zipfile

def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    name = "fingerlab-0.1.0-py3-none-any.whl"
    info = "fingerlab-0.1.0.dist-info/"
    files = {
        "fingerlab.pth": os.getcwd() + "\\n",
        info + "METADATA": "Metadata-Version: 2.1\\nName: fingerlab\\nVersion: 0.1.0\\n",
        info + "WHEEL": "Wheel-Version: 1.0\\nGenerator: tiny\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n",
    }
    with zipfile.ZipFile(os.path.join(wheel_directory, name), "w") as wheel:
        record = ""
        for path, text in files.items():
            data = text.encode()
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record += f"{path},sha256={digest},{len(data)}\\n"
            wheel.writestr(path, data)
        wheel.writestr(info + "RECORD", record + info + "RECORD,,\\n")
    return name
'''

RECORDER = '''\
"""Stands for the program that is started: notes how it was called and writes what it was told to write."""
import json, os, pathlib, sys

arguments = sys.argv[1:]
with open(os.environ["CALLS"], "a", encoding="utf-8") as stream:
    call = {"program": __package__, "arguments": arguments, "cwd": os.getcwd()}
    call["platform"] = os.environ.get("QT_QPA_PLATFORM", "")
    stream.write(json.dumps(call) + "\\n")
if "--out" in arguments:
    with open(arguments[arguments.index("--out") + 1], "x", encoding="utf-8") as out:
        out.write("written once")
sys.exit(7 if arguments[:1] == [os.environ.get("FAILS", "-")] else 0)
'''


def make_wheel(folder: Path, name: str, files: Mapping[str, str]) -> str:
    """Write a wheel of version 1.0 and return its line for a lock file."""
    info = f"{name}-1.0.dist-info/"
    contents = {
        **files,
        info + "METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n",
        info + "WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = ""
    path = folder / f"{name}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as wheel:
        for inside, text in contents.items():
            digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
            record += f"{inside},sha256={digest},{len(text.encode())}\n"
            wheel.writestr(inside, text)
        wheel.writestr(info + "RECORD", record + info + "RECORD,,\n")
    return f"{name}==1.0 --hash=sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}\n"


@dataclass
class Checkout:
    """A checkout in a folder with a space in its name, and the means to start it."""

    root: Path
    wheels: Path
    calls_file: Path
    settings: dict[str, str] = field(default_factory=dict)

    def environment(self, **settings: str) -> dict[str, str]:
        """This process's environment without pip's and the display's settings, and with ``settings``."""
        kept = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith("PIP_") and name not in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
        }
        local = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": self.wheels.as_uri(), "PIP_CONFIG_FILE": os.devnull}
        return {**kept, **local, "CALLS": str(self.calls_file), **self.settings, **settings}

    def begin(self, *arguments: str, **settings: str) -> subprocess.Popen[str]:
        """Start ``start.py`` from another folder and return at once."""
        return subprocess.Popen(
            [sys.executable, str(self.root / "start.py"), *arguments],
            cwd=self.root.parent,
            env=self.environment(**settings),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
        )

    def start(self, *arguments: str, **settings: str) -> subprocess.CompletedProcess[str]:
        """Run ``start.py`` to its end."""
        process = self.begin(*arguments, **settings)
        out, err = process.communicate(timeout=120)
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    def calls(self) -> list[dict[str, object]]:
        """How the started programs were called, since the last time this was asked."""
        if not self.calls_file.exists():
            return []
        lines = self.calls_file.read_text(encoding="utf-8").splitlines()
        self.calls_file.unlink()
        return [json.loads(line) for line in lines]

    def replace_libraries(self, names: Sequence[str]) -> None:
        """Let the starter look for these system libraries only, each in a package named after it."""
        path = self.root / "packaging" / "bootstrap" / "libraries.py"
        head, _, tail = path.read_text(encoding="utf-8").partition("ALWAYS = {")
        rest = tail[tail.index("}") + 1 :]
        table = ", ".join(f'"{name}": "package-of-{name}"' for name in names)
        path.write_text(f"{head}ALWAYS = {{{table}}}{rest}", encoding="utf-8")


def build_checkout(folder: Path) -> Checkout:
    """Lay out a checkout below ``folder``."""
    root = folder / "finger lab"
    wheels = folder / "wheels"
    wheels.mkdir(parents=True)
    shutil.copytree(ROOT / "packaging" / "bootstrap", root / "packaging" / "bootstrap")
    shutil.copy(ROOT / "start.py", root)
    (root / "pyproject.toml").write_text(PYPROJECT, encoding="utf-8")
    (root / "fingerlab").mkdir()
    (root / "fingerlab" / "__init__.py").touch()
    (root / "fingerlab" / "__main__.py").write_text(RECORDER, encoding="utf-8")
    backend = make_wheel(wheels, "tinybackend", {"tinybackend.py": BACKEND})
    application = "class QApplication:\n    def __init__(self, arguments): pass\n"
    qt = {"PySide6/__init__.py": "", "PySide6/QtSvg.py": "", "PySide6/QtWidgets.py": application}
    app = backend + make_wheel(wheels, "pyside6", qt)
    tools = make_wheel(wheels, "pytest", {"pytest/__init__.py": "", "pytest/__main__.py": RECORDER})
    (root / "requirements").mkdir()
    (root / "requirements" / "app.txt").write_text(app, encoding="utf-8")
    (root / "requirements" / "test.txt").write_text(app + tools, encoding="utf-8")
    checkout = Checkout(root, wheels, folder / "calls.jsonl")
    checkout.replace_libraries([])
    return checkout


@pytest.fixture(scope="session")
def make_checkout(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Checkout]:
    """Makes checkouts that outlive one test."""
    return lambda: build_checkout(tmp_path_factory.mktemp("checkout"))
