"""The fitted model as one set of equations with its numbers: for the page, as LaTeX and as Markdown.

Signs and symbols are those of ``docs/theory.md``; every number in an equation is in SI. A relative shift that
the fit found for a constant of the bench (its name in ``parameters``, unit 1) is in the printed number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from fingerlab.diagnosis.equations.parameters import SLIPS
from fingerlab.models.file import ParameterEstimate
from fingerlab.prediction.extended import ChosenEffect, ExtendedModel
from fingerlab.report.diagnosis_words import in_sentence
from fingerlab.report.parameter_words import is_told, parameter_titles
from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions.model import CABLE_SIGN

ADDED_UP = "What the effects below give for one symbol is added up."


@dataclass(frozen=True)
class EquationPart:
    """Equations that belong together: LaTeX lines of which the first starts each equation."""

    title: str
    lines: tuple[str, ...]
    note: str = ""


@dataclass(frozen=True)
class Value:
    """A number of the equations: its symbol (LaTeX), what it is, and the fitted value with its interval."""

    symbol: str
    title: str
    estimate: ParameterEstimate


@dataclass(frozen=True)
class FinalEquation:
    """All of it. ``values`` are those that the fit found; the bench's own constants stand in the report.

    ``finger``: whether there is one; else it is the equation of a motor alone.
    """

    parts: tuple[EquationPart, ...]
    values: tuple[Value, ...]
    finger: bool = True


Estimates = Mapping[str, ParameterEstimate]


def final_equation(
    model: ExtendedModel, rig: Rig, found_with: Mapping[str, Estimates] | None = None
) -> FinalEquation:
    """The equations of a fitted model with numbers.

    Args:
        rig: the bench that the model was fitted to.
        found_with: parameters of effects by their id, as a diagnosis gives them. A shape has its interval
            from there, where it is the same; a fit has none for it.
    """
    found = model.parameters
    chosen = model.extended.effects
    adds = {symbol for one in chosen for symbol in _added_symbols(one)}
    finger = rig.finger if _routings(found) else None
    if finger is None:
        parts = [_bench_part(found, r"\tau_m" in adds)]
    else:
        finger = fitted_finger(finger, found)
        parts = [
            _torque_part(finger),
            _tension_part(rig.motor, found, r"\tau_m" in adds),
            _balance_part(found, r"\tau_j" in adds),
            *_contact_part(finger, found),
            _cable_part(rig.motor, found, "x" in adds),
        ]
    of_effects = [list(_effect_values(o, found, (found_with or {}).get(o.effect.id, {}))) for o in chosen]
    titles = [_title(one, finger is None) for one in chosen]
    values = [*_model_values(found), *_distinct(titles, of_effects)]
    if len(chosen) > 1:
        last = parts[-1]
        parts[-1] = replace(last, note=f"{last.note} {ADDED_UP}".strip())
    of_chosen = map(_effect_part, chosen, titles)
    return FinalEquation((*parts, *of_chosen), tuple(values), finger is not None)


def _title(one: ChosenEffect, on_bench: bool) -> str:
    """What the effect is called as it was found."""
    named = one.effect.title_of_an_axis
    return named(one.shape) if on_bench and named is not None else one.effect.title


def _distinct(owners: Sequence[str], of_effects: Sequence[Sequence[Value]]) -> Iterator[Value]:
    """The effects' values; where two effects call a value the same, each says whose it is.

    Args:
        owners: titles of the effects.
    """
    titles = [value.title for values in of_effects for value in values]
    for owner, values in zip(owners, of_effects, strict=True):
        for value in values:
            whose = f" ({in_sentence(owner)})" if titles.count(value.title) > 1 else ""
            yield replace(value, title=value.title + whose)


def _added_symbols(one: ChosenEffect) -> Iterator[str]:
    """What an effect adds to the nominal equations: a torque at the joints or the motor, a length."""
    formula = one.effect.formula
    if formula is None:
        names = {"joint_torque": r"\tau_j", "motor_torque": r"\tau_m", "cable_kinematics": "x"}
        yield from (names[row] for row in one.effect.acts_on if row in names)
        return
    text = formula.equation
    if re.search(r"\\tau_[j12]", text):
        yield r"\tau_j"
    if r"\tau_m" in text:
        yield r"\tau_m"
    if re.search(r"(^|[^\w])x &?=", text):
        yield "x"


def fitted_finger(finger: Finger, found: Mapping[str, ParameterEstimate]) -> Finger:
    """The finger with the shifts that the fit found: mass and length of each segment, each spring."""

    def shifted(name: str, by: str = "") -> float:
        shift = found.get(by or name)
        return float(getattr(finger, name) * (1.0 + (0.0 if shift is None else shift.value)))

    return replace(
        finger,
        proximal_mass=shifted("proximal_mass"),
        proximal_inertia=shifted("proximal_inertia", "proximal_mass"),
        distal_mass=shifted("distal_mass"),
        distal_inertia=shifted("distal_inertia", "distal_mass"),
        proximal_half_length=shifted("proximal_half_length"),
        distal_half_length=shifted("distal_half_length"),
        mcp_stiffness=shifted("mcp_stiffness"),
        pip_stiffness=shifted("pip_stiffness"),
    )


@dataclass(frozen=True)
class TorqueConstants:
    """Numbers of the joint torques (3.16), (3.17): kg m^2 for ``own_mcp`` to ``own_pip``, N m for weights."""

    own_mcp: float
    coupling: float
    distal: float
    own_pip: float
    weight_mcp: float
    weight_pip: float


def torque_constants(finger: Finger) -> TorqueConstants:
    """The constants in front of the accelerations and cosines of (3.16) and (3.17)."""
    m1, m2 = finger.proximal_mass, finger.distal_mass
    l1, l2 = finger.proximal_half_length, finger.distal_half_length
    return TorqueConstants(
        own_mcp=finger.proximal_inertia + m1 * l1**2 + 4.0 * m2 * l1**2 + m2 * l2**2,
        coupling=2.0 * m2 * l1 * l2,
        distal=m2 * l2**2,
        own_pip=m2 * l2**2 + finger.distal_inertia,
        weight_mcp=finger.gravity * (m1 + 2.0 * m2) * l1,
        weight_pip=finger.gravity * m2 * l2,
    )


def _torque_part(finger: Finger) -> EquationPart:
    k = torque_constants(finger)
    c, d, alpha = latex(k.coupling), latex(k.distal), latex(finger.wrist_angle)
    weight = rf"{latex(k.weight_pip)}\,\cos(\theta_1 + \theta_2 - {alpha})"
    return EquationPart(
        "Joint torques that motion, weight and springs call for",
        (
            rf"\mathrm{{LHS}}_1 = ({latex(k.own_mcp)} + {latex(2 * k.coupling)}\,\cos\theta_2)"
            rf"\,\ddot\theta_1 + ({d} + {c}\,\cos\theta_2)\,\ddot\theta_2",
            rf"\qquad - {c}\,\sin\theta_2\,\dot\theta_2\,(2\dot\theta_1 + \dot\theta_2)"
            rf" - {latex(k.weight_mcp)}\,\cos({alpha} - \theta_1)",
            rf"\qquad - {weight} + {latex(finger.mcp_stiffness)}\,\theta_1",
            rf"\mathrm{{LHS}}_2 = ({d} + {c}\,\cos\theta_2)\,\ddot\theta_1 + {latex(k.own_pip)}"
            rf"\,\ddot\theta_2 + {c}\,\sin\theta_2\,\dot\theta_1^2",
            rf"\qquad - {weight} + {latex(finger.pip_stiffness)}\,\theta_2",
        ),
        "Thesis (3.16), (3.17).",
    )


def _tension_part(motor: Motor, found: Mapping[str, ParameterEstimate], with_effect: bool) -> EquationPart:
    gain = 1.0 - _value(found, "torque_gain")
    inertia = (motor.inertia or 0.0) + _value(found, "rotor_inertia")
    assert motor.pulley_radius is not None
    rotor = rf"{signed(-inertia)}\,\ddot\theta_m" if inertia else ""
    effect = r" - \tau_m" if with_effect else ""
    constant = motor.torque_constant * motor.gear_ratio if motor.torque_constant and motor.gear_ratio else 0.0
    current = rf",\qquad M = {latex(constant)}\,i" if constant else ""
    return EquationPart(
        "Cable tension from the motor",
        (rf"T = \frac{{{latex(gain)}\,M {rotor}{effect}}}{{{latex(motor.pulley_radius)}}}{current}",),
        "M: torque at the gearbox output. i: motor current."
        + (" The number before M corrects the torque constant." if gain != 1 else ""),
    )


def _balance_part(found: Mapping[str, ParameterEstimate], with_effect: bool) -> EquationPart:
    lines = []
    for cable in _routings(found):
        for joint, index in (("mcp", 1), ("pip", 2)):
            arm = CABLE_SIGN[cable] * _value(found, f"arm_{joint}@{cable}")
            loss, trace = _value(found, f"loss_{joint}@{cable}"), _value(found, f"trace_{joint}")
            lines.append(
                rf"\mathrm{{LHS}}_{index} = {latex(arm)}\,T {signed(loss)}"
                + rf" {signed(-trace)}\,\dot\theta_{index}"
                + (rf" - {latex(1.0 + _value(found, 'force_gain'))}\,F\,\ell_{index}")
                + (rf" - H\,\lambda_{index}" if "lateral" in found else "")
                + (rf" - \tau_{index}" if with_effect else "")
                + rf"\qquad\mathrm{{({cable}\ cable)}}"
            )
    corrected = " The number before F corrects the load cell." if _value(found, "force_gain") else ""
    return EquationPart("Balance of each joint", tuple(lines), f"On air F and H are zero.{corrected}")


def _contact_part(finger: Finger, found: Mapping[str, ParameterEstimate]) -> Iterator[EquationPart]:
    if "force_gain" not in found:
        return
    alpha = latex(finger.wrist_angle)
    one, two = latex(2 * finger.proximal_half_length), latex(2 * finger.distal_half_length)
    lines = [
        rf"\ell_2 = {two}\,\cos(\theta_1 + \theta_2 - {alpha}),\qquad"
        rf" \ell_1 = {one}\,\cos({alpha} - \theta_1) + \ell_2"
    ]
    note = "F: what the load cell reads."
    if "lateral" in found:
        lines.append(
            rf"\lambda_2 = {two}\,\sin(\theta_1 + \theta_2 - {alpha}),\qquad"
            rf" \lambda_1 = \lambda_2 - {one}\,\sin({alpha} - \theta_1)"
        )
        slips = sorted(found.keys() & set(SLIPS))
        factors = [
            ("lateral", 1.0, r"\,F"),
            ("lateral_constant", 1.0, ""),
            ("lateral_spring", 1.0, r"\,u"),
            ("lateral_rub", -1.0, r"\,f_H"),
            *((key, 1.0, rf"\,f_{k}") for k, key in enumerate(slips, start=1)),
        ]
        sides = [
            f"{signed(sign * _value(found, key))}{by}" for key, sign, by in factors if _value(found, key)
        ]
        lines.append(rf"H = {' '.join(sides).removeprefix('+ ') or '0'}")
        there = {by.removeprefix(r"\,") for key, _, by in factors if _value(found, key)}
        note += " H: force along its face."
        note += " u: travel of the tip from where it stands on average." if "u" in there else ""
        note += " f_H: friction of the tip by its travel, F at most." if "f_H" in there else ""
        if any(by.startswith("f_") and by != "f_H" for by in there):
            note += " f_1 and on: friction by the swing of F."
    yield EquationPart("Levers of the contact force", tuple(lines), note)


def _cable_part(motor: Motor, found: Mapping[str, ParameterEstimate], with_effect: bool) -> EquationPart:
    lines = []
    for cable in _routings(found):
        arms = [CABLE_SIGN[cable] * _value(found, f"arm_{joint}@{cable}") for joint in ("mcp", "pip")]
        stretch = [
            rf"{signed(_value(found, key))}\,{symbol}"
            for key, symbol in (("cable_compliance", "T"), ("cable_damping", r"\dot T"))
            if _value(found, key)
        ]
        lines.append(
            rf"{latex(motor.pulley_radius or math.nan)}\,\theta_m = "
            rf"{latex(_value(found, f'offset@{cable}'))} {signed(arms[0])}\,\theta_1"
            rf" {signed(arms[1])}\,\theta_2 {' '.join(stretch)}"
            + (" + x" if with_effect else "")
            + rf"\qquad\mathrm{{({cable}\ cable)}}"
        )
    return EquationPart("Cable wound on the pulley", tuple(lines))


def _bench_part(found: Mapping[str, ParameterEstimate], with_effect: bool) -> EquationPart:
    terms = [
        rf"{signed(_value(found, key))}{factor}"
        for key, factor in (
            ("bench_inertia", r"\,\ddot\theta_m"),
            ("bench_gain", r"\,\tau_l"),
            ("bench_offset", ""),
            ("bench_trace", r"\,\dot\theta_m"),
        )
        if key in found and is_told(key, found[key])
    ]
    line = rf"M = {' '.join(terms).removeprefix('+ ')}" + (r" + \tau_m" if with_effect else "")
    note = "M: torque at the output." + (" τ_l: known load." if r"\tau_l" in line else "")
    return EquationPart("Torque of the motor", (line,), note)


def _effect_part(one: ChosenEffect, title: str) -> EquationPart:
    formula = one.effect.formula
    if formula is None:
        return EquationPart(title, (), "An effect of your own; its terms stand in its own file.")
    text = formula.equation.replace(r"\begin{align*}", "").replace(r"\end{align*}", "")
    lines = tuple(line.replace("&", "").strip() for line in text.split(r"\\"))
    return EquationPart(title, lines, re.sub(r"\[([^]]+)\]\([^)]+\)", r"\1", formula.symbols))


_MODEL_SYMBOLS = {
    "arm_mcp": ("a", "Moment arm at the MCP"),
    "arm_pip": ("b", "Moment arm at the PIP"),
    "loss_mcp": ("L_1", "Friction loss at the MCP"),
    "loss_pip": ("L_2", "Friction loss at the PIP"),
    "offset": ("x_0", "Offset of the cable"),
    "trace_mcp": (r"\epsilon_1", "Trace of viscous friction at the MCP"),
    "trace_pip": (r"\epsilon_2", "Trace of viscous friction at the PIP"),
    "cable_compliance": ("c", "Compliance of the cable"),
    "bench_inertia": ("J", "Inertia at the gearbox output"),
    "bench_gain": (r"\mathrm{gain}", "Gain on the load"),
    "bench_offset": (r"\mathrm{offset}", "Offset of the torque"),
}


def _model_values(found: Mapping[str, ParameterEstimate]) -> Iterator[Value]:
    for base, (symbol, title) in _MODEL_SYMBOLS.items():
        for key, estimate in found.items():
            name, _, cable = key.partition("@")
            if name == base and is_told(key, estimate):
                yield Value(symbol, title + (f", {cable} cable" if cable else ""), estimate)


def _effect_values(one: ChosenEffect, found: Estimates, seen: Estimates) -> Iterator[Value]:
    """Gains of an effect with their interval, then its shape, which was chosen from a grid: see ``seen``."""
    effect = one.effect
    symbols = {parameter.name: parameter.symbol for parameter in effect.parameters}
    titles = parameter_titles(effect.id, [*effect.unknowns, *one.shape])
    for name in effect.unknowns:
        estimate = found.get(f"{effect.id}.{name}") or found.get(name)
        if estimate is not None and name not in _MODEL_SYMBOLS:
            yield Value(symbols.get(name, ""), _upper(titles[name]), estimate)
    for name, value in one.shape.items():
        if name in effect.shape_units:
            estimate = ParameterEstimate(value, effect.shape_units[name], value, value)
            if name in seen and math.isclose(seen[name].value, value, rel_tol=1e-3):
                estimate = replace(estimate, low=seen[name].low, high=seen[name].high)
            yield Value(symbols.get(name, ""), _upper(titles[name]), estimate)


def _upper(title: str) -> str:
    return title[:1].upper() + title[1:]


def _routings(found: Mapping[str, ParameterEstimate]) -> list[str]:
    return [cable for cable in CABLE_SIGN if f"arm_mcp@{cable}" in found]


def _value(found: Mapping[str, ParameterEstimate], key: str) -> float:
    return found[key].value if key in found else 0.0


def latex(value: float, digits: int = 4) -> str:
    r"""LaTeX of a number: ``0.01163``, ``5.21\times 10^{-5}``; at most ``digits`` digits that count."""
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:.{digits}g}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    short = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return rf"{short}\times 10^{{{int(exponent)}}}"


def signed(value: float) -> str:
    """A number as a further term of a sum: with a sign and a space in front."""
    return f"{'-' if value < 0 else '+'} {latex(abs(value))}"
