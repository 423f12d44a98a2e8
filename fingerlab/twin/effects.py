"""Effects as physical changes of the simulated bench: how they are named, chosen and put in."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fingerlab.core.errors import UserError
from fingerlab.physics.parameter import Parameter
from fingerlab.twin.bench import Bench

ON_AIR, CONTACT, MOTOR_BENCH = "on_air", "contact", "motor_bench"

Values = Mapping[str, float]


def constant(
    name: str, unit: str, default: float, low: float, high: float, source: str = "assumed"
) -> Parameter:
    """One number of an effect in the plant; its default is what is put in where nothing else is said."""
    return Parameter(unit, low, high, default, source, name=name, default=default)


@dataclass(frozen=True)
class PlantEffect:
    """An effect of the catalogue as a change of the plant.

    Attributes:
        id: fixed name of ``effects.md``.
        change: one sentence on what is different in the plant.
        parameters: the first is the strength; the others shape it.
        phases: phases of a session in which the effect acts.
        apply: changes the bench of one run in place, before the finger is hung and the load cell placed.
    """

    id: str
    change: str
    parameters: tuple[Parameter, ...]
    phases: frozenset[str]
    apply: Callable[[Bench, Values], None]

    def defaults(self) -> dict[str, float]:
        """Default value of every parameter, SI."""
        return {p.name: p.default for p in self.parameters}


Effects = Mapping[str, Values]
"""Effects in a plant: id -> parameter -> value, SI."""


def parse_effects(requests: Sequence[str]) -> dict[str, dict[str, float]]:
    """Read ``ID``, ``ID=STRENGTH`` (SI unit of the first parameter) or ``ID=xFACTOR`` (times the default).

    Raises:
        UserError: the id is unknown, is given twice, or the strength is no number.
    """
    from fingerlab.twin.effect_table import EFFECTS

    result: dict[str, dict[str, float]] = {}
    for request in requests:
        name, separator, strength = request.partition("=")
        effect = EFFECTS.get(name)
        if effect is None:
            raise UserError(f"There is no effect {name!r}; the catalogue has {', '.join(EFFECTS)}.")
        if name in result:
            raise UserError(f"The effect {name!r} is given twice; name it once, with one strength.")
        values = effect.defaults()
        first = effect.parameters[0]
        if separator:
            values[first.name] = _strength(strength, first, name)
        result[name] = values
    return result


def check_effects(effects: Mapping[str, Mapping[str, float]], where: str) -> dict[str, dict[str, float]]:
    """Effects of a preset with the defaults filled in.

    Raises:
        UserError: an unknown effect or parameter, or a value that is no number.
    """
    from fingerlab.twin.effect_table import EFFECTS

    result: dict[str, dict[str, float]] = {}
    for name, values in effects.items():
        if name not in EFFECTS or not isinstance(values, Mapping):
            raise UserError(
                f"{where} has the unknown effect {name!r}; the catalogue has {', '.join(EFFECTS)}."
            )
        full = EFFECTS[name].defaults()
        for key, value in values.items():
            if key not in full or isinstance(value, bool) or not isinstance(value, int | float):
                raise UserError(
                    f"{where}, effect {name!r}, has {key} = {value!r}; known are {', '.join(full)}."
                )
            full[key] = float(value)
        result[name] = full
    return result


def apply_effects(bench: Bench, effects: Effects) -> None:
    """Put effects into the bench of one run, in the order of the catalogue."""
    from fingerlab.twin.effect_table import EFFECTS

    for name, effect in EFFECTS.items():
        if name in effects:
            effect.apply(bench, effects[name])


def _strength(text: str, parameter: Parameter, name: str) -> float:
    factor = text.startswith("x")
    try:
        number = float(text[1:] if factor else text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UserError(
            f"The strength of {name!r} is {text!r}; it should be in {parameter.unit or 'plain units'}, or "
            f" like x0.5 for half of the default {parameter.default:g}."
        )
    return number * parameter.default if factor else number
