"""Figures of a diagnosis: measured against modelled, fingerprints, the error path, where the model fails."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fingerlab.core.text import ScreenUnit, screen_unit, with_minus
from fingerlab.diagnosis.answer.error_parts import Budget, Comparison, equation_of
from fingerlab.diagnosis.answer.residual_profiles import Profile, profile
from fingerlab.diagnosis.answer.results import Diagnosis, Failure, Fingerprint, PathStep
from fingerlab.report.budget_words import (
    axis_title,
    budget_lines,
    coordinate_unit,
    coordinates_of,
    main_family,
    residual_unit,
    worst_words,
)
from fingerlab.report.diagnosis_words import (
    FAMILY_TITLES,
    effect_title,
    in_sentence,
    model_words,
    suspects,
)
from fingerlab.report.figure_style import (
    CANDIDATE,
    FLOOR,
    LABEL_SIZE,
    MEASURED,
    MODELLED,
    RESIDUAL,
    TICK_SIZE,
    label,
    legend_below,
    named_handles,
    named_rows,
    new_figure,
    score_bars,
    titled,
)
from fingerlab.report.line_units import line_units
from fingerlab.report.recording_words import recorded_words
from fingerlab.sessions.model import Array, Session

HALF_SIZE = (4.4, 3.4)
"""Inches; two such figures stand side by side on the page."""
STRETCH_S = 5.0
"""Time shown of a run: about five movements of the bench's usual 1 Hz sine, s."""
ROUND_STEPS = [1, 2, 2.5, 5, 10]
FARTHEST = 1.5
"""A model that shoots past what was measured is shown to this share of the measured span beyond it."""
WORTH_CUTTING = 0.1
"""What would be cut has to be this share at least of what stays."""


@dataclass(frozen=True)
class DrawnStretch:
    """A stretch of a comparison that is drawn: run, and seconds into it."""

    comparison: Comparison
    start: float
    stop: float

    @property
    def part(self) -> slice:
        """Samples of the stretch."""
        time = self.comparison.time
        return slice(int(np.searchsorted(time, self.start)), int(np.searchsorted(time, self.stop, "right")))


