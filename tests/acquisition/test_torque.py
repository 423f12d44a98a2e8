"""A trajectory of torque: the current that makes it, soft at both ends, and every limit kept."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fingerlab.acquisition.control.machine import (
    Approach,
    Enable,
    Finish,
    Initialise,
    Mode,
    SetGains,
    SetUp,
    Start,
    Tare,
)
from fingerlab.acquisition.control.motion import FREE_SPEED
from fingerlab.acquisition.control.safety import Bounds, Reading
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.acquisition.protocols.steps import Change, Record, plan_steps
from fingerlab.acquisition.status import Number, Slot
from fingerlab.core.errors import UserError
from fingerlab.devices.faults import Faults, SensorFault
from fingerlab.devices.simulated import SimulatedRig, Simulation
from fingerlab.rig.limits import Limits
from fingerlab.sessions.trajectory import trajectory_words
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import single_run
from tests.acquisition import fake_device
from tests.acquisition.driving import SINE, Driven
from tests.acquisition.fake_device import SPRING, TORQUE_PER_AMP, FakeDevice

PULL = {
    "kind": "torque", "time_s": [0.0, 2.0, 4.0, 5.0], "torque_n_m": [0.0, 0.05, 0.05, 0.03], "ramp_s": 0.0,
}  # fmt: skip


def amps(bench: Driven) -> np.ndarray:
    """Current command of the run, A, one a cycle."""
    return bench.column("current_command")[bench.column("run") == 1]


def test_the_current_makes_the_torque_and_the_motor_goes_where_its_load_lets_it() -> None:
    bench = Driven(FakeDevice())
    bench.run(PULL)
    bench.cycles(4990)
    wanted = read_trajectory(PULL).command(np.arange(4990) / 1000.0)
    assert wanted[3000] == pytest.approx(0.05)
    # Against the spring the motor turns by 1 rad in 2 s: slower than where the brake begins.
    # The first half second leads softly from no torque and no slope to the trajectory's.
    np.testing.assert_allclose(TORQUE_PER_AMP * amps(bench)[600:4990], wanted[600:], atol=1e-9)
    position = bench.column("motor_position")[bench.column("run") == 1]
    assert position[3500:3900].mean() == pytest.approx(0.05 / SPRING, rel=0.02)
    command = bench.column("motor_command")[bench.column("run") == 1]
    np.testing.assert_allclose(command[1:], position[:-1], atol=2e-3)  # no angle was asked for


@pytest.mark.parametrize("after", [2700, 6100])
def test_the_position_loop_takes_over_without_a_jump_and_brings_the_motor_to_rest(after: int) -> None:
    """In the middle, and at the end of the trajectory."""
    bench = Driven(FakeDevice())
    bench.run(PULL)
    bench.cycles(after)
    if after < 5000:
        assert bench.loop.machine.mode is Mode.RUNNING
        assert bench.ask(Finish()) == ""
    else:
        assert bench.loop.machine.mode is Mode.STOPPING
    bench.cycles(3500)
    assert bench.loop.machine.mode is Mode.ENABLED
    assert abs(bench.column("motor_position")[-1]) < math.radians(2.0)
    torque = TORQUE_PER_AMP * bench.column("current_command")
    running = np.flatnonzero(torque)[:-1]
    # An encoder count in a sample moves the position loop's current by 60 mA, as control.py says: 8 mN m.
    assert np.abs(np.diff(torque[running[0] : running[-1]])).max() < 0.012
    assert bench.device.outputs[-1][1:] == (0.0, True)
    assert bench.fault == ""


def test_a_motor_without_a_load_is_braked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fake_device, "SPRING", 0.0)
    monkeypatch.setattr(fake_device, "FRICTION", 0.0)
    bench = Driven(FakeDevice(), Limits(position_high=1e3))
    assert bench.ask(SetUp("motor_bench", "none")) == ""
    bench.run({**PULL, "torque_n_m": [0.05, 0.05, 0.05, 0.05], "ramp_s": 0.1})
    bench.cycles(2000)
    speed = bench.column("motor_speed")
    # Torque and brake balance at 0.05 / (0.0302 * 4.3 * 0.25) = 1.54 rad/s above its start; free, the rotor
    # of 3e-4 kg m^2 would reach 300 rad/s in these 2 s.
    assert speed[-200:].mean() == pytest.approx(FREE_SPEED + 0.05 / (TORQUE_PER_AMP * 0.25), rel=0.05)
    assert bench.fault == ""


def test_a_soft_stop_brakes_a_fast_motor_no_harder_than_the_cable_may_be_pulled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At 3.5 rad/s the position loop asks for 0.9 A at once (0.25 A s/rad); 500 N/s are 58 A/s."""
    monkeypatch.setattr(fake_device, "SPRING", 0.0)
    monkeypatch.setattr(fake_device, "FRICTION", 0.0)
    bench = Driven(FakeDevice(), Limits(position_high=1e3))
    assert bench.ask(SetUp("motor_bench", "none")) == ""
    bench.run({**PULL, "torque_n_m": [0.05, 0.05, 0.05, 0.05], "ramp_s": 0.1})
    bench.cycles(2000)
    assert bench.ask(Finish()) == ""
    bench.cycles(300)
    tension = TORQUE_PER_AMP * np.abs(bench.column("current_command")[-300:]) / 0.015
    assert tension.max() > 1.0  # N: it brakes
    assert np.diff(tension).max() < 0.75 * 500.0 * 1e-3
    assert bench.fault == ""


