"""Emergency stop and "amplifier ready" in the loop: what they stop, what they hold back, what is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from fingerlab.acquisition.bench.bench import Bench, Kind, Status, line_words, notices
from fingerlab.acquisition.control.machine import Enable, Initialise, Mode, Release, Reset, Start
from fingerlab.acquisition.status import Input, Slot
from fingerlab.devices.protocol import Sample
from fingerlab.rig.daq import AmplifierReadyLine, DeadManLine, EmergencyStopLine, SafetyLines
from tests.acquisition.driving import SINE, Driven
from tests.acquisition.fake_device import FakeDevice

BOTH = SafetyLines(
    emergency_stop=EmergencyStopLine("port0/line2"), amplifier_ready=AmplifierReadyLine("port0/line3")
)


@dataclass
class WiredDevice(FakeDevice):
    """The fake bench with digital inputs, set by hand, and a count of the dead-man's edges."""

    safety_lines: SafetyLines = BOTH
    pressed: bool = False
    ready: bool = True
    ready_after: int = 0  # cycles after enable
    beats: int = 0
    since: int = field(default=0)

    def hold(self) -> None:
        """A hand brings the wheel to rest."""
        self.position = self.speed = 0.0

    def beat(self) -> None:
        self.beats += 1

    def set_enable(self, on: bool) -> None:
        super().set_enable(on)
        self.since = self.total

    def exchange(self, command_volts: float) -> Sample:
        sample = super().exchange(command_volts)
        rising = self.enabled and self.total - self.since < self.ready_after
        return replace(sample, lines=(float(self.pressed), float(self.ready and not rising)))


def running(device: WiredDevice) -> Driven:
    bench = Driven(device)
    bench.run(SINE, endless=True)
    bench.cycles(1000)
    assert bench.loop.machine.mode is Mode.RUNNING, bench.fault
    return bench


def status(bench: Driven) -> Status:
    return Bench.status(bench)  # type: ignore[arg-type]


def assert_dead(bench: Driven) -> None:
    assert bench.loop.machine.mode is Mode.FAULT
    assert (bench.device.volts, bench.device.enabled) == (0.0, False)


def test_the_emergency_stop_is_a_fault_in_the_very_sample_and_nothing_goes_on_before_it_is_released() -> None:
    bench = running(WiredDevice())
    bench.device.pressed = True
    bench.cycles(1)
    assert_dead(bench)
    assert bench.fault.startswith("The emergency stop was pressed")
    faults = bench.board[Slot.FAULTS]
    bench.cycles(500)
    assert bench.board[Slot.FAULTS] == faults  # said once
    assert "release it at its button" in bench.ask(Reset())
    assert bench.ask(Initialise()) != ""
    assert bench.ask(Enable()) != ""
    bench.device.pressed = False
    bench.cycles(10)
    assert bench.loop.machine.mode is Mode.FAULT  # by itself nothing comes back
    bench.device.hold()
    for command in (Reset(), Initialise(), Enable(), Start(SINE)):
        assert bench.ask(command) == ""
    assert bench.loop.machine.mode is Mode.RUNNING


@pytest.mark.parametrize("prepared", [(), (Initialise(),), (Initialise(), Enable())])
def test_it_is_a_fault_in_every_mode_and_again_in_a_fault(prepared: tuple[Initialise | Enable, ...]) -> None:
    bench = Driven(WiredDevice())
    for command in prepared:
        assert bench.ask(command) == ""
    bench.device.pressed = True
    bench.cycles(2)
    assert_dead(bench)
    bench.device.pressed = False
    bench.cycles(2)
    bench.device.pressed = True
    bench.cycles(2)
    assert bench.board[Slot.FAULTS] == 2


def test_connected_with_the_stop_pressed_it_says_so_at_once() -> None:
    bench = Driven(WiredDevice(pressed=True))
    bench.cycles(1)
    assert_dead(bench)
    assert "emergency stop" in bench.fault


def test_a_latched_stop_and_the_emergency_stop_do_not_open_each_other() -> None:
    bench = running(WiredDevice())
    bench.board[Slot.STOP_REQUESTS] += 1
    bench.cycles(1)
    bench.device.pressed = True
    bench.cycles(1)
    assert bench.ask(Release()) == ""
    assert "emergency stop is pressed" in bench.ask(Reset())
    bench.device.pressed = False
    bench.cycles(1)
    assert bench.ask(Reset()) == ""


def test_an_amplifier_that_is_not_ready_is_not_enabled() -> None:
    bench = Driven(WiredDevice(ready=False))
    assert bench.ask(Initialise()) == ""
    assert "The amplifier is not ready" in bench.ask(Enable())
    assert not bench.device.enabled
    assert bench.loop.machine.mode is Mode.INITIALISED  # nothing has failed
    bench.device.ready = True
    bench.cycles(1)
    assert bench.ask(Enable()) == ""


