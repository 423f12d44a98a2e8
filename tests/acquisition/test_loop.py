"""The control loop on a bench of our own: it follows, it changes without a jump, it stops."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fingerlab.acquisition.control.machine import (
    Approach,
    Disable,
    Enable,
    Finish,
    Initialise,
    Mode,
    Release,
    Reset,
    SetUp,
    Start,
    Tare,
)
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.acquisition.status import Number, Slot
from tests.acquisition import fake_device
from tests.acquisition.driving import SINE, Driven
from tests.acquisition.fake_device import FakeDevice


def test_the_command_of_a_run_is_the_trajectory_to_the_last_bit_of_noise() -> None:
    bench = Driven(FakeDevice())
    bench.run()
    bench.cycles(4000)
    run = bench.column("run") == 1
    command = bench.column("motor_command")[run][:4000]
    expected = read_trajectory(SINE).command(np.arange(4000) / 1000.0)
    np.testing.assert_allclose(command, expected, atol=1e-7)
    error = command[1500:] - bench.column("motor_position")[run][1500:4000]
    assert np.sqrt(np.mean(error**2)) < math.radians(2.0)
    assert bench.board[Slot.RUN_START] == bench.column("index")[run][0]


def test_a_run_ends_at_rest_and_leaves_the_amplifier_enabled_without_current() -> None:
    bench = Driven(FakeDevice())
    bench.run()
    bench.cycles(4000)
    assert bench.loop.machine.mode is Mode.STOPPING
    bench.cycles(1001)
    assert bench.loop.machine.mode is Mode.STOPPING  # the motor has yet to come to rest
    bench.cycles(2000)
    assert bench.loop.machine.mode is Mode.ENABLED
    assert abs(bench.column("motor_command")[-2]) < math.radians(1.0)
    assert bench.device.outputs[-1][1:] == (0.0, True)


@pytest.mark.parametrize("after", [1700, 2113, 2611])
def test_a_change_of_trajectory_has_no_jump_in_position_or_speed(after: int) -> None:
    bench = Driven(FakeDevice())
    bench.run(endless=True)
    bench.cycles(after)
    chirp = {"kind": "chirp", "amplitude_deg": 11.0, "frequency_hz": 0.5, "offset_deg": 30.0}
    assert bench.ask(Start(chirp)) == ""
    bench.cycles(3000)
    run = bench.column("run")
    command = bench.column("motor_command")[run > 0]
    speed = np.diff(command) * 1000.0
    # The sine accelerates by at most 0.26 * (2 pi)^2 = 10.3 rad/s^2, the way over and the chirp by less than
    # fifty: a jump in speed would show as one of hundreds.
    assert np.abs(np.diff(speed)).max() * 1000.0 < 60.0
    expected = read_trajectory(chirp).command(np.arange(3000) / 1000.0)
    np.testing.assert_allclose(bench.column("motor_command")[run == 2][1500:2999], expected[1501:], atol=1e-7)


def test_a_stop_takes_effect_in_the_next_cycle_and_stays() -> None:
    bench = Driven(FakeDevice())
    bench.run()
    bench.cycles(2000)
    assert any(volts != 0 for _, volts, _ in bench.device.outputs[-10:])
    bench.board[Slot.STOP_REQUESTS] += 1
    bench.cycles(1)
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)
    assert bench.board[Slot.LATCHED] == 1
    bench.cycles(300)
    assert not any(volts or on for _, volts, on in bench.device.outputs[-300:])
    bench.cycles(4000)  # the spring takes the finger back
    assert bench.ask(Initialise()) == ""
    assert "latched" in bench.ask(Enable())
    assert bench.ask(Release()) == ""
    assert bench.ask(Enable()) == ""
    assert bench.ask(Disable()) == ""
    bench.device.position -= 1.0  # turned by hand
    assert "stands at -57" in (told := bench.ask(Enable()))
    assert "limits of -20° to 160°; turn it back by hand, or initialise." in told
    assert bench.board[Slot.FAULTS] == 0


def test_samples_are_counted_on_over_a_stop() -> None:
    bench = Driven(FakeDevice())
    bench.run()
    bench.cycles(500)
    bench.board[Slot.STOP_REQUESTS] += 1
    bench.cycles(500)
    assert np.all(np.diff(bench.column("index")) == 1)


def test_after_a_fault_only_reset_initialise_enable_by_hand_lead_back() -> None:
    bench = Driven(FakeDevice(fault_at=1500))
    bench.run()
    bench.cycles(2500)
    assert bench.loop.machine.mode is Mode.FAULT
    assert "hiccup" in bench.fault
    assert "fault" in bench.ask(Initialise())
    assert "fault" in bench.ask(Start(SINE))
    assert bench.ask(Reset()) == ""
    assert bench.ask(Enable()) != ""
    bench.cycles(1500)
    for command in (Initialise(), Enable(), Start(SINE)):
        assert bench.ask(command) == ""


def test_initialise_sets_predefined_values_and_tare_the_load_cell() -> None:
    device = FakeDevice()
    bench = Driven(device)
    device.position = 0.25
    device.blocked = True
    bench.cycles(50)
    assert bench.ask(Initialise(position=0.0, mcp=0.0, pip=math.radians(10.0))) == ""
    bench.cycles(200)
    for name, value in (("motor_position", 0.0), ("mcp_angle", 0.0), ("pip_angle", math.radians(10.0))):
        assert bench.column(name)[-100:].mean() == pytest.approx(value, abs=1e-3)
    device.position = 0.75  # the spring of the load cell: 1 N
    bench.cycles(100)
    assert bench.column("endpoint_force")[-50:].mean() == pytest.approx(1.0, abs=5e-3)
    assert bench.ask(Tare()) == ""
    bench.cycles(100)
    assert bench.column("endpoint_force")[-50:].mean() == pytest.approx(0.0, abs=5e-3)


def test_initialising_waits_until_the_motor_stands() -> None:
    """A swing of 1 rad from end to end falls to the 1 degree that counts as rest within 4 / 1.67 s."""
    device = FakeDevice()
    bench = Driven(device)
    device.position = 0.5  # the spring swings it
    assert bench.ask(Initialise(position=0.1)) == ""
    assert 1800 < bench.board[Slot.INDEX] < 3400
    assert bench.loop.machine.mode is Mode.INITIALISED
    bench.cycles(1)
    assert bench.column("motor_position")[-1] == pytest.approx(0.1, abs=math.radians(0.5))


def test_initialising_a_motor_that_never_stands_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fake_device, "FRICTION", 0.0)
    device = FakeDevice()
    bench = Driven(device)
    device.position = 0.5
    assert "not at rest" in bench.ask(Initialise())
    assert 5000 <= bench.board[Slot.INDEX] < 5600
    assert bench.loop.machine.mode is Mode.IDLE


def test_the_approach_stops_where_the_force_is_reached() -> None:
    bench = Driven(FakeDevice())
    assert bench.ask(SetUp("contact", "flexion")) == ""
    bench.run({"kind": "blocked", "offset_deg": 0.0, "duration_s": 60.0})
    assert bench.ask(Approach(force=0.8, speed=math.radians(12.0), limit=math.radians(150.0))) == ""
    bench.cycles(8000, lambda: bench.board[Slot.APPROACHED] != 0)
    assert bench.board[Slot.APPROACHED] == 1
    # 4 N/rad from 0.5 rad on: 0.8 N stands at 0.7 rad.
    assert bench.board.number(Number.APPROACH) == pytest.approx(0.7, abs=0.01)
    bench.cycles(1500)
    assert bench.column("motor_position")[-1] == pytest.approx(0.7, abs=0.01)


@pytest.mark.parametrize(
    ("trajectory", "words"),
    [
        ({**SINE, "offset_deg": 200.0}, "limits are"),
        ({**SINE, "frequency_hz": 20.0}, "the limit is"),
        ({**SINE, "kind": "wobble"}, "should be one of"),
        ({"kind": "sine"}, "amplitude_deg"),
    ],
)
def test_an_impossible_trajectory_is_refused_before_anything_moves(
    trajectory: dict[str, object], words: str
) -> None:
    bench = Driven(FakeDevice())
    assert bench.ask(Initialise()) == ""
    assert bench.ask(Enable()) == ""
    assert words in bench.ask(Start(trajectory))
    bench.cycles(100)
    assert not any(volts for _, volts, _ in bench.device.outputs)


def test_disable_keeps_the_reference_and_the_cable_is_changed_only_then() -> None:
    bench = Driven(FakeDevice())
    bench.run()
    assert "disable" in bench.ask(SetUp("contact", "flexion"))
    assert bench.ask(Disable()) == ""
    assert not bench.device.enabled
    assert bench.loop.machine.mode is Mode.INITIALISED
    assert bench.ask(SetUp("contact", "flexion")) == ""
    assert bench.device.phase == "contact"
    assert "running trajectory" in bench.ask(Finish())


def test_the_same_bench_gives_the_same_samples_every_time() -> None:
    rows = []
    for _ in range(2):
        bench = Driven(FakeDevice())
        bench.run()
        bench.cycles(3000)
        rows.append(bench.ring.last(3000))
    np.testing.assert_array_equal(rows[0], rows[1])


def test_lost_cycles_pass_in_the_trajectory_too() -> None:
    bench = Driven(FakeDevice(lost={0: 40, 2500: 7}))  # those before the first sample were not lost
    bench.run()
    bench.cycles(3500)
    run = bench.column("run") == 1
    index = bench.column("index")[run] - bench.board[Slot.RUN_START]
    assert np.diff(index).max() == 8
    np.testing.assert_allclose(
        bench.column("motor_command")[run], read_trajectory(SINE).command(index / 1000.0), atol=1e-7
    )
    assert bench.board[Slot.LOST] == 7
