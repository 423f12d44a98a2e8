"""A diagnosis' model once it has been fitted, its file, and its forecasts in numbers with their intervals.

The width of the interval is read from errors of held-out runs, so that it knows what a covariance of
parameters does not: what repeats in the error and belongs to the model, and what differs from run to run.
Each held-out run is a draw of its own (as in the jackknife+ of Barber, Candes, Ramdas and Tibshirani 2021, by
runs); samples within a run are not. The width depends on where in the loading cycle the modelled force
stands: an error at the peak says little about one at rest. A factor makes the bands of the other runs hold
for the run left out.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar

import numpy as np
from scipy.interpolate import CubicSpline

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.equations.parameters import nuisance_ranges
from fingerlab.diagnosis.signals.scales import SI, Scales
from fingerlab.effects import find_effect
from fingerlab.effects.base import Effect
from fingerlab.models.file import DIAGNOSIS_METHOD, ParameterEstimate, SavedModel, SessionHash
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import MINIMUM_PERIODS, PeriodGrid, cross_correlation_delay
from fingerlab.thesis.prediction import ForcePrediction, judge_forces

FINE = 20
"""Samples put between two of the decimated ones, so that a peak or a delay falls on one: 2 ms."""


@dataclass(frozen=True)
class ForceNumbers:
    """One run. Forces in N; NaN where the run cannot tell. ``prediction`` as of the thesis' analysis.

    ``delay_s``: positive where the measured force comes later than the modelled one, s.
    """

    prediction: ForcePrediction
    delay_s: float

    def value(self, name: str) -> float:
        """One number by its name in the JSON of ``predict``."""
        return self.delay_s if name == "delay" else float(getattr(self.prediction, name))

    @property
    def error_by_phase(self) -> Mapping[str, float]:
        """Mean of modelled less measured force by phase of the force cycle, N."""
        return self.prediction.error_by_phase


def judge_stretches(
    measured: Sequence[Array], modelled: Sequence[Array], sample_rate_hz: float, frequency_hz: float
) -> ForceNumbers:
    """Judge the longest stretch of a run (a run of at most a minute has one).

    Args:
        measured, modelled: N, (n,) each, by stretch. frequency_hz: of the cycle; 0 where there is none.
    """
    longest = int(np.argmax([len(m) for m in modelled]))
    y, f = measured[longest], modelled[longest]
    rate = sample_rate_hz
    if np.isfinite(f).all() and len(f) > 3:
        y, f, rate = _fine(y), _fine(f), sample_rate_hz * FINE
    grid = _grid(len(f), rate, frequency_hz)
    return ForceNumbers(judge_forces(y, f, rate, grid, (0, len(f))), _delay(y, f, rate, grid))


def fine_grid(
    measured: Array, modelled: Array, frequency_hz: float, rate: float
) -> tuple[tuple[Array, Array], PeriodGrid | None]:
    """Both forces of one stretch between their samples, as they are judged, and their whole periods.

    Args:
        frequency_hz: of the cycle; 0 where there is none. rate: samples a second.
    """
    if not (np.isfinite(modelled).all() and len(modelled) > 3):
        return (measured, modelled), None
    pair = _fine(measured), _fine(modelled)
    return pair, _grid(len(pair[1]), rate * FINE, frequency_hz)


def _fine(values: Array) -> Array:
    """The band-limited signal between its samples; NaN stays NaN."""
    at = np.arange((len(values) - 1) * FINE + 1) / FINE
    if not np.isfinite(values).all():
        return np.full(len(at), np.nan)
    return np.asarray(CubicSpline(np.arange(len(values)), values)(at))


def _grid(length: int, rate: float, frequency_hz: float) -> PeriodGrid | None:
    if not 0 < frequency_hz < rate / 4:
        return None
    period = rate / frequency_hz
    count = int((length - 1) // period)
    whole = float(round(period)) if abs(period - round(period)) < 1e-6 else period
    return PeriodGrid(0.0, whole, count) if count >= MINIMUM_PERIODS else None


def _delay(measured: Array, modelled: Array, rate: float, grid: PeriodGrid | None) -> float:
    if grid is None:
        return float("nan")
    y, f = grid.mean(measured), grid.mean(modelled)
    if not (np.isfinite(y).all() and np.isfinite(f).all()):
        return float("nan")
    return cross_correlation_delay(y, f) * grid.period / grid.phases / rate


LEVEL = 0.90
CELLS = 12
"""Parts of the loading cycle, each 30 degrees of the angle between force and its rate."""
LEAST_IN_CELL = 20
"""Samples (0.8 s) below which a part takes the width of the whole cycle; assumed."""
LEAST_RUNS = 2
MOST_STRETCH = 10.0
"""Beyond the forces of the calibration the width grows with the force, at most by this."""


@dataclass(frozen=True)
class RunError:
    """Modelled force of a run and modelled less measured force, by a fit that has not seen the run.

    Attributes:
        force, rate: N and N/s, (n,). error: N, (n,); all finite.
    """

    force: Array
    rate: Array
    error: Array


@dataclass(frozen=True)
class Band:
    """Half width of the interval over the loading cycle.

    Attributes:
        centre, spread, rate_spread: N, N and N/s: what makes force and rate comparable.
        reach: largest distance from ``centre`` that the calibration saw, N.
        widths: half width at the middle of each part of the cycle, N, (``CELLS``,).
        factor: what the widths of all runs but one had to be multiplied with to hold for that one; in
            ``widths`` already.
        runs: how many held-out runs stand behind it.
    """

    centre: float
    spread: float
    rate_spread: float
    reach: float
    widths: tuple[float, ...]
    factor: float
    runs: int

    def times_as_far(self, force: Array) -> float:
        """How many times as far from ``centre`` the force goes as any that the calibration saw."""
        return float(np.max(np.abs(force - self.centre), initial=0.0)) / max(self.reach, 1e-9)

    def half_width(self, force: Array, rate: Array) -> Array:
        """Half width at each sample, N, (n,); wider where the force leaves what the calibration saw."""
        angle = _angle(force, rate, self.centre, self.spread, self.rate_spread)
        middles = (np.arange(CELLS) + 0.5) * 2 * np.pi / CELLS
        width = np.interp(np.mod(angle, 2 * np.pi), middles, self.widths, period=2 * np.pi)
        beyond = np.abs(force - self.centre) / max(self.reach, 1e-9)
        return np.asarray(width * np.clip(beyond, 1.0, MOST_STRETCH))


def error_of(force: Array, measured: Array, sample_rate_hz: float) -> RunError | None:
    """The held-out error of a stretch, samples without a number left out; None where none is left."""
    rate = force_rate(force, sample_rate_hz)
    good = np.isfinite(force) & np.isfinite(measured) & np.isfinite(rate)
    if not good.any():
        return None
    return RunError(force[good], rate[good], (force - measured)[good])


def force_rate(force: Array, sample_rate_hz: float) -> Array:
    """Rate of the modelled force, N/s, (n,)."""
    return np.asarray(np.gradient(force, 1.0 / sample_rate_hz)) if len(force) > 1 else np.zeros_like(force)


def calibrate(errors: Sequence[RunError]) -> Band | None:
    """The band of held-out runs; None with fewer than two of them."""
    if len(errors) < LEAST_RUNS:
        return None
    ratios = []
    for k, left_out in enumerate(errors):
        others = _plain([e for i, e in enumerate(errors) if i != k], 1.0)
        width = np.maximum(others.half_width(left_out.force, left_out.rate), 1e-12)
        ratios.append(np.abs(left_out.error) / width)
    factor = _run_quantile(ratios)
    return _plain(errors, factor)


def _plain(errors: Sequence[RunError], factor: float) -> Band:
    force = np.concatenate([e.force for e in errors])
    rate = np.concatenate([e.rate for e in errors])
    centre, spread = float(force.mean()), float(max(force.std(), 1e-9))
    rate_spread = float(max(rate.std(), 1e-9))
    cells = [_cell(_angle(e.force, e.rate, centre, spread, rate_spread)) for e in errors]
    whole = _run_quantile([np.abs(e.error) for e in errors])
    widths = []
    for cell in range(CELLS):
        parts = [np.abs(e.error[c == cell]) for e, c in zip(errors, cells, strict=True)]
        enough = sum(len(p) for p in parts) >= LEAST_IN_CELL
        widths.append(factor * (_run_quantile(parts) if enough else whole))
    reach = float(np.max(np.abs(force - centre)))
    return Band(centre, spread, rate_spread, reach, tuple(widths), factor, len(errors))


def _run_quantile(parts: Sequence[Array]) -> float:
    """Quantile at ``LEVEL`` in which every run weighs the same, however long it is."""
    kept = [p for p in parts if len(p)]
    values = np.concatenate(kept)
    weights = np.concatenate([np.full(len(p), 1.0 / len(p)) for p in kept])
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    return float(values[order][min(int(np.searchsorted(share, LEVEL)), len(values) - 1)])


def _angle(force: Array, rate: Array, centre: float, spread: float, rate_spread: float) -> Array:
    """Place in the loading cycle, rad: 0 at the peak, a quarter turn on while loading."""
    return np.asarray(np.arctan2(rate / rate_spread, (force - centre) / spread))


def _cell(angle: Array) -> Array:
    return np.asarray(np.floor(np.mod(angle, 2 * np.pi) * CELLS / (2 * np.pi)).astype(int) % CELLS)


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
    """

    effects: tuple[ChosenEffect, ...]
    values: Mapping[str, float]
    held_out: tuple[HeldOut, ...]
    score: float
    pip_weight: float = 0.5
    band: Band | None = None
    scales: Scales = SI

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
    wanted = set() if found.shapes_seen is not None else set(found.shape_units)
    known = {*found.follows, *found.switches_seen, *found.shape_units, *(key for s in tried for key in s)}
    if not wanted <= set(shape) <= known:
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
    )


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
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
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
