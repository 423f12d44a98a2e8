"""Devices whose guardian's part can be seen from outside; of a module that other processes can import."""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

from fingerlab.devices.choosing import DeviceChoice
from fingerlab.devices.ni.card import NiCard
from fingerlab.rig.file import default_rig
from tests.acquisition.fake_device import FakeDevice


@dataclass(frozen=True)
class Unsafe:
    """A bench whose stop fails the first time it is tried, in whatever process."""

    kind: str = "card"
    real_time: bool = True

    def build(self) -> FakeDevice:
        return FakeDevice(unsafe=1)


@dataclass(frozen=True)
class Interrupting:
    """A bench while whose first process is made, the program is asked to end."""

    kind: str = "simulated"
    real_time: bool = True

    def __getstate__(self) -> dict[str, str]:
        signal.raise_signal(signal.SIGTERM)
        return {}

    def build(self) -> FakeDevice:
        return FakeDevice()


class Telling(NiCard):
    """Writes into a file what is asked of it, and by which process."""

    log: Path

    def try_stop(self) -> None:
        super().try_stop()
        self._tell("tried")

    def open(self) -> None:
        self._tell("opened")
        super().open()

    def set_enable(self, on: bool) -> None:
        self._tell(f"enable {on}")
        super().set_enable(on)

    def _tell(self, what: str) -> None:
        drivers = all(name in sys.modules for name in ("nidaqmx", "grpc"))
        with self.log.open("a", encoding="utf-8") as file:
            file.write(f"{os.getpid()} {what}, drivers {'there' if drivers else 'missing'}\n")


@dataclass(frozen=True)
class TellingChoice:
    """A card that tells."""

    choice: DeviceChoice
    log: Path
    kind: str = "card"
    real_time: bool = True

    def build(self) -> Telling:
        device = Telling(self.choice.rig or default_rig())
        device.log = self.log
        return device