def chosen_stretches(comparisons: Iterable[Comparison], equation: str) -> tuple[DrawnStretch, ...]:
    """The run that misses most and the one in the middle, each around its worst half second.

    Empty where no run says anything about the equation; one where only one does.
    """
    ours = [c for c in comparisons if c.equation == equation and np.isfinite(c.measured - c.modelled).any()]
    ours.sort(key=_misfit, reverse=True)
    if not ours:
        return ()
    picked = [ours[0]] if len(ours) == 1 else [ours[0], ours[len(ours) // 2]]
    return tuple(_around(c, _worst_moment(c)) for c in picked)


def failure_stretch(comparisons: Iterable[Comparison], failure: Failure) -> DrawnStretch | None:
    """The stretch around the place where the model fails worst."""
    for one in comparisons:
        if _is_of(failure, one) and len(one.time) and one.time[0] <= failure.start <= one.time[-1]:
            return _around(one, 0.5 * (failure.start + failure.stop))
    return None


def _is_of(failure: Failure, one: Comparison) -> bool:
    """Whether the failure is in this equation of this run."""
    same = (one.equation, one.run) == (failure.equation, failure.run)
    return same and failure.session in ("", one.session)


def _misfit(comparison: Comparison) -> float:
    residual = comparison.measured - comparison.modelled
    return float(np.sqrt(np.nanmean(residual**2))) / max(comparison.floor, 1e-12)


def _worst_moment(comparison: Comparison) -> float:
    """Middle of the half second with the largest mean square residual, s into the run."""
    time = comparison.time
    square = np.nan_to_num(comparison.measured - comparison.modelled) ** 2
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    width = min(max(round(0.5 / step), 1), len(time))
    start = int(np.argmax(np.convolve(square, np.ones(width), "valid")))
    return float(time[start + width // 2])


def _around(comparison: Comparison, moment: float) -> DrawnStretch:
    first, last = float(comparison.time[0]), float(comparison.time[-1])
    start = min(max(moment - 0.5 * STRETCH_S, first), max(last - STRETCH_S, first))
    return DrawnStretch(comparison, start, min(start + STRETCH_S, last))


def comparison_figure(shown: DrawnStretch, failure: Failure | None = None) -> Figure:
    """Measured and modelled above, the residual with the floor as a band below.

    Args:
        failure: tinted where it falls into the stretch of this run and equation.
    """
    one, part = shown.comparison, shown.part
    time, measured, modelled = one.time[part], one.measured[part], one.modelled[part]
    figure, (above, below) = new_figure(2, 1, HALF_SIZE, sharex=True, height_ratios=[2, 1])
    unit = screen_unit(one.unit, _largest(measured))
    above.plot(time, unit.factor * measured, color=MEASURED, lw=1.6, label="measured")
    above.plot(time, unit.factor * modelled, color=MODELLED, lw=1.3, ls="--", label="modelled")
    _keep_in_sight(above, unit.factor * measured, unit.factor * modelled, unit)
    label(above, "", unit.label(in_sentence(equation_of(one.equation).quantity)))
    residual = measured - modelled
    small = screen_unit(one.unit, max(_largest(residual), one.floor))
    floor = small.factor * one.floor
    below.axhspan(-floor, floor, color=FLOOR, alpha=0.6, lw=0, label="floor")
    below.plot(time, small.factor * residual, color=RESIDUAL, lw=1.2, label="residual")
    label(below, "time in the run (s)", small.label("residual"))
    for axes in (above, below):
        axes.margins(x=0.0)
        if failure is not None and _is_of(failure, one):
            axes.axvspan(failure.start, failure.stop, color=RESIDUAL, alpha=0.25, lw=0, zorder=0)
    _round_ticks(above, below)
    figure.align_ylabels()
    legend_below(figure, named_handles(above) | named_handles(below))
    return figure


def _round_ticks(*figure_axes: Axes) -> None:
    for axes in figure_axes:
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=ROUND_STEPS))
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=ROUND_STEPS))


def _largest(values: Array) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if len(finite) else 0.0


def _keep_in_sight(axes: Axes, measured: Array, modelled: Array, unit: ScreenUnit) -> None:
    """Cut the axis where the model shoots far past what was measured, and say how far it goes.

    Args:
        measured, modelled: in ``unit``.
    """
    both = [v[np.isfinite(v)] for v in (measured, modelled)]
    if not len(both[0]) or not len(both[1]):
        return
    (low, high), (bottom, top) = ((float(v.min()), float(v.max())) for v in both)
    span = max(high - low, 1e-9)
    least, most = max(bottom, low - FARTHEST * span), min(top, high + FARTHEST * span)
    if max(least - bottom, top - most) > WORTH_CUTTING * (most - least):
        least, most = min(least, low), max(most, high)
        axes.set_ylim(least - 0.05 * (most - least), most + 0.15 * (most - least))
        words = f"cut: modelled reaches {_end(bottom)} to {unit.after(_end(top))}"
        axes.annotate(words, (0.01, 0.97), xycoords="axes fraction", va="top", fontsize=TICK_SIZE)


def _end(value: float) -> str:
    rounded = float(f"{value:.3g}")
    return with_minus(f"{rounded:.0f}" if abs(value) >= 100 else f"{rounded:g}")


