"""Where a model errs: its equations, measured beside modelled, and what each adds to the error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import sqrt
from typing import Any, Literal

from fingerlab.effects.base import Row
from fingerlab.sessions.model import Array


@dataclass(frozen=True)
class Equation:
    """A comparison of the nominal model, ``docs/theory.md``, in words.

    Attributes:
        title: of its figure. button: the same where room is short. quantity: what its axis shows.
        name: inside a sentence. family: of equations, whose error it counts towards.
        note: what is measured and what modelled. help: the same with formulas.
    """

    title: str
    button: str
    quantity: str
    name: str
    family: str
    note: str
    help: str


EQUATIONS = {
    "mcp_torque": Equation(
        "MCP torque", "MCP", "MCP torque", "MCP torque", "joint_torque",
        "Measured: what the cable does at the joint, from motor current. Modelled: what the joint's motion, "
        "springs and weight call for.",
        "Torque at the MCP joint, N m.\n"
        "Measured: what the motor's torque gives at the joint, s·a·T.\n"
        "Modelled: inertia, Coriolis, gravity and spring at the joint, less the losses: "
        "LHS1 = s·a·T + L1 (thesis 3.16).\n"
        "a moment arm (m), T cable tension (N), s +1 flexion, −1 extension.",
    ),
    "pip_torque": Equation(
        "PIP torque", "PIP", "PIP torque", "PIP torque", "joint_torque",
        "Measured and modelled as at the MCP.",
        "Torque at the PIP joint, N m.\n"
        "Measured: what the motor's torque gives at the joint, s·b·T.\n"
        "Modelled: inertia, Coriolis, gravity and spring at the joint, less the losses: "
        "LHS2 = s·b·T + L2 (thesis 3.17).\n"
        "b moment arm (m), T cable tension (N), s +1 flexion, −1 extension.",
    ),
    "cable_kinematics": Equation(
        "Cable kinematics", "Cable", "Cable wound", "cable length", "cable_kinematics",
        "Measured: cable wound on the pulley, from the motor angle. Modelled: what the joint angles call for "
        "while the cable is taut.",
        "Cable wound on the pulley, m.\n"
        "Measured: pulley radius times motor angle, x = r·θm.\n"
        "Modelled: what the joints call for while the cable is taut, x0 + s·(a·θ1 + b·θ2).\n"
        "Slack, stretch and backlash show here and hardly anywhere else.",
    ),
    "endpoint_force_pip": Equation(
        "Endpoint force (PIP equation)", "Force, PIP", "Fingertip force", "fingertip force",
        "endpoint_force",
        "Measured: the load cell. Modelled: the force that balances the PIP joint.",
        "Force of the fingertip on the load cell, N, compression positive.\n"
        "Measured: load cell.\n"
        "Modelled from the PIP balance: F = (s·b·T + L2 − LHS2) / lever (thesis 3.18).",
    ),
    "endpoint_force_mcp": Equation(
        "Endpoint force (MCP equation)", "Force, MCP", "Fingertip force", "fingertip force",
        "endpoint_force",
        "Measured: the load cell. Modelled: the force that balances the MCP joint.",
        "Force of the fingertip on the load cell, N, compression positive.\n"
        "Measured: load cell.\n"
        "Modelled from the MCP balance: F = (s·a·T + L1 − LHS1) / lever. "
        "It must agree with the PIP equation; where it does not, that is evidence.",
    ),
    "motor_torque": Equation(
        "Motor torque", "Motor", "Motor torque", "motor torque", "motor_torque",
        "Measured: the motor's torque at its output, as it was logged or from its current. "
        "Modelled: what inertia, a known load and an offset call for.",
        "Torque of the motor at its output, N m.\n"
        "Measured: as it was logged, or torque constant × gear ratio × current.\n"
        "Modelled: J·acceleration + gain·load + offset.",
    ),
    "motor_force": Equation(
        "Motor force", "Motor", "Motor force", "motor force", "motor_force",
        "Measured: the force that drives the axis, as it was logged or from the motor's current. "
        "Modelled: what mass, a known load and an offset call for.",
        "Force that drives the axis along its line, N.\n"
        "Measured: as it was logged, or force constant × current.\n"
        "Modelled: mass·acceleration + gain·load + offset.",
    ),
}  # fmt: skip
"""By the id that comparisons, parts of a score and ``--json`` have, in the order in which they are shown.

