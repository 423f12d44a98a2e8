"""Figures of a prediction with effects, and of several models side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fingerlab.core.text import score_text
from fingerlab.prediction.comparing import ComparedModel, ModelComparison
from fingerlab.prediction.predict import Curve, ExtendedPrediction, RunPrediction
from fingerlab.report.diagnosis_words import effect_title, in_sentence
from fingerlab.report.figure_style import (
    CANDIDATE,
    FLOOR,
    MEASURED,
    MODELLED,
    TICK_SIZE,
    label,
    legend_below,
    new_figure,
)
from fingerlab.report.force_figures import amplitude_bars, normalised_force
from fingerlab.sessions.model import Array

STRETCH_S = 5.0
"""Time shown of a run, s."""
COLOURS = {"extended": CANDIDATE, "nominal": MODELLED}


def extended_figures(result: ExtendedPrediction) -> Mapping[str, Figure]:
    """Force with its interval, what is missed, peaks by run and normalised force, for each variant."""
    figures: dict[str, Figure] = {}
    main = next(iter(result.runs))
    figures["force"] = force_figure({name: runs[0] for name, runs in result.runs.items()}, main)
    for name, runs in result.runs.items():
        title = f"{name} model"
        predictions = [run.numbers["both"].prediction for run in runs]
        figures[f"peaks-{name}"] = amplitude_bars([run.run for run in runs], predictions, title)
        normalised = normalised_force(predictions[0], f"{title}, run {runs[0].run}")
        if normalised is not None:
            figures[f"normalised-{name}"] = normalised
    return figures


def force_figure(runs: Mapping[str, RunPrediction], banded: str) -> Figure:
    """Measured and modelled force above, modelled less measured with the interval below.

    Args:
        runs: one run by each variant. banded: the variant whose 90 % interval is drawn.
    """
    figure, (above, below) = new_figure(2, 1, sharex=True, height_ratios=[3, 2])
    for name, run in runs.items():
        curve = _start_of(run.curves[0])
        colour = COLOURS.get(name, MODELLED)
        if name == banded:
            above.plot(curve.time, curve.measured, color=MEASURED, lw=1.6, label="measured")
            if np.isfinite(curve.half_width).any():
                for axes, middle, factor in ((above, curve.modelled, 1.0), (below, 0.0, 1e3)):
                    low, high = middle - curve.half_width, middle + curve.half_width
                    axes.fill_between(
                        curve.time, factor * low, factor * high, color=FLOOR, alpha=0.6, lw=0, zorder=0,
                        label="90 % interval",
                    )  # fmt: skip
        style = "--" if name == banded else ":"
        above.plot(curve.time, curve.modelled, color=colour, ls=style, lw=1.3, label=f"{name} model")
        below.plot(curve.time, 1e3 * (curve.measured - curve.modelled), color=colour, ls=style, lw=1.2)
    label(above, "", "endpoint force (N)", f"Run {runs[banded].run}")
    label(below, "time in the run (s)", "measured less\nmodelled (mN)")
    for axes in (above, below):
        axes.margins(x=0.0)
    figure.align_ylabels()
    handles, names = above.get_legend_handles_labels()
    legend_below(figure, dict(zip(names, handles, strict=True)))
    return figure


def _start_of(curve: Curve) -> Curve:
    part = slice(0, int(np.searchsorted(curve.time, curve.time[0] + STRETCH_S, "right")))
    return Curve(curve.time[part], curve.measured[part], curve.modelled[part], curve.half_width[part])


def comparison_figures(result: ModelComparison) -> Mapping[str, Figure]:
    """Error in floors and, where there are contact runs, error of the force and its interval, by model."""
    figures = {"error": error_figure(result.models)}
    runs = [run for model in result.models for run in model.forces]
    if runs and all(np.isfinite(run.numbers["both"].value("rmse")) for run in runs):
        figures["force-error"] = force_error_figure(result.models)
    return figures


def model_words(model: ComparedModel) -> str:
    """Name of the model and its effects, for an axis."""
    titles = [in_sentence(effect_title(name)) for name in model.effects]
    return f"{model.name}\n{', '.join(titles)}" if titles else model.name


def error_figure(models: Sequence[ComparedModel]) -> Figure:
    """Error over all equations in multiples of the floor, one bar a model."""
    figure, (axes,) = new_figure(size=(7.2, 1.2 + 0.5 * len(models)))
    at = np.arange(len(models), dtype=float)[::-1]
    scores = np.array([m.score for m in models])
    axes.axvspan(0.0, 1.0, color=FLOOR, alpha=0.6, lw=0, zorder=0, label="floor")
    axes.barh(at, scores, 0.6, color=[CANDIDATE if m.effects else MODELLED for m in models])
    _values_beside(axes, at, scores, [score_text(float(s)) for s in scores])
    axes.set_yticks(at, [model_words(m) for m in models], fontsize=TICK_SIZE)
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0.0, 1.12 * max(float(scores.max()), 1.0))
    label(axes, "error on runs left out of the fit, in multiples of the floor", "")
    legend_below(figure, dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True)))
    return figure


def force_error_figure(models: Sequence[ComparedModel]) -> Figure:
    """Error of the endpoint force, mean over the contact runs, with every run as a dot."""
    figure, (axes,) = new_figure(size=(7.2, 1.2 + 0.5 * len(models)))
    at = np.arange(len(models), dtype=float)[::-1]
    errors = [1e3 * np.array([r.numbers["both"].value("rmse") for r in m.forces]) for m in models]
    means = np.array([float(np.mean(e)) for e in errors])
    axes.barh(at, means, 0.6, color=[CANDIDATE if m.effects else MODELLED for m in models], alpha=0.8)
    for y, one in zip(at, errors, strict=True):
        axes.plot(one, np.full(len(one), y), "o", color=MEASURED, ms=3, label="one run" if y == 0 else None)
    axes.set_yticks(at, [model_words(m) for m in models], fontsize=TICK_SIZE)
    axes.tick_params(axis="y", length=0)
    label(axes, "error of the endpoint force (mN, rms)", "")
    legend_below(figure, dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True)))
    return figure


def _values_beside(axes: Axes, at: Array, values: Array, texts: Sequence[str]) -> None:
    for y, value, text in zip(at, values, texts, strict=True):
        axes.annotate(text, (value, y), xytext=(5, 0), textcoords="offset points", va="center", fontsize=9)
