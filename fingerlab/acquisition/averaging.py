"""Initialising and taring: the mean over a moment at rest, or one sentence why there was no rest."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fingerlab.acquisition.checks import Reading
from fingerlab.acquisition.commands import Initialise, Tare
from fingerlab.acquisition.units import Zeros

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
