"""A diagnosis' model once it has been fitted, with the band of its forces, and its file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import is_number
from fingerlab.diagnosis.equations.parameters import nuisance_ranges
from fingerlab.diagnosis.signals.reading_errors import CHANNELS, TORQUE, ReadingError, ReadingErrors
from fingerlab.diagnosis.signals.scales import SI, Scales
from fingerlab.effects import find_effect
from fingerlab.effects.base import Effect
from fingerlab.models.file import DIAGNOSIS_METHOD, ParameterEstimate, SavedModel, SessionHash
from fingerlab.prediction.error_band import CELLS, Band
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array

Equation = Literal["both", "pip", "mcp"]
EQUATIONS: tuple[Equation, ...] = ("both", "pip", "mcp")
"""What the force follows from: one joint's equation, or the two weighed by their held-out errors."""

EQUATION_WORDS: Mapping[Equation, str] = {"both": "PIP and MCP", "pip": "PIP", "mcp": "MCP"}


@dataclass(frozen=True)
class ChosenEffect:
    """An effect of the model and the point of its nonlinear unknowns; ``shape`` is empty without any."""

    effect: Effect
    shape: Mapping[str, float] = field(default_factory=dict)

    def alone(self, scales: Scales = SI) -> Effect:
        """The effect with this shape, in reduced units, as the only point of its grid."""
        return replace(self.effect, shapes=(dict(self.shape_in(scales)),))

    def shape_in(self, scales: Scales) -> Mapping[str, float]:
        """The shape in reduced units."""
        units = self.effect.shape_units
        return {name: value / scales.of(units.get(name, "1")) for name, value in self.shape.items()}


@dataclass(frozen=True)
class HeldOut:
    """Values of a fit that has not seen ``runs`` of the session with that hash."""

    session_sha256: str
    runs: tuple[str, ...]
    values: Mapping[str, float]


@dataclass(frozen=True)
class Variant:
    """A model with its values by key (``arm_mcp@flexion``, ``coulomb_friction.torque_mcp`` ...), SI.

    Attributes:
        score: error on held-out runs over all equations, in floors.
        pip_weight: share of the PIP equation in the force that follows from both; the rest is MCP's.
        band: half width of the force's 90 % interval; None with fewer than two contact runs in the fit.
        scales: of the machine that it was fitted to; its equations are evaluated in those units.
        readings: what was found to be wrong with channels as they are read, SI; the values hold without it.
    """

    effects: tuple[ChosenEffect, ...]
    values: Mapping[str, float]
    held_out: tuple[HeldOut, ...]
    score: float
    pip_weight: float = 0.5
    band: Band | None = None
    scales: Scales = SI
    readings: ReadingErrors = field(default_factory=dict)

    def pulling(self, torque: Array) -> Array:
        """What the motor pulls with where its channel reads ``torque``, N m."""
        error = self.readings.get(TORQUE)
        return torque if error is None else (1.0 + error.gain) * torque

    def reduced(self, values: Mapping[str, float], rig: Rig) -> Mapping[str, float]:
        """Values by key, from SI in the units of ``scales``."""
        if self.scales == SI:
            return values
        units = {name: one.unit for name, one in nuisance_ranges(rig).items()}
        for chosen in self.effects:
            gains = chosen.effect.gains
            units |= {f"{chosen.effect.id}.{name}": gain.unit for name, gain in gains.items()}
        own = {key: units.get(key, units.get(key.split("@")[0], "1")) for key in values}
        return {key: value / self.scales.of(own[key]) for key, value in values.items()}

    def values_without(self, session_sha256: str, run: str) -> Mapping[str, float] | None:
        """Values of the fit that has not seen the run; None where the run was not part of the fit."""
        for one in self.held_out:
            if one.session_sha256 == session_sha256 and run in one.runs:
                return one.values
        return None


@dataclass(frozen=True)
class ExtendedModel:
    """The nominal model and the same with effects, fitted to the same runs under the same weights.

    ``held``: unknowns that somebody held meanwhile, by key, and their values, SI. ``rig``: the bench's own
    constants, JSON text; empty in a file of an earlier version.
    """

    extended: Variant
    nominal: Variant
    parameters: Mapping[str, ParameterEstimate]
    sessions: tuple[SessionHash, ...]
    held: Mapping[str, float] = field(default_factory=dict)
    rig: str = ""

    @property
    def effect_ids(self) -> tuple[str, ...]:
        """Ids of the effects in the order in which they were added."""
        return tuple(c.effect.id for c in self.extended.effects)

    @property
    def words(self) -> str:
        """The model with effects in words, for a list."""
        model = " + ".join(["nominal model", *(c.effect.title or c.effect.id for c in self.extended.effects)])
        return f"{model}, {len(self.held)} held" if self.held else model

    @property
    def variants(self) -> Mapping[str, Variant]:
        """Both by name; the nominal model alone where no effect was added."""
        if not self.extended.effects:
            return {"nominal": self.nominal}
        return {"extended": self.extended, "nominal": self.nominal}


Part = TypeVar("Part")


