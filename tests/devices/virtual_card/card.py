"""The card itself: tasks, terminals, one sample clock, and whatever hangs on its connector."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from fingerlab.devices.protocol import VirtualClock

SINGLE_POINT, CONTINUOUS = 12522, 10123
DIGITAL = ("do", "di")
ENABLE = "port0/line0"
RATE = 1000.0


class DaqFailure(Exception):
    """An error of the driver, by code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"Error {code} of the virtual card.")
        self.code = code


class Plant(Protocol):
    """What hangs on the connector: set value and enable in, raw values (four voltages, counts) out."""

    def advance(self, volts: float, enabled: bool) -> None: ...

    def raw(self) -> tuple[float, ...]: ...


class SimplePlant:
    """Currents turn a wheel; every voltage tells which cycle it is, so that misplaced samples show."""

    def __init__(self) -> None:
        self.cycle = 0
        self.wheel = 0.0

    def advance(self, volts: float, enabled: bool) -> None:
        self.cycle += 1
        self.wheel += 100.0 * volts if enabled else 0.0

    def raw(self) -> tuple[float, ...]:
        c = self.cycle
        return (c * 1e-4, 1.0 + c * 1e-4, 2.0 + c * 1e-4, 3.0 + c * 1e-4, math.floor(self.wheel))


@dataclass
class Channel:
    """A virtual channel: ``kind`` is ai, ao, ci, do or di; ``terminal`` without the device's name."""

    kind: str
    terminal: str
    low: float = -10.0
    high: float = 10.0


