"""Shapes around one that was found on a coarse grid: where a second look at the recordings tries."""

from __future__ import annotations

from collections.abc import Sequence

from fingerlab.physics.effects.base import Closer, Shape

OCTAVE = tuple(2.0 ** (k / 4) for k in range(-4, 5))
"""Factors from one half to two."""


def times(name: str, factors: Sequence[float] = OCTAVE) -> Closer:
    """The shape with one number multiplied."""
    return lambda shape: [{**shape, name: shape[name] * factor} for factor in factors]


def plus(name: str, steps: Sequence[float]) -> Closer:
    """The shape with something added to one number."""
    return lambda shape: [{**shape, name: shape[name] + step} for step in steps]


def either(name: str, values: Sequence[float]) -> Closer:
    """The shape with one number, or switch, set to each of some values."""
    return lambda shape: [{**shape, name: value} for value in values]


def every(*closer: Closer) -> Closer:
    """All combinations."""

    def combined(shape: Shape) -> Sequence[Shape]:
        found: list[Shape] = [shape]
        for one in closer:
            found = [new for old in found for new in one(old)]
        return found

    return combined
