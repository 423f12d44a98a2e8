"""A loop that hangs, as in a driver that does not return: nobody died, and the motor has its last current."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from multiprocessing import resource_tracker
from pathlib import Path

import psutil
import pytest

from fingerlab.acquisition.bench.guardian import StallWatch
from fingerlab.acquisition.bench.loop import STOOD_STILL
from fingerlab.acquisition.bench.process_bench import ProcessBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Enable, Initialise
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.status import SharedStatus, Slot
from fingerlab.core.errors import UserError
from fingerlab.rig.file import default_rig
from fingerlab.sessions import check_session, open_session
from tests.faults.killing import ROOT
from tests.faults.shared_device import SharedChoice, make_output, read_output
from tests.faults.window import PATIENT

PATIENCE_S = 60.0


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be held still there")
def test_a_loop_that_hangs_is_stopped_in_its_place(tmp_path: Path) -> None:
    output, session = tmp_path / "output", tmp_path / "session.h5"
    make_output(output)
    arguments = [sys.executable, "-m", "tests.faults.window", str(output), str(session), str(tmp_path / "r")]
    with subprocess.Popen(
        [*arguments, "0.5"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT, text=True
    ) as window:
        assert window.stdout is not None
        told = json.loads(window.stdout.readline())
        board = attach(told["board"])
        assert wait_for(lambda: board[Slot.INDEX] > told["start"] + 600)
        board.close()
        assert read_output(output).enabled
        os.kill(told["loop"], signal.SIGSTOP)
        try:
            assert wait_for(lambda: read_output(output).zero)  # while the loop still hangs
            assert psutil.Process(told["loop"]).status() == psutil.STATUS_STOPPED
        finally:  # or nothing of it would ever end
            os.kill(told["loop"], signal.SIGCONT)
            try:
                _, said = window.communicate(timeout=PATIENCE_S)
            finally:
                window.kill()
    assert "The control loop" in said  # stood still, or was away: what is seen first
    assert "Traceback" not in said
    assert read_output(output).zero
    found = open_session(session)
    assert not check_session(found).errors
    assert found.attributes["ended"] == "truncated"
    assert found.runs[0].length > 400


def test_who_drives_is_told_that_the_loop_stood_still(tmp_path: Path) -> None:
    make_output(tmp_path / "output")
    settings = LoopSettings(BenchUnits.from_rig(default_rig()), PATIENT)
    bench = ProcessBench(SharedChoice(tmp_path / "output"), settings, tmp_path / "rescued")
    try:
        bench.ask(Initialise())
        bench.ask(Enable())
        bench.board[Slot.GUARDIAN_ACTED] = 1  # as the guardian says it
        assert wait_for(lambda: bench.status().loop_ended)
        assert bench.status().fault == STOOD_STILL
        with pytest.raises(UserError, match="stood still"):
            bench.ask(Initialise())
        with pytest.raises(UserError, match="stood still"):
            bench.wait(1.0)
        assert wait_for(lambda: read_output(tmp_path / "output").zero)
    finally:
        bench.close()


def attach(name: str) -> SharedStatus:
    """The board of the other process, which is its own to remove."""
    board = SharedStatus.attach(name)
    with suppress(AttributeError, KeyError):
        resource_tracker.unregister(f"/{name.lstrip('/')}", "shared_memory")
    return board


def wait_for(condition) -> bool:  # type: ignore[no-untyped-def]
    end = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < end:
        time.sleep(2e-3)
    return bool(condition())


def test_standing_still_counts_only_with_the_amplifier_on(monkeypatch: pytest.MonkeyPatch) -> None:
    board, now = SharedStatus.make(shared=False), [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    standstill = StallWatch(board, 0.02)

    def look(seconds: float, cycles: int) -> bool:
        now[0] += seconds
        board[Slot.CYCLES] += cycles
        return standstill.seen()

    assert not any(look(1.0, 0) for _ in range(20))  # off: nothing is driven
    board[Slot.ENABLE_LINE] = 1
    assert not any(look(0.09, 1) for _ in range(20))  # slow, but not still
    # The guardian was held up, too: an hour that nobody saw is no standstill yet.
    assert not look(3600.0, 0)
    assert not look(0.005, 1)
    still = [look(0.006, 0) for _ in range(50)]
    # Ten times 20 ms without a cycle, at looks of 6 ms each: the thirty-fourth.
    assert still.index(True) == 33
