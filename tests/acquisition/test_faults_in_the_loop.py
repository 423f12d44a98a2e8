"""Every fault, at a moment of full motion: zero output and enable low within 50 ms of plant time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fingerlab.acquisition.bench.loop import STOOD_STILL
from fingerlab.acquisition.control.machine import (
    Disable,
    Enable,
    Finish,
    Initialise,
    Mode,
    Quit,
    Release,
    Reset,
    SetUp,
    Start,
    Tare,
)
from fingerlab.acquisition.control.plausibility import safety_checks
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.status import Slot
from fingerlab.devices.protocol import DeviceFault
from fingerlab.rig.file import default_rig
from fingerlab.rig.limits import Limits
from tests.acquisition.driving import SINE, Driven
from tests.acquisition.fake_device import FakeDevice

AT = 2400

FAULTS: dict[str, tuple[dict[str, Any], int, str]] = {
    "load cell gives no number": ({"nan": {0: AT}}, 1, "force"),
    "MCP gives no number": ({"nan": {1: AT}}, 1, "MCP"),
    "PIP gives no number": ({"nan": {2: AT}}, 1, "PIP"),
    "current monitor gives no number": ({"nan": {3: AT}}, 1, "current"),
    "encoder gives no number": ({"nan": {4: AT}}, 1, "position"),
    "encoder jumps": ({"jump": (AT, 900.0)}, 1, "encoder jumped"),
    "encoder jumps back": ({"jump": (AT, -300.0)}, 1, "encoder jumped"),
    "cycles lost": ({"lost": {AT: 30}}, 31, "30 ms"),
    "late for long": ({"late": {AT: 0.03}}, 1, "30 ms"),
    "late in a row": ({"late": {AT + k: 0.002 for k in range(60)}}, 50, "late 50 times"),
    "device gone": ({"gone_at": AT}, 1, "gone"),
    "device fault": ({"fault_at": AT}, 1, "hiccup"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_ends_at_zero_output_within_50_ms_of_plant_time(name: str) -> None:
    options, cycles, words = FAULTS[name]
    bench = Driven(FakeDevice(**options))
    assert bench.ask(SetUp("contact", "flexion")) == ""
    bench.run()
    bench.cycles(3000)
    assert bench.loop.machine.mode is Mode.FAULT
    assert words in bench.fault
    live = [index for index, volts, on in bench.device.outputs if volts or on]
    assert live, "the motor was driven before"
    assert live[-1] <= AT + cycles
    assert live[-1] - AT <= 50
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)


LIMITS: dict[str, tuple[str, float]] = {
    "current": ("motor_current", 0.2),
    "torque": ("motor_torque", 0.025),
    "speed": ("motor_speed", 1.2),
    "position_high": ("motor_position", 0.5),
    "position_low": ("motor_position", 0.3),
    "mcp_high": ("mcp_angle", 0.2),
    "mcp_low": ("mcp_angle", 0.12),
    "pip_high": ("pip_angle", 0.3),
    "pip_low": ("pip_angle", 0.18),
    "force": ("endpoint_force", 0.3),
}


def beyond(name: str, values: np.ndarray, limit: float) -> np.ndarray:
    """Which of the values are beyond the limit of this name."""
    return values < limit if name.endswith("_low") else np.abs(values) > limit


@pytest.mark.parametrize("name", LIMITS)
def test_the_first_sample_beyond_a_limit_takes_the_current_away(name: str) -> None:
    column, limit = LIMITS[name]
    bench = Driven(FakeDevice())
    assert bench.ask(SetUp("contact", "flexion")) == ""
    bench.run(endless=True)
    bench.cycles(1200)
    # Narrowed while it moves: a trajectory beyond the limits would have been refused at its start.
    narrow = replace(Limits(), **{name: limit})
    while beyond(name, bench.column(column), limit)[-1]:  # begin on the safe side
        bench.cycles(1)
    inside = len(bench.column(column))
    bench.loop._safety = safety_checks(
        narrow, 1000.0, BenchUnits.from_rig(default_rig()), SetUp("contact", "flexion"), proves_drive=True
    )
    bench.cycles(1100, lambda: bool(bench.board[Slot.FAULTS]))
    outside = beyond(name, bench.column(column)[inside:], limit)
    assert outside.any(), "the motion reaches the limit"
    assert int(np.argmax(outside)) == len(outside) - 1, "the fault came in its very sample"
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)
    assert bench.loop.machine.mode is Mode.FAULT


def test_a_tension_that_rises_too_fast_takes_the_current_away() -> None:
    bench = Driven(FakeDevice(), Limits(tension_rise=40.0))
    bench.run({**SINE, "frequency_hz": 3.0}, endless=True)
    bench.cycles(1500)
    assert "tension rises" in bench.fault
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)


@pytest.mark.parametrize(
    ("channel", "phase", "words"), [(1, "on_air", "MCP"), (2, "on_air", "PIP"), (0, "contact", "load cell")]
)
def test_a_stuck_sensor_stops_the_motor(channel: int, phase: str, words: str) -> None:
    bench = Driven(FakeDevice(stuck={channel: AT}), Limits(stuck_torque=0.02))
    assert bench.ask(SetUp(phase, "flexion")) == ""
    bench.run()
    bench.cycles(3600)
    assert words in bench.fault
    live = [index for index, volts, on in bench.device.outputs if volts or on]
    assert live[-1] - AT <= 550  # half a second without any change, and enough motion meanwhile


def test_a_stuck_encoder_stops_the_motor_before_it_runs_away() -> None:
    device = FakeDevice(stuck={4: AT})
    bench = Driven(device)
    bench.run()
    where = []
    while bench.board[Slot.FAULTS] == 0 and len(where) < 3000:
        bench.cycles(1)
        where.append(device.position)
    assert bench.loop.machine.mode is Mode.FAULT
    assert max(where) - min(where) < 3.0


def test_a_blocked_motor_is_a_fault() -> None:
    device = FakeDevice()
    bench = Driven(device)
    bench.run()
    bench.cycles(1200)
    device.blocked = True
    bench.cycles(1000)
    assert "blocked" in bench.fault
    assert (device.volts, device.enabled) == (0.0, False)


@pytest.mark.parametrize(("who", "limit"), [("window", 500), ("recorder", 1000)])
def test_a_silent_process_stops_the_motor_after_its_time(who: str, limit: int) -> None:
    bench = Driven(FakeDevice())
    bench.run(endless=True)
    bench.cycles(1000)
    setattr(bench, who, False)
    bench.cycles(limit - 1)
    assert bench.loop.machine.mode is Mode.RUNNING
    bench.cycles(3)
    assert bench.loop.machine.mode is Mode.FAULT
    assert who in bench.fault


def test_a_lost_window_stops_the_motor_at_once_and_the_loop_soon_after() -> None:
    bench = Driven(FakeDevice())
    bench.run(endless=True)
    bench.cycles(1000)
    bench.loop.lose("The window has ended; the motor was stopped.", farewell=True)
    bench.cycles(1)
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)
    bench.cycles(2000)
    assert bench.loop.ended


def test_an_error_of_our_own_stops_the_motor_too() -> None:
    bench = Driven(FakeDevice())
    bench.run(endless=True)
    bench.cycles(1000)

    def broken() -> float:
        raise ZeroDivisionError("of our own making")

    bench.loop._steering.reference.next = broken
    with pytest.raises(ZeroDivisionError):
        bench.loop.run()
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)
    assert "ZeroDivisionError" in bench.fault
    assert bench.board[Slot.LOOP_ENDED] == 1
    assert bench.board[Slot.SAFE] == 1


@pytest.mark.parametrize("why", ["told to end", "the guardian has taken the device"])
def test_a_device_that_fails_in_every_cycle_does_not_keep_the_loop(
    why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is read then, and so nothing was obeyed: closing such a bench took ten seconds and a kill."""
    bench = Driven(FakeDevice())
    bench.run(endless=True)
    bench.cycles(1000)

    def failing(volts: float) -> None:
        raise DeviceFault("The fake bench fails for good.")

    monkeypatch.setattr(bench.device, "exchange", failing)
    bench.cycles(50)
    assert not bench.loop.ended
    if why == "told to end":
        bench.loop.submit(99, Quit())
    else:
        bench.board[Slot.GUARDIAN_ACTED] = 1
    bench.cycles(2)
    assert bench.loop.ended
    assert bench.fault == ("The fake bench fails for good." if why == "told to end" else STOOD_STILL)
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)


