"""What a person looks at: measured and modelled over time, fingerprints, and the worst place in words."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from fingerlab.diagnosis.answer.error_parts import EQUATIONS, ROW_EQUATIONS, Comparison, ExcludedInterval
from fingerlab.diagnosis.answer.results import Failure, Fingerprint
from fingerlab.diagnosis.answer.stretches import (
    TENSION_BY_WAY,
    TORQUE_BY_WAY,
    Kept,
    RunOffsets,
    arms_of,
    kept_stretch,
    left_aside,
    measured_force,
    measured_side,
    residual_of,
    unit_of_place,
)
from fingerlab.diagnosis.fit.noise import floor_covariance
from fingerlab.diagnosis.gram.decimation import Decimated
from fingerlab.diagnosis.gram.sums import Group, Reduced
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import (
    BINS,
    BINS_A_PERIOD,
    HIGH_LOAD,
    LEAST_SAMPLES,
    LOW_LOAD,
    NARROW_RATE_HZ,
    OUTLYING,
    SHOWN_STRETCHES,
    SLACK_SPREAD_M,
    SLOWLY,
    STANDS_STILL,
    Z90,
)
from fingerlab.diagnosis.signals.conditions import GroupKey
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.diagnosis.signals.scales import SI, Scales
from fingerlab.effects.base import Effect, Row
from fingerlab.sessions.model import Array, Run, Session

ROW_UNITS = {Row.MCP: "N m", Row.PIP: "N m", Row.CABLE: "m", Row.BENCH: "N m", Row.TIP: "m"}


OffsetsOf = Callable[[FittedModel], RunOffsets]


@dataclass(frozen=True)
class Curves:
    """All that is drawn."""

    comparisons: tuple[Comparison, ...]
    fingerprints: Mapping[str, Fingerprint]
    failure: Failure | None


@dataclass(frozen=True)
class FloorModel:
    """The model whose floors an answer tells: the last of its path, and what it was reduced to."""

    reduced: Reduced
    fitted: FittedModel

    def covariance(self, key: GroupKey) -> Array:
        """Of what no model can better in these runs, of one sample, (5, 5) over ``Row``, reduced units."""
        of = self.fitted.model, self.fitted.fit.values, self._group(key), self.fitted.weights[key]
        return floor_covariance(*of, means=self.reduced.constants is None)

    def arms(self, key: GroupKey) -> tuple[float, float]:
        """Moment arms at MCP and PIP in these runs, reduced units."""
        return arms_of(self.fitted, self._group(key))

    def _group(self, key: GroupKey) -> Group:
        return next(group for group in self.reduced.groups if group.key == key)


@dataclass
class Display:
    """Keeps the stretches that pass by while the sessions are reduced, and draws from them afterwards."""

    stretches: list[Kept] = field(default_factory=list)

    def keep(self, session: Session, run: Run, low: Decimated) -> None:
        """Called by the reduction for every stretch."""
        if len(self.stretches) >= SHOWN_STRETCHES:
            return
        self.stretches.append(kept_stretch(session, run, low))

    def fingerprint_between(
        self, reduced: Reduced, effect: Effect, base: FittedModel, fitted: FittedModel
    ) -> Fingerprint | None:
        """What ``base`` leaves over the coordinate of an effect, and what ``fitted`` tells of that; SI."""
        groups, scales = {g.key: g for g in reduced.groups}, reduced.layout.scales
        drawn = _fingerprint(effect, base, fitted, groups, self.stretches, reduced.on_bench, ({}, {}))
        return drawn if drawn is None or scales == SI else _fingerprint_in_si(drawn, scales)

    def curves(self, reduced: Reduced, evidence: Evidence, offsets: OffsetsOf, told: FloorModel) -> Curves:
        """Comparisons of the model as given, and the fingerprint of every effect tried beside it.

        ``offsets``: what the constants of every run add to a model's residuals. ``told``: whose floors are.
        """
        groups = {g.key: g for g in reduced.groups}
        comparisons: list[Comparison] = []
        before = offsets(evidence.base)
        last: Kept | None = None
        for kept, following in zip(self.stretches, (*self.stretches[1:], None), strict=True):
            aside = left_aside(last, kept, following, evidence.base)
            comparisons += [
                replace(one, aside=tuple(a for a in aside if a.reason != "slack" or one.equation == CABLE))
                for one in _comparisons(reduced, evidence.base, groups[kept.key], kept, before, told)
            ]
            last = kept
        prints = {}
        for fitted in evidence.candidates:
            one = fitted.last_effect
            both = before, offsets(fitted)
            drawn = _fingerprint(one, evidence.base, fitted, groups, self.stretches, reduced.on_bench, both)
            if drawn is not None:
                prints[one.id] = drawn
        best = int(np.argmax(evidence.probabilities)) if evidence.candidates else -1
        slack = best >= 0 and evidence.candidates[best].model.slack_free
        scales = reduced.layout.scales
        failure = _failure(
            comparisons, self.stretches, slack, bool(evidence.base.model.stiction), scales.time
        )
        if scales != SI:
            comparisons = [_comparison_in_si(one, scales) for one in comparisons]
            prints = {name: _fingerprint_in_si(one, scales) for name, one in prints.items()}
        return Curves(tuple(comparisons), prints, failure)


def comparisons_of(
    reduced: Reduced, fitted: FittedModel, display: Display, session: str, run: str, offsets: RunOffsets
) -> tuple[Comparison, ...]:
    """Every equation of the stretches of one run by another model of these sessions, in SI.

    ``offsets``: what the constants of every run add to the model's residuals.
    """
    groups, scales = {g.key: g for g in reduced.groups}, reduced.layout.scales
    found = [
        one
        for kept in display.stretches
        if (kept.session, kept.run) == (session, run)
        for one in _comparisons(reduced, fitted, groups[kept.key], kept, offsets, FloorModel(reduced, fitted))
    ]
    return tuple(found if scales == SI else (_comparison_in_si(one, scales) for one in found))


CABLE = ROW_EQUATIONS[Row.CABLE]


def _comparison_in_si(one: Comparison, scales: Scales) -> Comparison:
    """In SI, where the fit has reduced units."""
    size = scales.of(one.unit)
    places = {name: values * scales.of(unit_of_place(name)) for name, values in one.coordinates.items()}
    return replace(
        one, time=one.time * scales.time, measured=one.measured * size, modelled=one.modelled * size,
        floor=one.floor * size, coordinates=places,
        aside=tuple(
            ExcludedInterval(a.reason, a.start * scales.time, a.stop * scales.time) for a in one.aside
        ),
    )  # fmt: skip


def _fingerprint_in_si(one: Fingerprint, scales: Scales) -> Fingerprint:
    """In SI, where the fit has reduced units."""
    size = scales.of(one.value_unit)
    return replace(
        one, centre=one.centre * scales.of(one.coordinate_unit), mean=one.mean * size, low=one.low * size,
        high=one.high * size, curve=one.curve * size,
    )  # fmt: skip


def _comparisons(
    reduced: Reduced, fitted: FittedModel, group: Group, kept: Kept, offsets: RunOffsets, told: FloorModel
) -> list[Comparison]:
    present = [row for row in Row if np.any(fitted.model.rows == row)]
    residuals = {row: residual_of(fitted, group, kept, row, offsets) for row in present}
    noise = told.covariance(group.key)

    def one(equation: str, measured: Array, modelled: Array, unit: str, variance: float) -> Comparison:
        return Comparison(
            equation, kept.session, kept.run, kept.phase, kept.time, measured, modelled, unit,
            float(np.sqrt(max(variance, 0.0))), coordinates=kept.coordinates,
        )  # fmt: skip

    if group.on_bench:
        torque = measured_side(fitted, group, kept, Row.BENCH)
        return [one("motor_torque", torque, torque - residuals[Row.BENCH], "N m", noise[3, 3])]
    a, b = arms_of(fitted, group)
    pull = measured_side(fitted, group, kept, Row.MCP)
    wound = measured_side(fitted, group, kept, Row.CABLE)
    length = wound - residuals[Row.CABLE]
    if fitted.model.slack_free:
        length = np.where(kept.taut, length, np.nan)
    mean = 0.5 * (residuals[Row.MCP] + residuals[Row.PIP])
    radius = reduced.radius
    spread = 0.25 * (noise[0, 0] + noise[1, 1] + 2 * noise[0, 1])
    floor_a, floor_b = told.arms(group.key)
    result = [
        one("mcp_torque", a * pull, a * (pull - residuals[Row.MCP]), "N m", floor_a**2 * noise[0, 0]),
        one("pip_torque", b * pull, b * (pull - residuals[Row.PIP]), "N m", floor_b**2 * noise[1, 1]),
        one("cable_kinematics", wound, length, "m", noise[2, 2]),
        one("motor_torque", radius * pull, radius * (pull - mean), "N m", radius**2 * spread),
    ]
    if kept.levers is not None:
        force = measured_force(reduced, kept)
        for equation, arm, floor_arm, lever, row in (
            ("endpoint_force_pip", b, floor_b, kept.levers[1], Row.PIP),
            ("endpoint_force_mcp", a, floor_a, kept.levers[0], Row.MCP),
        ):
            variance = float(np.mean((floor_arm / lever) ** 2)) * noise[row, row]
            result.append(one(equation, force, force + arm / lever * residuals[row], "N", variance))
    return result


def _coordinate(effect: Effect, kept: Kept, bench: bool) -> Array | None:
    joint, name = {Row.MCP: " mcp", Row.PIP: " pip"}.get(effect.equation, " pip"), _drawn_over(effect, bench)
    return kept.coordinates.get(name, kept.coordinates.get(name + joint))


def _drawn_over(effect: Effect, bench: bool) -> str:
    """What the effect is drawn against in runs of a finger, or of the motor alone."""
    return TORQUE_BY_WAY if bench and effect.coordinate == TENSION_BY_WAY else effect.coordinate


def _fingerprint(
    effect: Effect,
    base: FittedModel,
    fitted: FittedModel,
    groups: Mapping[GroupKey, Group],
    stretches: Iterable[Kept],
    bench: bool,
    offsets: tuple[RunOffsets, RunOffsets],
) -> Fingerprint | None:
    """The base model's residual over the effect's own coordinate, with what the effect explains.

    ``offsets`` of the runs beside the base model and beside the fitted one.
    """
    row = Row.BENCH if bench else effect.equation
    places, residuals, explained = [], [], []
    period = _period(fitted)
    for kept in stretches:
        where = _coordinate(effect, kept, bench)
        if where is None or (effect.phases and kept.phase not in effect.phases):
            continue
        group = groups[kept.key]
        if group.on_bench != bench:  # one axis cannot hold two equations
            continue
        before = residual_of(base, group, kept, row, offsets[0])
        after = residual_of(fitted, group, kept, row, offsets[1])
        scale = 1.0 if row in (Row.CABLE, Row.BENCH, Row.TIP) else arms_of(base, group)[int(row)]
        # Torque of the joint in the direction of its angle, whichever way the cable pulls.
        places.append(where)
        residuals.append(scale * before)
        explained.append(scale * (before - after))
    if not places:
        return None
    place = np.concatenate(places)
    drawn = partial(
        _binned, effect, row, residual=np.concatenate(residuals), explained=np.concatenate(explained)
    )
    if np.ptp(place) <= period * BINS / BINS_A_PERIOD:
        return drawn(place)
    within = drawn(place % period)  # bins over all of the travel would hold nothing but the wave's mean
    return within if within is None else replace(within, coordinate=f"{effect.coordinate} within one period")


def _period(fitted: FittedModel) -> float:
    """Of the effect added last, where it repeats with the motor angle, rad; else infinite."""
    last = fitted.choices[-1]
    order = last.effect.shapes[last.shape].get("order", 0.0) if last.effect.shapes else 0.0
    repeats = order > 0 and last.effect.coordinate == "motor angle"
    return 2.0 * np.pi / order if repeats else np.inf


def _binned(effect: Effect, row: Row, place: Array, residual: Array, explained: Array) -> Fingerprint | None:
    low, high = np.quantile(place, (OUTLYING, 1.0 - OUTLYING))
    edges = np.linspace(float(low), float(high), BINS + 1)
    if not edges[-1] > edges[0]:
        return None
    number = np.clip(np.digitize(place, edges) - 1, 0, BINS - 1)
    counts = np.bincount(number, minlength=BINS)
    full = counts >= LEAST_SAMPLES
    divisor = np.maximum(counts, 1)

    def mean(values: Array) -> Array:
        return np.bincount(number, values, BINS) / divisor

    average = mean(residual)
    spread = np.sqrt(np.maximum(mean(residual**2) - average**2, 0.0))
    half = Z90 * spread / np.sqrt(np.maximum(divisor * EFFECTIVE_SHARE, 1.0))
    over = _drawn_over(effect, row == Row.BENCH)
    return Fingerprint(
        equation=ROW_EQUATIONS[row],
        coordinate=over,
        coordinate_unit=unit_of_place(over),
        value_unit=ROW_UNITS[row],
        centre=(0.5 * (edges[1:] + edges[:-1]))[full],
        mean=average[full],
        low=(average - half)[full],
        high=(average + half)[full],
        curve=mean(explained)[full],
    )


def _failure(
    comparisons: Iterable[Comparison],
    stretches: Iterable[Kept],
    slack_counts: bool,
    stiction: bool,
    second: float,
) -> Failure | None:
    """The half second in which an equation misses most, in floors; ``second`` s to a reduced one.

    ``stiction``: the model says nothing of a finger that stands still.
    """
    worst: tuple[float, Comparison, int] | None = None
    length = int(0.5 * NARROW_RATE_HZ)
    for c in comparisons:
        kept = _stretch_of(c, stretches)
        # A cable that hangs loose for a moment is no failure, unless slack is what is missing.
        spared = c.equation == "cable_kinematics" and not slack_counts
        floor = np.where(kept.taut, c.floor, SLACK_SPREAD_M) if spared else c.floor
        missed = np.nan_to_num((c.measured - c.modelled) / np.maximum(floor, 1e-12)) ** 2
        if stiction:
            missed[kept.rest] = 0.0
        if len(missed) < length:
            continue
        running = np.convolve(missed, np.ones(length) / length, mode="valid")
        k = int(np.argmax(running))
        if worst is None or running[k] > worst[0]:
            worst = (float(running[k]), c, k)
    if worst is None:
        return None
    floors, c, k = float(np.sqrt(worst[0])), worst[1], worst[2]
    start, stop = second * float(c.time[k]), second * float(c.time[k + length - 1])
    moment = _moment(_stretch_of(c, stretches), slice(k, k + length))
    place = f"{EQUATIONS[c.equation].title} of run {c.run} at {start:.1f} to {stop:.1f} s"
    text = f"{place}: {moment}; the model misses {floors:.1f} times the floor there"
    return Failure(text, c.equation, c.run, start, stop, c.session, moment)


def _stretch_of(comparison: Comparison, stretches: Iterable[Kept]) -> Kept:
    return next(
        s
        for s in stretches
        if (s.session, s.run) == (comparison.session, comparison.run) and s.time[0] == comparison.time[0]
    )


def _moment(kept: Kept, part: slice) -> str:
    """What the finger, or the motor alone, does there, in words; a motor alone winds no cable."""
    alone = "joint speed pip" not in kept.coordinates
    speed = kept.coordinates["motor speed" if alone else "joint speed pip"]
    now, usual = float(np.mean(speed[part])), float(np.sqrt(np.mean(speed**2))) + 1e-12
    words = ("moving forward", "moving backward") if alone else ("flexing", "extending")
    pace = "slowly" if abs(now) < SLOWLY * usual else "fast"
    motion = (
        "near standstill or reversing"
        if abs(now) < STANDS_STILL * usual
        else f"{words[0 if now > 0 else 1]} {pace}"
    )
    pull = np.abs(kept.coordinates["tension"]) if alone else kept.coordinates["tension"]  # or its torque
    low, high = np.quantile(pull, (LOW_LOAD, HIGH_LOAD))
    level = float(np.mean(pull[part]))
    size = "low" if level < low else "high" if level > high else "middling"
    return f"{motion}, at {size} {'torque' if alone else 'load'}"
