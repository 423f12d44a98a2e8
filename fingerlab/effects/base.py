"""What an effect is: one small object that the fit, the ranking, the plots and the report work from.

An effect adds *terms* to the equations. Every equation is written as measured minus modelled, and a
term is a column of the modelled side times an unknown gain:

* ``MCP`` and ``PIP``: cable tension (N) that the motor channel gives, minus the tension that the joint's
  torque balance implies. A term with ``scale="joint"`` is a torque at the joint (N m); the fit divides it
  by the signed moment arm. A term with ``scale="direct"`` is a tension (N).
* ``CABLE``: cable wound on the pulley (m) minus the length that the joints call for. A term with
  ``scale="direct"`` is a length (m), one with ``scale="arm_mcp"`` or ``"arm_pip"`` an angle (rad) that the
  signed moment arm turns into a length.
  One with ``scale="compliance"`` is a tension (N) that the motor gives and the cable never sees; the cable's
  compliance turns it into a length.
* ``BENCH``: motor torque (N m) of a motor-bench run minus its nominal equation.
* ``TIP``: depth of the pressing fingertip (m) from the joint angles minus that of the load cell's face.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Literal

import numpy as np

from fingerlab.effects.motion import Motion
from fingerlab.sessions.model import Array


class Row(IntEnum):
    """The equation that a term stands in."""

    MCP = 0
    PIP = 1
    CABLE = 2
    BENCH = 3
    TIP = 4


def nothing(length: int) -> Array:
    """Zeros, shape (length,), read-only and without memory of their own; another array at every call."""
    return np.ndarray((length,), np.float64, bytes(8), 0, (0,))


Scale = Literal["joint", "direct", "arm_mcp", "arm_pip", "compliance"]


@dataclass(frozen=True)
class Term:
    """One column of an equation: ``values`` of shape (n,) times (``constant`` + the gain named ``gain``).

    An empty ``gain`` leaves the constant alone.
    """

    row: Row
    gain: str
    values: Array
    scale: Scale = "direct"
    constant: float = 0.0


@dataclass(frozen=True)
class Gain:
    """An unknown strength.

    Attributes:
        unit: SI unit.
        low, high: plausible range; the fit never leaves it.
        typical: a strength that would matter, in ``unit``; scales the fit and the prior.
        source: where range and typical strength come from, or "assumed".
        title: what it is called in a sentence.
    """

    unit: str
    low: float
    high: float
    typical: float
    source: str = "assumed"
    title: str = ""


Shape = Mapping[str, float]
Columns = Callable[[Motion, Shape], list[Term]]
Closer = Callable[[Shape], Sequence[Shape]]


def as_found(shape: Shape) -> Sequence[Shape]:
    """The shape alone: there is nothing between the points of the grid."""
    return (shape,)


def unbounded(shape: Shape) -> Mapping[str, tuple[float, float]]:
    """No narrower limits than the gains have everywhere."""
    return {}


@dataclass(frozen=True)
class Effect:
    """A physical effect that the nominal model leaves out.

    Attributes:
        id: fixed name of ``effects.md``. title: in an operator's words.
        acts_on: equation families changed: joint_torque, cable_kinematics, motor_torque, endpoint_force.
        gains: the linear unknowns, by name.
        columns: terms from signals and one point of ``shapes``.
        shapes: grid of the nonlinear unknowns; each point is a mapping name -> value.
        shape_units: unit of each nonlinear unknown; what ``shapes`` holds beyond these are switches, 0 or 1.
        closer: shapes around one that was found, finer than the grid, and of other laws of the same physics
            (what these name beyond the grid's shapes is 0 where it is missing); tried in a second look.
        coordinate: what the residual is plotted against to see this effect (a ``Motion`` quantity).
        equation: the row in which that fingerprint is drawn.
        explanation: one sentence for a person, without numbers.
        reveal: the experiment that shows the effect where these data could not.
        phases: phases of a run in which it can act; empty means all.
        bench: whether it can be told from runs of the motor alone, which it then has columns for.
        bench_beside_finger: whether it has such columns too, but can be told only beside a finger's runs:
            alone, it is what the bench's own equation fits.
        cables: cables that the recording must hold, each, for it to be judged.
        special: how the fit treats it where it is not a column: "delay" or "slack".
        relaxes: nuisance gains that this effect sets free (it is the same term without the tight prior).
        sticks: whether it may hold any value between its extremes while nothing moves.
        wanders: whether its strength differs by some per cent from run to run, as friction does.
        offsets: gains of a constant that the joints' losses could be as well: no misfit tells them apart, but
            losses that one such gain makes small at all joints and routings do.
        bounds: narrower limits of a gain at a point of ``shapes``, where the law holds only near that point.
        turns: by how much (rad) the load cell's face is turned against the finger at a point of ``shapes``;
            what the tip does along the face turns with it.
        excess: gains that are what comes on top of another gain of the effect, and that one's name; nobody
            would speak of an excess that is a small share of it.
    """

    id: str
    title: str
    acts_on: tuple[str, ...]
    gains: Mapping[str, Gain]
    columns: Columns
    coordinate: str
    equation: Row
    explanation: str
    reveal: str
    shapes: Sequence[Shape] = field(default_factory=lambda: ({},))
    shape_units: Mapping[str, str] = field(default_factory=dict)
    closer: Closer = as_found
    phases: tuple[str, ...] = ()
    cables: tuple[str, ...] = ()
    bench: bool = False
    bench_beside_finger: bool = False
    special: Literal["", "delay", "slack"] = ""
    relaxes: Mapping[str, Gain] = field(default_factory=dict)
    wanders: bool = False
    sticks: bool = False
    offsets: tuple[str, ...] = ()
    bounds: Callable[[Shape], Mapping[str, tuple[float, float]]] = unbounded
    turns: Callable[[Shape], float] | None = None
    excess: Mapping[str, str] = field(default_factory=dict)

    def gains_at(self, shape: int) -> dict[str, Gain]:
        """The gains with the limits that they have at one point of ``shapes``."""
        within = self.bounds(self.shapes[shape])
        return {
            name: replace(gain, low=within[name][0], high=within[name][1]) if name in within else gain
            for name, gain in self.gains.items()
        }
