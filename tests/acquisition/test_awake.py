"""The system's sleep is held off while the motor is enabled, by a process that dies with the bench."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from fingerlab.acquisition.bench.bench import Kind, notices
from fingerlab.acquisition.bench.process_bench import ProcessBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Disable, Enable, Initialise, Release
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.status import Slot
from fingerlab.rig.file import default_rig
from tests.faults.shared_device import SharedChoice, make_output
from tests.faults.window import PATIENT

PATIENCE_S = 30.0


def opened(folder: Path) -> ProcessBench:
    make_output(folder / "output")
    settings = LoopSettings(BenchUnits.from_rig(default_rig()), PATIENT)
    return ProcessBench(SharedChoice(folder / "output"), settings, folder / "rescued")


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ProcessBench]:
    monkeypatch.setenv("WAKEPY_FAKE_SUCCESS", "1")  # wakepy's own stand-in for a system that grants it
    made = opened(tmp_path)
    yield made
    made.close()


def wait_for(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < end:
        time.sleep(5e-3)
    return condition()


def test_from_enable_to_disable_and_to_a_stop(bench: ProcessBench) -> None:
    awake = lambda: bench.board[Slot.AWAKE]  # noqa: E731
    bench.ask(Initialise())
    assert awake() == 0
    for end in (lambda: bench.ask(Disable()), bench.stop):
        bench.ask(Enable())
        assert wait_for(lambda: awake() == 1)
        end()
        assert wait_for(lambda: awake() == 0)
    assert bench.status().sleep == ""
    bench.ask(Release())


def test_a_system_that_refuses_is_named_once_and_nothing_else_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WAKEPY_FAKE_SUCCESS", "0")
    monkeypatch.setenv("DBUS_SESSION_BUS_ADDRESS", f"unix:path={tmp_path / 'no-bus'}")  # Linux: nobody to ask
    bench = opened(tmp_path)
    try:
        before = bench.status()
        bench.ask(Initialise())
        bench.ask(Enable())
        if (
            wait_for(lambda: bool(bench.status().sleep) or bench.board[Slot.AWAKE] == 1)
            and bench.board[Slot.AWAKE]
        ):
            pytest.skip("this system grants it to everybody")
        told = [notice for notice in notices(before, bench.status(), 1000.0) if notice.kind is Kind.SLEEP]
        assert ["switch sleep off" in notice.sentence for notice in told] == [True]
        assert bench.status().enabled
        seen = bench.status()
        for lost, said in (
            (5, []),
            (20, ["The machine does not hold 1000 Hz: 20 of 10000 cycles were lost"]),
        ):
            now = replace(seen, index=9_999, lost=lost)
            pace = [n.sentence for n in notices(before, now, 1000.0) if n.kind is Kind.PACE]
            assert [sentence.split(" since")[0] for sentence in pace] == said
            assert not [n for n in notices(now, now, 1000.0) if n.kind is Kind.PACE]  # told once
        bench.ask(Disable())
        bench.ask(Enable())
        assert not [n for n in notices(seen, bench.status(), 1000.0) if n.kind is Kind.SLEEP]
    finally:
        bench.close()
