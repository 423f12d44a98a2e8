"""Whether a user's own effect is one that the fit, the ranking and the plots can work from.

What is refused here would otherwise break a diagnosis half-way, far from the line that is to blame.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import is_number
from fingerlab.core.trust import error_with_line
from fingerlab.effects.base import (
    BESIDE_A_FINGER,
    COORDINATE_UNITS,
    EQUATION_FAMILIES,
    FAMILIES,
    Columns,
    Effect,
    Example,
    Formula,
    Row,
    Shape,
    Term,
)
from fingerlab.physics.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.physics.parameter import LOSS, Parameter, Role
from fingerlab.rig.file import default_rig
from fingerlab.sessions.model import CABLE_SIGN, PHASES, Array

SCALES = ("joint", "direct", "arm_mcp", "arm_pip", "compliance")
MOST_SHAPES = 50
"""Grid points of nonlinear parameters; the work and memory of a diagnosis grow with their square."""
PROBE_RATE_HZ = 250.0
PROBE_SECONDS = 4.0

_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Guarded:
    """The user's columns; what goes wrong in them becomes one sentence, also on data they never saw."""

    columns: Columns
    effect: str
    file: str

    def __call__(self, motion: Motion, shape: Shape) -> list[Term]:
        try:
            # A value that is not a number is told below, with the name of the effect.
            with np.errstate(all="ignore"):
                terms = list(self.columns(motion, shape))
                return [self._checked(term, motion) for term in terms]
        except UserError:
            raise
        except Exception as error:
            raise UserError(
                f"{error_with_line(error, self.file)}; put right the columns of '{self.effect}'."
            ) from None

    def _checked(self, term: object, motion: Motion) -> Term:
        where = f"{self.file}: the columns of '{self.effect}'"
        if not isinstance(term, Term):
            raise UserError(f"{where} hold a {type(term).__name__}; each should be a Term.")
        values = np.asarray(term.values)
        if values.shape != motion.time.shape:
            raise UserError(
                f"{where} give an array of shape {values.shape} for gain '{term.gain}' in a motion of "
                f"{len(motion.time)} samples; it should be {motion.time.shape}."
            )
        if values.dtype.kind not in "fiub":
            raise UserError(f"{where} give values of type {values.dtype}; they should be real numbers.")
        if not np.isfinite(values).all():
            at = int(np.flatnonzero(~np.isfinite(values))[0])
            raise UserError(
                f"{where} give a value that is not a finite number for gain '{term.gain}', at sample {at} "
                f"of a motion '{motion.phase}'; it should be finite for every motion, standstill too."
            )
        return replace(term, values=np.asarray(values, dtype=float))


def checked(effect: object, file: str) -> Effect:
    """The effect with guarded columns.

    Raises:
        UserError: it is not one, or something in it would break a diagnosis; the sentence says what.
    """
    if not isinstance(effect, Effect):
        raise UserError(f"{file} offers a {type(effect).__name__} as an effect; it should be an Effect(...).")
    where = f"{file}: the effect {effect.id!r}"
    _check_words(effect, where)
    _check_grid(effect, where)
    _check_gains(effect, where)
    if not callable(effect.columns):
        raise UserError(f"{where} has columns that cannot be called; give a function of motion and shape.")
    guarded = replace(effect, columns=Guarded(effect.columns, effect.id, file))
    _check_columns(guarded, where)
    problem = guarded.example_problem()
    if problem:
        raise UserError(f"{where} is not as in its example, which {problem}.")
    return guarded


def _check_words(effect: Effect, where: str) -> None:
    if not (isinstance(effect.id, str) and _NAME.fullmatch(effect.id)):
        raise UserError(f"{where} has a bad id; it should be small letters, digits and '_', letter first.")
    for name in ("title", "explanation", "reveal"):
        value = getattr(effect, name)
        if not isinstance(value, str) or not value.strip():
            raise UserError(f"{where} has no {name}; it should be a text that a person reads.")
    _all_of(effect.acts_on, EQUATION_FAMILIES, f"{where}, acts_on", least=1)
    _all_of(effect.phases, PHASES, f"{where}, phases")
    if effect.coordinate not in COORDINATE_UNITS:
        known = ", ".join(COORDINATE_UNITS)
        raise UserError(f"{where} has coordinate {effect.coordinate!r}; it should be one of {known}.")
    if effect.equation not in (Row.MCP, Row.PIP, Row.CABLE, Row.BENCH):
        raise UserError(
            f"{where} has equation {effect.equation!r}; it should be Row.MCP, PIP, CABLE or BENCH."
        )
    if effect.special or effect.relaxes or effect.turns is not None:
        raise UserError(
            f"{where} asks for 'special', 'relaxes' or 'turns'; an effect of your own acts by its "
            "columns alone."
        )
    _all_of(effect.cables, tuple(CABLE_SIGN), f"{where}, cables")
    _one_of(effect.bench, (True, False, BESIDE_A_FINGER), f"{where}, bench")
    _one_of(effect.family, FAMILIES, f"{where}, family")
    if effect.example is not None and not isinstance(effect.example, Example):
        raise UserError(f"{where} has an example that is none; it should be an Example(...).")
    if effect.formula is not None:
        _check_formula(effect.formula, f"{where}, formula")


