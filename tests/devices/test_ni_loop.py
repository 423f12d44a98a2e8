"""The whole control loop on the real nidaqmx package and a virtual PCIe-6343, with a finger behind it."""

from __future__ import annotations

import math

import grpc
import numpy as np
import pytest

from fingerlab.acquisition.control.machine import (
    Approach,
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
from fingerlab.acquisition.status import Number, Slot
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.simulated import SimulatedBench, Simulation
from tests.acquisition.driving import SINE, Driven

from .card_bench import BUFFERED, SINGLE, assert_safe, failing, rig_with
from .virtual_card import Card, InProcessChannel, Servicer

MODES = pytest.mark.parametrize("text", [SINGLE, BUFFERED], ids=["single-point", "buffered"])


def driven(text: str = SINGLE) -> tuple[Card, Driven, InProcessChannel]:
    rig = rig_with(text)
    card = Card(SimulatedBench(Simulation(seed=2), rig.daq))
    channel = InProcessChannel(Servicer(card))
    return card, Driven(NiCard(rig, card.clock, channel)), channel


def in_motion(text: str = SINGLE, cycles: int = 1000) -> tuple[Card, Driven, InProcessChannel]:
    card, bench, channel = driven(text)
    bench.run({**SINE, "ramp_s": 0.5}, endless=True)
    bench.cycles(cycles)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    assert card.line
    return card, bench, channel


def hung_anew(card: Card, bench: Driven) -> None:
    """After a stop the pulley runs out, the cable slack; a person hangs it anew, and all is at rest."""
    assert isinstance(card.plant, SimulatedBench)
    card.plant.set_up("on_air", "extension", 0.0)
    bench.cycles(600)


@MODES
def test_it_follows_and_gives_the_same_samples_every_time(text: str) -> None:
    records = []
    for _ in range(2):
        _, bench, _ = in_motion(text, 4000)
        records.append(bench.ring.last(4000))
        error = bench.column("motor_command")[-3000:] - bench.column("motor_position")[-3000:]
    np.testing.assert_array_equal(records[0], records[1])
    # At 100 Hz the loop is a tenth as stiff: of a sine of 1 Hz against the finger's springs two thirds would
    # be left. What it feeds forward brings the motor nearer to its command than 1 kHz alone does.
    assert math.degrees(float(np.sqrt(np.mean(error[-1000:] ** 2)))) < (1.0 if text == SINGLE else 0.3)
    last = np.degrees(bench.column("motor_position")[-1000:])
    assert np.ptp(last) == pytest.approx(30.0, abs=1.5 if text == SINGLE else 0.3)
    slope = bench.board.number(Number.FEED_FORWARD)
    assert slope == (0.0 if text == SINGLE else pytest.approx(0.8, abs=0.1))
    assert last.mean() == pytest.approx(22.0, abs=0.3)
    assert np.all(np.diff(records[0][:, 0]) == 1)


def test_a_card_that_turns_out_to_be_read_in_blocks_is_driven_at_the_rate_of_its_blocks() -> None:
    rig = rig_with('[daq]\ntiming = "auto"\n')
    card = Card(SimulatedBench(Simulation(seed=2), rig.daq))
    bench = Driven(NiCard(rig, card.clock, InProcessChannel(Servicer(card))))  # known only once it is open
    bench.run({**SINE, "ramp_s": 0.5}, endless=True)
    bench.cycles(4000)
    assert bench.board[Slot.HOLD] == 10
    changes = bench.column("index")[-999:][np.diff(bench.column("current_command")[-1000:]) != 0.0]
    assert set(changes % 10) == {9.0}  # from the newest sample of a block, not from its oldest
    last = np.degrees(bench.column("motor_position")[-1000:])
    assert np.ptp(last) == pytest.approx(30.0, abs=0.3)  # with the gains of 1 kHz it would shake


def test_a_fast_sine_that_brakes_before_it_has_pulled_hard_is_no_wrong_sense() -> None:
    """With 0.15 A of its 3 Hz the motor is braked first: it had gone with less current for degrees before."""
    _, bench, _ = driven(BUFFERED + "block = 5\n")
    bench.run({**SINE, "frequency_hz": 3.0, "ramp_s": 1.0}, endless=True)
    bench.cycles(2500)
    assert bench.fault == ""
    assert np.ptp(np.degrees(bench.column("motor_position")[-1000:])) == pytest.approx(30.0, abs=3.0)


@MODES
def test_a_finger_that_leaves_what_it_presses_comes_softly_to_rest(text: str) -> None:
    """Pressing, it asks for ten times the current of its springs; what leaves must not be pushed as hard."""
    rig = rig_with(text)
    card = Card(SimulatedBench(Simulation(seed=2, phase="contact"), rig.daq))
    bench = Driven(NiCard(rig, card.clock, InProcessChannel(Servicer(card))))
    find = Approach(0.8, math.radians(12.0), math.radians(150.0))
    for command in (SetUp("contact", "flexion"), Initialise(), Tare(), Enable(), find):
        assert bench.ask(command) == ""
    bench.cycles(8000, lambda: bench.board[Slot.APPROACHED] == 1)
    assert bench.column("endpoint_force")[-1] > 0.5
    assert bench.ask(Finish()) == ""
    bench.cycles(4000)
    assert bench.fault == ""
    assert np.degrees(bench.column("motor_position")[-4000:]).min() > -18.0
    assert bench.board.number(Number.FEED_FORWARD) == 0.0


@MODES
def test_a_stop_leaves_nothing_at_the_terminals_and_the_bench_can_be_seen(text: str) -> None:
    card, bench, _ = in_motion(text)
    bench.board[Slot.STOP_REQUESTS] += 1
    bench.cycles(1)
    assert_safe(card)
    before = len(card.history)
    bench.cycles(500)
    hung_anew(card, bench)
    assert not any(volts or line for volts, line in card.history[before:])
    assert np.all(np.diff(bench.column("index")[-2000:]) == 1)
    for command in (Release(), Initialise(), Enable(), Start(SINE)):
        assert bench.ask(command) == ""
    bench.cycles(1500)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault


CALLS = {
    -200279: ("ReadAnalogF64", BUFFERED),
    -200284: ("ReadAnalogF64", SINGLE),
    -200010: ("ReadAnalogF64", SINGLE),
    -200361: ("ReadAnalogF64", BUFFERED),
    -209829: ("ReadAnalogF64", BUFFERED),
    -200714: ("ReadAnalogF64", BUFFERED),
    -209800: ("ReadAnalogF64", SINGLE),
    -209801: ("WriteAnalogScalarF64", SINGLE),
    -209802: ("ReadAnalogF64", SINGLE),
    -209803: ("ReadCounterScalarF64", SINGLE),
}


@pytest.mark.parametrize("code", CALLS)
def test_every_error_in_full_motion_takes_the_current_away_and_can_be_recovered_from(code: int) -> None:
    call, text = CALLS[code]
    card, bench, _ = in_motion(text)
    came = len(card.history)
    card.hooks[call] = lambda: (card.hooks.clear(), failing(code)())[
        1
    ]  # once: the stop itself is not refused
    bench.cycles(40, lambda: bool(bench.board[Slot.FAULTS]))
    assert bench.loop.machine.mode is Mode.FAULT
    assert f"(NI-DAQmx {code})" in bench.fault
    assert "by hand" not in bench.fault
    assert_safe(card)
    live = [k for k, (volts, line) in enumerate(card.history) if volts or line]
    assert live[-1] - came <= 10  # the block that was under way
    assert bench.ask(Enable()) != ""
    hung_anew(card, bench)
    for command in (Reset(), Initialise(), Enable(), Start(SINE)):
        assert bench.ask(command) == ""
    bench.cycles(300)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault


@pytest.mark.parametrize("code", [-200220, -88709, -200088])
def test_a_card_that_is_gone_ends_the_loop(code: int) -> None:
    card, bench, _ = in_motion()
    card.hooks["ReadAnalogF64"] = failing(code)
    bench.cycles(1)
    assert bench.loop.ended
    assert f"NI-DAQmx {code}" in bench.fault
    assert_safe(card)  # the terminals still answered


def test_a_server_that_is_gone_is_told_with_what_is_left_to_do() -> None:
    card, bench, channel = in_motion(BUFFERED)
    channel.lost = grpc.StatusCode.UNAVAILABLE
    bench.cycles(20)
    assert bench.loop.ended
    assert "does not answer" in bench.fault
    assert "switch the amplifier off by hand" in bench.fault
    channel.lost = None
    bench.loop.close()  # as its process does at its end
    assert_safe(card)


@pytest.mark.parametrize("layout", ["rows", "packed"])
def test_partial_reads_lose_nothing_and_stop_nothing(layout: str) -> None:
    card, bench, _ = in_motion(BUFFERED)
    card.layout = layout
    for _ in range(5):
        card.partial = 4
        bench.cycles(50)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    assert np.all(np.diff(bench.column("index")) == 1)
    speed = np.diff(bench.column("motor_position")) * 1000.0
    assert np.abs(speed).max() < 3.0  # no count in another sample's place


def test_a_partial_read_that_cannot_be_told_apart_is_a_gap_and_no_fault() -> None:
    card, bench, _ = in_motion(BUFFERED)
    card.layout, card.partial = "zeros", 4
    bench.cycles(200)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    steps = np.diff(bench.column("index"))
    assert sorted(steps[steps > 1].tolist()) == [5.0]
    assert bench.board[Slot.LOST] == 4


@pytest.mark.parametrize(("cycles", "mode"), [(10, Mode.RUNNING), (30, Mode.FAULT)])
def test_cycles_that_pass_unseen(cycles: int, mode: Mode) -> None:
    card, bench, _ = in_motion()
    card.pass_time(cycles)
    bench.cycles(50)
    assert bench.loop.machine.mode is mode, bench.fault
    assert bench.board[Slot.LOST] == cycles - 1
    if mode is Mode.FAULT:
        assert_safe(card)
        assert "29 ms" in bench.fault or "30 ms" in bench.fault
