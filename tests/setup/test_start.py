"""start.py from outside: first and second start, no display, and the ways in which a start is cut short."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from .conftest import Checkout, build_checkout, make_wheel

linux_only = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="concerns Linux only")


@dataclass
class Begun:
    """A checkout that was started for the first time, twice at once, and what came of it."""

    checkout: Checkout
    codes: list[int]
    errors: list[str]
    calls: list[dict[str, object]]
    log: str


@pytest.fixture(scope="module")
def begun(make_checkout: Callable[[], Checkout]) -> Begun:
    """Makes the one environment that the tests of this file share: making one takes most of their time."""
    checkout = make_checkout()
    both = [checkout.begin("info", f"session {number}.h5") for number in (1, 2)]
    errors = [process.communicate(timeout=120)[1] for process in both]
    return Begun(checkout, [one.returncode for one in both], errors, checkout.calls(), log_of(checkout))


@pytest.fixture
def checkout(begun: Begun) -> Checkout:
    """The shared checkout, with its environment made and nothing left of an earlier test's calls."""
    begun.checkout.calls()
    return begun.checkout


@pytest.fixture
def sealed(checkout: Checkout) -> Iterator[Checkout]:
    """`checkout` with the test tools, and without pip: what works now works without installing."""
    assert checkout.start("test").returncode == 0
    checkout.calls()
    [pip] = (checkout.root / ".venv").rglob("site-packages/pip")
    away = pip.rename(checkout.root / "pip-put-away")
    yield checkout
    away.rename(pip)


def log_of(checkout: Checkout) -> str:
    return (checkout.root / ".venv" / "install.log").read_text(encoding="utf-8")


def test_first_start_installs_once_though_two_are_begun(begun: Begun) -> None:
    assert begun.codes == [0, 0], begun.errors
    assert sum("installing the locked dependencies" in error for error in begun.errors) == 1
    arguments = sorted(str(call["arguments"]) for call in begun.calls)
    assert arguments == ["['info', 'session 1.h5']", "['info', 'session 2.h5']"]
    assert {call["cwd"] for call in begun.calls} == {str(begun.checkout.root.parent.resolve())}
    assert "--require-hashes" in begun.log


def test_tests_run_off_screen_in_the_checkout_with_the_arguments_given(checkout: Checkout) -> None:
    tests = checkout.start("test", "-k", "two words")
    assert tests.returncode == 0, tests.stderr
    assert checkout.calls() == [
        {
            "program": "pytest",
            "arguments": ["-k", "two words"],
            "cwd": str(checkout.root.resolve()),
            "platform": "offscreen",
        }
    ]


def test_second_start_runs_no_installer(sealed: Checkout) -> None:
    before = log_of(sealed)
    for arguments in (["info", "a.h5"], ["test"], ["diagnose", "a.h5", "--json", "-"]):
        again = sealed.start(*arguments)
        assert (again.returncode, again.stdout, again.stderr) == (0, "", "")
    assert [call["program"] for call in sealed.calls()] == ["fingerlab", "pytest", "fingerlab"]
    assert log_of(sealed) == before


def test_exit_code_of_the_command_is_passed_on(checkout: Checkout) -> None:
    assert checkout.start("fit", "a.h5", FAILS="fit").returncode == 7


@linux_only
def test_without_display_the_job_runs_on_a_practice_session(checkout: Checkout) -> None:
    first = checkout.start()
    assert first.returncode == 0, first.stderr
    session = str(checkout.root.resolve() / "fingerlab-out" / "practice.h5")
    page = str(checkout.root.resolve() / "fingerlab-out" / "practice.html")
    assert "there is no display" in first.stdout
    assert f"The report page: {page}" in first.stdout
    simulate, diagnose, report = [call["arguments"] for call in checkout.calls()]
    assert simulate[:5] == ["simulate", "--protocol", "thesis", "--practice", "--seed"]
    assert simulate[5].isdigit()
    assert simulate[6:] == ["--out", session]
    assert diagnose == ["diagnose", session]
    assert report == ["report", session, "--out", page]

    again = checkout.start()
    assert again.returncode == 0, again.stderr
    assert "used again" in again.stdout
    assert [call["arguments"] for call in checkout.calls()] == [["diagnose", session]]
    assert Path(session).read_text(encoding="utf-8") == "written once"

    Path(page).unlink()
    failed = checkout.start(FAILS="diagnose", DISPLAY=":4095")
    assert failed.returncode == 7
    assert "the display :4095 does not answer" in failed.stdout
    assert not Path(page).exists()


@linux_only
def test_with_a_display_the_application_opens(checkout: Checkout) -> None:
    assert checkout.start(QT_QPA_PLATFORM="minimal").returncode == 0
    with socket.socket(socket.AF_UNIX) as server:
        name = str(checkout.root.parent / "wl")
        server.bind(name)
        server.listen()
        # The Wayland libraries may be missing here: what is asked is only whether the display was seen.
        started = checkout.start(XDG_RUNTIME_DIR=str(checkout.root.parent), WAYLAND_DISPLAY="wl")
    assert "no window is opened" not in started.stdout
    session = checkout.root.parent / "recorded.h5"
    session.touch()
    assert checkout.start(str(session), QT_QPA_PLATFORM="minimal").returncode == 0
    without = checkout.start(str(session))
    assert without.returncode == 1
    assert f"no window can show {session}" in without.stderr
    session.unlink()
    calls = checkout.calls()
    assert calls[-1]["arguments"] == [str(session)]
    assert calls[0] == {
        "program": "fingerlab",
        "arguments": [],
        "cwd": str(checkout.root.parent.resolve()),
        "platform": "minimal",
    }


