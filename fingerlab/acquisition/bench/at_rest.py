"""What is done at the bench with the amplifier off: setting references, and what the check of a rig tries."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from fingerlab.acquisition.control.commands import Initialise, MoveByHand, Tare, TryOutput
from fingerlab.acquisition.control.safety import Reading
from fingerlab.acquisition.control.units import Zeros
from fingerlab.acquisition.status import Number, SharedStatus, Slot
from fingerlab.devices.protocol import Device, MovedByHand, OutputReadBack, cycles_per_command

AVERAGE_S = 0.1
"""Duration of the mean (assumed): noise falls to a tenth."""

REST_POSITION = math.radians(1.0)
"""More than this much motor motion during the mean is not rest (assumed)."""

REST_ANGLE = math.radians(3.0)
"""The same for a joint, noise included (assumed)."""

REST_FORCE = 0.5
"""N; the same for the load cell (assumed)."""


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


@dataclass
class Averaging:
    """One initialising or taring that is under way.

    Attributes:
        number: of the command that asked for it. what: the command. samples: how many to take.
    """

    number: int
    what: Initialise | Tare
    samples: int
    _means: dict[str, _Mean] = field(default_factory=dict)
    _taken: int = 0

    def add(self, reading: Reading) -> bool:
        """Take a sample; whether it was the last one."""
        for name in ("position", "mcp", "pip", "force"):
            self._means.setdefault(name, _Mean()).add(getattr(reading, name))
        self._taken += 1
        return self._taken >= self.samples

    def finish(self, zeros: Zeros) -> str:
        """Set the references, or say why not."""
        wanted = self._wanted()
        for name, (_, words, rest) in wanted.items():
            mean = self._means[name]
            if not math.isfinite(mean.value):
                return f"The {words} gives no number; check its cable."
            if mean.high - mean.low > rest:
                return f"The {words} is not at rest; wait until nothing moves and try again."
        for name, (target, _, _) in wanted.items():
            setattr(zeros, name, getattr(zeros, name) + target - self._means[name].value)
        return ""

    def _wanted(self) -> dict[str, tuple[float, str, float]]:
        if isinstance(self.what, Tare):
            return {"force": (0.0, "load cell", REST_FORCE)}
        wanted = {"position": (self.what.position, "motor", REST_POSITION)}
        for name in ("mcp", "pip"):
            target = getattr(self.what, name)
            if target is not None:
                wanted[name] = (target, f"{name.upper()} sensor", REST_ANGLE)
        return wanted


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