@dataclass
class CardTask:
    """A task as the driver keeps it."""

    name: str
    channels: list[Channel] = field(default_factory=list)
    mode: int | None = None
    source: str = ""
    buffer: int = 0
    reserved: bool = False
    running: bool = False
    pending: float | None = None
    armed_at: float = 0.0
    samples: deque[Any] = field(default_factory=deque)
    newest: Any = None
    unread: bool = False
    total: int = 0
    attributes: dict[int, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        return self.channels[0].kind if self.channels else ""


class Card:
    """State of the card. Time passes only while somebody waits for a sample, or by ``pass_time``.

    Attributes:
        volts: at the output terminal. line: level of the enable line. inputs: level of each line that is
            read; one that is not named is open, and pulled down. edges: line -> ticks at which it changed.
        hooks: RPC name -> function called first, which may raise DaqFailure, to make things go wrong.
        stopped_clock: no more edges. partial: samples that the next block read delivers instead of all.
        layout: where a partial read puts them: ``rows``, ``packed`` or ``zeros`` (whole buffer returned).
        single_point: whether the device can do that at all. refusal: how it says that it cannot.
        holds: whether the output keeps its value when a task ends.
    """

    def __init__(self, plant: Plant, clock: VirtualClock | None = None, name: str = "Dev1") -> None:
        self.plant = plant
        self.clock = clock or VirtualClock()
        self.name = name
        self.product, self.serial, self.simulated = "PCIe-6343", 0x1C0FFEE, False
        self.volts, self.line = 0.0, False
        self.inputs: dict[str, bool] = {}
        self.levels: dict[str, bool] = {}
        self.edges: dict[str, list[int]] = {}
        self.tasks: dict[str, CardTask] = {}
        self.hooks: dict[str, Callable[[], None]] = {}
        self.stopped_clock = False
        self.partial: int | None = None
        self.layout = "rows"
        self.single_point, self.refusal = True, -209857
        self.holds = True
        self.history: list[tuple[float, bool]] = []
        self.resets = 0

    # ---- tasks -----------------------------------------------------------------------------------

    def create(self, name: str) -> None:
        if name in self.tasks:
            raise DaqFailure(-200089)
        self.tasks[name] = CardTask(name)

    def task(self, name: str) -> CardTask:
        if name not in self.tasks:
            raise DaqFailure(-200088)
        return self.tasks[name]

    def add(self, name: str, kind: str, physical: str, low: float = -10.0, high: float = 10.0) -> None:
        device, _, terminal = physical.partition("/")
        if device != self.name:
            raise DaqFailure(-200220)
        if terminal not in KNOWN[kind]:
            raise DaqFailure(-200170)
        self.task(name).channels.append(Channel(kind, terminal, low, high))

    def time(self, name: str, mode: int, source: str, buffer: int) -> None:
        if mode == SINGLE_POINT and not self.single_point:
            raise DaqFailure(self.refusal)
        if source not in ("", f"/{self.name}/ai/SampleClock"):
            raise DaqFailure(-200170)
        task = self.task(name)
        task.mode, task.source, task.buffer = mode, source, buffer

    def reserve(self, name: str) -> None:
        task = self.task(name)
        if task.reserved:
            return
        if task.kind == "ai" and task.mode == SINGLE_POINT and len(task.channels) % 2:
            raise DaqFailure(-200820)
        for other in self.tasks.values():
            if other.reserved and self._clash(task, other):
                raise DaqFailure(-200587 if task.kind in DIGITAL else -50103)
        task.reserved = True

    @staticmethod
    def _clash(task: CardTask, other: CardTask) -> bool:
        """Two tasks want the same engine of the card; digital lines on demand only clash line by line."""
        if task.kind not in DIGITAL or other.kind not in DIGITAL:
            return task.kind == other.kind
        return bool({c.terminal for c in task.channels} & {c.terminal for c in other.channels})

    def start(self, name: str) -> None:
        self.reserve(name)
        task = self.task(name)
        task.running, task.total, task.unread = True, 0, False
        task.samples.clear()
        if task.kind == "ci":
            task.armed_at = self.plant.raw()[4]

    def stop(self, name: str) -> None:
        task = self.task(name)
        task.running = False
        if not self.holds and task.kind == "ao":
            self.volts = 0.0

    def clear(self, name: str) -> None:
        self.stop(name)
        del self.tasks[name]

    def reset(self) -> None:
        self.resets += 1
        self.tasks.clear()
        self.volts, self.line = 0.0, False
        self.levels.clear()

    # ---- time ------------------------------------------------------------------------------------

    def clocked(self) -> bool:
        """Whether the shared sample clock, which is the analog task's, is running."""
        return not self.stopped_clock and any(
            t.running and t.kind == "ai" and t.mode is not None for t in self.tasks.values()
        )

    def pass_time(self, cycles: int) -> None:
        """Let time pass without anybody reading."""
        for _ in range(cycles):
            self.tick()

    def tick(self) -> None:
        """One millisecond, and the edge at its end where the clock runs."""
        self.clock.sleep(1.0 / RATE)
        self.plant.advance(self.volts, self.line)
        self.history.append((self.volts, self.line))
        if not self.clocked():
            return
        raw = self.plant.raw()
        for task in self.tasks.values():
            if task.running and task.mode is not None:
                self._edge(task, raw)

    def _edge(self, task: CardTask, raw: tuple[float, ...]) -> None:
        if task.kind == "ao":
            if task.pending is not None:
                self.volts, task.pending = task.pending, None
            return
        if task.kind == "ci":
            task.newest = (raw[4] - task.armed_at) % 2**32  # the counter does not know negative numbers
        else:
            task.newest = tuple(min(max(raw[int(c.terminal[2:])], c.low), c.high) for c in task.channels)
        task.total += 1
        task.unread = True
        if task.mode == CONTINUOUS:
            task.samples.append(task.newest)

    # ---- reading and writing ---------------------------------------------------------------------

    def read_point(self, name: str, timeout: float) -> Any:
        """The newest sample that was not read yet (single-point); None where none came in time."""
        task = self._readable(name)
        waited = 0
        while not task.unread:
            if waited > timeout * RATE:
                return None
            self.tick()
            waited += 1
        task.unread = False
        return task.newest

    def read_block(self, name: str, count: int, timeout: float) -> list[Any]:
        """The oldest ``count`` samples that were not read yet, or as many as came in time."""
        task = self._readable(name)
        if len(task.samples) > task.buffer:
            raise DaqFailure(-200279)
        waited = 0
        while len(task.samples) < count and waited <= timeout * RATE:
            self.tick()
            waited += 1
        if self.partial is not None and task.kind == "ai":
            count, self.partial = self.partial, None
        return [task.samples.popleft() for _ in range(min(count, len(task.samples)))]

    def read_now(self, name: str) -> float:
        """On demand, one channel, at once."""
        task = self.task(name)
        self.reserve(name)
        channel = task.channels[0]
        if channel.terminal == "_ao0_vs_aognd":
            return self.volts + 3e-4  # offset of the inner channel
        return self.plant.raw()[int(channel.terminal[2:])]

    def write_volts(self, name: str, value: float, auto_start: bool) -> None:
        task = self.task(name)
        if not math.isfinite(value) or not task.channels[0].low <= value <= task.channels[0].high:
            raise DaqFailure(-200077)
        self.reserve(name)
        if task.mode is None:
            self.volts = value
            return
        if not (task.running or auto_start):
            raise DaqFailure(-200803 if task.mode == SINGLE_POINT else -200846)
        task.pending = value
        task.running = True

    def write_line(self, name: str, high: bool) -> None:
        terminal = self.task(name).channels[0].terminal
        self.reserve(name)
        if terminal == ENABLE:
            self.line = high
        if self.levels.get(terminal, False) is not high:
            self.edges.setdefault(terminal, []).append(len(self.history))
        self.levels[terminal] = high

    def read_levels(self, name: str) -> list[bool]:
        """On demand: the lines of a task, in its order."""
        task = self.task(name)
        self.reserve(name)
        return [self.inputs.get(channel.terminal, False) for channel in task.channels]

    def _readable(self, name: str) -> CardTask:
        task = self.task(name)
        if not task.running:
            self.start(name)
        return task


KNOWN = {
    "ai": {*(f"ai{k}" for k in range(32)), "_ao0_vs_aognd", "_ao1_vs_aognd"},
    "ao": {f"ao{k}" for k in range(4)},
    "ci": {f"ctr{k}" for k in range(4)},
    "do": {f"port0/line{k}" for k in range(32)},
    "di": {f"port0/line{k}" for k in range(32)},
}
"""Terminals of a PCIe-6343 (NI 6343 specifications: 32 analog inputs, 4 outputs, 4 counters, 48 lines)."""
