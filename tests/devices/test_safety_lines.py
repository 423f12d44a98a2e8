"""Dead-man, emergency stop and "amplifier ready" on the real nidaqmx package and a virtual PCIe-6343."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fingerlab.acquisition.control.machine import Disable, Enable, Initialise, Mode, Reset, Start
from fingerlab.acquisition.status import Input, Slot
from fingerlab.core.errors import UserError
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import DeviceFault
from fingerlab.devices.simulated import SimulatedBench, Simulation
from fingerlab.rig.daq import plain_section
from fingerlab.rig.file import default_rig, parse_rig
from tests.acquisition.driving import SINE, Driven

from .card_bench import BUFFERED, SINGLE, assert_safe, failing, rig_with
from .safety_wiring import DEAD_MAN, READY, STOP, WIRED
from .virtual_card import Card, InProcessChannel, Servicer

MODES = pytest.mark.parametrize("text", [SINGLE, BUFFERED], ids=["single-point", "buffered"])
COMMAND = {SINGLE: 1, BUFFERED: 10}  # ms from one command to the next


def driven(text: str, lines: str = WIRED) -> tuple[Card, Driven]:
    rig = rig_with(text + lines)
    card = Card(SimulatedBench(Simulation(seed=2), rig.daq))
    card.inputs = {STOP: True, READY: True}  # 5 V through the contact of a stop that is not pressed
    return card, Driven(NiCard(rig, card.clock, InProcessChannel(Servicer(card))))


def in_motion(text: str, lines: str = WIRED) -> tuple[Card, Driven]:
    card, bench = driven(text, lines)
    bench.run({**SINE, "ramp_s": 0.5}, endless=True)
    bench.cycles(1000)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    return card, bench


@MODES
def test_the_dead_man_changes_with_every_command_from_enable_on(text: str) -> None:
    card, bench = driven(text)
    bench.cycles(300)
    assert bench.ask(Initialise()) == ""
    assert DEAD_MAN not in card.edges  # nothing is enabled
    assert bench.ask(Enable()) == ""
    begun = card.edges[DEAD_MAN][0]
    assert bench.ask(Start({**SINE, "ramp_s": 0.5})) == ""
    bench.cycles(2000)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    edges = np.array(card.edges[DEAD_MAN])
    assert set(np.diff(edges)) == {COMMAND[text]}
    assert len(edges) == pytest.approx((len(card.history) - begun) / COMMAND[text], abs=1.5)


@MODES
@pytest.mark.parametrize("end", ["stop", "disable", "fault", "hang", "killed"])
def test_whatever_ends_the_drive_ends_the_beat(text: str, end: str) -> None:
    card, bench = in_motion(text)
    if end == "stop":
        bench.board[Slot.STOP_REQUESTS] += 1
    elif end == "disable":
        assert bench.ask(Disable()) == ""
    elif end == "fault":
        card.hooks["ReadAnalogF64"] = lambda: (card.hooks.clear(), failing(-200010)())[1]
    now = len(card.history)
    if end in (
        "hang",
        "killed",
    ):  # the card's clock goes on, its tasks stay as they are: nobody takes them down
        card.pass_time(2000)
        assert card.line
    else:
        bench.cycles(500)
        assert_safe(card)
    assert card.edges[DEAD_MAN][-1] <= now + COMMAND[text]


@MODES
def test_no_task_of_the_dead_man_has_a_clock(text: str) -> None:
    """What free-runs on the card would go on while the computer stands still."""
    card, bench = in_motion(text)
    beating = [t for t in card.tasks.values() if any(c.terminal == DEAD_MAN for c in t.channels)]
    assert [task.mode for task in beating] == [None]
    assert bench.device.safety_lines.dead_man.hold_time == pytest.approx(0.05)


@MODES
def test_the_emergency_stop_takes_all_down_and_holds_it_down(text: str) -> None:
    card, bench = in_motion(text)
    card.inputs[STOP] = False  # pressed, or its wire is off
    pressed = len(card.history)
    bench.cycles(30, lambda: bool(bench.board[Slot.FAULTS]))
    assert "emergency stop was pressed" in bench.fault
    assert_safe(card)
    live = [k for k, (volts, line) in enumerate(card.history) if volts or line]
    assert live[-1] - pressed <= 2 * COMMAND[text]
    bench.cycles(100)
    assert "release it at its button" in bench.ask(Reset())
    card.inputs[STOP] = True
    bench.cycles(20)
    assert bench.ask(Reset()) == ""
    assert bench.board[Slot.EMERGENCY_STOP] == Input.NO


@MODES
def test_an_amplifier_that_is_not_ready(text: str) -> None:
    card, bench = in_motion(text)
    card.inputs[READY] = False
    bench.cycles(30, lambda: bool(bench.board[Slot.FAULTS]))
    assert "no longer ready" in bench.fault
    assert_safe(card)


def test_each_line_may_stand_alone_and_have_its_own_sense() -> None:
    alone = f'[daq.amplifier_ready]\nterminal = "{READY}"\nactive_high = false\n'
    card, bench = driven(SINGLE, alone)
    card.inputs[READY] = False
    bench.run(SINE)
    assert bench.board[Slot.EMERGENCY_STOP] == Input.NONE
    assert bench.board[Slot.AMPLIFIER_READY] == Input.YES
    assert DEAD_MAN not in card.edges
    stop, ready = bench.device.exchange(0.0).lines
    assert math.isnan(stop)
    assert ready == 1.0


def test_a_line_that_the_card_refuses_takes_the_current_away() -> None:
    card, bench = in_motion(SINGLE)
    card.hooks["ReadDigitalLines"] = lambda: (card.hooks.clear(), failing(-200088)())[1]
    bench.cycles(2)
    assert bench.loop.machine.mode is Mode.FAULT
    assert_safe(card)


def test_a_beat_without_a_clock_is_refused() -> None:
    _, bench = driven(SINGLE)
    bench.device.make_safe()
    with pytest.raises(DeviceFault, match="not running"):
        bench.device.beat()


def test_a_rig_file_without_the_lines_reads_as_ever() -> None:
    daq = default_rig().daq
    assert [daq.dead_man.terminal, daq.emergency_stop.terminal, daq.amplifier_ready.terminal] == ["", "", ""]
    assert not {"dead_man", "emergency_stop", "amplifier_ready"} & plain_section(daq).keys()
    wired = parse_rig(SINGLE + WIRED, "here").daq
    assert wired.dead_man.hold_time == pytest.approx(0.05)  # given in ms
    assert plain_section(wired)["emergency_stop"] == {"terminal": STOP, "active_high": False}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[daq.dead_man]\nterminal = "port0/line0"\n', "dead_man and enable are both on port0/line0"),
        ('[daq.emergency_stop]\nterminal = "port0/line3"\n[daq.amplifier_ready]\nterminal = "port0/line3"\n',
         "both on port0/line3"),
        (f'{BUFFERED}[daq.dead_man]\nterminal = "{DEAD_MAN}"\nhold_time = 0.03\n', "0.04 s"),
        (f'{SINGLE}[daq.dead_man]\nterminal = "{DEAD_MAN}"\nhold_time = 0.5\n', "to 0.05 s, in which"),
        (f'{BUFFERED}block = 10\nrate_hz = 500\n[daq.dead_man]\nterminal = "{DEAD_MAN}"\n',
         "make block smaller, or"),
        (f'[daq.amplifier_ready]\nterminal = "{READY}"\nsettling_time = 5.0\n', "0 to 2 s"),
        ('[daq.dead_man]\nline = "x"\n', "unknown 'line'"),
        ('[daq.emergency_stop]\nterminal = 3\n', "text in quotes"),
    ],
)  # fmt: skip
def test_lines_that_no_bench_can_have(text: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        parse_rig(text, "the rig")


def test_a_card_that_falls_back_to_blocks_is_driven_and_beaten_by_blocks() -> None:
    """Only the open card tells: gains for 1 kHz at 100 Hz would shake the bench."""
    auto = '[daq]\ntiming = "auto"\n'
    rig = rig_with(auto + WIRED)
    card = Card(SimulatedBench(Simulation(seed=2), rig.daq))
    card.single_point, card.inputs = False, {STOP: True, READY: True}
    bench = Driven(NiCard(rig, card.clock, InProcessChannel(Servicer(card))))
    bench.run({**SINE, "ramp_s": 0.5}, endless=True)
    bench.cycles(3000)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    assert set(np.diff(card.edges[DEAD_MAN])) == {10}
    commands = np.flatnonzero(np.diff(bench.column("current_command")[-2000:])) % 10
    assert len(set(commands)) == 1  # one command a block
