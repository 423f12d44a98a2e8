"""The starter's parts that a real start does not reach on every machine."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from .conftest import ROOT

START = ROOT / "start.py"
linux_only = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="concerns Linux only")


@pytest.fixture
def bootstrap(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The starter's package, as start.py finds it."""
    monkeypatch.syspath_prepend(str(ROOT / "packaging"))
    yield importlib.import_module("bootstrap")
    for name in [name for name in sys.modules if name.split(".")[0] == "bootstrap"]:
        del sys.modules[name]


def part(name: str) -> ModuleType:
    return importlib.import_module(f"bootstrap.{name}")


def test_old_python_gets_one_sentence() -> None:
    pretend = (
        "import sys, runpy; sys.version_info = (3, 8, 10, 'final', 0); "
        f"runpy.run_path({str(START)!r}, run_name='__main__')"
    )
    told = subprocess.run([sys.executable, "-c", pretend], capture_output=True, text=True, check=False)
    assert told.returncode == 1
    [sentence] = told.stderr.splitlines()
    assert sentence.startswith("FingerLab needs Python 3.11 or newer, and this is Python 3.8 (")


def test_start_has_no_syntax_that_an_old_python_cannot_read() -> None:
    tree = ast.parse(START.read_text(encoding="utf-8"), feature_version=(3, 3))
    newer = (ast.JoinedStr, ast.AnnAssign, ast.arg, ast.AsyncFunctionDef, ast.NamedExpr)
    assert not [node for node in ast.walk(tree) if isinstance(node, newer)]


@pytest.mark.parametrize("version", ["2.7", "3.6", "3.8", "3.10"])
def test_real_old_python_gets_one_sentence(version: str) -> None:
    places = [shutil.which(f"python{version}"), *Path.home().glob(f".pyenv/versions/{version}.*/bin/python")]
    runs = (
        str(python)
        for python in places
        if python and subprocess.run([python, "--version"], capture_output=True, check=False).returncode == 0
    )
    python = next(runs, None)
    if python is None:
        pytest.skip(f"there is no Python {version} on this machine")
    told = subprocess.run([python, str(START), "test"], capture_output=True, text=True, check=False)
    assert told.returncode == 1
    [sentence] = told.stderr.splitlines()
    assert sentence.startswith(f"FingerLab needs Python 3.11 or newer, and this is Python {version} (")


@pytest.mark.parametrize(
    ("printed", "sentence"),
    [
        (
            "WARNING: Retrying (Retry(total=2, ...)) after connection broken by 'NewConnectionError("
            "'<HTTPSConnection>: Failed to establish a new connection: [Errno -3] Temporary failure in name "
            "resolution')': /simple/click/\nERROR: Could not find a version that satisfies the requirement "
            "click==8.5.1 (from versions: none)\nERROR: No matching distribution found for click==8.5.1\n",
            "The network is missing",
        ),
        (
            "WARNING: Retrying (Retry(total=2, ...)) after connection broken by 'SSLError("
            "SSLCertVerificationError(1, '[SSL: CERTIFICATE_VERIFY_FAILED] certificate verify failed: "
            "unable to get local issuer certificate (_ssl.c:1006)'))': /simple/click/\n",
            "The package index cannot be trusted",
        ),
        (
            "ERROR: Could not find a version that satisfies the requirement h5py==3.16.0 "
            "(from versions: 2.2.1)\n"
            "ERROR: No matching distribution found for h5py==3.16.0\n",
            "There is no ready-made package of h5py==3.16.0 for this ",
        ),
        (
            "ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device\n",
            "The disk is full",
        ),
        (
            "ERROR: Could not install packages due to an OSError: [Errno 13] Permission denied: '/x'\n",
            "The dependencies could not be installed: Could not install packages due to an OSError: "
            "[Errno 13] Permission denied: '/x'; ",
        ),
    ],
    ids=["network", "certificate", "no wheel", "disk", "other"],
)
def test_what_pip_prints_becomes_one_sentence(bootstrap: ModuleType, printed: str, sentence: str) -> None:
    told = part("installing").explain(printed, Path("somewhere") / "install.log")
    assert told.startswith(sentence)
    assert str(Path("somewhere") / "install.log") in told
    assert "\n" not in told


def test_stamp_serves_only_what_it_was_made_for(bootstrap: ModuleType) -> None:
    stamp = part("stamp")
    app = stamp.Stamp(python="3.11 linux", root="/a", locks="1", tools="app")
    test = dataclasses.replace(app, tools="test")
    assert app.serves(app)
    assert test.serves(app)
    assert not app.serves(test)
    for change in ({"python": "3.12 linux"}, {"root": "/b"}, {"locks": "2"}, {"tools": "unheard of"}):
        assert not dataclasses.replace(app, **change).serves(app)


