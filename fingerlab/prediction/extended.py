"""What a diagnosis' model is once it has been fitted: effects with their shapes, values, held-out values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from fingerlab.effects.base import Effect
from fingerlab.models.file import ParameterEstimate, SessionHash
from fingerlab.prediction.interval import Band

Equation = Literal["both", "pip", "mcp"]
EQUATIONS: tuple[Equation, ...] = ("both", "pip", "mcp")
"""What the force follows from: one joint's equation, or the two weighed by their held-out errors."""

EQUATION_WORDS: Mapping[Equation, str] = {"both": "PIP and MCP", "pip": "PIP", "mcp": "MCP"}


@dataclass(frozen=True)
class ChosenEffect:
    """An effect of the model and the point of its nonlinear unknowns; ``shape`` is empty without any."""

    effect: Effect
    shape: Mapping[str, float] = field(default_factory=dict)

    def alone(self) -> Effect:
        """The effect with this shape as the only point of its grid."""
        return replace(self.effect, shapes=(dict(self.shape),))


@dataclass(frozen=True)
class HeldOut:
    """Values of a fit that has not seen ``runs`` of the session with that hash."""

    session_sha256: str
    runs: tuple[str, ...]
    values: Mapping[str, float]


@dataclass(frozen=True)
class Variant:
    """A model with its values by key (``arm_mcp@flexion``, ``coulomb_friction.torque_mcp`` ...), SI.

    Attributes:
        score: error on held-out runs over all equations, in floors.
        pip_weight: share of the PIP equation in the force that follows from both; the rest is MCP's.
        band: half width of the force's 90 % interval; None with fewer than two contact runs in the fit.
    """

    effects: tuple[ChosenEffect, ...]
    values: Mapping[str, float]
    held_out: tuple[HeldOut, ...]
    score: float
    pip_weight: float = 0.5
    band: Band | None = None

    def values_without(self, session_sha256: str, run: str) -> Mapping[str, float] | None:
        """Values of the fit that has not seen the run; None where the run was not part of the fit."""
        for one in self.held_out:
            if one.session_sha256 == session_sha256 and run in one.runs:
                return one.values
        return None


@dataclass(frozen=True)
class ExtendedModel:
    """The nominal model and the same with effects, fitted to the same runs under the same weights."""

    extended: Variant
    nominal: Variant
    parameters: Mapping[str, ParameterEstimate]
    sessions: tuple[SessionHash, ...]

    @property
    def effect_ids(self) -> tuple[str, ...]:
        """Ids of the effects in the order in which they were added."""
        return tuple(c.effect.id for c in self.extended.effects)

    @property
    def words(self) -> str:
        """The model with effects in words, for a list."""
        return " + ".join(["nominal model", *(c.effect.title or c.effect.id for c in self.extended.effects)])

    @property
    def variants(self) -> Mapping[str, Variant]:
        """Both by name; the nominal model alone where no effect was added."""
        if not self.extended.effects:
            return {"nominal": self.nominal}
        return {"extended": self.extended, "nominal": self.nominal}