def _check_formula(formula: object, where: str) -> None:
    if not isinstance(formula, Formula):
        raise UserError(f"{where} is a {type(formula).__name__}; it should be a Formula(...).")
    words = (formula.equation, formula.symbols, formula.source)
    if not all(isinstance(word, str) and word.strip() for word in words):
        raise UserError(f"{where} lacks equation, symbols or source; each should be a text.")
    if not isinstance(formula.values, Mapping) or not all(
        isinstance(v, str) for v in formula.values.values()
    ):
        raise UserError(f"{where} has bad values; give the LaTeX symbol of each unknown by its name.")
    if not isinstance(formula.alike, (tuple, list)):
        raise UserError(f"{where} has alike {formula.alike!r}; it should be a tuple of ids.")


def _one_of(value: object, allowed: Sequence[object], where: str) -> None:
    if not any(value is known or (isinstance(value, str) and value == known) for known in allowed):
        raise UserError(f"{where} is {value!r}; it should be one of {', '.join(map(str, allowed))}.")


def _all_of(values: object, allowed: Sequence[str], where: str, least: int = 0) -> None:
    good = isinstance(values, (tuple, list)) and all(v in allowed for v in values) and len(values) >= least
    if not good:
        raise UserError(f"{where} is {values!r}; it should be a tuple of {', '.join(allowed)}.")


def _check_gains(effect: Effect, where: str) -> None:
    if not isinstance(effect.gains, Mapping) or not effect.gains:
        raise UserError(f"{where} has no gains; it should have at least one strength to find.")
    for name, gain in effect.gains.items():
        here = f"{where}, gain {name!r}"
        if not (isinstance(name, str) and _NAME.fullmatch(name)):
            raise UserError(f"{here} has a bad name; it should be small letters, digits and '_'.")
        if not isinstance(gain, Parameter):
            raise UserError(f"{here} is a {type(gain).__name__}; it should be a Gain(...).")
        if not isinstance(gain.unit, str) or not gain.unit.strip():
            raise UserError(f"{here} has no unit; it should be an SI unit such as 'N m', or '1'.")
        if not all(isinstance(text, str) for text in (gain.title, gain.name, gain.symbol)):
            raise UserError(f"{here} has a title, name or symbol that is no text.")
        if not isinstance(gain.source, str) or not gain.source.strip():
            raise UserError(f"{here} has no source; say where the range comes from, or 'assumed'.")
        if not all(is_number(v) for v in (gain.low, gain.high, gain.typical)) or not gain.low < gain.high:
            raise UserError(f"{here} has the range {gain.low} to {gain.high}; low should be below high.")
        if not 0 < gain.typical <= max(abs(gain.low), abs(gain.high)):
            raise UserError(f"{here} has typical {gain.typical}; it should be above 0 and within the range.")
        _check_role(effect, name, gain, here)


def _check_role(effect: Effect, name: str, gain: Parameter, here: str) -> None:
    """What a gain says of itself that the fit and the ranking act upon."""
    _one_of(gain.role, (Role.PHYSICAL,), f"{here}, role")
    _one_of(gain.varies_between_runs, (True, False), f"{here}, varies_between_runs")
    _one_of(gain.holds_at_rest, (True, False), f"{here}, holds_at_rest")
    if gain.excess_of and (gain.excess_of == name or gain.excess_of not in effect.gains):
        raise UserError(f"{here} is the excess of {gain.excess_of!r}; it should be another of the gains.")
    _one_of(gain.degenerate_with, ("", LOSS), f"{here}, degenerate_with")
    if gain.degenerate_with and not gain.excess_of:
        raise UserError(f"{here} could be a loss as well; it should say which gain it is the excess_of.")
    if gain.limits is None:
        return
    if not callable(gain.limits):
        raise UserError(f"{here} has limits that cannot be called; give a function of the shape.")
    for shape in effect.shapes:
        within = gain.limits(shape)
        if within is None:
            continue
        good = isinstance(within, (tuple, list)) and len(within) == 2 and all(is_number(v) for v in within)
        if not good or not gain.low <= within[0] < within[1] <= gain.high:
            raise UserError(f"{here} has the limits {within!r} at {dict(shape)}; it should lie in the range.")


