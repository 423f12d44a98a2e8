"""Shapes around one that was found on a coarse grid: what grid refinement tries."""

from __future__ import annotations

from collections.abc import Sequence

from fingerlab.effects.base import Closer, Shape

OCTAVE = tuple(2.0 ** (k / 4) for k in range(-4, 5))
"""Factors from one half to two."""
HALF_OCTAVE = OCTAVE[2:-2]
FINE_OCTAVE = tuple(2.0 ** (k / 8) for k in range(-6, 7))
"""Factors for a travel of degrees, on which much of every cycle depends."""
SPEED_FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)
SHARPNESSES = (0.0, 0.5, 1.0)
"""Virgin curves of a friction that builds up (:func:`hysteresis.friction_state`): many contacts, parts that
let go evenly, one contact."""


def times(name: str, factors: Sequence[float] = OCTAVE) -> Closer:
    """The shape with one number multiplied."""
    return lambda shape: [{**shape, name: shape[name] * factor} for factor in factors]


def plus(name: str, steps: Sequence[float]) -> Closer:
    """The shape with something added to one number."""
    return lambda shape: [{**shape, name: shape[name] + step} for step in steps]


def either(name: str, values: Sequence[float]) -> Closer:
    """The shape with one number, or switch, set to each of some values."""
    return lambda shape: [{**shape, name: value} for value in values]


def rubbing(factors: Sequence[float] = HALF_OCTAVE, sharpnesses: Sequence[float] = SHARPNESSES) -> Closer:
    """Friction that builds up over other travels and along other virgin curves.

    A sharper curve, 1 - (1 - x / (p d))^p with its p nearer to 1, lacks less work behind every reversal:
    d p / (1 + p). At the same lack it is softer at first, by 1 + 1/p.
    """

    def around(shape: Shape) -> Sequence[Shape]:
        even = shape["travel_deg"] / (1.0 + shape.get("sharpness", 0.0))
        return [
            {**shape, "travel_deg": even * (1.0 + sharpness) * factor, "sharpness": sharpness}
            for sharpness in sharpnesses
            for factor in factors
        ]

    return around


def every(*closer: Closer) -> Closer:
    """All combinations."""

    def combined(shape: Shape) -> Sequence[Shape]:
        found: list[Shape] = [shape]
        for one in closer:
            found = [new for old in found for new in one(old)]
        return found

    return combined


def dahl_or_masing(shape: Shape) -> list[Shape]:
    """Presliding over other travels: by Dahl's law, or by spring-sliders (Masing) of two virgin curves."""
    masing = either("masing", (1.0,))
    return [
        *times("travel_deg", HALF_OCTAVE)(shape),
        *every(masing, rubbing(OCTAVE[1:-1], (0.0,)))(shape),
        *every(masing, rubbing(FINE_OCTAVE, (0.5,)))(shape),
    ]
