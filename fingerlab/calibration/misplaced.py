"""Steps whose known value is doubtful: a wrong weight on the cell, a joint at a wrong mark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.calibration.plan import Plan, mark_text
from fingerlab.calibration.steps import Step

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


def find_misplaced(plan: Plan, steps: Sequence[Step], numbers: Sequence[int]) -> tuple[Misplaced, ...]:
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


def _describe(plan: Plan, number: int, off: float) -> Misplaced:
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
