"""What an operator does by hand: take up the slack of the cable, and jog."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import (
    Approach,
    Enable,
    Initialise,
    Jog,
    Release,
    SetUp,
    Start,
    TakeUp,
)
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.protocols.driver import ProtocolDriver
from fingerlab.acquisition.protocols.finding import take_up_slack
from fingerlab.acquisition.protocols.steps import Change, Find
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Number, Slot
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


def test_where_the_cable_holds_the_motor_the_slack_is_taken_up_and_no_current_jumps_after_it() -> None:
    """0.3 A are 39.0 mN m, and a spring of 0.05 N m/rad balances them at 44.6 degrees."""
    bench = Driven(FakeDevice())
    for command in (Initialise(), Enable(), TakeUp(moved=10.0, or_held=True)):
        assert bench.ask(command) == ""
    bench.cycles(9000, lambda: bool(bench.board[Slot.APPROACHED]))
    assert bench.board[Slot.APPROACHED] == 1
    assert math.degrees(bench.board.number(Number.APPROACH)) == pytest.approx(44.6, abs=1.0)
    assert bench.ask(Approach(9.0, 0.2, 1.2)) == ""  # which its load cell never shows
    bench.cycles(1000)
    current = bench.column("current_command")
    assert current[-1] > 0.35
    # An encoder count moves the position loop's current by 60 mA, as control.py says.
    assert abs(np.diff(current[-1500:])).max() < 0.08
    assert bench.fault == ""


def slack_bench(folder: Path, slack: float) -> tuple[InlineBench, ProtocolDriver]:
    """The practice bench with so much slack in its cable, m, and its load cell under the fingertip."""
    device = SimulatedRig(simulation=Simulation(seed=4, effects={"cable_slack": {"travel": slack}}))
    bench = InlineBench(device, LoopSettings(BenchUnits.from_rig(device.rig), device.rig.limits), folder)
    return bench, ProtocolDriver(bench, lambda sentence: None)


def test_the_load_cell_is_found_with_a_slack_cable_and_the_runs_begin_where_it_pulls(tmp_path: Path) -> None:
    """10 mm on a pulley of 15 mm are 38.2 degrees: more than the 25 within which a finger has to follow."""
    bench, driver = slack_bench(tmp_path, 1e-2)
    driver.take([Change(SetUp("contact", "flexion"), "Put the load cell there."), Find(0.8)])
    rows = bench.ring.last(bench.status().index - 1)
    position, current, force = (
        np.degrees(rows[:, COLUMN["motor_position"]]), rows[:, COLUMN["motor_current"]],
        rows[:, COLUMN["endpoint_force"]],
    )  # fmt: skip
    assert force.max() > 0.8
    again = int(np.flatnonzero(np.diff(position) < -10.0)[-1])  # the motor's reference is another one
    assert position[again] - position[again + 1] == pytest.approx(38.2, abs=5.0)
    assert abs(current[: again + 1]).max() < 0.45  # 0.3 A and the monitor's noise
    assert bench.status().fault == ""
    bench.close()


def test_slack_beyond_the_take_up_is_one_sentence_and_leaves_no_current(tmp_path: Path) -> None:
    bench, driver = slack_bench(tmp_path, 3e-2)
    with pytest.raises(UserError, match="Neither the joints nor the load cell answer within 60°"):
        driver.take([Change(SetUp("contact", "flexion"), "Put the load cell there."), Find(0.8)])
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
