"""Parameters of a fitted model in words: title, value, where it comes from, and what is held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fingerlab.core.text import (
    ParameterEstimate,
    ScreenUnit,
    decimals_for,
    estimate_text,
    fixed,
    largest_of,
    with_minus,
)
from fingerlab.diagnosis.equations.parameters import CHANGED_OFFSET, SLIPS
from fingerlab.diagnosis.settings import MOST_CHANGES
from fingerlab.effects import find_effect
from fingerlab.report.line_units import LineUnits

if TYPE_CHECKING:
    from fingerlab.diagnosis.answer.parameter_explorer import FittedParameter

FAR = 1000.0
"""Times value and interval, from which on a bound is none that a fit could meet."""
TURNS = LineUnits()
"""Units of an axis that turns, and of a finger."""
GRIPS = ("soft", "middling", "stiff")
"""Of the tip that slides, by how stiffly it is held sideways: ``SLIP_STIFFNESSES``."""
TITLES = {
    "arm_mcp": ("Moment arm at the MCP", "m"),
    "arm_pip": ("Moment arm at the PIP", "m"),
    "loss_mcp": ("Friction loss at the MCP", "N m"),
    "loss_pip": ("Friction loss at the PIP", "N m"),
    "bench_inertia": ("Inertia J", "kg m^2"),
    "bench_gain": ("Gain on the load", "1"),
    "bench_offset": ("Offset of the torque", "N m"),
    "bench_trace": ("Trace of viscous friction", "N m s/rad"),
    "bench_lag": ("Torque logged late by", "s"),
    "bench_lag_square": ("Second order of the torque's lag", "s^2"),
    "proximal_mass": ("Proximal mass, off by", "%"),
    "distal_mass": ("Distal mass, off by", "%"),
    "proximal_half_length": ("Proximal length, off by", "%"),
    "distal_half_length": ("Distal length, off by", "%"),
    "mcp_stiffness": ("MCP stiffness, off by", "%"),
    "pip_stiffness": ("PIP stiffness, off by", "%"),
    "rotor_inertia": ("Motor inertia, off by", "kg m^2"),
    "torque_gain": ("Motor torque, reads too high by", "%"),
    "force_gain": ("Load cell's gain, off by", "%"),
    "knock_gain": ("Knock of the tip that lands, harder by", "%"),
    "load_gain": ("Known load, off by", "%"),
    "trace_mcp": ("Trace of viscous friction at the MCP", "N m s/rad"),
    "trace_pip": ("Trace of viscous friction at the PIP", "N m s/rad"),
    "offset": ("Offset of the cable", "m"),
    "cable_compliance": ("Compliance of the cable", "m/N"),
    # A damper beside the cable's spring lets the stretch lag: x = c T - c t dT/dt.
    "cable_damping": ("Stretch by the tension's rate (below 0: it lags)", "m s/N"),
    "torque_zero": ("Zero of the motor's torque", "N m"),
    "delay": ("Delay of the motor's channels", "s"),
    "lateral": ("Sideways force over normal force", "tan"),
    "lateral_constant": ("Sideways force at first touch", "N"),
    "lateral_spring": ("Sideways stiffness of the tip", "N/m"),
    "lateral_rub": ("Friction coefficient of the tip", "1"),
    "tip_tilt": ("Tilt of the pressed face", "1"),
    "tip_compliance": ("Compliance of tip and load cell", "m/N"),
    **{
        name: (f"Friction of the tip that slides, {grip} contact", "1")
        for name, grip in zip(SLIPS, GRIPS, strict=True)
    },
    **{
        f"{CHANGED_OFFSET}{k}": (f"Offset of the cable, more with change {k}", "m")
        for k in range(1, MOST_CHANGES + 1)
    },
}
"""Title and unit of what every model leaves open; "%": the model has the share, 0.01 of it."""
SHORT_TITLES = {
    "arm_mcp": "Moment arm MCP",
    "arm_pip": "Moment arm PIP",
    "loss_mcp": "Loss MCP",
    "loss_pip": "Loss PIP",
    "offset": "Cable offset",
    "bench_gain": "Load per known load",
    "bench_offset": "Torque without load",
}
"""The same of what is followed over sessions, whose tables have room for less."""


_JOINT_ENDINGS = {"mcp": "MCP", "pip": "PIP"}


def parameter_titles(effect: str, names: Sequence[str]) -> dict[str, str]:
    """Each of the effect's parameters in words, such as ``MCP friction torque``; no title twice."""
    titles = {name: _parameter_title(effect, name) for name in names}
    twice = {t for t in titles.values() if list(titles.values()).count(t) > 1}
    return {name: f"{title} ({_plain(name)})" if title in twice else title for name, title in titles.items()}


def _parameter_title(effect: str, name: str) -> str:
    one = find_effect(effect)
    gain = None if one is None else one.unknowns.get(name)
    title = gain.title if gain is not None and gain.title else _plain(name)
    joint = _JOINT_ENDINGS.get(name.rsplit("_", 1)[-1], "")
    return f"{joint} {title}" if joint and not title.upper().startswith(joint) else title


def _plain(name: str) -> str:
    """A parameter's name without joint and unit."""
    parts = name.split("_")
    while len(parts) > 1 and parts[-1] in (*_JOINT_ENDINGS, "deg", "s", "hz"):
        parts.pop()
    return " ".join(_JOINT_ENDINGS.get(part, part) for part in parts)


