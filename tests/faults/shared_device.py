"""A bench that outlives the process that drives it, as hardware does: its output stands in a file.

Paced in real time. The bench waits for a program that is late, so that samples count its own time.
"""

from __future__ import annotations

import mmap
import struct
import time
from dataclasses import dataclass
from pathlib import Path

from fingerlab.devices.protocol import DeviceFault, Sample
from fingerlab.devices.simulated import SimulatedRig, Simulation
from tests.acquisition.fake_device import FakeDevice

LAYOUT = struct.Struct("qdqqqq")
"""Cycles of the bench, set value (V), enable, monotonic time (ns) and cycle of the last change of the output,
guard."""


@dataclass(frozen=True)
class Output:
    """What the bench is told at this moment."""

    cycles: int
    volts: float
    enabled: bool
    changed_ns: int
    changed_at: int
    guarded: int

    @property
    def zero(self) -> bool:
        return self.volts == 0.0 and not self.enabled


def make_output(path: Path) -> None:
    """The file in which the output stands."""
    path.write_bytes(bytes(LAYOUT.size))


def read_output(path: Path) -> Output:
    """The output as it is."""
    cycles, volts, enabled, changed, at, guarded = LAYOUT.unpack(path.read_bytes())
    return Output(cycles, volts, bool(enabled), changed, at, guarded)


class _OutputInFile:
    """What a bench adds to be one that outlives its program: its output in a file, and its own pace."""

    rate_hz: float

    def _stands(self) -> tuple[float, bool, int]:
        """Set value (V), enable, cycles of the bench."""
        raise NotImplementedError

    def _let_go(self) -> None:
        """The guardian has reset the card, which took its tasks away."""
        raise NotImplementedError

    def _share(self, path: Path) -> None:
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), LAYOUT.size)
        self._driving = False
        self._due = 0.0

    def open(self) -> None:
        super().open()  # type: ignore[misc]
        cycles, volts, enabled, changed, at, _ = LAYOUT.unpack(self._memory[:])
        self._memory[:] = LAYOUT.pack(cycles, volts, enabled, changed, at, 0)  # the guardian's trial is over

    def start(self) -> None:
        super().start()  # type: ignore[misc]
        self._driving = True
        self._due = time.perf_counter()

    def set_enable(self, on: bool) -> None:
        super().set_enable(on)  # type: ignore[misc]
        self._tell()

    def exchange(self, command_volts: float) -> Sample:
        self._due += 1.0 / self.rate_hz
        early = self._due - time.perf_counter()
        if early > 0:
            time.sleep(early)
        else:
            self._due -= early
        if LAYOUT.unpack(self._memory[:])[5]:
            self._let_go()
            raise DeviceFault("The shared bench was taken away.")
        sample: Sample = super().exchange(command_volts)  # type: ignore[misc]
        self._tell()
        return sample

    def make_safe(self) -> bool:
        super().make_safe()  # type: ignore[misc]
        self._tell()
        return True

    def _tell(self) -> None:
        cycles, volts, enabled, changed, at, guarded = LAYOUT.unpack(self._memory[:])
        now, on, total = self._stands()
        if self._driving:
            cycles = total
        else:
            guarded += 1
        if (now, int(on)) != (volts, enabled):
            changed, at = time.monotonic_ns(), cycles
        self._memory[:] = LAYOUT.pack(cycles, now, int(on), changed, at, guarded)


class SharedDevice(_OutputInFile, FakeDevice):
    """The fake bench with its output in a file."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._share(path)

    def _stands(self) -> tuple[float, bool, int]:
        return self.volts, self.enabled, self.total

    def _let_go(self) -> None:
        self.volts, self.enabled = 0.0, False


class SharedFinger(_OutputInFile, SimulatedRig):
    """The simulated rig with its output in a file; its finger ends with the program."""

    def __init__(self, path: Path) -> None:
        super().__init__(simulation=Simulation(seed=2))
        self._share(path)

    def _stands(self) -> tuple[float, bool, int]:
        return self._output, self._enabled, self._cycles

    def _let_go(self) -> None:
        self._output, self._enabled = 0.0, False


@dataclass(frozen=True)
class SharedChoice:
    """Builds the bench in whatever process asks for it; ``finger``: that of the simulated rig."""

    path: Path
    kind: str = "card"
    real_time: bool = True
    finger: bool = False

    def build(self) -> SharedDevice | SharedFinger:
        return (SharedFinger if self.finger else SharedDevice)(self.path)