def test_an_amplifier_that_is_no_longer_ready_stops_with_its_sentence() -> None:
    bench = running(WiredDevice())
    bench.device.ready = False
    bench.cycles(1)
    assert_dead(bench)
    assert "no longer ready" in bench.fault
    bench.device.hold()
    assert bench.ask(Reset()) == ""  # which may be what makes it ready again
    assert bench.ask(Initialise()) == ""
    assert "not ready" in bench.ask(Enable())


@pytest.mark.parametrize(("cycles", "comes"), [(0, True), (60, True), (99, True), (150, False)])
def test_after_enable_it_has_its_settling_time(cycles: int, comes: bool) -> None:
    """100 ms in the rig file: no motion begins before it is ready, none at all where it never is."""
    bench = Driven(WiredDevice(ready_after=cycles))
    assert bench.ask(Initialise()) == ""
    answer = bench.ask(Enable())
    waited = bench.device.total - bench.device.since
    if comes:
        assert answer == ""
        assert cycles <= waited <= cycles + 3
        assert bench.ask(Start(SINE)) == ""
    else:
        assert "not ready 100 ms after" in answer
        assert answer == bench.fault
        assert_dead(bench)


def test_one_that_tells_only_when_enabled_is_not_asked_before() -> None:
    """The ADS 50/5 clears a stored fault by being enabled again."""
    late = replace(BOTH, amplifier_ready=AmplifierReadyLine("port0/line3", needs_enable=True))
    device = WiredDevice(safety_lines=late, ready=False)
    bench = Driven(device)
    assert bench.ask(Initialise()) == ""
    bench.cycles(50)
    assert bench.loop.machine.mode is Mode.INITIALISED
    assert "not ready 100 ms after" in bench.ask(Enable())
    assert_dead(bench)
    for command in (Reset(), Initialise()):
        assert bench.ask(command) == ""
    device.ready = True
    assert bench.ask(Enable()) == ""


def test_a_bench_without_the_lines_works_as_ever_and_says_that_it_has_none() -> None:
    bench = Driven(FakeDevice())
    bench.run(SINE)
    bench.cycles(100)
    now = status(bench)
    assert (now.emergency_stop, now.amplifier_ready, now.dead_man) == (Input.NONE, Input.NONE, False)
    assert set(line_words(now).values()) == {"not wired"}


DEAD_MAN = SafetyLines(dead_man=DeadManLine("port0/line1"))
ENDS: dict[str, Callable[[Driven], None]] = {
    "stop": lambda bench: bench.board.__setitem__(Slot.STOP_REQUESTS, bench.board[Slot.STOP_REQUESTS] + 1),
    "fault": lambda bench: bench.device.lost.update({bench.device.total: 30}),
    "window lost": lambda bench: bench.loop.lose("The window is gone.", farewell=True),
}


@pytest.mark.parametrize("name", ENDS)
def test_the_dead_man_beats_once_a_cycle_while_all_is_well_and_never_after(name: str) -> None:
    device = WiredDevice(safety_lines=DEAD_MAN)
    bench = Driven(device)
    bench.cycles(100)
    assert bench.ask(Initialise()) == ""
    assert device.beats == 0  # not without enable
    assert bench.ask(Enable()) == ""
    assert device.beats >= 4  # answered once a charge pump is full
    assert bench.ask(Start(SINE)) == ""
    before, cycles = device.beats, device.total
    bench.cycles(700)
    assert device.beats - before == device.total - cycles == 700
    ENDS[name](bench)
    bench.cycles(1)
    after = device.beats
    assert after - before <= 701
    bench.cycles(300)
    assert device.beats == after
    assert (device.volts, device.enabled) == (0.0, False)


def test_what_changes_is_told_in_words_with_its_time() -> None:
    bench = running(WiredDevice())
    before = status(bench)
    assert line_words(before) == {"emergency stop": "released", "amplifier": "ready", "dead-man": "not wired"}
    bench.device.pressed = True
    bench.cycles(1)
    at = bench.board[Slot.LINES_AT]
    now = status(bench)
    told = {notice.kind: notice.sentence for notice in notices(before, now, 1000.0)}
    assert [one.grave for one in notices(before, now, 1000.0) if one.kind is Kind.LINE] == [True]
    assert [one.grave for one in notices(now, before, 1000.0) if one.kind is Kind.LINE] == [False]  # released
    assert told[Kind.LINE] == f"The emergency stop was pressed at {at / 1000:.3f} s of the bench's time."
    assert "emergency stop was pressed" in told[Kind.STOPPED]
    assert line_words(now)["emergency stop"] == "pressed"
    assert bench.column("raw/emergency_stop")[-3:].tolist() == [0.0, 0.0, 1.0]
    assert bench.column("raw/amplifier_ready")[-1] == 1.0