"motor_force" is "motor_torque" of an axis along a line, as it is shown (``report/line_units.py``).
"""


def equation_of(name: str) -> Equation:
    """The equation of that id; of one that is not compared, such as the tip's depth, what its id says."""
    known = EQUATIONS.get(name)
    if known is not None:
        return known
    title = name.replace("_", " ").capitalize()
    return Equation(title, title, title, title.lower(), name, "", title)


ROW_EQUATIONS = {
    Row.MCP: "mcp_torque",
    Row.PIP: "pip_torque",
    Row.CABLE: "cable_kinematics",
    Row.BENCH: "motor_torque",
    Row.TIP: "tip_depth",
}
FAMILY_OF = {name: one.family for name, one in EQUATIONS.items()} | {"tip_depth": "endpoint_force"}
"""Family in ``diagnose --json`` of each equation; where a tip lies, its force says."""
EXCLUSION_REASONS = {
    "ramp": "ramp",
    "slack": "slack",
    "standstill": "standstill",
    "spikes": "outliers",
    "gap": "gap",
}
"""Reasons of :class:`ExcludedTime`, and what ``diagnose --json`` calls them."""


@dataclass(frozen=True)
class ExcludedInterval:
    """A stretch of a run, s from its start, that an equation leaves aside; see ``EXCLUSION_REASONS``."""

    reason: str
    start: float
    stop: float


@dataclass(frozen=True)
class Comparison:
    """One equation over one run: what was measured and what the model says, shapes (n,).

    ``measured`` and ``modelled`` are in ``unit`` (SI), low-passed and decimated; both hold NaN where
    the equation says nothing (start-up, filter edges, slack cable). ``floor`` is the repeatability
    of the bench for this equation, in ``unit``. ``coordinates`` tell at the same times, each (n,) in SI,
    what ``residual_profiles.py`` asks for: "tension", "motor angle", "joint speed mcp" and so on.
    ``aside`` are the stretches of the whole run that do not count here.
    """

    equation: str
    session: str
    run: str
    phase: str
    time: Array
    measured: Array
    modelled: Array
    unit: str
    floor: float
    coordinates: Mapping[str, Array] = field(default_factory=dict)
    aside: tuple[ExcludedInterval, ...] = ()


@dataclass(frozen=True)
class EquationError:
    """Error of one equation family on held-out runs; ``rmse`` and ``floor`` in ``unit``.

    ``rubbing``: what the score takes for the tip's friction in contact on top of the floor, rms in ``unit``.
    ``seen``: the error where the fit has seen all runs; 0: not looked at.
    """

    unit: str
    rmse: float
    r2: float
    floor: float
    rubbing: float = 0.0
    seen: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """As the contract has it."""
        return {"unit": self.unit, "rmse": self.rmse, "r2": self.r2, "floor": self.floor}


@dataclass(frozen=True)
class RowAndScore:
    """What leads from the row of the motor's torque to the error over all: factors, which multiply to it.

    Attributes:
        runs: what runs may differ by: in the row's floor, and taken off by the score.
        stuck: moments at which the motor sticks, which the score weighs less.
    """

    runs: float
    stuck: float


@dataclass(frozen=True)
class ScorePart:
    """What one equation of the runs of one motion adds to the squared score of the model as given.

    Attributes:
        runs: their names. phase, cable: as in the session format. equation: "mcp_torque" and so on.
        samples: share of all samples that these runs hold, 0 to 1.
        left_aside: share of these runs' samples at which the equation says nothing (a slack cable), 0 to 1.
        squared: all of these, and 1 for the floor, sum to the square of the score.
    """

    runs: tuple[str, ...]
    phase: str
    cable: str
    equation: str
    samples: float
    left_aside: float
    squared: float


