"""What a calibration gives: the line, doubtful steps, how passes differ, and how it compares with before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fingerlab.calibration.line import Calibration, SteadyStep, calibrate_steps
from fingerlab.calibration.sensors import CalibrationPlan, Sensor, mark_text

SLIP = 0.5
"""A reading that is nearer to another mark than to its own belongs to that one."""
DISTURBED = 0.12
"""A step that is off by this share of the distance between marks was disturbed (assumed: 12 g, 1.8 degrees;
the sensors' own errors are smaller: 1.1 degrees for the KMA210)."""


@dataclass(frozen=True)
class Misplaced:
    """A step that does not fit the others.

    Attributes:
        number: of the step, from 0. off: reading less known value, in ``mark_unit``.
        reads_like: the mark that it reads like, or None where it was rather disturbed. words: the sentence.
    """

    number: int
    off: float
    reads_like: float | None
    words: str


def robust_line(volts: Sequence[float], marks: Sequence[float]) -> tuple[float, float]:
    """Slope (mark unit/V) and value at 0 V after Theil and Sen: a few wrong steps do not turn it.

    The least-squares line leans towards a wrong step and so hides part of its error; this one does not.
    """
    x, y = np.asarray(volts, dtype=np.float64), np.asarray(marks, dtype=np.float64)
    first, second = np.triu_indices(len(x), 1)
    apart = y[first] != y[second]
    dx, dy = (x[second] - x[first])[apart], (y[second] - y[first])[apart]
    # The mark is what is set and the voltage what answers: the median is taken of volts a mark.
    slope = float(np.median(dx / dy)) if len(dx) else 0.0
    if slope == 0:
        return 0.0, float(np.median(y))
    return 1.0 / slope, float(np.median(y - x / slope))


def find_misplaced(
    plan: CalibrationPlan, steps: Sequence[SteadyStep], numbers: Sequence[int]
) -> tuple[Misplaced, ...]:
    """Which of the captured steps do not fit the line of the others.

    Args:
        steps: what was read. numbers: the step of the plan that each belongs to.
    """
    marks = [plan.moves[number].mark for number in numbers]
    if len(set(marks)) < 3 or len(steps) < 4:
        return ()
    gain, offset = robust_line([step.volts for step in steps], marks)
    if gain == 0:
        return ()
    found = []
    for number, step, mark in zip(numbers, steps, marks, strict=True):
        off = gain * step.volts + offset - mark
        if abs(off) > DISTURBED * plan.spacing:
            found.append(_describe(plan, number, off))
    return tuple(found)


LEAST_VOLTS = 0.05
"""V by which two steps have to differ, or their slope says nothing (assumed: fifty times the noise)."""


def early_objection(plan: CalibrationPlan, steps: Sequence[SteadyStep], rises: bool | None = None) -> str:
    """What the data sheet says against the very first steps: zero, sense or span; empty for nothing.

    The first step tells a sensor without supply or with a wire off. Two are enough to see that one is wired
    or mounted the wrong way round, or has another span.

    Args:
        rises: whether the volts should rise with the known value; None where either is right.
    """
    sensor, marks = plan.sensor, plan.marks
    if not steps:
        return ""
    zero = sensor.zero
    if zero is not None and marks[0] == 0 and not zero.low <= steps[0].volts <= zero.high:
        return (
            f"With nothing on it the sensor gives {steps[0].volts:.3f} V, and its data sheet allows "
            f"{zero.low:g} to {zero.high:g} V ({zero.source}); look at its supply and its wires first."
        )
    beyond = next((s.volts for s in steps if not sensor.volts.low <= s.volts <= sensor.volts.high), None)
    if beyond is not None:
        return (
            f"The sensor gives {beyond:.3f} V, and its data sheet allows {sensor.volts.low:g} to "
            f"{sensor.volts.high:g} V ({sensor.volts.source}); look at supply, wires and mounting first."
        )
    shares = _shares(plan, steps)
    if not shares:
        return ""
    slope = float(np.median(shares))  # V a unit of the quantity
    turned = _turned(sensor, slope, rises)
    if turned:
        return turned
    low, high = 1.0 / sensor.gain.high, 1.0 / sensor.gain.low
    off = EARLY_TOLERANCE
    if not low * (1.0 - off) <= abs(slope) <= high * (1.0 + off):
        share = abs(slope) / (0.5 * (low + high))
        return (
            f"From step to step the reading changes by {100 * share:.0f} % of what the data sheet says "
            f"({sensor.gain.source}); look at the supply, the range and the known values before you go on."
        )
    return ""


def _turned(sensor: Sensor, slope: float, rises: bool | None) -> str:
    """That the reading goes the wrong way, where it does; ``slope`` in V a unit of the quantity."""
    if rises is None or abs(slope) * sensor.gain.high <= 0.3 or (slope > 0) is rises:
        return ""
    way = "falls" if slope < 0 else "rises"
    return (
        f"The reading {way} as the known value grows, and should do the opposite: the sensor is turned "
        "round, its wires are swapped, or its sign in the rig file is wrong."
    )


EARLY_TOLERANCE = 0.1
"""Share by which the slope of a few steps may be beyond the data sheet's (assumed: a mark is set by hand)."""


def _shares(plan: CalibrationPlan, steps: Sequence[SteadyStep]) -> list[float]:
    """Volts a unit of the quantity between captured steps whose known values are far enough apart."""
    factor = plan.sensor.mark_factor
    least = LEAST_VOLTS * plan.sensor.gain.low
    known = [factor * mark for mark in plan.marks[: len(steps)]]
    volts = [step.volts for step in steps]
    pairs = [(i, k) for i in range(len(steps)) for k in range(i) if abs(known[i] - known[k]) >= least]
    return [(volts[i] - volts[k]) / (known[i] - known[k]) for i, k in pairs]


def _describe(plan: CalibrationPlan, number: int, off: float) -> Misplaced:
    move, sensor = plan.moves[number], plan.sensor
    place = f"Step {number + 1} ({move.sweep}, {mark_text(sensor, move.mark)})"
    weight = sensor.mark_unit == "kg"
    amount = f"{abs(1000 * off):.0f} g" if weight else f"{abs(off):.1f}°"
    way = "more" if off > 0 else "less"
    if abs(off) > SLIP * plan.spacing:
        like = move.mark + round(off / plan.spacing) * plan.spacing
        what = "Was the wrong weight on it?" if weight else "Was the joint at the wrong mark?"
        words = (
            f"{place} reads {amount} {way} than the other steps say, like {mark_text(sensor, like)}. {what}"
        )
        return Misplaced(number, off, like, words)
    why = "Did something touch it?" if weight else "Was the joint beside its mark?"
    return Misplaced(number, off, None, f"{place} reads {amount} {way} than the other steps say. {why}")


@dataclass(frozen=True)
class Sweep:
    """The line of one pass alone: gain in ``unit``/V, offset in ``unit``, R2 unitless."""

    name: str
    gain: float
    offset: float
    r2: float


@dataclass(frozen=True)
class Repeat:
    """How well the second pass repeats the first, at the known values that both have.

    Attributes:
        known: ``unit``, increasing. differences: second less first pass by the common line, ``unit``.
        largest: the largest of them in magnitude: the hysteresis where a load cell is loaded and unloaded.
        deviation: standard deviation of one reading, root mean square of the differences over sqrt(2).
    """

    known: tuple[float, ...]
    differences: tuple[float, ...]
    largest: float
    deviation: float


@dataclass(frozen=True)
class CalibrationOutcome:
    """A calibration with all that speaks for and against it.

    Attributes:
        plan: steps in their order. calibration: the common line.
        sweeps: each pass alone. repeat: passes compared; None where there is only one.
        misplaced: steps at a wrong weight or mark, as it seems.
        rises: as of :func:`early_objection`.
    """

    plan: CalibrationPlan
    calibration: Calibration
    sweeps: tuple[Sweep, ...]
    repeat: Repeat | None
    misplaced: tuple[Misplaced, ...]
    rises: bool | None = None

    @property
    def sensor(self) -> Sensor:
        """Whose it is."""
        return self.plan.sensor

    @property
    def objections(self) -> tuple[str, ...]:
        """Everything that speaks against accepting it, one sentence each; empty where nothing does."""
        turned = _turned(self.sensor, 1.0 / self.calibration.gain.value, self.rises)
        found = [turned] * bool(turned) + [one.words for one in self.misplaced]
        named = {f"Step {one.number + 1} lies" for one in self.misplaced}
        found += [text for text in self.calibration.suspect if not any(text.startswith(n) for n in named)]
        limit = self.sensor.accuracy
        if self.repeat is not None and abs(self.repeat.largest) > limit.high and not self.misplaced:
            found.append(
                f"The two passes differ by up to {amount_text(self.sensor, abs(self.repeat.largest))}, more "
                f"than the {amount_text(self.sensor, limit.high)} of the data sheet ({limit.source})."
            )
        return tuple(found)

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``, all values in SI: the calibration with its passes."""
        data = self.calibration.to_json()
        for entry, move in zip(data["steps"], self.plan.moves, strict=True):
            entry["pass"] = move.sweep
        data["passes"] = [asdict(sweep) for sweep in self.sweeps]
        data["repeat"] = None if self.repeat is None else asdict(self.repeat)
        data["objections"] = list(self.objections)
        return data


@dataclass(frozen=True)
class CalibrationChange:
    """A calibration against an earlier one.

    Attributes:
        gain: relative change of the gain. largest: largest change of the quantity over the known values,
            ``unit``. within: whether gain and offset agree within their 90 % intervals together.
    """

    gain: float
    largest: float
    within: bool


def outcome_of(
    plan: CalibrationPlan, steps: Sequence[SteadyStep], rises: bool | None = None
) -> CalibrationOutcome:
    """Fit the steps of a plan.

    Args:
        rises: as of :func:`early_objection`.

    Raises:
        UserError: they make no line.
    """
    calibration = calibrate_steps(plan.sensor, steps, plan.marks)
    names = list(dict.fromkeys(move.sweep for move in plan.moves))
    members = {name: [i for i, move in enumerate(plan.moves) if move.sweep == name] for name in names}
    sweeps = []
    for name, chosen in members.items():
        line = calibrate_steps(plan.sensor, [steps[i] for i in chosen], [plan.marks[i] for i in chosen])
        sweeps.append(Sweep(name, line.gain.value, line.offset.value, line.r2))
    repeat = _repeat(calibration, members[names[0]], members[names[1]]) if len(names) > 1 else None
    misplaced = find_misplaced(plan, steps, range(len(steps)))
    return CalibrationOutcome(plan, calibration, tuple(sweeps), repeat, misplaced, rises)


def compare(new: Calibration, gain: dict[str, Any], offset: dict[str, Any]) -> CalibrationChange:
    """``new`` against the stored gain and offset of an earlier calibration (value, low, high; SI)."""
    within = all(
        abs(now.value - then["value"])
        <= math.hypot((now.high - now.low) / 2, (then["high"] - then["low"]) / 2)
        for now, then in ((new.gain, gain), (new.offset, offset))
    )
    volts = np.array([step.volts for step in new.steps])
    change = new.apply(volts) - (gain["value"] * volts + offset["value"])
    largest = float(change[np.argmax(np.abs(change))])
    return CalibrationChange(new.gain.value / gain["value"] - 1.0, largest, within)


def amount_text(sensor: Sensor, value: float) -> str:
    """A quantity with its unit as a person reads it: N, mN where it is small, degrees for an angle in rad."""
    if sensor.unit == "rad":
        return f"{math.degrees(value):.2f}°"
    if abs(value) < 0.1:
        return f"{1e3 * value:.1f} m{sensor.unit}"
    return f"{value:.3f} {sensor.unit}"


def _repeat(calibration: Calibration, first: Sequence[int], second: Sequence[int]) -> Repeat | None:
    """Differences at the known values that both passes have; None where they share none."""
    values = calibration.apply(np.array([step.volts for step in calibration.steps]))
    before = {calibration.known[i]: float(values[i]) for i in first}
    after = {calibration.known[i]: float(values[i]) for i in second}
    known = tuple(sorted(set(before) & set(after)))
    if not known:
        return None
    differences = np.array([after[value] - before[value] for value in known])
    return Repeat(
        known,
        tuple(differences.tolist()),
        float(differences[np.argmax(np.abs(differences))]),
        float(np.sqrt(np.mean(differences**2) / 2)),
    )
