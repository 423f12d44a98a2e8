"""The catalogue: every physical effect that the nominal model may miss, each defined in one place."""

from __future__ import annotations

from fingerlab.core.errors import UserError
from fingerlab.effects import cable, contact, drive, elastic, friction, mass, own, sensing
from fingerlab.effects.base import Effect, Gain, Row, Term
from fingerlab.effects.motion import Motion

CATALOGUE: dict[str, Effect] = {
    effect.id: effect
    for family in (friction, elastic, mass, cable, drive, sensing, contact)
    for effect in family.EFFECTS
}
"""Effect by id, in the order of the families."""


def whole_catalogue() -> dict[str, Effect]:
    """The catalogue and, after it, the user's own effects that they have confirmed; by id.

    Raises:
        UserError: the settings of the user's own effects are damaged.
    """
    return CATALOGUE | {e.id: e for file in own.own_files(CATALOGUE) for e in file.effects}


def effect(name: str) -> Effect:
    """The effect with the id ``name``, the user's own ones included.

    Raises:
        UserError: there is no such effect.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    known = whole_catalogue()
    if name not in known:
        waiting = " ".join(own.notices(CATALOGUE))
        raise UserError(
            f"There is no effect '{name}'; the catalogue holds {', '.join(known)}. {waiting}".strip()
        )
    return known[name]


def find_effect(name: str) -> Effect | None:
    """The effect with the id ``name``, or None: a result may name one that is no longer there."""
    return CATALOGUE.get(name) or whole_catalogue().get(name)


__all__ = [
    "CATALOGUE",
    "Effect",
    "Gain",
    "Motion",
    "Row",
    "Term",
    "effect",
    "find_effect",
    "whole_catalogue",
]
