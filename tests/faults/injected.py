"""Every fault but a kill: put into a bench in full motion that records, on a virtual clock, and counted.

The bench is the fake one, or the same rotor on the virtual card, driven by the real ``nidaqmx`` package.

The recorder takes its turn every 20 cycles, as its process does every 20 ms. ``python -m tests.faults.sweep``
shows the table; ``test_injected.py`` holds each to its limits.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from fingerlab.acquisition.control.machine import SetUp
from fingerlab.acquisition.recorder import Recorder
from fingerlab.acquisition.recording import RunInfo, SessionInfo
from fingerlab.acquisition.status import Slot, Text
from fingerlab.core.errors import UserError
from fingerlab.devices.faults import ChargePump, Faults, LineFault
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import VirtualClock
from fingerlab.devices.simulated import SimulatedRig, simulated_rig_file
from fingerlab.rig.file import default_rig
from fingerlab.rig.limits import Limits
from fingerlab.sessions import check_session, open_session
from fingerlab.sessions.recording_files import PART_SUFFIX, RESERVE_BYTES, PartWriter
from fingerlab.twin.protocols import load_preset
from tests.acquisition.driving import SINE, Driven
from tests.acquisition.fake_device import FakeDevice
from tests.devices.card_bench import SINGLE, failing, rig_with
from tests.devices.safety_wiring import DEAD_MAN, READY, STOP, WIRED, wired
from tests.devices.virtual_card import Card, InProcessChannel, Servicer

AT = 2400
"""Cycle of the bench at which the fault comes: the motor is at full speed."""
LAST = 7000
TURN = 20
"""Cycles between two turns of the recorder: ``process.POLL_S`` at 1 kHz."""
ROOM_BYTES = 8 << 10
"""Room that is left when the disk fills up: less than the next piece of any channel."""


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        name: for the table. device: options of the fake bench, or ``clock_steps`` of the simulated one.
        during: done once at cycle ``AT``; what it enters is left when the recording ends.
        card: how a card has it that the fake device's options have no say in: called with the card and the
            cycles since ``AT``, every cycle from there on.
        most_ms: plant time within which output and enable are at zero; None where the run goes on.
        frozen: the program stands still from cycle ``AT`` on, the bench and its dead-man do not.
        words: in the sentence that the operator reads. phase: of the run.
        card_ms: the same as ``most_ms`` for a card, whose cycles pass while the program is late.
    """

    name: str
    device: dict[str, Any] = field(default_factory=dict)
    during: Callable[[ExitStack, Path], None] | None = None
    card: Callable[[Card, int], None] | None = None
    most_ms: int | None = 50
    words: str = ""
    phase: str = "contact"
    card_ms: int | None = None
    frozen: bool = False


@dataclass(frozen=True)
class Counted:
    """What became of it: ms of plant time to zero (None where the motor went on), s of samples that are not
    in the session, how that says it ended, and the operator's sentence."""

    name: str
    reaction_ms: int | None
    lost_s: float
    ended: str
    sentence: str


def fill_the_disk(stack: ExitStack, place: Path) -> None:
    """From here on the file may grow by ``ROOM_BYTES`` only; the system itself refuses the rest.

    As on a full disk, the room that the recorder has set aside can be had when it gives it up.
    """
    import resource

    def spend(writer: PartWriter) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest + ROOM_BYTES + RESERVE_BYTES, hard))
        give_up(writer)

    largest = max(path.stat().st_size for path in place.rglob(f"*{PART_SUFFIX}"))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    give_up = PartWriter._spend_reserve
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest + ROOM_BYTES, hard))
    stack.enter_context(mock.patch.object(PartWriter, "_spend_reserve", spend))
    stack.callback(resource.setrlimit, resource.RLIMIT_FSIZE, (soft, hard))


def little_room(stack: ExitStack, place: Path) -> None:
    """The disk has one megabyte left."""
    usage = shutil._ntuple_diskusage(10**9, 10**9 - 10**6, 10**6)  # type: ignore[attr-defined]
    stack.enter_context(mock.patch.object(shutil, "disk_usage", return_value=usage))


