"""Nobody drives before the guardian has tried that it can stop the motor."""

from __future__ import annotations

import multiprocessing
import signal
from pathlib import Path

import pytest

from fingerlab.acquisition.bench.guardian import try_stop
from fingerlab.acquisition.bench.process_bench import ProcessBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Disable, Enable, Initialise, Mode, Start
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.status import Block, SharedStatus, Slot, Text
from fingerlab.cli.common import Interrupts
from fingerlab.core.errors import UserError
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import DeviceFault, DeviceLost
from fingerlab.rig.file import default_rig
from tests.acquisition.driving import SINE, Driven
from tests.acquisition.fake_device import FakeDevice
from tests.acquisition.guarded import Interrupting, TellingChoice, Unsafe
from tests.devices.card_bench import bench as card_bench
from tests.devices.card_bench import failing
from tests.faults.live_card import served
from tests.faults.window import PATIENT

SETTINGS = LoopSettings(BenchUnits.from_rig(default_rig()), PATIENT)


class Raising(FakeDevice):
    """A device of somebody's own that breaks the protocol."""

    def make_safe(self) -> bool:
        raise ZeroDivisionError("of their own making")


@pytest.mark.parametrize(
    ("device", "ready", "words"),
    [
        (None, 1, ""),
        (FakeDevice(), 1, ""),
        (FakeDevice(unsafe=1), -1, "fake bench does not confirm zero output and a low enable line"),
        (Raising(), -1, "ZeroDivisionError: of their own making"),
    ],
    ids=["in the loop", "confirms", "does not confirm", "breaks its word"],
)
def test_the_trial_and_what_is_said_of_it(device: FakeDevice | None, ready: int, words: str) -> None:
    board = SharedStatus.make(shared=False)
    try_stop(device, board)
    assert board[Slot.GUARDIAN_READY] == ready
    assert words in board.text(Text.GUARDIAN)


def test_without_a_guardian_the_bench_is_seen_and_not_driven() -> None:
    bench = Driven(FakeDevice())
    bench.board[Slot.GUARDIAN_READY] = 0
    assert bench.ask(Initialise()) == ""
    assert "is not ready; open the bench again" in bench.ask(Enable())
    bench.board[Slot.GUARDIAN_READY] = -1
    bench.board.set_text(Text.GUARDIAN, "It could not.")
    assert bench.ask(Enable()) == "It could not."
    assert bench.loop.machine.mode is Mode.INITIALISED
    assert not bench.device.enabled
    bench.board[Slot.GUARDIAN_READY] = 1
    assert bench.ask(Enable()) == ""


def test_a_card_is_tried_without_taking_it_from_who_has_it() -> None:
    card, guardian, channel = card_bench()
    guardian.try_stop()
    assert (card.resets, card.volts, card.line) == (0, 0.0, False)
    driving = NiCard(guardian.rig, card.clock, channel)
    driving.open()
    driving.start()
    driving.set_enable(True)
    for _ in range(5):
        driving.exchange(0.5)
    calls = dict(channel.servicer.calls)
    assert guardian.make_safe()  # the loop is dead; its tasks still hold the terminals
    made = {name: count - calls.get(name, 0) for name, count in channel.servicer.calls.items()}
    assert (card.resets, card.volts, card.line) == (1, 0.0, False)
    assert made["WriteDigitalLines"] == 2  # refused once, and written anew after the reset
    assert made["WriteAnalogScalarF64"] == 1
    taken, other, _ = card_bench()
    taken.hooks["WriteDigitalLines"] = failing(-200587)
    board = SharedStatus.make(shared=False)
    try_stop(other, board)
    assert board[Slot.GUARDIAN_READY] == -1
    assert "in use by another program" in board.text(Text.GUARDIAN)
    assert taken.resets == 0