def fingerprint_figure(print_: Fingerprint, title: str) -> Figure:
    """Binned residual with its 90 % interval over the effect's coordinate, and the effect's curve."""
    figure, (axes,) = new_figure(size=(4.4, 3.1))
    across = screen_unit(print_.coordinate_unit, _largest(print_.centre))
    if print_.coordinate_unit == "s":
        across = screen_unit("s", 10.0)
    up = screen_unit(print_.value_unit, max(_largest(print_.mean), _largest(print_.curve)))
    x = across.factor * print_.centre
    axes.axhline(0.0, color=FLOOR, lw=0.8, zorder=0)
    bars = up.factor * np.stack([print_.mean - print_.low, print_.high - print_.mean])
    axes.errorbar(
        x, up.factor * print_.mean, np.maximum(bars, 0.0), fmt="o", ms=4, color=RESIDUAL, capsize=2.5, lw=1.2,
        label="residual, 90 % interval",
    )  # fmt: skip
    axes.plot(x, up.factor * print_.curve, color=CANDIDATE, lw=1.6, label=in_sentence(title))
    quantity = in_sentence(equation_of(print_.equation).quantity)
    label(axes, across.label(print_.coordinate), up.label(f"residual, {quantity}"))
    _round_ticks(axes)
    legend_below(figure, dict(reversed(named_handles(axes).items())))
    return figure


def path_figure(path: Sequence[PathStep], given: Sequence[str]) -> Figure:
    """The error in floors: the model as given, then with each effect worth adding; 1 is the floor."""
    names = [_step_name(step, given) for step in path]
    colours = [MODELLED] + [CANDIDATE] * (len(path) - 1)
    size = (5.6, 1.0 + 0.42 * len(path))
    figure, axes = score_bars(names, [step.score for step in path], colours, size, LABEL_SIZE)
    axes.xaxis.set_major_locator(MaxNLocator(8, steps=ROUND_STEPS))
    label(axes, "held-out error, in multiples of the floor", "")
    return figure


def budget_figure(budget: Budget, family: str) -> Figure:
    """What a squared error is made of, from all of it at the top down to nothing, in per cent."""
    figure, (axes,) = new_figure(1, 1, (5.6, 1.0 + 0.36 * (len(budget.parts) + 1)))
    draw_budget(axes, budget, family)
    return figure


def draw_budget(axes: Axes, budget: Budget, family: str) -> None:
    """Bars from top to bottom: the whole, then what each part takes away, with its share."""
    label(axes, f"squared error of the {in_sentence(FAMILY_TITLES.get(family, family))}, %", "")
    reached, bars = 100.0, [("All of it", 0.0, 100.0, RESIDUAL)]
    for one in budget_lines(budget):
        colour = {"effect": CANDIDATE, "floor": FLOOR}.get(one.kind, MODELLED)
        bars.append((one.title, reached - 0.1 * one.tenths, 0.1 * one.tenths, colour))
        reached -= 0.1 * one.tenths
    for place, (_, low, size, colour) in enumerate(reversed(bars)):
        axes.barh(place, size, 0.6, low, color=colour)
        axes.annotate(
            with_minus(f"{size:.1f}"), (max(low, low + size), place), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize=TICK_SIZE,
        )  # fmt: skip
    named_rows(axes, [name for name, *_ in bars], TICK_SIZE)
    ends = [end for _, low, size, _ in bars for end in (low, low + size)]
    axes.set_xlim(min(ends), max(ends) + 0.12 * (max(ends) - min(ends)))
    axes.axvline(0.0, color=MEASURED, lw=0.6)