def _check_grid(effect: Effect, where: str) -> None:
    shapes, units = effect.shapes, effect.shape_units
    if not isinstance(shapes, (tuple, list)) or not 1 <= len(shapes) <= MOST_SHAPES:
        raise UserError(f"{where} has bad shapes; give a tuple of 1 to {MOST_SHAPES} points of its grid.")
    if not isinstance(units, Mapping) or not all(isinstance(unit, str) for unit in units.values()):
        raise UserError(f"{where} has shape_units {units!r}; give the unit of each unknown by its name.")
    for shape in shapes:
        if not isinstance(shape, Mapping) or set(shape) != set(units):
            raise UserError(
                f"{where} has the shape {shape!r}; each should name {sorted(units)}, as shape_units."
            )
        if not all(is_number(v) for v in shape.values()):
            raise UserError(f"{where} has the shape {dict(shape)!r}; its values should be finite numbers.")
    points = [tuple(sorted(shape.items())) for shape in shapes]
    if len(set(points)) != len(points):
        raise UserError(f"{where} has the same shape twice; each point of the grid should differ.")
    if not callable(effect.closer):
        raise UserError(f"{where} has a closer that cannot be called; give a function of a shape.")
    for shape in shapes:
        for near in effect.closer(shape):
            if not set(units) <= set(near) or not all(is_number(v) for v in near.values()):
                raise UserError(f"{where}: closer gives {near!r}; it should be a shape like {dict(shape)!r}.")


def _check_columns(effect: Effect, where: str) -> None:
    """Every point of the grid on every probe, whole and cut short: the same terms each time."""
    for on_bench in (False, True) if effect.bench else (False,):
        rows = (Row.BENCH,) if on_bench else (Row.MCP, Row.PIP, Row.CABLE, Row.TIP)
        for shape in effect.shapes:
            seen: list[tuple[object, ...]] | None = None
            for motion in _probes(on_bench):
                terms = effect.columns(motion, shape)
                _check_terms(effect, terms, rows, where)
                now: list[tuple[object, ...]] = [(t.row, t.gain, t.scale, t.constant) for t in terms]
                if seen is not None and now != seen:
                    raise UserError(
                        f"{where} gives other terms in a motion '{motion.phase}' than before; it should give "
                        "the same ones always, with columns of zeros where it does not act."
                    )
                seen = now


def _check_terms(effect: Effect, terms: Sequence[Term], rows: Sequence[Row], where: str) -> None:
    for term in terms:
        if term.row not in rows:
            names = ", ".join(f"Row.{row.name}" for row in rows)
            raise UserError(f"{where} has a term in {term.row!r}; it should stand in {names}.")
        if term.scale not in SCALES or (term.scale == "joint" and term.row not in (Row.MCP, Row.PIP)):
            raise UserError(
                f"{where} has scale {term.scale!r} in {Row(term.row).name}; see Term for what goes."
            )
        if term.gain and term.gain not in effect.gains:
            raise UserError(f"{where} uses the gain '{term.gain}', which its gains do not list.")
    unused = set(effect.gains) - {term.gain for term in terms}
    if unused:
        raise UserError(f"{where} never uses its gain '{min(unused)}'; a term should carry it.")


def _probes(on_bench: bool) -> list[Motion]:
    """Motions of every kind that a diagnosis may hand to an effect, standstill among them."""
    kinds: list[tuple[str, int]] = [("on_air", -1), ("on_air", 1), ("contact", 1)]
    if on_bench:
        kinds = [("motor_bench", 0)]
    whole = [_probe(phase, sign, swing) for phase, sign in kinds for swing in (1.0, 0.0)]
    return [*whole, *(motion.head() for motion in whole)]


def _probe(phase: str, sign: int, swing: float) -> Motion:
    time = np.arange(round(PROBE_SECONDS * PROBE_RATE_HZ)) / PROBE_RATE_HZ
    rig = default_rig()
    position, velocity, acceleration = _wave(time, 0.5, 0.4 * swing, 0.75)
    mcp, pip = _wave(time, -0.2, 0.25 * swing, 1.0), _wave(time, -0.15, 0.35 * swing, 0.5)
    on_bench = phase == "motor_bench"
    return Motion(
        phase=phase,
        cable_sign=sign,
        sample_rate_hz=PROBE_RATE_HZ,
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        torque=0.05 + 0.02 * swing * np.sin(2 * np.pi * 0.25 * time),
        motor=rig.motor,
        finger=None if on_bench else rig.finger,
        joints=None if on_bench else JointMotion(mcp[0], pip[0], mcp[1], pip[1], mcp[2], pip[2]),
        force=1.0 + 0.3 * swing * np.sin(2 * np.pi * time) if phase == "contact" else None,
        load=np.zeros_like(time) if on_bench else None,
    )


def _wave(time: Array, middle: float, amplitude: float, frequency_hz: float) -> tuple[Array, Array, Array]:
    """A sine with its first and second derivative."""
    omega = 2 * np.pi * frequency_hz
    return (
        middle + amplitude * np.sin(omega * time),
        amplitude * omega * np.cos(omega * time),
        -amplitude * omega**2 * np.sin(omega * time),
    )
