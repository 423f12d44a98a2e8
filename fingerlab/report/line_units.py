"""One place for the units of a linear axis: what is told of an arc as masses, forces and lengths.

A session of such an axis holds angles and torques about a radius (``docs/file-format.md``), and so does what
is worked out of it. What is shown of it, channels, constants and diagnosis, goes through :class:`LineUnits`,
in the window, on the page and on the terminal; of an axis that turns all of it stays the same object.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

from fingerlab.core.text import (
    RAD_IN_DEGREE,
    ParameterEstimate,
    ScreenUnit,
    estimate_text,
    listed,
    screen_unit,
)
from fingerlab.diagnosis.answer.error_parts import Budget, BudgetPart, Comparison, EquationError
from fingerlab.diagnosis.answer.results import BenchFinding, Candidate, Diagnosis, Fingerprint, FirstLook
from fingerlab.diagnosis.answer.stretches import unit_of_place
from fingerlab.rig.file import CONSTANT_UNITS, GIVES_TORQUE, Finger, Motor, Rig
from fingerlab.sessions.model import CHANNEL_UNITS, Session

EQUATIONS = {"motor_torque": "motor_force"}
"""Id of an equation, and of its family, about the arc; the one that tells the same along the line."""
WORDS = (
    (r"\binertia J\b", "mass"),
    (r"\bInertia J\b", "Mass"),
    (r"\btorque at the gearbox output\b", "force"),
    (r"\btorque\b", "force"),
    (r"\bTorque\b", "Force"),
)
"""In titles of parameters: what stands for an angular quantity."""
PLACES = ((r"\b(?:motor )?angle\b", "position"), (r"\bmotor (speed|acceleration)\b", r"\1"))
"""In what a residual is drawn over, and in sentences: the same of a place."""
CALLED = {
    "motor_command": "command",
    "motor_position": "position",
    "motor_torque": "force",
    "motor_current": "current",
    "load_torque": "load",
    "inertia": "mass",
    "torque_constant": "force constant",
}
"""What channels of a session, and constants of its rig, are called where they are of a line."""
TURN = 2.0 * math.pi
"""rad."""


@dataclass(frozen=True)
class Constant:
    """A constant of a bench. ``part`` and ``key`` of the rig file; ``name`` in words; ``unit`` SI."""

    part: str
    key: str
    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class LineUnits:
    """Units in which quantities of an axis are shown.

    Attributes:
        radius: ``Rig.line_radius``, m: of the arc as which a linear axis is told; 0: it turns, and every
            quantity keeps its unit.
    """

    radius: float = 0.0

    def unit(self, si: str) -> tuple[str, float]:
        """The SI unit along the line of what has the unit ``si`` about the arc, and the factor to it."""
        if not self.radius:
            return si, 1.0
        if si == "1/turn":
            return "1/m", 1.0 / (TURN * self.radius)
        factor, power, line = 1.0, 0, si
        if line == "deg" or line.startswith("deg/"):
            line, factor = f"rad{line.removeprefix('deg')}", RAD_IN_DEGREE
        for angular, straight in (("N m", "N"), ("kg m^2", "kg")):
            if line == angular or line.startswith((f"{angular} ", f"{angular}/")):
                power = -2 if straight == "kg" else -1
                line = straight + line.removeprefix(angular)
        above, over, below = line.partition("/")
        power += _exponent(above) - _exponent(below)
        line = re.sub(r"\brad\b", "m", above) + over + re.sub(r"\brad\b", "m", below)
        return line, factor * self.radius**power

    def screen(self, si: str, largest: float) -> ScreenUnit:
        """The unit on the screen for values about the arc up to ``largest``, in ``si``, as they are."""
        line, factor = self.unit(si)
        shown = screen_unit(line, factor * largest)
        return replace(shown, factor=factor * shown.factor)

    def estimate(self, one: ParameterEstimate) -> ParameterEstimate:
        """A parameter with its interval."""
        unit, factor = self.unit(one.unit)
        if unit == one.unit:
            return one
        return ParameterEstimate(one.value * factor, unit, one.low * factor, one.high * factor)

    def title(self, title: str) -> str:
        """A title with mass and force in place of inertia and torque."""
        return _worded(title, WORDS) if self.radius else title

    def place(self, name: str) -> str:
        """What a residual is drawn over: ``position`` for ``motor angle``."""
        return _worded(name, (*WORDS, *PLACES)) if self.radius else name

    def sentence(self, text: str) -> str:
        """A sentence with its words, and each amount of an angular unit, along the line."""
        return _worded(AMOUNT.sub(self._amount, text), (*WORDS, *PLACES)) if self.radius else text

    def _amount(self, found: re.Match[str]) -> str:
        symbol = found["unit"]
        prefix, si = UNITS[symbol]
        line, factor = self.unit(si)
        value, half, low, high = (_number(found[name]) * prefix * factor for name in GROUPS)
        if math.isfinite(half):
            low, high = value - half, value + half
        if math.isfinite(low):
            return estimate_text(ParameterEstimate(value, line, low, high))
        unit = screen_unit(line, abs(value))
        digits = len(found["value"].strip("−-").replace(".", "").lstrip("0"))
        return unit.after(f"{float(f'{value * unit.factor:.{max(digits, 2)}g}'):g}".replace("-", "−"))

    @property
    def arc(self) -> str:
        """What the angles and torques mean that are still told of the arc; empty where the axis turns."""
        if not self.radius:
            return ""
        kept = self._kept(f"1 N m s/rad is {1.0 / self.radius**2:g} N s/m")
        return f"{kept} Equations, drafted laws and JSON are told so."

    @property
    def file(self) -> str:
        """What the angles and torques of its session file mean; empty where the axis turns."""
        return f"{self._kept()} The file and what is exported of it are told so." if self.radius else ""

    def _kept(self, *more: str) -> str:
        degree = f"1 deg is {1e3 * math.radians(self.radius):.3g} mm"
        units = listed((f"1 N m is {1.0 / self.radius:g} N", degree, *more))
        return f"The axis is linear, kept as an arc of {1e3 * self.radius:g} mm: {units}."

    # what a session holds

    def called(self, key: str) -> str:
        """A channel of a session, or a constant of its rig, in words: ``motor torque``; along a line
        ``force``.
        """
        words = key.replace("_", " ")
        return CALLED.get(key, words) if self.radius else words

    def channel(self, name: str, largest: float) -> ScreenUnit:
        """The unit on the screen of a channel of the session format, whose values, SI, reach ``largest``."""
        return self.screen(CHANNEL_UNITS[name], largest)

    def constants(self, rig: Rig) -> list[Constant]:
        """What somebody said of a bench, in the order of its rig file.

        Of an axis along a line the moving mass, and what an ampere gives there with its gear, N/A.
        """
        found = []
        for part, given, kind in (("finger", rig.finger, Finger), ("motor", rig.motor, Motor)):
            for key in [one.name for one in fields(kind)] if given is not None else ():
                value = getattr(given, key)
                if self.radius and key in GIVES_TORQUE:  # of the motor, which the line sees through its gear
                    value = rig.ampere or None if key == "torque_constant" else None
                if value is None or key in rig.untold:
                    continue
                unit, factor = self.unit(CONSTANT_UNITS[key])
                found.append(Constant(part, key, self.called(key), value * factor, unit))
        return found

    # what a diagnosis is made of

    def error(self, one: EquationError) -> EquationError:
        """An error of the torque as one of the force."""
        if not self.radius or one.unit != "N m":
            return one
        numbers = {name: getattr(one, name) / self.radius for name in ("rmse", "floor", "rubbing", "seen")}
        return replace(one, unit="N", **numbers)

    def errors(self, errors: Mapping[str, EquationError]) -> Mapping[str, EquationError]:
        """By family of equations."""
        return {_id(name): self.error(one) for name, one in errors.items()} if self.radius else errors

    def comparison(self, one: Comparison) -> Comparison:
        """Measured and modelled, with what they can be drawn over."""
        if not self.radius or one.equation not in EQUATIONS:
            return one
        unit, factor = self.unit(one.unit)
        return replace(
            one,
            equation=_id(one.equation),
            measured=one.measured * factor,
            modelled=one.modelled * factor,
            unit=unit,
            floor=one.floor * factor,
            coordinates={
                self.place(name): values * self.unit(unit_of_place(name))[1]
                for name, values in one.coordinates.items()
            },
        )

    def fingerprint(self, one: Fingerprint) -> Fingerprint:
        """A residual over its coordinate."""
        if not self.radius or one.equation not in EQUATIONS:
            return one
        across, along = self.unit(one.coordinate_unit)
        up, factor = self.unit(one.value_unit)
        return Fingerprint(
            _id(one.equation),
            self.place(one.coordinate),
            across,
            up,
            one.centre * along,
            *(values * factor for values in (one.mean, one.low, one.high, one.curve)),
        )

    def look(self, one: FirstLook) -> FirstLook:
        """What is known of a model before the rest of its diagnosis."""
        return replace(one, errors=self.errors(one.errors)) if self.radius else one

    def diagnosis(self, one: Diagnosis) -> Diagnosis:
        """All that a diagnosis shows; what it holds for further work stays as the fit has it."""
        if not self.radius or one.line_radius:
            return one
        failure = one.failure
        return replace(
            one,
            line_radius=self.radius,
            of_arc=one,
            errors=self.errors(one.errors),
            candidates=tuple(map(self._candidate, one.candidates)),
            parameters=self._estimates(one.parameters),
            final_parameters=self._estimates(one.final_parameters),
            comparisons=tuple(map(self.comparison, one.comparisons)),
            failure=failure
            and replace(
                failure,
                text=self.sentence(failure.text),
                moment=self.sentence(failure.moment),
                equation=_id(failure.equation),
            ),
            score_parts=tuple(replace(part, equation=_id(part.equation)) for part in one.score_parts),
            excluded_by_motion=tuple(
                replace(part, equation=_id(part.equation)) for part in one.excluded_by_motion
            ),
            bench=tuple(map(self._finding, one.bench)),
            paired=tuple(replace(pair, words=self.sentence(pair.words)) for pair in one.paired),
            budget={_id(name): self._budget(budget) for name, budget in one.budget.items()},
        )

    def _estimates(self, found: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
        return {key: self.estimate(one) for key, one in found.items()}

    def _candidate(self, one: Candidate) -> Candidate:
        return replace(
            one,
            parameters=self._estimates(one.parameters),
            equations=tuple(map(_id, one.equations)),
            explanation=self.sentence(one.explanation),
            fingerprint=one.fingerprint and self.fingerprint(one.fingerprint),
        )

    def _finding(self, one: BenchFinding) -> BenchFinding:
        unit, factor = self.unit(one.unit)
        sentence, advice = self.sentence(one.sentence), self.sentence(one.advice)
        return replace(one, size=one.size * factor, unit=unit, sentence=sentence, advice=advice)

    def _budget(self, one: Budget) -> Budget:
        unit, factor = self.unit(one.unit)
        square = factor**2

        def part(found: BudgetPart) -> BudgetPart:
            orders = (None if v is None else square * v for v in (found.low, found.high, found.average))
            low, high, average = orders
            return replace(found, mean_square=square * found.mean_square, low=low, high=high, average=average)

        return Budget(unit, square * one.mean_square, tuple(map(part, one.parts)))


def line_units(sessions: Sequence[Session]) -> LineUnits:
    """Those of the axis that these sessions, of one machine, are of."""
    return LineUnits(sessions[0].rig.line_radius if sessions else 0.0)


def _id(name: str) -> str:
    return EQUATIONS.get(name, name)


def _worded(text: str, words: Sequence[tuple[str, str]]) -> str:
    for angular, straight in words:
        text = re.sub(angular, straight, text)
    return text


def _exponent(part: str) -> int:
    """Power of ``rad`` in a product of units."""
    found = re.search(r"\brad(?:\^(\d))?", part)
    return 0 if found is None else int(found[1] or 1)


def _number(text: str | None) -> float:
    return math.nan if text is None else float(text.replace("−", "-"))


GROUPS = ("value", "half", "low", "high")
_TORQUES = ("N m", "N m/rad", "N m s/rad", "N m s^2/rad^2", "N m s/rad^2", "N m/rad^3")
_WRITTEN: Mapping[str, tuple[float, str]] = {
    **{f"{p}{u}": (f, u) for u in _TORQUES for p, f in (("", 1.0), ("m", 1e-3), ("k", 1e3))},
    "g cm^2": (1e-7, "kg m^2"), "kg cm^2": (1e-4, "kg m^2"), "kg m^2": (1.0, "kg m^2"),
    "°": (1.0, "deg"), "deg": (1.0, "deg"), "°/s": (1.0, "deg/s"), "deg/s": (1.0, "deg/s"),
    "per turn": (1.0, "1/turn"),
}  # fmt: skip
"""Of the arc, as sentences have them: what a number is multiplied by, and the unit that it then has."""
UNITS = {**_WRITTEN, **{u.replace("^2", "²").replace("^3", "³"): what for u, what in _WRITTEN.items()}}
_NUMBER = r"[−-]?\d+(?:\.\d+)?"
AMOUNT = re.compile(
    rf"(?<![\w.^])(?P<value>{_NUMBER})(?: ± (?P<half>{_NUMBER}))? ?"
    rf"(?P<unit>{'|'.join(map(re.escape, sorted(UNITS, key=len, reverse=True)))})(?![\w/²³^])"
    rf"(?: \((?P<low>{_NUMBER}) to (?P<high>{_NUMBER})\))?"
)
"""``153 ± 6 mN m``, ``0.08° (0.08 to 0.25)``, ``34 N m``."""
