"""A device of your own: a current-driven rotor that is computed, with the five raw channels of the bench.

It keeps to ``fingerlab/devices/protocol.py`` and needs nothing else of FingerLab. Replace ``_wait``,
``_turn`` and ``_raw`` by the calls of your hardware. All numbers here are assumed; none is a bench's.
"""

from __future__ import annotations

import math
import time

from fingerlab.devices.protocol import DeviceFault, Sample

INERTIA = 2.6e-4  # kg m^2 at the gearbox output
DAMPING = 1.0e-3  # N m s/rad
TORQUE_PER_AMP = 0.13  # N m/A at the gearbox output
AMPS_PER_VOLT = 1.0
COUNTS_PER_TURN = 8600.0


class Rotor:
    """A rotor with damping behind a current amplifier; no finger, no load cell."""

    name = "computed rotor"
    rate_hz = 1000.0

    def __init__(self) -> None:
        self._angle = self._speed = self._volts = 0.0
        self._enabled = self._running = False
        self._index, self._began = -1, 0.0

    def open(self) -> None:
        self.make_safe()

    def start(self) -> None:
        if self._running:
            raise DeviceFault("The computed rotor runs already; stop it before it is started again.")
        self._running, self._index, self._began = True, -1, time.perf_counter()

    def set_enable(self, on: bool) -> None:
        self._enabled = on

    def exchange(self, command_volts: float) -> Sample:
        if not self._running:
            raise DeviceFault("The computed rotor has not been started.")
        self._turn(self._volts)  # the command of the cycle before acts up to this edge of the clock
        self._volts = command_volts
        self._index += 1
        self._wait()
        return Sample(self._index, self._raw())

    def make_safe(self) -> bool:
        self._volts, self._enabled, self._running = 0.0, False, False
        return True  # a real device reads output and enable line back before it says so

    def close(self) -> None:
        self.make_safe()

    def _wait(self) -> None:
        """Until this cycle is over; a card does that by itself."""
        time.sleep(max(self._began + self._index / self.rate_hz - time.perf_counter(), 0.0))

    def _turn(self, volts: float) -> None:
        """One cycle of inertia and damping under a constant torque, exactly."""
        torque = TORQUE_PER_AMP * AMPS_PER_VOLT * volts if self._enabled else 0.0
        cycle, rate = 1.0 / self.rate_hz, DAMPING / INERTIA
        final = torque / DAMPING
        decay = math.exp(-rate * cycle)
        self._angle += final * cycle + (self._speed - final) * (1.0 - decay) / rate
        self._speed = final + (self._speed - final) * decay

    def _raw(self) -> tuple[float, ...]:
        current = AMPS_PER_VOLT * self._volts if self._enabled else 0.0
        counts = math.floor(self._angle / (2.0 * math.pi) * COUNTS_PER_TURN)
        return math.nan, math.nan, math.nan, -current / 1.25, float(counts)