def take_the_folder_away(stack: ExitStack, place: Path) -> None:
    """The folder that is recorded to vanishes with all that is in it."""
    shutil.rmtree(place)


def set_the_clock(stack: ExitStack, place: Path) -> None:
    """Somebody sets the machine's clock an hour forward, then two back, and so on with every look at it."""
    now, hours = time.time(), cycle((1.0, -1.0))

    def jumping() -> float:
        return now + 3600.0 * next(hours)

    def jumping_ns() -> int:
        return int(1e9 * jumping())

    stack.enter_context(mock.patch.object(time, "time", jumping))
    stack.enter_context(mock.patch.object(time, "time_ns", jumping_ns))


def _unplugged(card: Card, since: int) -> None:
    card.hooks["ReadAnalogF64"] = failing(-88709)


def _hiccup(card: Card, since: int) -> None:
    if since == 0:
        card.hooks["ReadAnalogF64"] = lambda: (card.hooks.clear(), failing(-200284)())[1]


def _at_line(line: str, level: bool) -> Callable[[Card, int], None]:
    """A digital input of the card falls to this level and stays there."""

    def change(card: Card, since: int) -> None:
        card.inputs[line] = level

    return change


def _line(line: str, on: bool) -> dict[str, Any]:
    return {"lines": (LineFault(line, AT, on),)}


def _away(cycles: int, times: int = 1) -> Callable[[Card, int], None]:
    """So many cycles pass unseen, so many times in a row: the program was late for them."""
    return lambda card, since: card.pass_time(cycles) if since < times * (cycles + 1) else None


STUCK_MS = 550
"""Half a second without any change to the last bit, while what moves the sensor moves."""

FAULTS = [
    Fault("disk full", during=fill_the_disk, words="cannot be written"),
    Fault("less than 32 MB of room left", during=little_room, words="MB left", most_ms=300),
    Fault("target folder vanishes", during=take_the_folder_away, words="vanished", most_ms=300),
    Fault("device unplugged", {"gone_at": AT}, card=_unplugged, words="gone|removed", most_ms=1),
    Fault("device reports an error", {"fault_at": AT}, card=_hiccup, words="hiccup|-200284", most_ms=1),
    Fault("load cell gives no number", {"nan": {0: AT}}, words="force", most_ms=1),
    Fault("MCP sensor gives no number", {"nan": {1: AT}}, words="MCP", most_ms=1),
    Fault("PIP sensor gives no number", {"nan": {2: AT}}, words="PIP", most_ms=1),
    Fault("current monitor gives no number", {"nan": {3: AT}}, words="current", most_ms=1),
    Fault("encoder gives no number", {"nan": {4: AT}}, words="position", most_ms=1),
    Fault("load cell stuck to the last bit", {"stuck": {0: AT}}, words="load cell", most_ms=STUCK_MS),
    Fault("MCP sensor stuck to the last bit", {"stuck": {1: AT}}, words="MCP", most_ms=STUCK_MS),
    Fault("PIP sensor stuck to the last bit", {"stuck": {2: AT}}, words="PIP", most_ms=STUCK_MS),
    Fault("encoder stuck", {"stuck": {4: AT}}, words="encoder", most_ms=150),
    Fault("encoder jumps by 38 degrees", {"jump": (AT, 900.0)}, words="encoder jumped", most_ms=1),
    Fault("encoder jumps back by 13 degrees", {"jump": (AT, -300.0)}, words="encoder jumped", most_ms=1),
    Fault("one cycle 30 ms late", {"late": {AT: 0.03}}, card=_away(31), words="30 ms", most_ms=1, card_ms=32),
    Fault(
        "60 cycles in a row 2 ms late",
        {"late": {AT + k: 2e-3 for k in range(60)}},
        card=_away(3, 60),
        card_ms=151,
        words="late 50 times|tension rises",  # in blocks, late cycles may swing the cable first
    ),
    Fault("10 cycles lost", {"lost": {AT: 10}}, card=_away(11), most_ms=None),
    Fault("30 cycles lost at once", {"lost": {AT: 30}}, card=_away(31), words="30 ms", most_ms=31),
    Fault(
        "emergency stop pressed",
        _line("emergency_stop", True),
        card=_at_line(STOP, False),
        words="emergency stop was pressed",
        most_ms=1,
        phase="on_air",
    ),
    Fault(
        "amplifier no longer ready",
        _line("amplifier_ready", False),
        card=_at_line(READY, False),
        words="no longer ready",
        most_ms=1,
        phase="on_air",
    ),
    Fault(
        "computer frozen: the dead-man ends the current",
        {"lines": ()},
        words="away for",
        phase="on_air",
        frozen=True,
    ),
    Fault("machine's clock set forward and back by hours", during=set_the_clock, most_ms=None),
    Fault("rig's clock set forward by an hour", {"clock_steps": {AT: 3600.0}}, most_ms=None, phase="on_air"),
    Fault("rig's clock set back by two hours", {"clock_steps": {AT: -7200.0}}, most_ms=None, phase="on_air"),
]


