"""A small bench of our own: a rotor on a spring, sensors on straight lines, every fault on request.

It shares no code with the simulated rig. Everything that reaches its output is kept in ``outputs``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fingerlab.devices.protocol import DeviceFault, DeviceLost, Sample

INERTIA = 3.0e-4  # kg m^2
SPRING = 0.05  # N m/rad
FRICTION = 1.0e-3  # N m s/rad
TORQUE_PER_AMP = 0.0302 * 4.3  # N m/A
RADIANS_PER_COUNT = 2.0 * math.pi / 8600.0
STEPS = 10


@dataclass
class FakeDevice:
    """The protocol's device; ``outputs`` holds (index, volts, enabled) of each cycle.

    ``nan``, ``stuck``: raw channel -> first index. ``jump``: (index, counts). ``late``, ``lost``:
    index -> s, cycles. ``gone_at``, ``fault_at``: index from which it is lost, at which it fails once.
    """

    rate_hz: float = 1000.0
    nan: dict[int, int] = field(default_factory=dict)
    stuck: dict[int, int] = field(default_factory=dict)
    jump: tuple[int, float] | None = None
    late: dict[int, float] = field(default_factory=dict)
    lost: dict[int, int] = field(default_factory=dict)
    gone_at: float = math.inf
    fault_at: float = math.inf
    unsafe: int = 0
    blocked: bool = False

    name = "fake bench"

    def __post_init__(self) -> None:
        self.outputs: list[tuple[int, float, bool]] = []
        self.position = self.speed = self.current = 0.0
        self.volts, self.enabled, self.running = 0.0, False, False
        self.total = 0  # cycles since the bench was switched on, whatever was restarted
        self.index = -1
        self.zero = 0.0
        self.held: dict[int, float] = {}
        self.side = -1.0  # joints under the extension cable, which the loop has without being told another

    def open(self) -> None:
        self.volts, self.enabled = 0.0, False

    def start(self) -> None:
        if self.running:
            raise DeviceFault("The fake bench runs already.")
        if self.total >= self.gone_at:
            raise DeviceLost("The fake bench is gone.")
        self.running, self.index = True, -1
        self.zero = self.position

    def set_enable(self, on: bool) -> None:
        self.enabled = on

    def exchange(self, command_volts: float) -> Sample:
        if self.total >= self.gone_at:
            self.volts, self.enabled, self.running = 0.0, False, False
            raise DeviceLost("The fake bench is gone.")
        if self.total == self.fault_at:
            self.total += 1
            raise DeviceFault("The fake bench had a hiccup.")
        assert self.running, "exchange without start"
        assert math.isfinite(command_volts)
        cycles = 1 + self.lost.get(self.total, 0)
        for _ in range(cycles):
            self._move()
        self.volts = command_volts
        self.index += cycles
        self.total += cycles
        self.outputs.append((self.total, self.volts, self.enabled))
        return Sample(self.index, self._raw(), self.late.get(self.total, 0.0))

    def make_safe(self) -> bool:
        self.running = False
        if self.unsafe:
            self.unsafe -= 1
            return False
        self.volts, self.enabled = 0.0, False
        self.outputs.append((self.total, 0.0, False))
        return True

    def close(self) -> None:
        self.make_safe()

    def set_up(self, phase: str, cable: str | None, load_torque: float) -> None:
        self.phase, self.side = phase, -1.0 if cable == "extension" else 1.0

    def _move(self) -> None:
        self.current = self.volts if self.enabled else 0.0
        if self.blocked:
            return
        step = 1.0 / self.rate_hz / STEPS
        for _ in range(STEPS):
            torque = TORQUE_PER_AMP * self.current - SPRING * self.position - FRICTION * self.speed
            self.speed += step * torque / INERTIA
            self.position += step * self.speed

    def _raw(self) -> tuple[float, ...]:
        wiggle = 1e-3 * ((self.total * 7919) % 13 - 6)  # V; no two readings alike
        force = max(0.0, 4.0 * (self.position - 0.5))
        raw = [
            (force + 5.317) / 11.194 + 0.02 * wiggle,
            (0.4 * self.side * self.position) / (math.pi / 4.5) + 2.5 + 0.1 * wiggle,
            (0.6 * self.side * self.position) / (math.pi / 4.5) + 2.5 + 0.1 * wiggle,
            -self.current / 1.25 + wiggle,
            math.floor((self.position - self.zero) / RADIANS_PER_COUNT),
        ]
        if self.jump and self.total >= self.jump[0]:
            raw[4] += self.jump[1]
        for channel, start in self.stuck.items():
            if self.total >= start:
                raw[channel] = self.held.setdefault(channel, raw[channel])
        for channel, start in self.nan.items():
            if self.total >= start:
                raw[channel] = math.nan
        return tuple(raw)
