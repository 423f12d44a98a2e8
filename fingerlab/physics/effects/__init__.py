"""The catalogue: every physical effect that the nominal model may miss, each defined in one place."""

from __future__ import annotations

from fingerlab.errors import UserError
from fingerlab.physics.effects import cable, drive, elastic, friction, mass, sensing
from fingerlab.physics.effects.base import Effect, Gain, Row, Term
from fingerlab.physics.effects.motion import Motion

CATALOGUE: dict[str, Effect] = {
    effect.id: effect
    for family in (friction, elastic, mass, cable, drive, sensing)
    for effect in family.EFFECTS
}
"""Effect by id, in the order of the families."""


def effect(name: str) -> Effect:
    """The effect with the id ``name``.

    Raises:
        UserError: there is no such effect.
    """
    if name not in CATALOGUE:
        raise UserError(f"There is no effect '{name}'; the catalogue holds {', '.join(CATALOGUE)}.")
    return CATALOGUE[name]


__all__ = ["CATALOGUE", "Effect", "Gain", "Motion", "Row", "Term", "effect"]
