"""The charge pump of docs/rig.md against the circuit's own arithmetic, and the simulated rig behind it."""

from __future__ import annotations

import pytest

from fingerlab.acquisition.control.machine import Enable, Initialise, Mode, Reset
from fingerlab.acquisition.status import Slot
from fingerlab.devices.faults import ChargePump, Faults, fault_after
from fingerlab.devices.simulated import SimulatedRig, Simulation, simulated_rig_file
from fingerlab.twin.protocols import load_preset
from tests.acquisition.driving import SINE, Driven

from .safety_wiring import wired

HOLD = 0.05  # s, the rig file's


def simulated(faults: Faults | None = None) -> SimulatedRig:
    return SimulatedRig(wired(simulated_rig_file(load_preset())), Simulation(seed=4), faults)


def driven(faults: Faults | None = None) -> Driven:
    bench = Driven(simulated(faults))
    bench.run({**SINE, "ramp_s": 0.5}, endless=True)
    return bench


def test_one_rising_edge_fills_it_and_it_lets_go_at_30_percent() -> None:
    pump = ChargePump(HOLD)
    assert not pump.on
    pump.invert()
    assert pump.on
    # 470 nF onto 47 nF leaves 10/11 of the highest voltage, and exp(-t / RC) of that is 0.3 after 1.1087 RC.
    rc = 0.05 / 1.2039728  # ln(1 / 0.3)
    pump.wait(1.108 * rc)
    assert pump.on
    pump.wait(0.002 * rc)
    assert not pump.on


@pytest.mark.parametrize("level", [False, True])
def test_a_line_that_stands_still_holds_nothing(level: bool) -> None:
    pump = ChargePump(HOLD)
    for _ in range(200 + level):
        pump.invert()
        pump.wait(1e-3)
    assert pump.on
    pump.wait(HOLD)
    assert not pump.on


@pytest.mark.parametrize("edges_s", [1e-3, 5e-3, 10e-3])
def test_it_never_lets_go_at_the_rates_of_both_ways_of_timing(edges_s: float) -> None:
    """1 kHz sample by sample; 100 to 200 Hz in blocks: of 5 and 10 samples."""
    pump, held = ChargePump(HOLD), []
    for _ in range(500):
        pump.invert()
        held.append(pump.on)
        pump.wait(edges_s)
        held.append(pump.on)
    assert all(held)
    pump.wait(0.02)  # and is late by what the loop's own watchdog lets pass
    assert pump.on


def test_a_computer_that_freezes_takes_the_current_away_within_the_hold_time() -> None:
    for k in range(500, 512):
        bench = driven()
        bench.cycles(k)
        rig = bench.device
        assert bench.loop.machine.mode is Mode.RUNNING
        assert rig.powered
        on = 0
        while rig.powered:
            rig.freeze(1)
            on += 1
            assert on <= 50
        # Enable line and set value stand as the loop left them: nobody was there to take them down.
        assert rig.enabled
        assert rig.driven_current == 0.0
        assert on >= 48  # 50 ms from the last rising edge, which came a cycle or two before
        rig.freeze(500)
        assert not rig.powered


def test_late_cycles_up_to_the_watchdogs_limit_never_take_the_current_away() -> None:
    late = dict.fromkeys(range(1500, 4000, 100), 19)  # 20 ms away at a time is the loop's own limit
    bench = driven(Faults(lost=late))
    powered = []
    for _ in range(3500):
        bench.cycles(1)
        powered.append(bench.device.powered)  # before the next beat: nothing has filled the pump again
    assert bench.board[Slot.LOST] > 400
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    assert all(powered)


def test_a_stop_ends_the_beat_and_without_a_beat_enable_alone_drives_nothing() -> None:
    rig = simulated()
    rig.open()
    rig.start()
    rig.set_enable(True)
    for _ in range(50):
        rig.exchange(1.0)
    assert rig.enabled
    assert rig.driven_current == 0.0
    assert rig.bench.stream.now[2] == 0.0
    rig.beat()
    rig.exchange(1.0)
    assert rig.driven_current == pytest.approx(1.0)
    assert rig.make_safe()
    assert not rig.powered


class Sleeper:
    """A machine's clock that goes on while the machine sleeps."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds


def test_a_machine_that_slept_wakes_up_without_current() -> None:
    """An hour is no lateness to the loop, but the pump has long been empty."""
    clock = Sleeper()
    rig = SimulatedRig(wired(simulated_rig_file(load_preset())), Simulation(seed=4), clock=clock)
    rig.open()
    rig.start()
    rig.set_enable(True)
    for _ in range(100):
        rig.beat()
        rig.exchange(0.5)
    assert rig.driven_current == pytest.approx(0.5)
    clock.time += 3600.0
    rig.exchange(0.5)
    assert rig.enabled
    assert rig.driven_current == 0.0


def test_an_emergency_stop_for_practice_is_held_whatever_is_started_anew() -> None:
    rig = SimulatedRig(faults=fault_after("emergency-stop", 0.3, 1000.0))
    bench = Driven(rig)
    bench.cycles(301)
    assert bench.loop.machine.mode is Mode.FAULT
    bench.cycles(4990)
    assert "emergency stop is pressed" in bench.ask(Reset())
    bench.cycles(20)
    for command in (Reset(), Initialise(), Enable()):
        assert bench.ask(command) == ""
    bench.cycles(1000)  # it was pressed once
    assert bench.loop.machine.mode is Mode.ENABLED
    rig.set_line("amplifier_ready", False)
    bench.cycles(1)
    assert "no longer ready" in bench.fault