def parameter_title(key: str, keys: Sequence[str]) -> str:
    """``MCP friction torque``, ``Moment arm at the MCP, flexion cable``.

    Args:
        keys: of the whole model, so that no title of an effect comes twice.
    """
    effect, _, gain = key.rpartition(".")
    if not effect:
        name, _, cable = key.partition("@")
        title = TITLES[name][0] if name in TITLES else name.replace("_", " ")
        return title + (f", {cable} cable" if cable else "")
    gains = [one.rpartition(".")[2] for one in (*keys, key) if one.startswith(f"{effect}.")]
    text = parameter_titles(effect, list(dict.fromkeys(gains)))[gain]
    return text[:1].upper() + text[1:]


def is_told(key: str, estimate: ParameterEstimate) -> bool:
    """Whether the recordings say anything of a parameter.

    The gain of a load that is not there stands at exactly 0, with the interval of what it may be at all.
    """
    return key != "bench_gain" or estimate.value != 0.0


def shown_unit(key: str, unit: str, largest: float, line: LineUnits = TURNS) -> ScreenUnit:
    """The unit in which a parameter up to ``largest``, SI, is shown; a share off a constant in per cent."""
    if TITLES.get(key.partition("@")[0], ("", ""))[1] == "%":
        return ScreenUnit("%", 100.0)
    return line.screen("1" if unit == "tan" else unit, largest)


def value_words(key: str, estimate: ParameterEstimate) -> str:
    """Value with its 90 % interval."""
    if TITLES.get(key.partition("@")[0], ("", ""))[1] != "%":
        return estimate_text(estimate)
    value, low, high = (100.0 * v for v in (estimate.value, estimate.low, estimate.high))
    return estimate_text(replace(estimate, unit="%", value=value, low=low, high=high))


def _unit(key: str) -> str:
    effect, _, gain = key.rpartition(".")
    one = find_effect(effect) if effect else None
    if one is not None and gain in one.unknowns:
        return one.unknowns[gain].unit
    return TITLES.get(key.partition("@")[0], ("", "1"))[1].replace("%", "1")


def held_words(held: Mapping[str, float], radius: float = 0.0) -> str:
    """``MCP friction torque held at 4 mN m``; empty: nothing is held.

    Args:
        held: by key, SI. radius: of the arc as which a linear axis is told, m; 0: it turns.
    """
    said, line = [], LineUnits(radius)
    for key, value in held.items():
        title = line.title(parameter_title(key, list(held)))
        title = title if title.startswith(("MCP", "PIP")) else title[:1].lower() + title[1:]
        found = line.estimate(ParameterEstimate(value, _unit(key), value, value))
        said.append(f"{title} held at {value_words(key, found)}")
    return "; ".join(said)


def known_by(one: FittedParameter) -> str:
    """Where a value comes from: ``fitted here``, ``rig file; these runs hardly tell``, ``held by hand``."""
    if one.held:
        return "held by hand"
    end = "; at its bound" if at_bound(one) else ""
    if one.identified:
        return ("fitted here" if not one.spread else f"fitted here, before: {one.source}") + end
    return f"{one.source}; these runs hardly tell{end}"


def at_bound(one: FittedParameter) -> bool:
    """Whether the value stands where no fit goes beyond."""
    near = 1e-6 * room_of(one)
    return not one.held and not one.low + near < one.estimate.value < one.high - near


def room_of(one: FittedParameter) -> float:
    """How far apart its bounds are, SI; of bounds that no fit could meet, ten times value and interval."""
    between = one.high - one.low
    largest = largest_of((one.estimate.value, one.estimate.low, one.estimate.high))
    return between if between <= 2.0 * FAR * largest or one.held or not largest else 10.0 * largest


def cells(
    one: FittedParameter, keys: Sequence[str], line: LineUnits = TURNS
) -> tuple[str, str, str, str, str, str]:
    """Title, value, 90 % interval, bounds, unit, what it is known by: a row of the table."""
    found = one.estimate
    unit = shown_unit(one.key, found.unit, largest_of((found.value, found.low, found.high)), line)
    value, low, high, least, most = (
        unit.factor * v for v in (found.value, found.low, found.high, one.low, one.high)
    )
    places = places_of(one, unit)
    # The interval is that of a parabola about the value; what lies beyond a bound no fit allows.
    interval = "–" if one.held else f"{fixed(max(low, least), places)} to {fixed(min(high, most), places)}"
    bounds = _bounds(least, most, FAR * largest_of((value, low, high)))
    title = line.title(parameter_title(one.key, keys))
    return title, fixed(value, places), interval, bounds, unit.symbol or "1", known_by(one)


def places_of(one: FittedParameter, unit: ScreenUnit) -> int:
    """Decimals that a parameter's interval, or where it is held its range, calls for."""
    half = 0.5 * unit.factor * (one.estimate.high - one.estimate.low)
    return decimals_for(half if half > 0 and not one.held else 1e-3 * unit.factor * (one.high - one.low))


def _bounds(least: float, most: float, far: float) -> str:
    """``0 to 115``, ``from 0``, ``none``: a bound beyond ``far`` is left out; all in the unit shown."""
    if far <= 0 or max(abs(least), abs(most)) <= far:
        return f"{_bound(least)} to {_bound(most)}"
    if abs(least) <= far:
        return f"from {_bound(least)}"
    return f"up to {_bound(most)}" if abs(most) <= far else "none"


def _bound(value: float) -> str:
    rounded = f"{value:.3g}"
    return with_minus(f"{float(rounded):,.0f}".replace(",", "\u202f") if "e+" in rounded else rounded)
