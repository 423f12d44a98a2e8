"""Where a run begins: never before its references were set, nor before its load was carried."""

from __future__ import annotations

from pathlib import Path

import pytest

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Enable, Initialise, SetUp, Start, Tare
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.protocols.driver import run_to_record
from fingerlab.rig.file import default_rig
from fingerlab.rig.limits import Limits
from tests.acquisition.driving import SINE
from tests.acquisition.fake_device import FakeDevice

GAINS = {"proportional": 14.0, "integral": 25.0, "derivative": 0.25}
"""The usual ones of a card that is read sample by sample: A/rad, A/(rad s), A s/rad."""


@pytest.fixture
def bench(tmp_path: Path) -> InlineBench:
    settings = LoopSettings(BenchUnits.from_rig(default_rig()), Limits())
    return InlineBench(FakeDevice(), settings, tmp_path / "rescued")


@pytest.mark.parametrize("command", [Initialise(), Tare(), SetUp("contact", "flexion")])
def test_what_was_measured_with_other_references_is_left_out(bench: InlineBench, command: object) -> None:
    bench.step(2000)
    bench.ask(command)  # type: ignore[arg-type]
    first = bench.status().index + 1
    bench.step(400)
    run = run_to_record(bench, SetUp(), SINE, before_s=1.0)
    # The mean of a reference takes 0.1 s; from the sample after it on the new one holds.
    assert run.start == first
    assert run.attributes == {"pre_trigger_s": 0.4, "gains": GAINS}
    bench.step(1000)
    assert run_to_record(bench, SetUp(), SINE, before_s=1.0).start == first + 400


def test_seconds_before_are_counted_from_the_moment_that_is_meant(bench: InlineBench) -> None:
    for command in (Initialise(), Enable()):
        bench.ask(command)
    bench.step(3000)
    bench.ask(Start(SINE, True))
    began = bench.status().run_start
    bench.step(500)
    run = run_to_record(bench, SetUp(), SINE, 0.75, at=began + 200, stop=began + 900)
    assert (run.start, run.stop) == (began - 550, began + 900)
    assert run.attributes == {"pre_trigger_s": 0.75, "trajectory_start_s": 0.55, "gains": GAINS}
    now = run_to_record(bench, SetUp(), SINE)
    assert (now.start, now.stop) == (bench.status().index + 1, None)
    assert now.attributes == {
        "trajectory_start_s": pytest.approx((began - now.start) / 1000.0),
        "gains": GAINS,
    }
    loaded = run_to_record(bench, SetUp("motor_bench", "none", 0.05), SINE, 20.0)
    assert (loaded.start, loaded.load_torque) == (began, 0.05)
