"""What is done at the bench with the amplifier off: setting references, and what the check of a rig tries."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Initialise, MoveByHand, Tare, TryOutput
from fingerlab.acquisition.control.plausibility import SENSORS, lacking, window_fault
from fingerlab.acquisition.control.safety import Reading
from fingerlab.acquisition.control.units import Zeros
from fingerlab.acquisition.status import Number, SharedStatus, Slot
from fingerlab.devices.protocol import Device, MovedByHand, OutputReadBack, cycles_per_command
from fingerlab.rig.limits import Limits

AVERAGE_S = 0.5
"""Duration of the mean (assumed): a finger that swings at 2 Hz passes its turning points meanwhile."""

LONGEST_WAIT_S = 5.0
"""For so long a finger may swing before its references are taken (assumed: five times what it needs)."""

REST_POSITION = math.radians(1.0)
"""More than this much motor motion during the mean is not rest (assumed)."""

REST_ANGLE = math.radians(3.0)
"""The same for a joint, noise included (assumed)."""

REST_FORCE = 0.5
"""N; the same for the load cell (assumed)."""

REST_CURRENT = 0.3
"""A that the monitor may show with the amplifier off (assumed: its offset)."""


def beyond_its_range(position: float, limits: Limits) -> str:
    """Why a motor that stands at ``position`` (rad) is not enabled, or empty."""
    if limits.position_low <= position <= limits.position_high:
        return ""
    low, high = math.degrees(limits.position_low), math.degrees(limits.position_high)
    return (
        f"The pulley stands at {math.degrees(position):.4g}°, beyond its limits of {low:.4g}° to "
        f"{high:.4g}°; turn it back by hand, or initialise."
    )


@dataclass
class _Mean:
    count: int = 0
    total: float = 0.0
    low: float = math.inf
    high: float = -math.inf

    def add(self, value: float) -> None:
        self.count += 1
        self.total += value
        self.low, self.high = min(self.low, value), max(self.high, value)

    @property
    def value(self) -> float:
        return self.total / self.count


@dataclass(frozen=True)
class _Wanted:
    """One reference: its value afterwards, its sensor (as among ``SENSORS``; None for the encoder), words,
    the spread that still is rest, and how far it may lie from the calibrated zero, SI."""

    target: float
    sensor: int | None
    words: str
    rest: float
    bound: float = math.inf


class Averaging:
    """One initialising or taring that is under way: it waits for standstill, and takes the mean.

    Args:
        number: of the command that asked for it. what: the command.
        sensors: raw values that the set-up relies on.
    """

    def __init__(
        self,
        number: int,
        what: Initialise | Tare,
        settings: LoopSettings,
        sensors: tuple[int, ...],
        period: float,
    ) -> None:
        self.number, self.what = number, what
        self._settings = settings
        self._sensors = (0,) if isinstance(what, Tare) else sensors
        self._samples, self._longest = round(AVERAGE_S / period), round(LONGEST_WAIT_S / period)
        self._wanted = self._references(settings.limits)
        self._waited = 0
        self._begin()

    def add(self, reading: Reading) -> bool:
        """Take a sample; whether it was the last one."""
        for name in ("position", "mcp", "pip", "force", "current"):
            self._means[name].add(getattr(reading, name))
        for k, volts in self._volts.items():
            volts.add(reading.raw[k])
        self._waited += 1 + reading.lost
        if self._moving() and self._waited < self._longest:
            self._begin()
        return self._means["position"].count >= self._samples

    def finish(self, zeros: Zeros) -> str:
        """Set the references, or say why not."""
        units = self._settings.units
        sentence = lacking([k for k in self._sensors if k != 3], units)  # that is asked for at enable
        if sentence:
            return sentence
        for k, volts in self._volts.items():
            sentence = window_fault(SENSORS[k], units.inputs[k], volts.value)
            if sentence:
                return sentence
        for name, wanted in self._wanted.items():
            if not math.isfinite(self._means[name].value):
                return f"The {wanted.words} gives no number; check its cable."
        moving = self._moving()
        if moving:
            return f"The {moving} is not at rest; wait until nothing moves and try again."
        return self._beyond(zeros) or self._set(zeros)

    def _set(self, zeros: Zeros) -> str:
        for name, wanted in self._wanted.items():
            setattr(zeros, name, getattr(zeros, name) + wanted.target - self._means[name].value)
        return ""

    def _beyond(self, zeros: Zeros) -> str:
        """Which reading cannot be what it is said to be."""
        for name, wanted in self._wanted.items():
            by = wanted.target - (self._means[name].value - getattr(zeros, name))
            if abs(by) > wanted.bound:
                return _too_far(name, wanted, -by)
        current = self._means["current"].value
        if isinstance(self.what, Initialise) and abs(current) > REST_CURRENT:
            return (
                f"The current monitor shows {current:.2g} A with the amplifier off; check its cable, and its "
                "sign and gain in the rig file's [daq]."
            )
        limits = self._settings.limits
        for k, name in ((1, "mcp"), (2, "pip")):
            if k not in self._sensors or name in self._wanted:
                continue
            low, high = getattr(limits, f"{name}_low"), getattr(limits, f"{name}_high")
            angle = self._means[name].value
            if not low <= angle <= high:
                return (
                    f"The {SENSORS[k]} shows {math.degrees(angle):.3g}°, where its joint can be at "
                    f"{math.degrees(low):.3g}° to {math.degrees(high):.3g}°; check its cable, and which "
                    "sensor is on which terminal."
                )
        return ""

    def _moving(self) -> str:
        """What is not at rest, in words."""
        for name, wanted in self._wanted.items():
            mean = self._means[name]
            if mean.high - mean.low > wanted.rest:
                return wanted.words
        return ""

    def _begin(self) -> None:
        self._means = {name: _Mean() for name in ("position", "mcp", "pip", "force", "current")}
        self._volts = {k: _Mean() for k in self._sensors if self._settings.units.inputs[k] is not None}

    def _references(self, limits: Limits) -> dict[str, _Wanted]:
        if isinstance(self.what, Tare):
            return {"force": _Wanted(0.0, 0, SENSORS[0], REST_FORCE, limits.tare)}
        wanted = {"position": _Wanted(self.what.position, None, "motor", REST_POSITION)}
        for k, name in ((1, "mcp"), (2, "pip")):
            target = getattr(self.what, name)
            if target is not None:
                wanted[name] = _Wanted(target, k, SENSORS[k], REST_ANGLE, limits.reference_shift)
        return wanted


def _too_far(name: str, wanted: _Wanted, by: float) -> str:
    if name == "force":
        return (
            f"The load cell shows {by:.3g} N, and at no load at most {wanted.bound:.3g} N; take off what "
            "lies on it, check its supply and cable, or calibrate it."
        )
    return (
        f"The {wanted.words} is {math.degrees(by):.3g}° off the {math.degrees(wanted.target):.3g}° that it "
        f"is to be set to, and {math.degrees(wanted.bound):.3g}° at most can be; check its cable, or "
        "calibrate it."
    )


STAND_COMMANDS = 20
"""Set values written before the clock is stopped: the last has then long reached the output (assumed)."""

STOPPED_MEANWHILE = "The bench was stopped meanwhile; try again."


def move_by_hand(device: Device, command: MoveByHand) -> str:
    """Let a simulated rig do what its operator was asked to do; nothing where the bench is real."""
    if isinstance(device, MovedByHand):
        device.move_by_hand(command.channel, command.amount)
    return ""


def try_output(device: Device, command: TryOutput, board: SharedStatus, stopped: Callable[[], bool]) -> str:
    """Leave volts standing, stop the clock, write too late, look; then stop as ever, and look again.

    What was seen is in the board's ``LEFT``, ``CLEARED`` and ``SAFE``. The device's clock stands afterwards.

    Args:
        stopped: whether the operator or a process that died wants the bench at rest, asked once a cycle.

    Returns:
        Why not, as one sentence; empty where it was done.

    Raises:
        DeviceLost, DeviceFault: by the device.
    """
    if not isinstance(device, OutputReadBack):
        return f"The {device.name} cannot stop its clock with a set value standing; only a card can."
    block = cycles_per_command(device)
    for _ in range(STAND_COMMANDS * block):
        device.exchange(command.volts)
        if stopped():
            device.make_safe()
            return STOPPED_MEANWHILE
    device.abandon(late_write=0.0 if block == 1 else None)
    left = device.read_back_output()
    board[Slot.SAFE] = int(device.make_safe())
    cleared = device.read_back_output()
    board.set_number(Number.LEFT, math.nan if left is None else left)
    board.set_number(Number.CLEARED, math.nan if cleared is None else cleared)
    return ""
