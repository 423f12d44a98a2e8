"""A parameter: one number with its unit, its range, where these come from, and the role that it plays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum

Limits = tuple[float, float]


LOSS = "loss"
"""The constant torque that every joint has of its own for each routing: the first letters of its names."""


class Role(Enum):
    """What a parameter is to a model."""

    PHYSICAL = "physical"
    """A strength of an effect: it multiplies a column."""
    NUISANCE = "nuisance of the bench"
    """Open in every model, with one value in all runs of a session, or one for each cable routing."""
    SHAPE = "shape"
    """Nonlinear: tried at the points of a grid, one after the other."""


@dataclass(frozen=True)
class Parameter:
    """A number of an effect, of a nuisance or of the simulated bench.

    Attributes:
        unit: SI unit; "1" or empty where there is none.
        low, high: plausible range; a fit never leaves it.
        typical: a strength that would matter, in ``unit``; scales the fit and the prior. Of a nuisance: one
            standard deviation of its prior.
        source: where range and typical strength come from, or "assumed".
        title: what it is called in a sentence.
        name: by which it is known beside the others of the same effect or model.
        default: its value where nothing else is said: a fit starts there, the simulated bench has it.
        role: what it is to a model.
        symbol: in LaTeX, as in the printed equation.
        varies_between_runs: whether it differs by some per cent from run to run, as friction does.
        holds_at_rest: whether what it multiplies may have any value between its extremes while nothing moves.
        excess_of: name of the parameter on top of which it comes; nobody would speak of an excess that is a
            small share of it.
        degenerate_with: the nuisance that it could be as well ("loss"): no misfit tells them apart, but
            losses that one such parameter makes small at all joints and routings do.
        open: of a nuisance, whether nothing is known of it before a run tells; its prior then hardly counts.
        phase: of a nuisance, the phase of a run that alone can tell it; empty: any.
        cable: the one that alone can tell it; empty: any. A model has it where a run has that cable.
        limits: other limits at a point of the grid of shapes, where the law holds only near that point or
            means another thing there; None: as elsewhere.
    """

    unit: str
    low: float
    high: float
    typical: float
    source: str = "assumed"
    title: str = ""
    name: str = ""
    default: float = 0.0
    role: Role = Role.PHYSICAL
    symbol: str = ""
    varies_between_runs: bool = False
    holds_at_rest: bool = False
    excess_of: str = ""
    degenerate_with: str = ""
    open: bool = False
    phase: str = ""
    cable: str = ""
    limits: Callable[[Mapping[str, float]], Limits | None] | None = None

    def at(self, shape: Mapping[str, float]) -> Parameter:
        """The parameter with the limits that it has at a point of the grid of shapes."""
        found = None if self.limits is None else self.limits(shape)
        return self if found is None else replace(self, low=found[0], high=found[1])
