"""A virtual card in a process of its own, in real time: it goes on when every program that drives it is gone.

``python -m tests.faults.live_card OUTPUT`` serves a PCIe-6343 with the simulated bench on its connector at a
port of this machine, prints one line of JSON with its address, and puts what stands at its terminals into the
file OUTPUT (``shared_device.LAYOUT``), with the card's own cycle and the time of the last change. It obeys
lines of JSON on standard input, ``["move_by_hand", "mcp", 0.5]`` or ``["set_up", "motor_bench", "none"]``, as
the operator at its bench, and ends with it.
"""

from __future__ import annotations

import json
import mmap
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fingerlab.acquisition.bench.processes import come_first
from fingerlab.devices.choosing import DeviceChoice, choose_device
from fingerlab.devices.simulated import SimulatedBench, Simulation
from fingerlab.rig.file import default_rig
from tests.devices.safety_wiring import READY, STOP
from tests.devices.virtual_card import Card, Servicer, TcpServer
from tests.devices.virtual_card.card import RATE, CardTask
from tests.faults.shared_device import LAYOUT, make_output

ROOT = Path(__file__).resolve().parents[2]
WORKERS = 8
"""A read that waits for its block may not keep a guardian's call waiting."""


class LiveCard(Card):
    """A card whose clock nobody turns: a thread of its own does, once a millisecond."""

    def __init__(self, plant: SimulatedBench, output: Path) -> None:
        super().__init__(plant)
        self.turned = threading.Condition()  # its lock is held by whoever looks at the card or changes it
        self.cycles = 0
        with output.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), LAYOUT.size)
        self._told = (0.0, False)
        self._changed = (0, 0)

    def tick(self) -> None:
        """Who reads waits for the clock."""
        self.turned.wait(1.0)

    def run(self) -> None:
        """The clock, for ever; after a pause of the machine it makes up for it, as time does."""
        due = time.perf_counter()
        while True:
            due += 1.0 / RATE
            time.sleep(max(0.0, due - time.perf_counter()))
            with self.turned:
                super().tick()
                self.history.clear()
                self.cycles += 1
                self.tell()
                self.turned.notify_all()

    def tell(self) -> None:
        """What stands at the terminals, into the file."""
        if (self.volts, self.line) != self._told:
            self._told, self._changed = (self.volts, self.line), (time.monotonic_ns(), self.cycles)
        self._memory[:] = LAYOUT.pack(self.cycles, self.volts, int(self.line), *self._changed, self.resets)

    def _edge(self, task: CardTask, raw: tuple[float, ...]) -> None:
        super()._edge(task, raw)
        if len(task.samples) > 2 * task.buffer:  # whom nobody reads any more
            task.samples.popleft()


class LiveServicer(Servicer):
    """One call at a time, but for reads that wait."""


def _locked(call: Callable[..., Any]) -> Callable[..., Any]:
    def locked(self: LiveServicer, request: Any, context: Any) -> Any:
        with self.card.turned:
            try:
                return call(self, request, context)
            finally:
                self.card.tell()

    return locked


for _name, _call in vars(Servicer).items():
    if _name[0].isupper():
        setattr(LiveServicer, _name, _locked(_call))


def main(output: str) -> None:
    """Serve until standard input ends."""
    sys.setswitchinterval(5e-4)
    come_first(paced=True)  # a card has a clock and wires of its own and waits for no program of this machine
    plant = SimulatedBench(Simulation(seed=2), default_rig().daq)
    plant.advance(0.0, False)  # compiled before the clock runs
    card = LiveCard(plant, Path(output))
    card.inputs = {STOP: True, READY: True}  # released and ready, to a rig file that wires them
    server = TcpServer(LiveServicer(card), WORKERS)
    threading.Thread(target=card.run, daemon=True).start()
    print(json.dumps({"address": server.address}), flush=True)
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        with card.turned:
            getattr(plant, name)(*arguments)
    server.stop()


class Served:
    """The card as a test has it.

    Attributes:
        address: of its server. choice: the card as a device that is to be built.
        output: the file in which its terminals stand.
    """

    def __init__(self, process: subprocess.Popen[str], output: Path) -> None:
        self.output = output
        assert process.stdin is not None
        assert process.stdout is not None
        self._in = process.stdin
        self.address: str = json.loads(process.stdout.readline())["address"]

    @property
    def choice(self) -> DeviceChoice:
        return choose_device(f"{self.address}/Dev1")

    def do(self, name: str, *arguments: Any) -> None:
        """What the operator does at the bench."""
        self._in.write(json.dumps([name, *arguments]) + "\n")
        self._in.flush()


@contextmanager
def served(output: Path) -> Iterator[Served]:
    """A card of one's own, its terminals told in ``output``."""
    make_output(output)
    arguments = [sys.executable, "-m", "tests.faults.live_card", str(output)]
    with subprocess.Popen(
        arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT, text=True
    ) as process:
        try:
            yield Served(process, output)
        finally:
            process.kill()


if __name__ == "__main__":
    main(sys.argv[1])