def diagnosis_figures(diagnosis: Diagnosis, sessions: Sequence[Session] = ()) -> Mapping[str, Figure]:
    """By name: error path and budget, where the model fails and worst of all, the suspects' fingerprints.

    Where no effect is suspected, the fingerprint is that of the most probable one. Above each stands what it
    shows, and of which sessions and model; ``sessions`` tell the day of recording as well, and whether the
    axis is a linear one, whose figures are in units of the line.
    """
    diagnosis = line_units(sessions).diagnosis(diagnosis)
    figures = {"error-path": path_figure(diagnosis.path, diagnosis.model)}
    titles = {"error-path": "Error path"}
    if diagnosis.budget:
        family = main_family(diagnosis.budget)
        figures["error-budget"] = budget_figure(diagnosis.budget[family], family)
        titles["error-budget"] = f"Error budget of the {in_sentence(FAMILY_TITLES.get(family, family))}"
    if diagnosis.failure is not None:
        worst = failure_stretch(diagnosis.comparisons, diagnosis.failure)
        if worst is not None:
            figures["worst-place"] = comparison_figure(worst, diagnosis.failure)
            titles["worst-place"] = f"Where the model fails worst: {_place(worst)}"
        where = where_figure(diagnosis.comparisons, diagnosis.failure.equation)
        if where is not None:
            figures["where"] = where
            titles["where"] = f"Where the model fails: {equation_of(diagnosis.failure.equation).title}"
    for equation in dict.fromkeys(c.equation for c in diagnosis.comparisons):
        for number, shown in enumerate(chosen_stretches(diagnosis.comparisons, equation), start=1):
            name = f"{equation.replace('_', '-')}-{number}"
            figures[name], titles[name] = comparison_figure(shown, diagnosis.failure), _place(shown)
    drawn = [c for c in diagnosis.candidates if c.fingerprint is not None]
    for candidate in [c for c in drawn if c.effect in suspects(diagnosis)] or drawn[:1]:
        if candidate.fingerprint is not None:
            name = f"fingerprint-{candidate.effect.replace('_', '-')}"
            figures[name] = fingerprint_figure(candidate.fingerprint, candidate.title)
            titles[name] = f"Fingerprint of {in_sentence(candidate.title)}"
    told = recorded_words(sessions) or " + ".join(Path(one).name for one in diagnosis.sessions)
    return titled(figures, titles, f"{told}; {model_words(diagnosis.model, diagnosis)}")


def _place(shown: DrawnStretch) -> str:
    """``Joint torque (MCP), run 010``."""
    return f"{equation_of(shown.comparison.equation).title}, run {shown.comparison.run}"


def _step_name(step: PathStep, given: Sequence[str]) -> str:
    if step.added is not None and step.removed is not None:
        return f"{in_sentence(_added(step))} for {in_sentence(effect_title(step.removed))}"
    if step.added is not None:
        return f"+ {in_sentence(_added(step))}"
    return "model as given" if given else "nominal model"


def _added(step: PathStep) -> str:
    return step.title or effect_title(str(step.added))


WHERE_COLUMNS = 2
ROW_INCHES = 2.4
BAR_SHARE = 0.88
WORDS_SIZE, WORDS_WIDE = 7.5, 44
"""Points, and characters that fit over one picture."""


def where_figure(comparisons: Sequence[Comparison], equation: str) -> Figure | None:
    """One picture for each coordinate that the runs tell; None where they tell none."""
    made = [profile(comparisons, equation, name) for name in coordinates_of(comparisons, equation)]
    found = [one for one in made if one is not None]
    if not found:
        return None
    rows = -(-len(found) // WHERE_COLUMNS)
    figure, axes = new_figure(rows, WHERE_COLUMNS, (7.2, 0.5 + ROW_INCHES * rows))
    for one, place in zip(found, axes, strict=False):
        _draw_profile(place, one)
    for place in axes[len(found) :]:
        place.set_visible(False)
    legend_below(figure, axes[0])
    return figure


def _draw_profile(axes: Axes, found: Profile) -> None:
    across, up = coordinate_unit(found), residual_unit(found)
    x, width = across.factor * found.centres, across.factor * float(found.edges[1] - found.edges[0])
    known = np.isfinite(found.rms)
    floor = up.factor * found.floor
    axes.axhspan(-floor, floor, color=FLOOR, alpha=0.6, lw=0, zorder=0, label="floor")
    axes.bar(
        x[known], up.factor * found.rms[known], BAR_SHARE * width, color=RESIDUAL, alpha=0.35,
        label="root mean square",
    )  # fmt: skip
    axes.errorbar(
        x[known], up.factor * found.mean[known], up.factor * found.half[known], fmt="o", ms=3, lw=1.0,
        color=RESIDUAL, label="mean, 90 % interval",
    )  # fmt: skip
    if found.runs:
        axes.set_xticks(x, [run for _, run, _ in found.runs], rotation=90 if len(x) > 8 else 0)
    label(axes, across.label(axis_title(found)), up.label("residual"))
    axes.set_title("\n".join(wrap(worst_words(found), WORDS_WIDE)), fontsize=WORDS_SIZE, loc="left")