def test_stamp_changes_with_every_file_it_covers(bootstrap: ModuleType, tmp_path: Path) -> None:
    stamp, places = part("stamp"), part("places").Places(tmp_path)
    (tmp_path / "requirements").mkdir()
    files = [places.project, places.locked("app"), places.locked("test")]
    for path in files:
        path.write_text("first", encoding="utf-8")
    seen = {stamp.wanted_stamp(places, "app").locks}
    for path in files:
        path.write_text("second", encoding="utf-8")
        seen.add(stamp.wanted_stamp(places, "app").locks)
    assert len(seen) == 4


@pytest.mark.parametrize("text", ["", "{", "[]", '{"python": "3.11"}'])
def test_unreadable_stamp_counts_as_none(bootstrap: ModuleType, tmp_path: Path, text: str) -> None:
    places = part("places").Places(tmp_path)
    places.venv.mkdir()
    places.stamp.write_text(text, encoding="utf-8")
    assert part("stamp").read_stamp(places) is None


def test_stamp_without_the_interpreter_is_not_trusted(bootstrap: ModuleType, tmp_path: Path) -> None:
    places = part("places").Places(tmp_path)
    places.venv.mkdir()
    stamp = part("stamp")
    made = stamp.Stamp(python="3.11 linux", root="/a", locks="1", tools="app")
    stamp.write_stamp(places, made)
    assert stamp.read_stamp(places) == made
    assert not part("environment")._nothing_to_do(places, made, "")


@linux_only
def test_a_display_counts_where_something_answers(bootstrap: ModuleType, tmp_path: Path) -> None:
    display = part("display")
    assert display.qt_platform({}) == ""
    assert display.why_none({}) == "there is no display"
    assert display.qt_platform({"DISPLAY": ":4095"}) == ""
    assert display.qt_platform({"DISPLAY": "nonsense"}) == ""
    assert display.why_none({"DISPLAY": ":4095"}) == "the display :4095 does not answer"
    assert display.qt_platform({"QT_QPA_PLATFORM": "vnc:size=800x600"}) == "vnc"
    assert display.qt_platform({"QT_QPA_PLATFORM": "wayland;xcb"}) == "wayland"
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("\0/tmp/.X11-unix/X4094")
        server.listen()
        assert display.qt_platform({"DISPLAY": ":4094.0"}) == "xcb"
        assert display.qt_platform({"DISPLAY": "unix:4094"}) == "xcb"
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "w"))
        server.listen()
        seen = {"WAYLAND_DISPLAY": "w", "XDG_RUNTIME_DIR": str(tmp_path)}
        assert display.qt_platform(seen) == "wayland"
    assert display.qt_platform(seen) == ""


@linux_only
@pytest.mark.parametrize(
    ("apt", "sudo", "advice"),
    [
        (True, False, "run: sudo apt-get install -y libegl1 libgl1"),
        (False, False, "install the packages of your system that hold them"),
    ],
    ids=["Debian without rights", "not Debian"],
)
def test_what_may_not_be_installed_is_told(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, apt: bool, sudo: bool, advice: str
) -> None:
    system, libraries, messages = part("system"), part("libraries"), part("messages")
    monkeypatch.setattr(libraries, "missing", lambda wanted: ["libEGL.so.1", "libGL.so.1"])
    monkeypatch.setattr(system.os, "geteuid", lambda: 1000)
    monkeypatch.setattr(system.shutil, "which", lambda name: {"apt-get": apt, "sudo": sudo}.get(name) or None)
    with pytest.raises(messages.SetupError) as told:
        system.supply("offscreen", need_venv=False, log=messages.Log(tmp_path / "log"))
    assert "lacks Qt's system libraries libEGL.so.1, libGL.so.1" in str(told.value)
    assert advice in str(told.value)


@linux_only
def test_only_absent_libraries_count_as_missing(bootstrap: ModuleType) -> None:
    libraries = part("libraries")
    assert libraries.missing(["libc.so.6", "libfingerlab-absent.so.1"]) == ["libfingerlab-absent.so.1"]
    assert set(libraries.needed("offscreen")) < set(libraries.needed("xcb"))
    assert "libxcb-cursor.so.0" in libraries.needed("xcb")


def test_places_follow_the_system(bootstrap: ModuleType) -> None:
    places = part("places").here()
    assert places.root == ROOT
    expected = ["Scripts", "python.exe"] if sys.platform == "win32" else ["bin", "python"]
    assert list(places.python.relative_to(ROOT / ".venv").parts) == expected
