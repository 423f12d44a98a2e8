"""The steady part of each step of a stepped recording."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class StepTiming:
    """Thesis section 2.2: a step every 15 s, of which the central 5 s count (5-10 s, 20-25 s, ...)."""

    seconds: float = 15.0
    centre: float = 5.0

    def __post_init__(self) -> None:
        if not 0 < self.centre <= self.seconds:
            raise UserError(
                f"The central {self.centre:g} s do not lie in a step of {self.seconds:g} s; "
                "give a positive time that is no longer than the step."
            )

    def window(self, step: int) -> tuple[float, float]:
        """Start and end of the part of step ``step`` (from 0) that counts, s after the start."""
        start = step * self.seconds + (self.seconds - self.centre) / 2
        return start, start + self.centre


@dataclass(frozen=True)
class Step:
    """The steady part of one step.

    Attributes:
        volts: mean reading, V.
        spread: standard deviation of its samples, V.
        samples: how many.
    """

    volts: float
    spread: float
    samples: int


def count_steps(time: Array, timing: StepTiming) -> int:
    """How many steps have their whole central part in the recording; ``time`` in s, shape (n,)."""
    if len(time) < 2:
        return 0
    # The last sample ends one sampling interval after its own time.
    duration = float(time[-1] - time[0]) + float(np.median(np.diff(time)))
    tail = (timing.seconds + timing.centre) / 2
    return max(0, math.floor((duration - tail) / timing.seconds + 1e-9) + 1)


def find_steps(time: Array, volts: Array, count: int, timing: StepTiming) -> tuple[Step, ...]:
    """Mean reading of the central part of each of the first ``count`` steps.

    Args:
        time: s, shape (n,), strictly increasing; counted from its first sample.
        volts: V, shape (n,).

    Raises:
        UserError: the recording is too short, or a step has fewer than two samples.
    """
    available = count_steps(time, timing)
    if available < count:
        raise UserError(
            f"The recording holds {available} steps of {timing.seconds:g} s, but {count} known values are "
            f"given; it should last {count * timing.seconds:g} s, or fewer values be given with --marks."
        )
    elapsed = time - time[0]
    steps = []
    for number in range(count):
        start, end = timing.window(number)
        inside = volts[np.searchsorted(elapsed, start - 1e-9) : np.searchsorted(elapsed, end - 1e-9)]
        if len(inside) < 2:
            raise UserError(
                f"Step {number + 1} of the recording has {len(inside)} samples between {start:g} and "
                f"{end:g} s; it should have at least two (the bench records 20 a second)."
            )
        steps.append(Step(float(inside.mean()), float(inside.std(ddof=1)), len(inside)))
    return tuple(steps)