def closed_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


def test_missing_network_and_changed_package_are_one_sentence_each(checkout: Checkout) -> None:
    log = str(checkout.root.resolve() / ".venv" / "install.log")
    lock = checkout.root / "requirements" / "app.txt"
    before = lock.read_text(encoding="utf-8")
    newcomer = make_wheel(checkout.wheels, "newcomer", {"newcomer.py": ""})

    lock.write_text(before + f"newcomer==1.0 --hash=sha256:{'0' * 64}\n", encoding="utf-8")
    refused = checkout.start("info")
    assert (refused.returncode, refused.stdout) == (1, "")
    announcement, sentence = refused.stderr.splitlines()
    assert "installing the locked dependencies" in announcement
    assert sentence.startswith("FingerLab: A downloaded package is not the one that was locked")
    assert log in sentence

    lock.write_text(before + newcomer, encoding="utf-8")
    index = f"http://127.0.0.1:{closed_port()}/simple"
    cut_off = checkout.start("info", PIP_NO_INDEX="0", PIP_FIND_LINKS="", PIP_INDEX_URL=index)
    assert (cut_off.returncode, cut_off.stdout) == (1, "")
    _, sentence = cut_off.stderr.splitlines()
    assert sentence.startswith("FingerLab: The network is missing: the package index could not be reached")
    assert log in sentence
    assert "127.0.0.1" in log_of(checkout)
    assert checkout.calls() == []

    # Neither spoiled the environment: once connected it is gone on with.
    connected = checkout.start("info")
    assert connected.returncode == 0, connected.stderr
    assert "making it anew" not in connected.stderr
    assert list((checkout.root / ".venv").rglob("site-packages/newcomer.py"))


@pytest.mark.skipif(sys.platform == "win32", reason="sends the kill signal")
def test_killed_start_is_repaired(checkout: Checkout) -> None:
    lock = checkout.root / "requirements" / "app.txt"
    line = make_wheel(checkout.wheels, "latecomer", {"latecomer.py": ""})
    lock.write_text(lock.read_text(encoding="utf-8") + line, encoding="utf-8")
    with socket.create_server(("127.0.0.1", 0)) as index:  # takes calls and never answers
        index.settimeout(60)
        url = f"http://127.0.0.1:{index.getsockname()[1]}/simple"
        hanging = checkout.begin("info", PIP_NO_INDEX="0", PIP_FIND_LINKS="", PIP_INDEX_URL=url)
        connection, _ = index.accept()
        hanging.kill()
        hanging.communicate(timeout=60)
        connection.close()

    # pip lives on for a moment after its start was killed; the next start waits until it is gone.
    after = checkout.start("info")
    assert after.returncode == 0, after.stderr
    assert "making it anew" in after.stderr
    assert len(checkout.calls()) == 1
    assert list((checkout.root / ".venv").rglob("site-packages/latecomer.py"))
    assert list(checkout.root.glob(".venv-old-*")) == []


def test_incomplete_copy_says_so(tmp_path: Path) -> None:
    checkout = build_checkout(tmp_path)
    (checkout.root / "requirements" / "app.txt").unlink()
    told = checkout.start("info")
    assert told.returncode == 1
    assert "app.txt is missing" in told.stderr
    assert not (checkout.root / ".venv").exists()


def test_help_installs_nothing(tmp_path: Path) -> None:
    checkout = build_checkout(tmp_path)
    told = checkout.start("--help")
    assert told.returncode == 0
    assert "python start.py test" in told.stdout
    assert not (checkout.root / ".venv").exists()


@linux_only
def test_missing_system_library_is_installed_after_saying_so(checkout: Checkout, tmp_path: Path) -> None:
    """apt-get and sudo are stood for by scripts: apt-get "installs" by laying a library where it is found."""
    name = "libfingerlabtest.so.1"
    checkout.replace_libraries([name])
    tools, libraries = tmp_path / "tools", tmp_path / "libraries"
    tools.mkdir()
    libraries.mkdir()
    real = subprocess.run(["ldd", sys.executable], capture_output=True, text=True, check=True).stdout
    libc = next(word for word in real.split() if word.startswith("/") and "libc.so" in word)
    lay = f'case "$*" in *install*) cp {libc} "{libraries}/{name}";; esac'
    apt = f'#!/bin/sh\necho "$@" >> "{tmp_path}/apt"\n{lay}\n'
    sudo = '#!/bin/sh\nshift\nexec "$@"\n'
    for script, text in (("apt-get", apt), ("sudo", sudo)):
        (tools / script).write_text(text, encoding="utf-8")
        (tools / script).chmod(0o755)
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    done = checkout.start("test", PATH=path, LD_LIBRARY_PATH=str(libraries))
    assert done.returncode == 0, done.stderr
    assert (
        f"lacks Qt's system library {name}; installing the system packages package-of-{name}." in done.stderr
    )
    [asked] = (tmp_path / "apt").read_text(encoding="utf-8").splitlines()
    assert asked.endswith(f"install --no-install-recommends package-of-{name}")

    # A command needs no window, so it asks for no library of Qt.
    (libraries / name).unlink()
    assert checkout.start("info", PATH=path, LD_LIBRARY_PATH=str(libraries)).stderr == ""
    checkout.replace_libraries([])