def test_the_guardian_of_a_second_program_never_takes_the_amplifier_from_the_first() -> None:
    """The second is killed while it begins: its guardian is no reason to reset the first one's card."""
    card, first, channel = card_bench()
    first.open()
    first.start()
    first.set_enable(True)
    for _ in range(5):
        first.exchange(0.5)
    guardian = NiCard(first.rig, card.clock, channel)
    with pytest.raises(DeviceFault, match="in use by another program"):
        guardian.try_stop()
    assert not guardian.make_safe()  # its own loop died without a word
    assert (card.resets, card.volts, card.line) == (0, 0.5, True)
    assert first.exchange(0.5).index == 5
    first.close()
    assert guardian.make_safe()  # nobody has the card any more


def test_who_loses_the_card_to_a_reset_hears_that_another_program_may_have_done_it() -> None:
    card, first, _ = card_bench()
    first.open()
    first.start()
    first.exchange(0.0)
    card.reset()
    with pytest.raises(DeviceLost, match="reset by hand or by another program, while it was running"):
        first.exchange(0.0)


def test_a_guardian_whose_stop_fails_refuses_the_enable(tmp_path: Path) -> None:
    bench = ProcessBench(Unsafe(), SETTINGS, tmp_path)
    try:
        bench.ask(Initialise())
        with pytest.raises(UserError, match="does not confirm zero output"):
            bench.ask(Enable())
        assert not bench.status().enabled
    finally:
        bench.close()


def test_the_driver_is_there_and_the_tasks_are_tried_before_the_motor_is_enabled(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with served(tmp_path / "output") as card:
        bench = ProcessBench(TellingChoice(card.choice, log), SETTINGS, tmp_path)
        try:
            for command in (Initialise(), Enable(), Disable()):
                bench.ask(command)
            guardian, loop = bench.recorder_process.pid, bench.loop_process.pid
        finally:
            bench.close()
    lines = log.read_text(encoding="utf-8").splitlines()
    assert lines[0] == f"{guardian} tried, drivers there"
    assert lines[1].startswith(f"{loop} opened")
    assert f"{loop} enable True, drivers there" in lines[2:]


def test_who_is_asked_to_end_while_the_processes_are_made_gives_all_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen before: memory left to the system's tracker, which warned of it, and processes left alone."""
    made: list[str] = []
    make = Block.make

    def noted(size: int, shared: bool) -> Block:
        block = make(size, shared)
        made.append(str(block.name))
        return block

    monkeypatch.setattr(Block, "make", noted)
    with Interrupts(lambda: None), pytest.raises(KeyboardInterrupt):
        ProcessBench(Interrupting(), SETTINGS, tmp_path)
    assert len(made) == 2
    for name in made:
        with pytest.raises(FileNotFoundError):
            Block.attach(name)
    assert not multiprocessing.active_children()


def test_who_is_asked_to_end_while_the_bench_is_closed_closes_it_and_then_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen before: the recorder was not told to end, and the program waited for it without an end."""
    bench = ProcessBench(Unsafe(), SETTINGS, tmp_path)
    monkeypatch.setattr(bench, "stop", lambda: signal.raise_signal(signal.SIGTERM))
    with Interrupts(lambda: None), pytest.raises(KeyboardInterrupt):
        bench.close()
    assert not multiprocessing.active_children()


def test_a_card_that_is_gone_is_told_by_who_opens_it() -> None:
    card, device, _ = card_bench()
    card.hooks["WriteDigitalLines"] = failing(-88709)
    with pytest.raises(DeviceLost):
        device.open()


def test_without_the_line_all_but_the_line_is_as_ever() -> None:
    bench = Driven(FakeDevice())
    for command in (Initialise(), Enable(line=False), Start(SINE)):
        assert bench.ask(command) == ""
    bench.cycles(800)
    assert bench.loop.machine.mode is Mode.RUNNING
    assert bench.board[Slot.ENABLE_LINE] == 0
    assert bench.board[Slot.RUN_ACTIVE] == 1  # the guardian watches it for that
    assert max(abs(volts) for _, volts, _ in bench.device.outputs) > 0.5
    assert not any(enabled for _, _, enabled in bench.device.outputs)
    assert bench.device.position == 0.0
