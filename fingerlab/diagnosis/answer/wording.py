"""Parameters with intervals, and the sentences that explain an effect."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from fingerlab.core.text import in_sentence
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_assumed_bounds, own_keys
from fingerlab.diagnosis.settings import MOST_NAMED, Z90
from fingerlab.effects import find_effect
from fingerlab.effects.base import Effect, Row
from fingerlab.models.file import ParameterEstimate

SCREEN_UNITS = {
    "N m": (1e3, "mN m"),
    "m/N": (1e6, "um/N"),
    "s": (1e3, "ms"),
    "kg": (1e3, "g"),
    "N m s/rad": (1e3, "mN m s/rad"),
    "m s/N": (1e6, "um s/N"),
    "rad": (180.0 / np.pi, "deg"),
    "rad/s": (180.0 / np.pi, "deg/s"),
    "kg m^2": (1e7, "g cm^2"),
    "m": (1e3, "mm"),
}
"""SI unit -> factor and unit in which a person reads it."""


def deviations(fitted: FittedModel, heat: float) -> dict[str, float]:
    """Standard deviation of every unknown, given what else is unknown; in the model's units."""
    spread = fitted.fit.deviations_at(heat)
    return dict(zip((u.key for u in fitted.model.unknowns), (float(s) for s in spread), strict=True))


def parameters(fitted: FittedModel, effect: Effect, heat: float) -> dict[str, ParameterEstimate]:
    """The effect's parameters with 90 % intervals; a grid parameter's interval is to its neighbours."""
    values = fitted.values
    gains = {u.key: u.parameter for u in fitted.model.unknowns}
    spread = deviations(fitted, heat)
    result = {}
    for name, key in own_keys(fitted, effect).items():
        gain, value = gains[key], float(values[key])
        low = max(gain.low, value - Z90 * spread[key])
        high = min(gain.high, value + Z90 * spread[key])
        result[name] = _told(fitted, gain.unit, value, low, high)
    choice = next(c for c in fitted.choices if c.effect is effect)
    for name, unit in effect.shape_units.items():
        grid = sorted({float(s[name]) for s in effect.shapes})
        value = float(effect.shapes[choice.shape][name])
        at = grid.index(value)
        result[name] = _told(fitted, unit, value, grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)])
    return result


def _told(fitted: FittedModel, unit: str, value: float, low: float, high: float) -> ParameterEstimate:
    """A number of a model, which is in reduced units, in SI."""
    size = fitted.model.layout.scales.of(unit)
    return ParameterEstimate(value * size, unit, low * size, high * size)


def every_parameter(fitted: FittedModel, heat: float) -> dict[str, ParameterEstimate]:
    """All unknowns of the model by key, SI, with 90 % intervals that no bound cuts."""
    spread = deviations(fitted, heat)
    return {
        u.key: _told(
            fitted, u.parameter.unit, float(v), float(v) - Z90 * spread[u.key], float(v) + Z90 * spread[u.key]
        )
        for u, v in zip(fitted.model.unknowns, fitted.fit.values, strict=True)
    }


def would_have_shown(fitted: FittedModel, effect: Effect, least: float) -> str:
    """The strength from which on an effect would have shown, in words; empty where none would.

    Args:
        least: multiple of its typical strength (see ``evidence.least_strength``).
    """
    names = {key: name for name, key in own_keys(fitted, effect).items()}
    gains, told = {u.key: u.parameter for u in fitted.model.unknowns}, fitted.model.layout.scales.of
    title = partial(parameter_title, effect)
    said = [
        f"{title(names[key])} {_amount(least * strength * told(gains[key].unit), gains[key].unit)}"
        for key, strength in fitted.sensitivity.strengths.items()
        if least * strength <= MOST_NAMED * max(abs(gains[key].high), abs(gains[key].low))
    ]
    return " and ".join(said) if len(said) == len(fitted.sensitivity.strengths) else ""


def _amount(value: float, unit: str) -> str:
    factor, shown = SCREEN_UNITS.get(unit, (1.0, unit))
    rounded = float(f"{value * factor:.2g}")
    return f"{rounded:g}" + ("" if shown == "1" else f" {shown}")  # 1300, where .2g would write 1.3e+03


