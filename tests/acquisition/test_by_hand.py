"""What an operator does by hand: take up the slack of the cable, and jog."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Enable, Initialise, Jog, Release, Start, TakeUp
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.protocols.finding import take_up_slack
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Slot
from fingerlab.core.errors import UserError
from fingerlab.devices.simulated import SimulatedRig, Simulation
from tests.acquisition.driving import SINE, Driven
from tests.acquisition.fake_device import FakeDevice


def opened(slack: float, folder: Path) -> InlineBench:
    effects = {"cable_slack": {"travel": slack}}
    device = SimulatedRig(simulation=Simulation(seed=4, effects=effects))
    settings = LoopSettings(BenchUnits.from_rig(device.rig), device.rig.limits)
    bench = InlineBench(device, settings, folder)
    bench.step(1500)
    bench.ask(Initialise())
    return bench


def test_slack_is_taken_up_and_the_reference_is_where_the_joints_begin_to_move(
    tmp_path: Path,
) -> None:
    """5 mm on a pulley of 15 mm are 19.1 degrees; 0.3 mm more or less are left by hand (1.1 degrees)."""
    bench = opened(5e-3, tmp_path)
    slack = take_up_slack(bench, Initialise())
    assert math.degrees(slack) == pytest.approx(19.1, abs=4.0)
    current = bench.ring.last(8000)[:, COLUMN["motor_current"]]
    assert abs(current).max() < 0.45  # 0.3 A and the monitor's noise
    again = take_up_slack(bench, Initialise())  # of what it was let go by: 2 degrees
    assert math.degrees(again) == pytest.approx(3.0, abs=2.0)
    bench.ask(Enable())
    bench.ask(Start(SINE))
    bench.step(2250)  # it unwinds, as fast as it goes
    bench.stop()
    bench.step(1500)
    bench.ask(Release())
    bench.ask(Enable())  # it has come to rest within its limits, and its reference still holds
    bench.close()


def test_a_cable_that_is_off_is_told(tmp_path: Path) -> None:
    bench = opened(3e-2, tmp_path)
    with pytest.raises(UserError, match=r"do not move|does not follow"):
        take_up_slack(bench, Initialise())
    assert not bench.status().enabled
    bench.close()


def test_a_jog_turns_at_its_speed_holds_when_let_go_and_ends_before_the_limit() -> None:
    bench = Driven(FakeDevice())
    assert bench.ask(Initialise()) == ""
    assert bench.ask(Enable()) == ""
    assert bench.ask(Jog(0.2)) == ""
    bench.cycles(2000)
    assert bench.column("motor_position")[-1] == pytest.approx(0.4, abs=0.08)  # 0.5 s of soft start
    assert bench.ask(Jog(0.0)) == ""
    bench.cycles(1500)
    held = bench.column("motor_position")[-1]
    bench.cycles(1000)
    assert bench.column("motor_position")[-1] == pytest.approx(held, abs=2e-3)
    assert bench.ask(Jog(-0.4)) == ""
    bench.cycles(4000)
    assert math.degrees(bench.column("motor_position")[-1]) == pytest.approx(-20.0 + 2.0 + 2.3, abs=0.4)
    assert bench.board[Slot.FAULTS] == 0


def test_a_take_up_needs_an_amplifier_that_is_on() -> None:
    bench = Driven(FakeDevice())
    assert "enabled" in bench.ask(TakeUp())