def model_of_extended(model: ExtendedModel) -> SavedModel:
    """The model file's content; ``details`` holds all that a prediction needs."""
    details = {
        "shapes": {c.effect.id: dict(c.shape) for c in model.extended.effects},
        "extended": _variant_json(model.extended),
        "nominal": _variant_json(model.nominal),
        **({"held": dict(model.held)} if model.held else {}),
        **({"rig": json.loads(model.rig)} if model.rig else {}),
    }
    return SavedModel(DIAGNOSIS_METHOD, model.parameters, model.sessions, model.effect_ids, details)


def _variant_json(variant: Variant) -> dict[str, Any]:
    return {
        "score": variant.score,
        "values": dict(variant.values),
        "held_out": [
            {"session": h.session_sha256, "runs": list(h.runs), "values": dict(h.values)}
            for h in variant.held_out
        ],
        "pip_weight": variant.pip_weight,
        "interval": None if variant.band is None else vars(variant.band),
        "scales": vars(variant.scales),
        **({"readings": {k: e._asdict() for k, e in variant.readings.items()}} if variant.readings else {}),
    }


def extended_model(model: SavedModel, where: str) -> ExtendedModel:
    """The extended model that a model file of a diagnosis holds.

    Args:
        where: the model's file, for the error's sentence.

    Raises:
        UserError: another program's or method's file, effects that this program does not know, or a part
            that is missing or damaged.
    """
    if model.method != DIAGNOSIS_METHOD:
        raise UserError(
            f"{where} is of method '{model.method}'; a model with effects is written by "
            "'fingerlab diagnose SESSION --save M.json'."
        )
    shapes = _checked(
        where, "shapes", lambda: {str(k): _numbers(v) for k, v in model.details["shapes"].items()}
    )
    effects = tuple(_effect(name, shapes.get(name, {}), where) for name in model.effects)
    extended = _checked(where, "extended", lambda: _variant(model.details["extended"], effects))
    nominal = _checked(where, "nominal", lambda: _variant(model.details["nominal"], ()))
    held = _checked(where, "held", lambda: _numbers(model.details.get("held", {})))
    entry = model.details.get("rig")
    rig = json.dumps(entry) if isinstance(entry, Mapping) else ""
    return ExtendedModel(extended, nominal, model.parameters, model.sessions, held, rig)


def _effect(name: str, shape: Mapping[str, float], where: str) -> ChosenEffect:
    found = find_effect(name)
    if found is None:
        raise UserError(
            f"{where} holds the effect '{name}', which this program does not know; if it is one of your own, "
            "let its file in first ('fingerlab effects' tells how), else use the program that wrote the file."
        )
    tried = [s for point in found.shapes for s in (point, *found.closer(point))]
    # Its nonlinear unknowns are those of a point of the grid, or of one around it: friction has several laws.
    laws = {frozenset(found.shape_units.keys() & s.keys()) for s in tried}
    whole = found.shapes_seen is not None or found.shape_units.keys() & shape.keys() in laws
    known = {*found.follows, *found.switches_seen, *found.shape_units, *(key for s in tried for key in s)}
    if not (whole and set(shape) <= known):
        raise UserError(
            f"{where} gives '{name}' the shape {sorted(shape)}, but that effect here has "
            f"{sorted(known) or 'none'}; save the model again with 'fingerlab diagnose --save'."
        )
    return ChosenEffect(found, shape)


def _variant(data: Mapping[str, Any], effects: tuple[ChosenEffect, ...]) -> Variant:
    band = data["interval"]
    return Variant(
        effects,
        _numbers(data["values"]),
        tuple(
            HeldOut(str(h["session"]), tuple(str(r) for r in h["runs"]), _numbers(h["values"]))
            for h in data["held_out"]
        ),
        _number(data["score"]),
        _number(data["pip_weight"]),
        None if band is None else _band(band),
        _scales(data.get("scales", {})),
        {_channel(name): ReadingError(**_numbers(one)) for name, one in data.get("readings", {}).items()},
    )


def _channel(name: str) -> str:
    if name not in CHANNELS:
        raise ValueError
    return name


def _scales(data: Mapping[str, Any]) -> Scales:
    """Scales of a file; one of an earlier version has none, and is told in SI."""
    found = Scales(**_numbers(data))
    if min(vars(found).values()) <= 0:
        raise ValueError
    return found


def _band(data: Mapping[str, Any]) -> Band:
    widths = tuple(_number(w) for w in data["widths"])
    if len(widths) != CELLS or min(widths) < 0:
        raise ValueError
    return Band(
        _number(data["centre"]),
        _number(data["spread"]),
        _number(data["rate_spread"]),
        _number(data["reach"]),
        widths,
        _number(data["factor"]),
        int(data["runs"]),
    )


def _numbers(data: Mapping[str, Any]) -> dict[str, float]:
    return {str(key): _number(value) for key, value in data.items()}


def _number(value: Any) -> float:
    if not is_number(value):
        raise ValueError
    return float(value)


def _checked(where: str, part: str, make: Callable[[], Part]) -> Part:
    try:
        return make()
    except (KeyError, TypeError, ValueError, AttributeError):
        raise UserError(
            f"{where}, 'details' lacks '{part}' or holds something else there; save the model again with "
            "'fingerlab diagnose SESSION --save M.json'."
        ) from None
