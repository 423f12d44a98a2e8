"""What is told of every effect: its chance, its numbers with their intervals, and sentences on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from fingerlab.core.text import estimate_text, in_sentence, score_text, screen_unit, significant
from fingerlab.diagnosis.answer.results import Candidate, Fingerprint
from fingerlab.diagnosis.score.calibration import CalibratedAnswer, Verdict
from fingerlab.diagnosis.score.evidence import Evidence, needed_fall, undetectable
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_assumed_bounds, own_keys
from fingerlab.diagnosis.score.selection import justified, least_strength
from fingerlab.diagnosis.settings import (
    CONSTANTS_SPEAK,
    MOST_NAMED,
    NOTHING_SEEN,
    SET_LOG_ODDS,
    Z90,
)
from fingerlab.effects import find_effect
from fingerlab.effects.base import Effect, Row
from fingerlab.models.file import ParameterEstimate


@dataclass(frozen=True)
class JudgedEffects:
    """Effects as they were judged.

    Attributes:
        probability: calibrated, of every answer, 0 to 1.
        chosen: indices of the candidates that cannot be ruled out. stuck: of those at the edge of what is
            allowed.
    """

    evidence: Evidence
    probability: Mapping[str, float]
    chosen: Sequence[int]
    stuck: Sequence[int]


@dataclass(frozen=True)
class ToldModels:
    """Models from which an effect is told in place of those that were judged, by its id.

    Attributes:
        closer: with its refined shape, or with it in place of a given one.
        reported: whose numbers are told.
        replaced: ids of the given effects in whose place it is.
        variances: of unknowns of reported models, by key, over the shapes of their effects.
    """

    closer: Mapping[str, FittedModel]
    reported: Mapping[str, FittedModel]
    replaced: Mapping[str, tuple[str, ...]]
    variances: Mapping[str, Mapping[str, float]]


def cannot_be_ruled_out(
    evidence: Evidence, said: CalibratedAnswer, probability: Mapping[str, float]
) -> list[int]:
    """Indices of the effects that are left open, likeliest first; the verdict's own is among them.

    Args:
        probability: calibrated probability of every answer.
    """
    if evidence.verdict == Verdict.NOT_IN_CATALOGUE:
        return []
    names = [c.last_effect.id for c in evidence.candidates]
    if evidence.verdict == Verdict.NOTHING_MISSING:
        # Of the hidden ones 95 % would be most of the catalogue: those that could hide, and what is seen
        # and nearly as likely as nothing.
        near = float(np.exp(-SET_LOG_ODDS)) * probability[Verdict.NOTHING_MISSING]
        hidden = undetectable(evidence)
        seen = [i for i, name in enumerate(names) if probability[name] >= near and i not in hidden]
        return sorted([*hidden, *seen], key=lambda i: -probability[names[i]])
    index = {name: i for i, name in enumerate(names)}
    chosen = [index[name] for name in said.cannot_be_ruled_out if name in index]
    if evidence.verdict == Verdict.MISSING_EFFECT and not chosen:
        chosen = [int(np.argmax(evidence.probabilities))]
    return chosen


def candidates(
    judged: JudgedEffects, models: ToldModels, prints: Mapping[str, Fingerprint], loose: bool, alone: bool
) -> tuple[Candidate, ...]:
    """What is told of every effect, likeliest first.

    Args:
        prints: curves of an effect, by its id. loose: the cable was slack at times.
        alone: there is one run, of which nothing was held out.
    """
    result = []
    evidence = judged.evidence
    posterior = [judged.probability[c.last_effect.id] for c in evidence.candidates]
    order = sorted(
        range(len(evidence.candidates)), key=lambda i: (-posterior[i], evidence.candidates[i].misfit)
    )
    for i in order:
        name = evidence.candidates[i].last_effect.id
        variances = models.variances.get(name, NO_VARIANCE)
        fitted = models.closer.get(name, evidence.candidates[i])
        one = fitted.last_effect
        least = least_strength(fitted, needed_fall(evidence, fitted))
        shown = loose if one.special == "slack" else least <= 1.0
        shown = shown or name in models.replaced or justified(evidence.base, fitted)
        shown = shown or (evidence.verdict == Verdict.MISSING_EFFECT and name == evidence.best.last_effect.id)
        fitted = models.reported.get(name, fitted)
        result.append(
            Candidate(
                effect=one.id,
                title=titles_in(fitted)[one.id],
                score=fitted.score,
                probability=posterior[i],
                in_set=i in judged.chosen,
                parameters=parameters(fitted, one, temperature_for(evidence, fitted), variances),
                equations=one.acts_on,
                explanation=explanation(
                    evidence, fitted, one, shown, least, models, alone, i not in judged.chosen
                ),
                detectable=shown,
                fingerprint=prints.get(one.id),
                replaces=models.replaced.get(name, ()),
                at_bound=i in judged.stuck,
            )
        )
    return tuple(result)


NO_VARIANCE: Mapping[str, float] = MappingProxyType({})
"""No other shape was looked at."""


def deviations(
    fitted: FittedModel, temperature: float, variances: Mapping[str, float] = NO_VARIANCE
) -> dict[str, float]:
    """Standard deviation of every unknown, given what else is unknown; in the model's units; 0: held.

    Args:
        variances: of unknowns over the shapes of the model's effects, which come on top.
    """
    spread, held = fitted.fit.deviations_at(temperature), fitted.model.fixed
    keys = [u.key for u in fitted.model.unknowns]
    return {
        key: 0.0 if key in held else float(np.sqrt(s**2 + variances.get(key, 0.0)))
        for key, s in zip(keys, spread, strict=True)
    }


def temperature_for(evidence: Evidence, fitted: FittedModel) -> float:
    """By how much intervals of a model are wider than its noise makes them, squared.

    By what it leaves itself, or by what the best of the first fits does where that is less.
    """
    return min(evidence.temperature, fitted.temperature())


def parameters(
    fitted: FittedModel,
    effect: Effect,
    temperature: float,
    variances: Mapping[str, float] = NO_VARIANCE,
) -> dict[str, ParameterEstimate]:
    """The effect's parameters with 90 % intervals; a grid parameter's interval is to its neighbours."""
    values = fitted.values
    gains = {u.key: u.parameter for u in fitted.model.unknowns}
    spread = deviations(fitted, temperature, variances)
    result = {}
    for name, key in own_keys(fitted, effect).items():
        gain, value = gains[key], float(values[key])
        low = max(gain.low, value - Z90 * spread[key])
        high = min(gain.high, value + Z90 * spread[key])
        result[name] = _estimate_in_si(fitted, gain.unit, value, low, high)
    shape = effect.shapes[fitted.choice_of(effect).shape]
    for name, unit in effect.shape_units.items():
        if name not in shape:
            continue
        grid = sorted({float(s[name]) for s in effect.shapes if name in s})
        value = float(shape[name])
        at = grid.index(value)
        result[name] = _estimate_in_si(
            fitted, unit, value, grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
        )
    return result


def _estimate_in_si(
    fitted: FittedModel, unit: str, value: float, low: float, high: float
) -> ParameterEstimate:
    """A number of a model, which is in reduced units, in SI."""
    size = fitted.model.layout.scales.of(unit)
    return ParameterEstimate(value * size, unit, low * size, high * size)


def every_parameter(
    fitted: FittedModel, temperature: float, variances: Mapping[str, float] = NO_VARIANCE
) -> dict[str, ParameterEstimate]:
    """All unknowns of the model by key, SI, with 90 % intervals that no bound cuts.

    Not what an effect has for another of its laws than the one at hand.
    """
    spread = deviations(fitted, temperature, variances)
    of_laws = {key for choice in fitted.choices for key in own_keys(fitted, choice.effect).values()}
    return {
        u.key: _estimate_in_si(
            fitted, u.parameter.unit, float(v), float(v) - Z90 * spread[u.key], float(v) + Z90 * spread[u.key]
        )
        for u, v in zip(fitted.model.unknowns, fitted.fit.values, strict=True)
        if not u.effect or u.key in of_laws
    }


def would_have_shown(fitted: FittedModel, effect: Effect, least: float) -> str:
    """The strength from which on an effect would have shown, in words; empty where none would.

    Args:
        least: multiple of its typical strength (see ``selection.least_strength``).
    """
    names = {key: name for name, key in own_keys(fitted, effect).items()}
    gains, size_of = {u.key: u.parameter for u in fitted.model.unknowns}, fitted.model.layout.scales.of
    title = partial(parameter_title, effect)
    said = [
        f"{title(names[key])} {_amount(least * strength * size_of(gains[key].unit), gains[key].unit)}"
        for key, strength in fitted.sensitivity.strengths.items()
        if least * strength <= MOST_NAMED * max(abs(gains[key].high), abs(gains[key].low))
    ]
    if len(said) != len(fitted.sensitivity.strengths):
        return ""
    if any("," in title for title in said):
        return "; ".join(said)
    return " and ".join((", ".join(said[:-1]), said[-1]) if len(said) > 1 else said)


def _amount(value: float, unit: str) -> str:
    shown = screen_unit(unit, abs(value))
    rounded = float(f"{value * shown.factor:.2g}")
    return shown.after(f"{rounded:g}")  # 1300, where .2g would write 1.3e+03


def explanation(
    evidence: Evidence,
    fitted: FittedModel,
    effect: Effect,
    shown: bool,
    least: float,
    models: ToldModels,
    alone: bool = False,
    ruled_out: bool = False,
) -> str:
    """One or two plain sentences with the evidence in numbers.

    Those of the effect are told as of a first fit: once it is in the model all is fitted anew, and what is
    then still missed, from which the intervals follow, is another.

    Args:
        shown: whether it would have shown at a typical strength. least: the multiple of that from which on.
        models: in whose place the effect is in ``fitted``, and how its numbers vary over its shapes.
        alone: there is one run, of which nothing was held out.
        ruled_out: it is none of those that could be what is missing.
    """
    replaced = models.replaced.get(effect.id, ())
    variances = models.variances.get(effect.id, NO_VARIANCE)
    error = "the error" if alone else "the held-out error"
    before, after = score_text(evidence.base.score), score_text(fitted.score)
    fall = f"goes from {before} to {after} floors" if before != after else f"stays at {after} floors"
    said, told = _said(fitted, effect), "" if ruled_out else _told_by_constants(evidence.base, fitted)
    if not shown:
        strength = would_have_shown(fitted, effect, least)
        reveal = (effect.reveal_of_an_axis if _on_bench(fitted) else "") or effect.reveal
        from_there = f" (it would have shown from {strength} on)" if strength else ""
        if ";" in strength:
            from_there = f" (it would have shown from these on: {strength})"
        return (
            f"{said} These data could not show it at a plausible strength{from_there}; {reveal} would.{told}"
        )
    if fitted.misfit > evidence.base.misfit * NOTHING_SEEN and not (replaced or told):
        usual = _usual_already(fitted, effect, temperature_for(evidence, fitted))
        return f"{said} Nothing of that is seen{usual}: {error} {fall}."
    numbers = [
        f"{parameter_title(effect, name)} "
        f"{_grid_value(found) if name in effect.shape_units else estimate_text(found)}"
        for name, found in parameters(fitted, effect, temperature_for(evidence, fitted), variances).items()
    ]
    found = f" (first fit: {'; '.join(numbers)})" if numbers else ""
    there = f" in place of {_in_sentence(evidence.base, replaced)}" if replaced else ""
    bounds = _at_bounds(fitted, effect)
    return f"{said[:-1]}{found}. With it{there} {error} {fall}.{told}{bounds}"


def _usual_already(fitted: FittedModel, effect: Effect, temperature: float) -> str:
    """What of the effect every model has, where it is seen: a cable that gives as cables do; else nothing."""
    held = [
        f"{parameter_title(effect, name)} {estimate_text(found)}"
        for name, found in parameters(fitted, effect, temperature).items()
        if name in effect.relaxes and (found.low > 0.0 or found.high < 0.0)
    ]
    return f" beyond what is usual and in every model ({'; '.join(held)})" if held else ""


def _told_by_constants(base: FittedModel, fitted: FittedModel) -> str:
    """What is to be said where constants of the rig that are off come back with an effect; else nothing.

    Where the misfit falls by what makes a step, that speaks for it.
    """
    if justified(base, fitted) or base.constants_off - fitted.constants_off < CONSTANTS_SPEAK:
        return ""
    before, after = base.constants_off, fitted.constants_off
    return (
        f" What speaks for it are the rig's constants: without it they are off by {before:.1f} in chi-square "
        f"by their tolerances, with it by {after:.1f}; {len(base.constants)} is usual."
    )


def _at_bounds(fitted: FittedModel, effect: Effect) -> str:
    """What is to be said where a strength is beyond, or at the end of, what was thought plausible.

    Of a machine that nobody here knows that is a guess by its torque and pace, which a law may exceed.
    """
    on_bench, size = _on_bench(fitted), "so large"
    usual, keys, stuck = find_effect(effect.id) or effect, own_keys(fitted, effect), at_assumed_bounds(fitted)
    said = []
    for name in (one for one in dict.fromkeys((*effect.widened, *stuck)) if one in keys):
        before, value = usual.unknowns[name], abs(float(fitted.values[keys[name]]))
        bound = max(abs(before.low), abs(before.high))
        if value < bound and name not in stuck:
            continue
        shown = _amount(bound * fitted.model.layout.scales.of(before.unit), before.unit)
        title, beyond = parameter_title(effect, name), value > bound
        if on_bench and beyond:
            said.append(f"{title} is beyond {shown}, which was guessed from this machine's torque and pace")
        elif on_bench:
            said.append(f"{title} stands at {shown}, the most that was looked for")
            size = "larger"
        else:
            said.append(f"{title} {'is beyond' if beyond else 'stands at'} the assumed bound of {shown}")
    if not said:
        return ""
    so = f": it may be {size}, or another effect." if on_bench else ", so that it may be another effect."
    return f" Its {' and its '.join(said)}{so}"


def _in_sentence(fitted: FittedModel, names: Sequence[str]) -> str:
    """Titles of some of the model's effects as they stand inside a sentence."""
    titles = titles_in(fitted)
    return " and ".join(in_sentence(titles.get(name, name)) for name in names)


