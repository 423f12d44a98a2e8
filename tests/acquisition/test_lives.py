"""Whether a process lives is told before the system has cleared it away."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fingerlab.acquisition.bench.guardian import LOOK_CYCLES, PeerWatch, ProcessWatch
from fingerlab.acquisition.status import SharedStatus, Slot

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="only Linux tells it this way")


@pytest.fixture
def child() -> subprocess.Popen[str]:
    with subprocess.Popen(
        [sys.executable, "-c", "print(1, flush=True); import time; time.sleep(60)"],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield process
        process.kill()


def test_a_kill_is_seen_although_nobody_has_taken_leave_of_the_process(child: subprocess.Popen[str]) -> None:
    pulse = ProcessWatch(child.pid)
    assert not pulse.dying()
    child.kill()
    assert pulse.dying()  # at once: the signal waits, or the process is ending, or it has ended
    child.wait()
    assert pulse.dying()
    pulse.close()
    assert not pulse.dying()


def test_a_process_with_a_bracket_in_its_name_and_one_that_never_was() -> None:
    own = ProcessWatch(os.getpid())
    name = Path("/proc/self/comm")
    before = name.read_text()
    name.write_text("a) Z 0 (b")
    try:
        assert not own.dying()
    finally:
        name.write_text(before)
    assert not ProcessWatch(2**22 + 1).dying()  # beyond the largest number that Linux gives


def test_each_loss_is_told_once_whoever_noticed_it(child: subprocess.Popen[str]) -> None:
    told: list[str] = []
    board = SharedStatus.make(shared=False)
    lives = PeerWatch(os.getpid(), board, told.append, ("window", "recorder"))
    for _ in range(3 * LOOK_CYCLES):
        lives.look()
    board[Slot.RECORDER_PID] = child.pid
    for _ in range(LOOK_CYCLES):
        lives.look()
    assert told == []
    child.kill()
    end = time.monotonic() + 30.0
    while not told and time.monotonic() < end:
        lives.look()
    lives.tell("recorder")
    lives.tell("window")
    assert told == ["recorder", "window"]