@pytest.mark.parametrize("where", ["stop", "fault", "position"])
def test_stop_and_limits_take_the_current_away(where: str) -> None:
    limits = Limits(position_high=math.radians(30.0)) if where == "position" else Limits()
    device = FakeDevice(nan={0: 0}) if where == "fault" else FakeDevice()
    bench = Driven(device, limits)
    bench.run(PULL)
    if where == "stop":
        bench.cycles(1000)
        bench.board[Slot.STOP_REQUESTS] += 1
        bench.cycles(2)
        assert bench.loop.machine.mode is Mode.IDLE
    elif where == "position":
        bench.cycles(2000)
        assert "motor position" in bench.fault
    else:
        device.fault_at = device.total + 10
        bench.cycles(20)
        assert "hiccup" in bench.fault
    volts, enabled = bench.device.outputs[-1][1:]
    assert (volts, enabled) == (0.0, False)


def test_a_torque_ends_within_its_own_bounds_long_before_the_limits() -> None:
    bench = Driven(FakeDevice())
    bench.run({**PULL, "most_position_deg": 10.0})
    bench.cycles(3000)
    assert "stay below 10°" in bench.fault
    position = np.degrees(bench.column("motor_position"))
    first = int(np.flatnonzero(position > 10.0)[0])
    current = np.abs(bench.column("current_command"))
    assert not current[first + 50 :].any()  # 50 ms at 1 kHz
    assert bench.device.outputs[-1][1:] == (0.0, False)


def test_the_load_cells_noise_is_no_doubt_and_a_force_that_stays_is() -> None:
    bounds, reading = Bounds(force=2.0, position=math.inf, samples=5), Reading()
    reading.position = 0.0
    told = []
    for force in (2.1, 1.9, 2.1, 2.1, 2.1, 2.1, 2.1):
        reading.force = force
        told.append(bounds.fault(reading))
    assert told[:6] == [None] * 6
    assert told[6] is not None
    assert "2.1 N" in told[6]


@pytest.mark.parametrize(
    ("torque", "words"),
    [([0.0, 0.5], "limits of torque"), ([0.0, -0.5], "limits of torque")],
)
def test_a_torque_beyond_the_limits_is_refused(torque: list[float], words: str) -> None:
    bench = Driven(FakeDevice())
    for command in (Initialise(), Enable()):
        assert bench.ask(command) == ""
    told = bench.ask(Start({"kind": "torque", "time_s": [0.0, 2.0], "torque_n_m": torque, "ramp_s": 0.0}))
    assert words in told
    assert bench.loop.machine.mode is Mode.ENABLED


def test_a_torque_that_tightens_the_cable_too_fast_is_refused() -> None:
    bench = Driven(FakeDevice(), Limits(tension_rise=100.0))
    for command in (Initialise(), Enable()):
        assert bench.ask(command) == ""
    # 0.1 N m in 10 ms at a pulley of 15 mm: 667 N/s.
    step = {
        "kind": "torque",
        "time_s": [0.0, 1.0, 1.01, 2.0],
        "torque_n_m": [0.0, 0.0, 0.1, 0.1],
        "ramp_s": 0.0,
    }
    assert "666.7 N/s; the limit is 100 N/s" in bench.ask(Start(step))


def test_torque_and_angle_do_not_change_into_each_other_on_the_run() -> None:
    bench = Driven(FakeDevice())
    bench.run(PULL)
    bench.cycles(500)
    assert "bring it to rest first" in bench.ask(Start(SINE))
    assert "bring it to rest first" in bench.ask(Approach(0.5, 0.1, 1.0))
    assert bench.ask(Start({**PULL, "torque_n_m": [0.02, 0.02, 0.02, 0.02]})) == ""
    assert bench.ask(Finish()) == ""
    bench.cycles(2000)
    assert bench.ask(Start(SINE)) == ""
    bench.cycles(3000)
    assert bench.fault == ""
    assert bench.column("motor_position")[-1] > 0.1