def test_zero_output_is_tried_again_and_its_failure_is_told() -> None:
    bench = Driven(FakeDevice(unsafe=3, fault_at=AT))
    bench.run()
    bench.cycles(3000)
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)
    assert "by hand" not in bench.fault
    bench = Driven(FakeDevice(unsafe=10_000, fault_at=AT))
    bench.run()
    bench.cycles(3000)
    assert "switch the amplifier off by hand" in bench.fault


ACTIONS = st.one_of(
    st.sampled_from(
        [Initialise(), Enable(), Disable(), Start(SINE, True), Finish(), Release(), Reset(), Tare()]
    ),
    st.sampled_from(["stop", "hiccup", "lost process", "wait"]),
)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(ACTIONS, max_size=25))
def test_whatever_happens_in_whatever_order_no_current_leaves_where_none_may(actions: list[Any]) -> None:
    bench = Driven(FakeDevice())
    device = bench.device
    for action in [Initialise(), Enable(), Start(SINE, True), *actions]:
        if action == "stop":
            bench.board[Slot.STOP_REQUESTS] += 1
            bench.cycles(1)
            assert (device.volts, device.enabled) == (0.0, False)
        elif action == "hiccup":
            device.fault_at = device.total
            bench.cycles(1)
            assert (device.volts, device.enabled) == (0.0, False)
        elif action == "lost process":
            bench.loop.lose("The recorder has ended; the motor was stopped.", farewell=False)
            bench.cycles(1)
            assert (device.volts, device.enabled) == (0.0, False)
        elif action == "wait":
            bench.cycles(40)
        else:
            bench.ask(action)
        bench.cycles(2)
        if not bench.loop.machine.enable_allowed:
            assert not device.enabled
        if not bench.loop.machine.command_allowed:
            assert device.volts == 0.0