class Rotor(FakeDevice):
    """The fake bench's rotor and sensors on the card's connector, under the flexion cable."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.side = 1.0

    def advance(self, volts: float, enabled: bool) -> None:
        """One cycle under the set value."""
        self.volts, self.enabled = volts, enabled
        self._move()
        self.total += 1

    def raw(self) -> tuple[float, ...]:
        """What stands at the inputs."""
        return self._raw()


class Amplified(Rotor):
    """The same behind the charge pump of a dead-man, which the card does not know of."""

    card: Card

    def __init__(self, **spoilt: Any) -> None:
        super().__init__(**spoilt)
        self.pump, self._beats = ChargePump(0.05), 0

    @property
    def driven_current(self) -> float:
        """A, under the card's set value."""
        return self.card.volts if self.card.line and self.pump.on else 0.0

    def advance(self, volts: float, enabled: bool) -> None:
        edges = len(self.card.edges.get(DEAD_MAN, ()))
        for _ in range(edges - self._beats):
            self.pump.invert()
        self._beats = edges
        self.pump.wait(1e-3)
        super().advance(volts, enabled and self.pump.on)


def possible(fault: Fault, card: bool = False) -> bool:
    """Whether this system can have the fault: Windows keeps a folder with open files, and has no limit.

    A ``card`` has a clock that nobody sets.
    """
    if card and "clock_steps" in fault.device:
        return False
    return sys.platform != "win32" or fault.during not in (fill_the_disk, take_the_folder_away)


def inject(fault: Fault, folder: Path, on_card: bool = False) -> Counted:
    """Let it happen in a recording below ``folder``, of the fake bench or of the virtual card."""
    bench = _bench_on_card(fault) if on_card else _bench(fault)
    place = folder / "place"
    place.mkdir()
    recorder = Recorder(bench.ring, bench.board, folder / "rescued", lambda: bench.loop._reader.index / 1000)
    recorder.open(SessionInfo(place / "s.h5", default_rig().to_json(), "fault", "2026-11-01T09:00:00+01:00"))
    assert bench.ask(SetUp(fault.phase, "flexion")) == ""
    bench.run({**SINE, "ramp_s": 0.5}, endless=True)
    start = bench.board[Slot.RUN_START]
    recorder.begin(RunInfo(fault.phase, "flexion", 1000.0, SINE, start))
    with ExitStack() as stack:
        came, zero = _run(bench, recorder, fault, stack, place)
        newest = bench.board[Slot.INDEX] if zero is None else zero
        sentence = bench.fault or bench.board.text(Text.RECORDER)
    path = _finish(recorder, sentence, place / "s.h5", folder / "rescued" / "s.h5")
    lost, ended = _missing(path, start, newest)
    return Counted(fault.name, None if zero is None else zero - came, lost / 1000.0, ended, sentence)


def _bench(fault: Fault) -> Driven:
    if "clock_steps" in fault.device:
        clock = VirtualClock(1e4)
        return Driven(SimulatedRig(faults=Faults(**fault.device), clock=clock))
    if "lines" in fault.device:
        rig = wired(simulated_rig_file(load_preset()))
        return Driven(SimulatedRig(rig, faults=Faults(**fault.device)))
    return Driven(FakeDevice(**fault.device), Limits(stuck_torque=0.02))


