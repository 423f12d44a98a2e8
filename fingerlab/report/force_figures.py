"""Measured and modelled endpoint force: in time, by run, normalised, over contact angles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fingerlab.core.text import r2_text
from fingerlab.report.figure_style import (
    CANDIDATE,
    FLOOR,
    MEASURED,
    MODELLED,
    RESIDUAL,
    SECOND,
    THIRD,
    label,
    legend,
    legend_below,
    new_figure,
)
from fingerlab.report.onair_figures import region_patches, run_ticks, shade
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import Labels, normalise
from fingerlab.thesis.prediction import AngleStep, ForcePrediction
from fingerlab.thesis.traces import RunExcerpt

SERIES = ((MODELLED, "-"), (CANDIDATE, "--"), (RESIDUAL, "-."), (SECOND, ":"), (THIRD, "-"), (FLOOR, "--"))
"""Colour and line style of modelled forces, in order."""


def force_in_time(
    shown: RunExcerpt, forces: Mapping[str, Array], title: str, labels: Labels | None = None
) -> Figure:
    """Measured and modelled force of the shown stretch of a run; ``forces`` by legend entry, N.

    ``labels`` of the average period tint the regions.
    """
    figure, (axes,) = new_figure()
    if labels is not None:
        shade(axes, shown.time, labels, shown)
        legend_below(figure, region_patches())
        axes.margins(x=0.0)
    if shown.force is not None:
        axes.plot(shown.time, shown.force, color=MEASURED, lw=1.6, label="measured")
    for (name, force), (colour, style) in zip(forces.items(), _series(len(forces)), strict=True):
        axes.plot(shown.time, force, color=colour, ls=style, lw=1.3, label=name)
    label(axes, "time (s)", "endpoint force (N)", title)
    _keep_in_sight(axes, shown.force, list(forces.values()))
    legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _series(count: int) -> list[tuple[str, str]]:
    return [SERIES[i % len(SERIES)] for i in range(count)]


def _keep_in_sight(axes: Axes, measured: Array | None, modelled: Sequence[Array]) -> None:
    """Cut the axis where a model shoots far past what was measured; the text says how far."""
    if measured is None or not np.isfinite(measured).any():
        return
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    span = max(high - low, 1e-9)
    ends = [(float(np.nanmin(m)), float(np.nanmax(m))) for m in modelled if np.isfinite(m).any()]
    bottom = min([low, *(e[0] for e in ends)])
    top = max([high, *(e[1] for e in ends)])
    shown = max(bottom, low - 3 * span), min(top, high + 3 * span)
    margin = 0.05 * (shown[1] - shown[0])
    axes.set_ylim(shown[0] - margin, shown[1] + margin)
    if (bottom, top) != shown:
        axes.annotate(
            f"cut; modelled from {bottom:.3g} to {top:.3g} N",
            (0.01, 0.02),
            xycoords="axes fraction",
            fontsize=8,
        )


def amplitude_bars(names: Sequence[str], predictions: Sequence[ForcePrediction], title: str) -> Figure:
    """Modelled peak and what is missing to the measured one, stacked, by run (figure 4.18)."""
    figure, (axes,) = new_figure(size=(7.2, 3.8))
    modelled = np.array([p.peak_modelled for p in predictions])
    measured = np.array([p.peak_measured for p in predictions])
    at = np.arange(len(names))
    axes.bar(at, np.fmin(modelled, measured), 0.7, color=MODELLED, label="modelled")
    missing = np.clip(measured - modelled, 0, None)
    if (missing > 0).any():
        axes.bar(at, missing, 0.7, bottom=modelled, color=FLOOR, label="missing")
    too_much = np.clip(modelled - measured, 0, None)
    if (too_much > 0).any():
        axes.bar(at, too_much, 0.7, bottom=measured, color=RESIDUAL, label="too much")
    for x, y in zip(at, measured, strict=True):
        axes.plot([x - 0.4, x + 0.4], [y, y], color=MEASURED, lw=2, label="measured" if x == 0 else None)
    run_ticks(axes, tuple(names))
    axes.margins(y=0.05)
    share = 100.0 * float(np.nanmean(modelled / measured)) if np.isfinite(measured).any() else float("nan")
    label(axes, "run", "mean peak force (N)", f"{title}: {share:.1f} % of the measured peak")
    legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def normalised_force(prediction: ForcePrediction, title: str) -> Figure | None:
    """Both forces over the average period, each scaled to run from 0 to 1 (figure 4.19)."""
    if len(prediction.measured) == 0 or not np.isfinite(prediction.measured).any():
        return None
    figure, (axes,) = new_figure()
    time = np.arange(len(prediction.measured)) / len(prediction.measured) * prediction.period_s
    axes.plot(time, normalise(prediction.measured), color=MEASURED, lw=1.6, label="measured")
    axes.plot(time, normalise(prediction.modelled), color=MODELLED, ls="--", label="modelled")
    title += f", R2 = {r2_text(prediction.normalised_r2)}"
    label(axes, "time in the period (s)", "normalised force (–)", title)
    legend(axes)
    return figure


def angle_figure(prediction: ForcePrediction, sweep: Sequence[AngleStep], title: str) -> Figure:
    """Modelled force over the average period for each contact angle (figure 5.2)."""
    figure, (axes,) = new_figure()
    count = max(len(prediction.measured), len(sweep[0].modelled))
    time = np.arange(count) / count * prediction.period_s
    axes.plot(time, prediction.measured, color=MEASURED, lw=1.8, label="measured")
    for step, (colour, style) in zip(sweep, _series(len(sweep)), strict=True):
        words = (
            f"{step.angle_deg:g}°, R2 {r2_text(step.r2)}"
            if np.isfinite(step.r2)
            else f"{step.angle_deg:g}°, no lever"
        )
        axes.plot(time, step.modelled, color=colour, ls=style, lw=1.2, label=words)
    _keep_in_sight(axes, prediction.measured, [step.modelled for step in sweep])
    label(axes, "time in the period (s)", "endpoint force (N)", title)
    legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