def test_a_contact_run_of_torque_looks_for_no_contact() -> None:
    plan = single_run(json.dumps(PULL), "contact")
    kinds = [type(step) for step in plan_steps([plan], 0.8)]
    assert kinds == [Change, Record]


def test_many_points_stay_with_the_plan_and_out_of_the_file() -> None:
    time = np.linspace(0.0, 20.0, 1001).tolist()
    plan = single_run({"kind": "torque", "time_s": time, "torque_n_m": [0.01] * 1001}, "contact")
    assert len(plan.trajectory["time_s"]) == 1001
    assert "time_s" not in read_trajectory(dict(plan.trajectory)).settings


def test_a_torque_in_words() -> None:
    told = trajectory_words(
        read_trajectory({**PULL, "wanted_force": {"kind": "sine", "mean_n": 1.0}}).settings
    )
    assert told.startswith("torque, 0 to 50 mN m, for a wanted force (kind sine, mean_n 1)")
    assert "[" not in told


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"kind": "torque"}, "torque in N m"),
        ({"kind": "torque", "time_s": [0, 1], "angle_deg": [0, 1]}, "'torque_n_m'"),
        ({"kind": "torque", "time_s": [0, 1], "torque_n_m": [0]}, "2 times and 1 torques"),
    ],
)
def test_what_is_no_torque_is_one_sentence(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(UserError, match=words):
        read_trajectory(settings)


def test_a_torque_from_a_table(tmp_path: Path) -> None:
    path = tmp_path / "pull.csv"
    path.write_text("time,torque\n0,0\n2,0.04\n4,0.02\n", encoding="utf-8")
    pull = read_trajectory({"kind": "torque", "file": str(path), "ramp_s": 0.0})
    np.testing.assert_allclose(pull.command(np.array([1.0, 2.0, 3.0])), [0.02, 0.04, 0.03])
    assert pull.duration == 4.0


def test_gains_are_changed_while_it_runs_without_a_jump_and_within_their_ranges() -> None:
    """The error of a sine falls with the stiffness, as that of a loop below its bandwidth does."""
    driven = Driven(SimulatedRig(simulation=Simulation(seed=1)))
    driven.run({**SINE, "amplitude_deg": 10.0}, endless=True)
    driven.cycles(3000)

    def error() -> float:
        driven.cycles(3000)
        wanted, is_at = driven.column("motor_command")[-2000:], driven.column("motor_position")[-2000:]
        return float(np.sqrt(np.mean((wanted - is_at) ** 2)))

    soft, stiff = (3.5, 0.0, 0.2), (18.0, 50.0, 0.34)
    found = {}
    for gains in (soft, stiff):
        before = driven.column("current_command")[-1]
        assert driven.ask(SetGains(*gains)) == ""
        steps = np.abs(np.diff(driven.column("current_command")[-40:]))
        assert abs(driven.column("current_command")[-1] - before) < 0.1
        assert steps.max() < 0.1  # an encoder count alone moves it by 0.06 A
        found[gains] = error()
        assert [
            driven.board.number(n) for n in (Number.PROPORTIONAL, Number.INTEGRAL, Number.DERIVATIVE)
        ] == (pytest.approx(gains))
    assert driven.fault == ""
    assert found[stiff] < 0.4 * found[soft]
    assert driven.ask(SetGains(30.0, 25.0, 0.25)) == (
        "The proportional gain is 30; it should be 3.5 to 18 A/rad."
    )
    assert driven.board.number(Number.PROPORTIONAL) == 18.0


@pytest.mark.parametrize("blind", [False, True])
def test_friction_may_hold_a_pressing_motor_and_an_encoder_that_is_off_stops_it(blind: bool) -> None:
    """A slow swing against a sheath and a gearbox with much friction, both within their ranges."""
    off = (SensorFault("encoder_counts", 6300, stuck=True),) if blind else ()
    effects = parse_effects(("load_dependent_friction=0.3", "capstan_friction=0.3"))
    bench = Driven(SimulatedRig(simulation=Simulation(seed=1, effects=effects), faults=Faults(sensors=off)))
    assert bench.ask(SetUp("contact", "flexion")) == ""
    bench.cycles(1500)
    for command in (Initialise(), Tare(), Enable()):
        assert bench.ask(command) == ""
    time = np.arange(0.0, 10.01, 0.02)
    swing = 0.255 - 0.105 * np.cos(math.pi * (time - 2.0))
    torque = np.where(time < 2.0, 0.075 * time, swing)
    pull = {"kind": "torque", "time_s": time.tolist(), "torque_n_m": torque.tolist(), "ramp_s": 0.0}
    assert bench.ask(Start(pull)) == ""
    bench.cycles(9000, lambda: bool(bench.fault))
    assert bench.fault.startswith("The encoder stands still under") == blind
    assert bool(bench.fault) == blind