def _bench_on_card(fault: Fault) -> Driven:
    spoilt = {name: value for name, value in fault.device.items() if name in ("nan", "stuck", "jump")}
    lines = "lines" in fault.device
    plant = Amplified(**spoilt) if lines else Rotor(**spoilt)
    card = plant.card = Card(plant)
    card.inputs = {STOP: True, READY: True}
    device = NiCard(
        rig_with(SINGLE + WIRED if lines else SINGLE), card.clock, InProcessChannel(Servicer(card))
    )
    bench = Driven(device, Limits(stuck_torque=0.02))
    device.virtual = card
    return bench


def _run(
    bench: Driven, recorder: Recorder, fault: Fault, stack: ExitStack, place: Path
) -> tuple[int, int | None]:
    """Index at which the fault came, and of the first sample with zero output; None where it never fell.

    A full disk comes with the first write that it refuses.
    """
    came, frozen, faults = AT, 0, bench.board[Slot.FAULTS]
    card = getattr(bench.device, "virtual", None)
    while bench.board[Slot.INDEX] < LAST and not bench.loop.ended:
        bench.cycles(1)
        index = bench.board[Slot.INDEX]
        if card is not None and fault.card is not None and index >= AT:
            fault.card(card, index - AT)
        if fault.during is not None and index == AT:
            recorder.poll()
            fault.during(stack, place)
        if fault.frozen and index == AT:
            frozen = _freeze(bench.device, card)
        if index % TURN == 0:
            recorder.poll()
            if fault.during is fill_the_disk and bench.board[Slot.RECORDER_ERRORS]:
                came = index
        if bench.board[Slot.FAULTS] != faults:
            assert _told(bench.device, card) == (0.0, False)
            return came, came + frozen if fault.frozen else max(index, came)
    return came, None


def _freeze(device: Any, card: Card | None) -> int:
    """Let the program stand still until the motor has no current, and longer; ms of plant time to zero."""
    plant, tick = (device, lambda: device.freeze(1)) if card is None else (card.plant, card.tick)
    current = []
    for _ in range(100):
        current.append(plant.driven_current)
        tick()
    assert current[0] != 0.0
    assert current[-1] == 0.0
    return int(np.flatnonzero(current)[-1]) + 1


def _told(device: Any, card: Card | None) -> tuple[float, bool]:
    """Set value and enable line at the bench."""
    if card is not None:
        return card.volts, card.line
    if isinstance(device, SimulatedRig):
        return device.driven_current, device.enabled
    return device.volts, device.enabled


def _finish(recorder: Recorder, sentence: str, path: Path, rescued: Path) -> Path:
    """As ``fingerlab record`` does it when a run is over or broke off."""
    try:
        if sentence:
            recorder.cut(sentence)
        return recorder.close()
    except UserError:  # the recorder had to give up before
        return path if path.parent.exists() else rescued


def _missing(path: Path, start: int, newest: int) -> tuple[int, str]:
    """How many samples from ``start`` to before ``newest`` the session lacks, and how it says it ended."""
    session = open_session(path)
    assert not check_session(session).errors
    times = session.runs[0].load(["time"])["time"]
    index = start + np.rint(times * 1000.0).astype(int)
    assert len(np.unique(index)) == len(index)
    return newest - start - int((index < newest).sum()), str(session.attributes["ended"])


def table(folder: Path, on_card: bool = False) -> Iterator[str]:
    """Rows of the table in ``docs/faults.md``."""
    for number, fault in enumerate(FAULTS):
        if not possible(fault, on_card):
            continue
        place = folder / f"{number}{'c' * on_card}"
        place.mkdir()
        seen = inject(fault, place, on_card)
        zero = "goes on" if seen.reaction_ms is None else f"{max(seen.reaction_ms, 1)} ms"
        sentence = seen.sentence.replace(str(place / "place"), "FOLDER").replace(str(place), "DATA")
        yield f"| {seen.name} | {zero} | {seen.lost_s:.3f} | {seen.ended} | {sentence or '-'} |"