def titles_in(fitted: FittedModel) -> dict[str, str]:
    """What the model's effects are called, by id: a motor alone has a name for some as they were found."""
    on_bench = _on_bench(fitted)
    return {
        one.effect.id: one.effect.title_of_an_axis(one.effect.shapes[one.shape])
        if on_bench and one.effect.title_of_an_axis is not None
        else one.effect.title
        for one in fitted.choices
    }


def _on_bench(fitted: FittedModel) -> bool:
    return all(f.row == Row.BENCH for f in fitted.model.layout.features)


def _said(fitted: FittedModel, effect: Effect) -> str:
    """The effect's sentence; a motor bench has no joints to speak of."""
    on_bench = _on_bench(fitted)
    if on_bench and effect.of_an_axis is not None:
        return effect.of_an_axis(effect.shapes[fitted.choice_of(effect).shape])
    return effect.explanation_alone if on_bench else effect.explanation


def _grid_value(estimate: ParameterEstimate) -> str:
    """A value that was only tried on a grid has no interval worth a sign."""
    shown = screen_unit(estimate.unit, abs(estimate.value))
    return f"about {shown.after(significant(estimate.value * shown.factor))}"


def parameter_title(effect: Effect, name: str) -> str:
    """What a number of an effect is called in a sentence."""
    gain = effect.unknowns.get(name)
    title = gain.title if gain is not None and gain.title else name.removesuffix("_deg").replace("_", " ")
    joint = {"mcp": "MCP ", "pip": "PIP "}.get(name.rsplit("_", 1)[-1], "")
    return f"{joint}{title}"
