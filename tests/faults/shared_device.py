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


@dataclass(frozen=True)
class SharedChoice:
    """Builds the bench in whatever process asks for it."""

    path: Path
    kind: str = "card"
    real_time: bool = True

    def build(self) -> SharedDevice:
        return SharedDevice(self.path)


class SharedDevice(FakeDevice):
    """The fake bench with its output in a file."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), LAYOUT.size)
        self._driving = False
        self._due = 0.0

    def open(self) -> None:
        super().open()
        cycles, volts, enabled, changed, at, _ = LAYOUT.unpack(self._memory[:])
        self._memory[:] = LAYOUT.pack(cycles, volts, enabled, changed, at, 0)  # the guardian's trial is over

    def start(self) -> None:
        super().start()
        self._driving = True
        self._due = time.perf_counter()

    def set_enable(self, on: bool) -> None:
        super().set_enable(on)
        self._tell()

    def exchange(self, command_volts: float) -> Sample:
        self._due += 1.0 / self.rate_hz
        early = self._due - time.perf_counter()
        if early > 0:
            time.sleep(early)
        else:
            self._due -= early
        if LAYOUT.unpack(self._memory[:])[5]:  # the guardian has reset the card, which took its tasks away
            self.volts, self.enabled = 0.0, False
            raise DeviceFault("The shared bench was taken away.")
        sample = super().exchange(command_volts)
        self._tell()
        return sample

    def make_safe(self) -> bool:
        super().make_safe()
        self._tell()
        return True

    def _tell(self) -> None:
        cycles, volts, enabled, changed, at, guarded = LAYOUT.unpack(self._memory[:])
        if self._driving:
            cycles = self.total
        else:
            guarded += 1
        if (self.volts, int(self.enabled)) != (volts, enabled):
            changed, at = time.monotonic_ns(), cycles
        self._memory[:] = LAYOUT.pack(cycles, self.volts, int(self.enabled), changed, at, guarded)