def quantity(estimate: ParameterEstimate) -> str:
    """Value with half its 90 % interval, with as many digits as that allows, in a unit for the screen."""
    factor, unit = SCREEN_UNITS.get(estimate.unit, (1.0, estimate.unit))
    half = 0.5 * (estimate.high - estimate.low) * factor
    value = estimate.value * factor
    shown = "" if unit == "1" else f" {unit}"
    if half <= 0 or not np.isfinite(half):
        return f"{value:.3g}{shown}"
    digits = min(int(1 - np.floor(np.log10(half))), 6)
    places = max(digits, 0)
    return f"{round(value, digits):.{places}f} ± {round(half, digits):.{places}f}{shown}"


def explanation(
    evidence: Evidence,
    fitted: FittedModel,
    effect: Effect,
    shown: bool,
    least: float,
    replaced: Sequence[str] = (),
    alone: bool = False,
) -> str:
    """One or two plain sentences with the evidence in numbers.

    Args:
        shown: whether it would have shown at a typical strength. least: the multiple of that from which on.
        replaced: ids of the effects of the base in whose place it is in ``fitted``.
        alone: there is one run, so that none was held out.
    """
    error = "the error" if alone else "the held-out error"
    fall = f"{evidence.base.score:.2f} to {fitted.score:.2f} floors"
    said = _said(fitted, effect)
    if not shown:
        strength = would_have_shown(fitted, effect, least)
        from_there = f" (it would have shown from {strength} on)" if strength else ""
        return (
            f"{said} These data could not show it at a plausible strength{from_there}; {effect.reveal} would."
        )
    if fitted.misfit > evidence.base.misfit * 0.98 and not replaced:
        return f"{said} Nothing of that is seen: {error} goes from {fall}."
    numbers = [
        f"{parameter_title(effect, name)} {quantity(p) if name not in effect.shape_units else _grid_value(p)}"
        for name, p in parameters(fitted, effect, evidence.temperature).items()
    ]
    found = f" ({'; '.join(numbers)})" if numbers else ""
    there = f" in place of {_in_sentence(evidence.base, replaced)}" if replaced else ""
    bounds = _at_bounds(fitted, effect)
    return f"{said[:-1]}{found}. With it{there} {error} goes from {fall}.{bounds}"


def _at_bounds(fitted: FittedModel, effect: Effect) -> str:
    """What is to be said where a strength is beyond, or at the end of, what was thought plausible."""
    usual, keys, stuck = find_effect(effect.id) or effect, own_keys(fitted, effect), at_assumed_bounds(fitted)
    said = []
    for name in dict.fromkeys((*effect.widened, *stuck)):
        before, value = usual.unknowns[name], abs(float(fitted.values[keys[name]]))
        bound = max(abs(before.low), abs(before.high))
        if value < bound and name not in stuck:
            continue
        shown = _amount(bound * fitted.model.layout.scales.of(before.unit), before.unit)
        where = "is beyond" if value > bound else "stands at"
        said.append(f"{parameter_title(effect, name)} {where} the assumed bound of {shown}")
    return f" Its {' and its '.join(said)}, so that it may be another effect." if said else ""


def _in_sentence(fitted: FittedModel, names: Sequence[str]) -> str:
    """Titles of some of the model's effects as they stand inside a sentence."""
    titles = {c.effect.id: c.effect.title for c in fitted.choices}
    return " and ".join(in_sentence(titles.get(name, name)) for name in names)


def _said(fitted: FittedModel, effect: Effect) -> str:
    """The effect's sentence; a motor bench has no joints to speak of."""
    on_bench = all(f.row == Row.BENCH for f in fitted.model.layout.features)
    return effect.explanation.replace(BOTH_JOINTS, ON_BENCH) if on_bench else effect.explanation


BOTH_JOINTS, ON_BENCH = "Both joints miss the same tension", "The motor's equation misses a torque"


def _grid_value(estimate: ParameterEstimate) -> str:
    """A value that was only tried on a grid has no interval worth a sign."""
    factor, unit = SCREEN_UNITS.get(estimate.unit, (1.0, estimate.unit))
    if estimate.unit == "s" and estimate.value >= 1.0:
        factor, unit = 1.0, "s"
    return f"about {estimate.value * factor:.3g} {unit}"


def parameter_title(effect: Effect, name: str) -> str:
    """What a number of an effect is called in a sentence."""
    gain = effect.unknowns.get(name)
    title = gain.title if gain is not None and gain.title else name.removesuffix("_deg").replace("_", " ")
    joint = {"mcp": "MCP ", "pip": "PIP "}.get(name.rsplit("_", 1)[-1], "")
    return f"{joint}{title}"
