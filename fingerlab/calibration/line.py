"""The straight line through the steady parts of a stepped recording, and whether the data sheet allows it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fingerlab.calibration.sensors import Limit, Sensor
from fingerlab.core.errors import UserError
from fingerlab.core.text import LEVEL, ParameterEstimate
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
class SteadyStep:
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


def find_steps(time: Array, volts: Array, count: int, timing: StepTiming) -> tuple[SteadyStep, ...]:
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
        steps.append(SteadyStep(float(inside.mean()), float(inside.std(ddof=1)), len(inside)))
    return tuple(steps)


UNSTEADY = 0.25
"""A step whose samples spread by more than this share of the usual distance between steps was disturbed.

Assumed: a reading that wanders by a quarter of a step cannot tell neighbouring steps apart well.
"""


@dataclass(frozen=True)
class Calibration:
    """quantity = gain * volts + offset, from the means of steps at known values.

    Attributes:
        sensor: which one.
        gain, offset: the line, in ``unit``/V and ``unit``.
        r2: coefficient of determination over the steps, unitless.
        rms: root mean square of the residuals, ``unit``.
        known: known value of each step, ``unit``.
        steps: reading of each step.
        residuals: known value less the line, ``unit``.
        zero_volts: reading at zero, V.
        suspect: why the data sheet does not allow it, one sentence each; empty where it does.
    """

    sensor: Sensor
    gain: ParameterEstimate
    offset: ParameterEstimate
    r2: float
    rms: float
    known: tuple[float, ...]
    steps: tuple[SteadyStep, ...]
    residuals: tuple[float, ...]
    zero_volts: float
    suspect: tuple[str, ...]

    def apply(self, volts: Array) -> Array:
        """Readings in volts, any shape, as the quantity in SI."""
        return self.gain.value * volts + self.offset.value

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``; all values in SI."""
        published = self.sensor.published
        return {
            "schema": 1,
            "sensor": self.sensor.name,
            "unit": self.sensor.unit,
            "gain": asdict(self.gain),
            "offset": asdict(self.offset),
            "confidence": LEVEL,
            "r2": self.r2,
            "rms": self.rms,
            "zero_volts": self.zero_volts,
            "steps": [
                {"known": known, "volts": s.volts, "spread": s.spread, "samples": s.samples, "residual": r}
                for known, s, r in zip(self.known, self.steps, self.residuals, strict=True)
            ],
            "data_sheet": asdict(self.sensor.gain),
            "thesis": None if published is None else {"gain": published[0], "offset": published[1]},
            "suspect": list(self.suspect),
        }


def calibrate_steps(sensor: Sensor, steps: Sequence[SteadyStep], marks: Sequence[float]) -> Calibration:
    """Fit the line by least squares to the means of the steps.

    The means and not the samples are fitted: the samples of one step share the error of placing the
    weight or the joint, so that counting each of them would make the intervals far too narrow.

    Args:
        steps: readings, one for each mark.
        marks: known values in the sensor's ``mark_unit``.

    Raises:
        UserError: fewer than three steps, or all at one reading or one value.
    """
    from scipy.special import stdtrit  # takes 0.2 s to load; commands that fit nothing come by here, too

    known = np.asarray(marks, dtype=np.float64) * sensor.mark_factor
    volts = np.array([step.volts for step in steps])
    if len(volts) < 3 or len(volts) != len(known):
        raise UserError(
            f"{len(volts)} steps at {len(known)} known values do not make a line; at least three are needed."
        )
    spread = float(((volts - volts.mean()) ** 2).sum())
    if np.ptp(known) == 0 or spread <= 1e-18 * len(volts):
        raise UserError("All steps read the same; a calibration needs steps at different known values.")
    gain = float(((volts - volts.mean()) @ (known - known.mean())) / spread)
    offset = float(known.mean() - gain * volts.mean())
    residuals = known - gain * volts - offset
    variance = float(residuals @ residuals) / (len(volts) - 2)
    factor = float(stdtrit(len(volts) - 2, 0.5 + LEVEL / 2))
    gain_error = factor * math.sqrt(variance / spread)
    offset_error = factor * math.sqrt(variance * (1 / len(volts) + volts.mean() ** 2 / spread))
    if gain == 0:
        raise UserError("The readings do not follow the known values at all; check --marks and the wiring.")
    zero_volts = -offset / gain
    total = float(((known - known.mean()) ** 2).sum())
    return Calibration(
        sensor=sensor,
        gain=ParameterEstimate(gain, sensor.gain.unit, gain - gain_error, gain + gain_error),
        offset=ParameterEstimate(offset, sensor.unit, offset - offset_error, offset + offset_error),
        r2=1.0 - float(residuals @ residuals) / total,
        rms=float(np.sqrt(np.mean(residuals**2))),
        known=tuple(known.tolist()),
        steps=tuple(steps),
        residuals=tuple(residuals.tolist()),
        zero_volts=zero_volts,
        suspect=tuple(_suspect(sensor, gain, zero_volts, steps, residuals)),
    )


def _suspect(
    sensor: Sensor, gain: float, zero_volts: float, steps: Sequence[SteadyStep], residuals: Array
) -> list[str]:
    """Where the data sheet does not allow the result, one sentence each."""
    found = []
    # An angle sensor may be mounted either way round; a load cell gives more volts under more load.
    size = gain if sensor.name == "load-cell" else abs(gain)
    found += _outside(sensor.gain, size)
    if sensor.zero is not None:
        found += _outside(sensor.zero, zero_volts)
    volts = np.array([step.volts for step in steps])
    for extreme in (float(volts.min()), float(volts.max())):
        found += _outside(sensor.volts, extreme)
    found += _off_the_line(sensor.accuracy, residuals)
    usual = float(np.median(np.abs(np.diff(volts))))
    for number, step in enumerate(steps, start=1):
        if step.spread > UNSTEADY * usual:
            found.append(
                f"Step {number} is not steady: its samples spread by {step.spread:.3g} V, while steps are "
                f"{usual:.3g} V apart."
            )
    return found


NAMED_ALONE = 2
"""So many steps off the line are named one by one; more, mostly drawn by a single one, in one sentence."""


def _off_the_line(limit: Limit, residuals: Array) -> list[str]:
    far = [(n, float(r)) for n, r in enumerate(residuals, start=1) if not limit.low <= r <= limit.high]
    allowed = f"more than the {_show(limit.high, limit.unit)} of the data sheet ({limit.source})."
    if len(far) <= NAMED_ALONE:
        return [f"Step {n} lies {_show(value, limit.unit)} off the line, {allowed}" for n, value in far]
    largest = _show(max(abs(value) for _, value in far), limit.unit)
    return [f"Steps {_in_runs([n for n, _ in far])} lie up to {largest} off the line, {allowed}"]


def _in_runs(numbers: Sequence[int]) -> str:
    """``1 to 5, 7, 9 to 12``: increasing whole numbers, neighbours together."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def _outside(limit: Limit, value: float) -> list[str]:
    if limit.low <= value <= limit.high:
        return []
    low, high = _show(limit.low, limit.unit), _show(limit.high, limit.unit)
    return [
        f"The {limit.quantity} of {_show(value, limit.unit)} is outside {low} to {high} ({limit.source})."
    ]


def _show(value: float, unit: str) -> str:
    """A number as a person reads it: radians as degrees."""
    if unit.startswith("rad"):
        return f"{math.degrees(value):.4g}°{unit[3:]}"
    return f"{value:.4g} {unit}"
