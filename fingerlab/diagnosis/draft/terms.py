"""One term of a drafted law: where it acts, what it computes, and the same as an effect.

A term is an :class:`~fingerlab.effects.base.Effect` of its own, so that it is fitted beside all unknowns of
the bench and scored on runs left out as an effect of the catalogue is. What it computes is written once, as
an expression: it is evaluated here, and stands as it is in the file of an own effect that is made of a draft.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from types import CodeType
from typing import Any

import numpy as np

from fingerlab.diagnosis.settings import DRAFT_RANGE, STATE_RIDGE
from fingerlab.effects.base import Effect, PortableColumns, Row, Scale, Shape, Term
from fingerlab.effects.joints import lateral_levers, misread
from fingerlab.physics.friction_states import (
    dahl_states,
    first_order_lags,
    friction_state,
    rubbing_forces,
    way_while,
)
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

Powers = Mapping[str, int]
"""A unit as the powers of its parts."""


@dataclass(frozen=True)
class Place:
    """Where a term acts: on which equations, and what it is there.

    Attributes:
        title: in a sentence. unit: of what it adds. family: of the equations, as effects name it.
        row: equation in which it is drawn. coordinate: a joint's quantities are its own.
        subject: LaTeX of what is missing.
    """

    title: str
    unit: Powers
    family: str
    row: Row
    subject: str


TORQUE: Powers = {"N": 1, "m": 1}
ANGLE: Powers = {"rad": 1}
PLACES: Mapping[str, Place] = {
    "mcp": Place("torque at the MCP joint", TORQUE, "joint_torque", Row.MCP, r"\tau_1"),
    "pip": Place("torque at the PIP joint", TORQUE, "joint_torque", Row.PIP, r"\tau_2"),
    "joints": Place("torque at both joints", TORQUE, "joint_torque", Row.PIP, r"\tau_j"),
    "motor": Place("torque of motor and cable", TORQUE, "motor_torque", Row.PIP, r"\tau_m"),
    "bench": Place("torque of the motor", TORQUE, "motor_torque", Row.BENCH, r"\tau_m"),
    "cable": Place("length of cable", {"m": 1}, "cable_kinematics", Row.CABLE, "x"),
    "tip": Place("force across the load cell", {"N": 1}, "endpoint_force", Row.PIP, "F_t"),
    "cell": Place("force on the load cell", {"N": 1}, "endpoint_force", Row.PIP, "F_n"),
    "sensor_mcp": Place("reading of the MCP angle", ANGLE, "cable_kinematics", Row.CABLE, "e_1"),
    "sensor_pip": Place("reading of the PIP angle", ANGLE, "cable_kinematics", Row.CABLE, "e_2"),
    "sensors": Place("reading of both joint angles", ANGLE, "cable_kinematics", Row.CABLE, "e_j"),
}
PAIRED = {"joints": ("mcp", "pip"), "sensors": ("sensor_mcp", "sensor_pip")}
"""Places that are two: a term there has a coefficient of its own in either."""


@dataclass(frozen=True)
class TermPart:
    """One column of a term: an expression with its unit, and the same in words and in LaTeX.

    ``place`` is where it acts, if the term's parts act in several.
    """

    code: str
    words: str
    latex: str
    unit: Powers = field(hash=False)
    place: str = ""


@dataclass(frozen=True)
class DraftTerm:
    """A function of the state, times a coefficient for each of its parts, in one place.

    Attributes:
        place: key of ``PLACES``. name: its own there. variables: what it depends on, of :data:`VARIABLES`.
        coordinate: what a residual is drawn against to see it. friction: it differs from run to run by some
            per cent, and may hold any value between its extremes at rest.
        number: stands for § in its expressions: a travel, speed or time, in the fit's units; 0: none does.
        sharpness: stands for ¤, the virgin curve of a friction (:func:`friction_state`).
        size: of a unit of the number, SI.
    """

    place: str
    name: str
    parts: tuple[TermPart, ...]
    variables: tuple[str, ...]
    coordinate: str
    friction: bool = False
    number: float = 0.0
    sharpness: float = 0.0
    size: float = 1.0

    @property
    def id(self) -> str:
        return f"draft_{self.place}_{self.name}"

    def code(self, part: TermPart) -> str:
        """The expression of one of its parts, with its numbers."""
        return part.code.replace("§", f"{self.number:.4g}").replace("¤", f"{self.sharpness:g}")

    @property
    def words(self) -> str:
        """The same for a person, in SI."""
        return " and ".join(dict.fromkeys(self.part_words))

    @property
    def part_words(self) -> tuple[str, ...]:
        """... of each of its parts."""
        number = f"{self.number * self.size:.2g}"
        return tuple(part.words.replace("§", number) for part in self.parts)

    @property
    def gains(self) -> tuple[str, ...]:
        """Names of its coefficients, one a part."""
        if self.place in PAIRED:
            count = len(self.parts) // 2
            names = ("c",) if count == 1 else tuple(f"c{k + 1}" for k in range(count))
            return tuple(f"{name}_{joint}" for joint in ("mcp", "pip") for name in names)
        return ("c",) if len(self.parts) == 1 else tuple(f"c{k + 1}" for k in range(len(self.parts)))

    @property
    def varies(self) -> bool:
        """Whether it is a friction, which differs by some per cent from run to run."""
        return self.friction or any("speed" in one for one in self.variables)

    @property
    def units(self) -> tuple[str, ...]:
        """SI unit of each coefficient."""
        return tuple(ratio(PLACES[self.place].unit, part.unit) for part in self.parts)


VARIABLES = (
    "joint speed", "joint angle", "other joint", "joint acceleration", "motor speed", "motor angle",
    "motor acceleration", "direction", "way since reversal", "tension", "load", "force", "time", "past",
    "motor phase", "gravity", "lateness", "end of travel", "slack",
)  # fmt: skip
"""What a law may depend on. ``other joint``: that whose torque it is not. ``past``: what was before, over a
time. ``load``: the known load of a motor bench. ``lateness``: by how much a channel changes over a time.
``slack``: tension so low that the cable may hang loose."""


def ratio(over: Powers, under: Powers) -> str:
    """The unit of one quantity over another, such as ``N m s/rad``."""
    powers = dict(over)
    for name, power in under.items():
        powers[name] = powers.get(name, 0) - power

    def product_text(names: Iterable[tuple[str, int]]) -> str:
        return " ".join(name if power == 1 else f"{name}^{power}" for name, power in names)

    top = product_text((n, p) for n, p in powers.items() if p > 0)
    bottom = product_text((n, -p) for n, p in powers.items() if p < 0)
    return f"{top or '1'}/{bottom}" if bottom else top or "1"


@cache
def _compiled(code: str) -> CodeType:
    return compile(code, "<term of a draft>", "eval")


def signals(motion: Motion) -> dict[str, Any]:
    """The names that expressions are written in; the file of an own effect begins with the same."""
    zero = np.zeros_like(motion.time)
    return {
        "np": np,
        "motion": motion,
        "q": motion.joints,
        "force": zero if motion.force is None else motion.force,
        "load": zero if motion.load is None else motion.load,
        # What the rotor takes to speed up, the cable never carries.
        "tension": motion.tension - (motion.motor.inertia or 0.0) * motion.inertial_pull,
        "dahl_states": dahl_states,
        "first_order_lags": first_order_lags,
        "friction_state": friction_state,
        "rubbing_forces": rubbing_forces,
        "way_while": way_while,
    }


def value_of(code: str, motion: Motion) -> Array:
    """An expression of the library in a motion, (n,); one that several terms hold is computed once."""
    # No text of anybody else comes here: all expressions are made in library.py.
    return motion.remember(
        ("draft", code), lambda: np.asarray(eval(_compiled(code), signals(motion)), dtype=float)
    )


@dataclass(frozen=True)
class TermColumns(PortableColumns):
    """The columns of a term."""

    term: DraftTerm

    def __call__(self, motion: Motion, shape: Shape) -> list[Term]:
        term = self.term
        if motion.joints is None and term.place != "bench":
            return []
        if shape:  # tried at other numbers
            term = replace(term, number=shape["number"], sharpness=shape["sharpness"])
        return [
            one
            for part, gain in zip(term.parts, term.gains, strict=True)
            for one in placed(part.place or term.place, gain, value_of(term.code(part), motion), motion)
        ]


def placed(place: str, gain: str, values: Array, motion: Motion) -> list[Term]:
    """What ``values`` that act in a place are in the equations."""
    if place == "bench":
        return [Term(Row.BENCH, gain, values)]
    if place == "cable":
        return [Term(Row.CABLE, gain, values)]
    if place == "motor":
        pull = values / motion.radius
        scales: list[tuple[Row, Scale]] = [
            (Row.MCP, "direct"),
            (Row.PIP, "direct"),
            (Row.CABLE, "compliance"),
        ]
        return [Term(row, gain, pull, scale) for row, scale in scales]
    if place == "tip":
        return [Term(t.row, gain, values * t.values, "joint") for t in lateral_levers(motion, gain)]
    if place in PAIRED["sensors"]:
        return misread(motion, gain, place.removeprefix("sensor_"), values)
    if place == "cell":
        levers = zip((Row.MCP, Row.PIP), motion.contact_levers, strict=True)
        return [Term(row, gain, values * lever, "joint") for row, lever in levers]
    return [Term(PLACES[place].row, gain, values, "joint")]


def as_effects(terms: Iterable[DraftTerm], motions: Sequence[Motion]) -> dict[DraftTerm, Effect]:
    """The terms that these motions move, as effects with ranges by what the motions carry.

    Args:
        motions: some of every kind of run, in the fit's units.
    """
    sizes = {place: _size(place, motions) for place in PLACES}
    found = {}
    for term in terms:
        spreads = [_spread(term.code(part), term, motions) for part in term.parts]
        if min(spreads) <= STATE_RIDGE * max(sizes[term.place], 1e-12):
            continue
        gains = {}
        for gain, unit, spread in zip(term.gains, term.units, spreads, strict=True):
            typical = sizes[term.place] / spread
            gains[gain] = Parameter(
                unit, -DRAFT_RANGE * typical, DRAFT_RANGE * typical, 0.1 * typical, "the recordings",
                varies_between_runs=term.varies, holds_at_rest=term.friction,
            )  # fmt: skip
        found[term] = effect_of(term, gains)
    return found


def effect_of(term: DraftTerm, gains: Mapping[str, Parameter]) -> Effect:
    """The term as an effect."""
    place = PLACES[term.place]
    words = term.words
    return Effect(
        id=term.id,
        title=f"{words}, {place.title}",
        acts_on=(place.family,),
        gains=gains,
        columns=TermColumns(term),
        coordinate=term.coordinate,
        equation=place.row,
        explanation=f"A part of the {place.title} follows {words}.",
        reveal="a run in which it is large",
        phases=("contact",) if term.place in ("tip", "cell") else (),
        bench=term.place == "bench",
    )


def _size(place: str, motions: Sequence[Motion]) -> float:
    """What the equations of a place hold: torque, force or length, root mean square, in the fit's units."""
    found = [0.0]
    for motion in motions:
        if (motion.joints is None) != (place == "bench"):
            continue
        inner = slice(motion.lead, None)
        if place == "cable":
            found.append(motion.radius * float(np.std(motion.position[inner])))
        elif PLACES[place].unit == ANGLE:
            found.append(_turned(motion))
        elif place in ("tip", "cell"):
            found.append(0.0 if motion.force is None else _rms(motion.force[inner]))
        else:
            found.append(_rms(motion.torque[inner]))
    return max(found)


def _turned(motion: Motion) -> float:
    """How far the joints turn, root mean square, rad."""
    _, joints = motion.finger_and_joints
    return max(float(np.std(angle[motion.lead :])) for angle in (joints.mcp, joints.pip))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _spread(code: str, term: DraftTerm, motions: Sequence[Motion]) -> float:
    """Largest root mean square of a part's changes within a run, in the fit's units."""
    found = [0.0]
    for motion in motions:
        if (motion.joints is None) == (term.place == "bench"):
            found.append(float(np.std(value_of(code, motion)[motion.lead :])))
    return max(found)