BudgetKind = Literal["effect", "parameters", "calibration", "between_runs", "floor", "unknown"]
BUDGET_KINDS: tuple[BudgetKind, ...] = (
    "effect",
    "unknown",
    "parameters",
    "calibration",
    "between_runs",
    "floor",
)
"""In the order in which parts stand in a figure, those of the path first."""


@dataclass(frozen=True)
class BudgetPart:
    """One part of a mean squared error.

    Attributes:
        kind: one of ``BUDGET_KINDS``. effect: id of what the path adds, where it is an effect.
        removed: id of the one that it replaces.
        mean_square: of the family's unit; all of a family sum to the whole.
        low, high: least and most that the error falls by, whatever the order in which effects are added, and
            average: over all orders; None: there is one order, or too many.
        parameter: key of the unknown whose uncertainty weighs most, of parameters and calibration.
        title: what the effect is called as it was found; empty: as the catalogue calls it.
    """

    kind: BudgetKind
    mean_square: float
    effect: str = ""
    removed: str = ""
    low: float | None = None
    high: float | None = None
    average: float | None = None
    parameter: str = ""
    title: str = ""


@dataclass(frozen=True)
class Budget:
    """Parts of one family's mean squared error, by ``BUDGET_KINDS``; those of the path in its order.

    ``unit`` is the family's; ``mean_square`` the square of the error that the answer tells.
    """

    unit: str
    mean_square: float
    parts: tuple[BudgetPart, ...]

    def without(self, part: BudgetPart) -> float:
        """Root mean square of the error with this part mended, in ``unit``."""
        return sqrt(max(self.mean_square - part.mean_square, 0.0))

    def to_json(self) -> dict[str, Any]:
        """Plain data; ``rmse_without`` is what each part, mended, would leave."""
        return {
            "unit": self.unit,
            "mean_square": self.mean_square,
            "rmse": sqrt(self.mean_square),
            "parts": [
                {name: value for name, value in vars(part).items() if value not in ("", None)}
                | {
                    "share": part.mean_square / max(self.mean_square, 1e-300),
                    "rmse_without": self.without(part),
                }
                for part in self.parts
            ],
        }


@dataclass(frozen=True)
class RunShare:
    """What one family of equations of one run adds to the squared score of the model as given.

    Attributes:
        session, run, phase, cable: which run. equation: the family, "joint_torque" and so on.
        samples: share of all samples that the run holds, 0 to 1.
        left_aside: as of :class:`ScorePart`.
        squared: all of these, and 1 for the floor, sum to the square of the score.
        share: the same with the floor's 1 dealt to runs and equations by samples; all sum to the square.
    """

    session: str
    run: str
    phase: str
    cable: str
    equation: str
    samples: float
    left_aside: float
    squared: float
    share: float


@dataclass(frozen=True)
class ExcludedTime:
    """How much of one run an equation is not judged by, and why.

    Attributes:
        session, run, phase, cable: which run.
        equation, reason, share, seconds: as of :class:`ExcludedByMotion`.
    """

    session: str
    run: str
    phase: str
    cable: str
    equation: str
    reason: str
    share: float
    seconds: float

    def to_json(self) -> dict[str, Any]:
        """The object "left_aside" of ``diagnose --json``."""
        return {**vars(self), "why": EXCLUSION_REASONS[self.reason], "runs": [self.run]}


@dataclass(frozen=True)
class ExcludedByMotion:
    """How much of the runs of one motion an equation is not judged by, and why.

    Attributes:
        runs, phase, cable: as in :class:`ScorePart`. equation: its id; empty: every equation.
        reason: "ramp" (start-up and the edges of filters and gaps), "slack" (the cable may hang loose),
            "standstill" (counted, but weighed less: friction that sticks may hold any torque there),
            "spikes" (samples put on the line between their neighbours), "gap" (samples that were lost).
        share: of the runs' time, 0 to 1. seconds: the same as time, s.
    """

    runs: tuple[str, ...]
    phase: str
    cable: str
    equation: str
    reason: str
    share: float
    seconds: float
