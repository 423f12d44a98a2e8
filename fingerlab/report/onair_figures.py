"""Figures of the on-air part of the thesis' analysis: filtering, regions, regression, delays."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from fingerlab.core.text import r2_text
from fingerlab.report.figure_style import (
    CANDIDATE,
    FLOOR,
    JOINT_COLOURS,
    MEASURED,
    MODELLED,
    REGION_SHADES,
    RESIDUAL,
    SECOND,
    THIRD,
    label,
    legend,
    legend_below,
    new_figure,
)
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import (
    REGION_TITLES,
    REGIONS,
    THRESHOLDS_PERCENT,
    Labels,
    consecutive_mask,
    normalise,
    recognise,
    speed_threshold,
)
from fingerlab.thesis.analysis import ThesisAnalysis
from fingerlab.thesis.onair import AveragePeriod, CableFit, OnAirRun
from fingerlab.thesis.traces import (
    FOUR_REGIONS,
    JOINT_TITLES,
    JOINTS,
    THESIS_DELAYS,
    Delay,
    FitSpec,
    Joint,
    RunExcerpt,
)

DELAY_TITLES = {"none": "no delay", "finddelay": "cross-correlation", "findsignal": "findsignal"}
THRESHOLD_COLOURS = dict(zip(THRESHOLDS_PERCENT, (THIRD, MODELLED, MEASURED), strict=True))


def example_run(analysis: ThesisAnalysis) -> OnAirRun | None:
    """The periodic run that single-run figures show: the example's, else the first that repeats."""
    periodic = [run for run in analysis.on_air if run.curves is not None]
    named = [run for run in periodic if run.name == analysis.example_on_air.run]
    return next(iter(named or periodic), None)


def filtering(analysis: ThesisAnalysis) -> Figure:
    """Filtering of the MCP angle."""
    shown = analysis.example_on_air
    figure, (whole, close) = new_figure(1, 2, (7.2, 3.4), width_ratios=[2, 1])
    for axes, part in ((whole, slice(None)), (close, _top(shown))):
        axes.plot(shown.time[part], np.degrees(shown.raw_mcp[part]), color=RESIDUAL, lw=0.7, label="recorded")
        axes.plot(
            shown.time[part],
            np.degrees(shown.mcp[part]),
            color=MEASURED,
            lw=1.2,
            label="low-pass 5 Hz, 4th order",
        )
        label(axes, "time (s)", "MCP angle (°)")
    whole.set_title(f"MCP angle, run {shown.run}", fontsize=10.5, loc="left")
    close.set_title("the same, close up", fontsize=10.5, loc="left")
    close.xaxis.set_major_locator(MaxNLocator(3))
    legend_below(figure, whole)
    return figure


def _top(shown: RunExcerpt) -> slice:
    width = max(len(shown.mcp) // 20, 5)
    peak = int(np.argmax(shown.mcp))
    start = max(min(peak - width // 2, len(shown.mcp) - width), 0)
    return slice(start, start + width)


def regions_of_speed(analysis: ThesisAnalysis) -> Figure:
    """Regions on the joint speeds of an on-air run."""
    figure, axes = new_figure(2, 1, (7.2, 5.0), sharex=True)
    run, shown = example_run(analysis), analysis.example_on_air
    for joint, one in zip(JOINTS, axes, strict=True):
        speed = None if run is None or run.curves is None else run.curves.speed[joint]
        _speed_panel(one, shown, joint, speed, speed)
    axes[0].set_title(f"Regions at 10 % of the speed range, run {shown.run}", fontsize=10.5, loc="left")
    axes[1].set_xlabel("time (s)", fontsize=9)
    legend_below(figure, region_patches())
    return figure


def speeds_in_contact(analysis: ThesisAnalysis) -> Figure | None:
    """Speeds in contact between the thresholds of the on-air case."""
    shown, run = analysis.example_contact, example_run(analysis)
    if shown is None or run is None or run.curves is None:
        return None
    figure, axes = new_figure(2, 1, (7.2, 5.0), sharex=True)
    for joint, one in zip(JOINTS, axes, strict=True):
        _speed_panel(one, shown, joint, run.curves.speed[joint], None)
    within = [
        np.mean(np.abs(shown.speed[j]) <= speed_threshold(run.curves.speed[j], FOUR_REGIONS.threshold))
        for j in JOINTS
    ]
    title = f"Run {shown.run}: {100 * within[0]:.0f} % (MCP), {100 * within[1]:.0f} % (PIP) of samples "
    title += "within the on-air thresholds"
    axes[0].set_title(title, fontsize=10.5, loc="left")
    axes[1].set_xlabel("time (s)", fontsize=9)
    legend_below(figure, axes[0])
    return figure


def _speed_panel(
    axes: Axes, shown: RunExcerpt, joint: Joint, thresholds_of: Array | None, labels_of: Array | None
) -> None:
    if thresholds_of is not None:
        threshold = speed_threshold(thresholds_of, FOUR_REGIONS.threshold)
        for sign in (1, -1):
            axes.axhline(
                sign * np.degrees(threshold),
                color=RESIDUAL,
                lw=1,
                ls="--",
                label="thresholds" if sign == 1 else None,
            )
        if labels_of is not None:
            shade(axes, shown.time, recognise(labels_of, threshold), shown)
    axes.plot(shown.time, np.degrees(shown.speed[joint]), color=MEASURED, lw=1.2, label="joint speed")
    axes.set_ylabel(f"{JOINT_TITLES[joint]} speed (°/s)", fontsize=9)
    axes.margins(x=0.0)


def shade(axes: Axes, time: Array, labels: Labels, shown: RunExcerpt) -> None:
    """Tint a time axis by the regions of the average period; limits as thin yellow lines (figure 4.2)."""
    period = shown.period_samples or len(time)
    phase = (np.arange(len(time)) % period) / period
    sample = labels[np.minimum((phase * len(labels)).astype(int), len(labels) - 1)]
    limits = np.flatnonzero(np.diff(sample)) + 1
    edges = [0, *limits.tolist(), len(sample) - 1]
    for start, stop in itertools.pairwise(edges):
        axes.axvspan(time[start], time[stop], color=REGION_SHADES[REGIONS[sample[start]]], lw=0, zorder=0)
    for limit in limits:
        axes.axvline(time[limit], color="#F0E442", lw=0.8, zorder=0.5)


def region_patches() -> dict[str, Any]:
    """Legend handles of the region tints."""
    return {REGION_TITLES[region]: Patch(color=REGION_SHADES[region]) for region in REGIONS}


def r2_of_regions(analysis: ThesisAnalysis) -> Figure:
    """R2 of the four-region regression by run."""
    figure, axes = new_figure(2, 2, (7.2, 5.2), sharex=True, sharey=True)
    results = analysis.fits[FOUR_REGIONS].cables[analysis.cable]
    for region, one in zip(REGIONS, axes, strict=True):
        names = results["mcp", region].runs
        series = {JOINT_TITLES[j]: (results[j, region].r2.values, JOINT_COLOURS[j]) for j in JOINTS}
        grouped_bars(one, names, series)
        label(one, "", "R2 (–)", REGION_TITLES[region])
        one.set_ylim(0, 1.02)
    for one in axes[2:]:
        one.set_xlabel("run", fontsize=9)
    legend_below(figure, axes[0])
    return figure


def grouped_bars(
    axes: Axes, names: tuple[str, ...], series: dict[str, tuple[tuple[float, ...], str]]
) -> None:
    """Bars side by side for each run; a missing value leaves its place empty."""
    width = 0.8 / max(len(series), 1)
    at = np.arange(len(names), dtype=float)
    for number, (name, (values, colour)) in enumerate(series.items()):
        axes.bar(at + (number - (len(series) - 1) / 2) * width, values, width, color=colour, label=name)
    run_ticks(axes, names)


def run_ticks(axes: Axes, names: tuple[str, ...]) -> None:
    """Run names on the x axis, thinned where there are many."""
    step = max(len(names) // 12, 1)
    axes.set_xticks(np.arange(0, len(names), step), [name.lstrip("0") or name for name in names[::step]])


def tension_plane(analysis: ThesisAnalysis, region: str) -> Figure | None:
    """Tension-LHS plane of a region."""
    shown = analysis.example_on_air
    if ("pip", region) not in shown.cloud:
        return None
    tension, lhs = shown.cloud["pip", region]
    figure, (axes,) = new_figure(size=(5.2, 4.2))
    axes.plot(tension, 1e3 * lhs, ".", ms=2, color=MEASURED, alpha=0.5, label="samples", rasterized=True)
    run = next(r for r in analysis.on_air if r.name == shown.run)
    line = run.fits[FOUR_REGIONS]["pip", region].line if FOUR_REGIONS in run.fits else None
    title = f"PIP, {REGION_TITLES[region]}, run {shown.run}"
    if line is not None:
        ends = np.array([tension.min(), tension.max()])
        axes.plot(
            ends, 1e3 * (line.slope * ends + line.intercept), color=MODELLED, lw=1.5, label="regression"
        )
        title += f", R2 = {r2_text(line.r2)}"
    label(axes, "cable tension (N)", "LHS of the PIP equation (mN m)", title)
    legend(axes)
    return figure


def lhs_and_tension(analysis: ThesisAnalysis) -> Figure | None:
    """Normalised LHS and tension over one period."""
    run = example_run(analysis)
    if run is None or run.curves is None:
        return None
    figure, (axes,) = new_figure()
    time = _phase_time(run.curves)
    axes.plot(time, normalise(run.curves.lhs["pip"]), color=MEASURED, label="LHS of the PIP equation")
    axes.plot(time, _tension(run), color=MODELLED, ls="--", label=tension_words(run))
    label(axes, "time in the period (s)", "normalised (–)", f"Average period, run {run.name}")
    legend(axes)
    return figure


def tension_words(run: OnAirRun) -> str:
    """Tension with its cable's sign, so that it rises where the LHS rises."""
    return "tension" if run.cable_sign > 0 else "tension, sign of the extension cable (−T)"


def _tension(run: OnAirRun) -> Array:
    assert run.curves is not None
    return normalise(run.cable_sign * run.curves.tension)


def _phase_time(curves: AveragePeriod) -> Array:
    return np.arange(len(curves.tension)) / len(curves.tension) * curves.period_s


def delays_by_run(analysis: ThesisAnalysis) -> Figure | None:
    """Delay of each run by cross-correlation."""
    runs = [run for run in analysis.on_air if "pip" in run.delays_s]
    if not runs:
        return None
    figure, (axes,) = new_figure(size=(7.2, 3.6))
    names = tuple(run.name for run in runs)
    values = [1e3 * run.delays_s["pip"]["finddelay"] for run in runs]
    axes.bar(np.arange(len(names)), values, 0.7, color=MODELLED, label="finddelay")
    round_period = [1e3 * run.delays_s["pip"]["xcorr"] for run in runs]
    axes.plot(np.arange(len(names)), round_period, "D", ms=4, color=RESIDUAL, label="round the period")
    quantity = analysis.quantity("delay_finddelay")
    axes.axhline(quantity.value, color=MEASURED, lw=1, ls="--")
    run_ticks(axes, names)
    spread = f" ± {quantity.deviation:.1f}" if np.isfinite(quantity.deviation) else ""
    label(axes, "run", "delay (ms)", f"LHS after tension: {quantity.value:.1f}{spread} ms")
    legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _cable_fit(analysis: ThesisAnalysis, delay: Delay, threshold: int) -> CableFit | None:
    return analysis.fits[FitSpec("flexion-extension", delay, threshold)].cables.get(analysis.cable)


def r2_with_delay(analysis: ThesisAnalysis, delay: Delay) -> Figure | None:
    """R2 of flexion and extension by run and threshold, with the delay from one method."""
    fits = {t: fit for t in THRESHOLDS_PERCENT if (fit := _cable_fit(analysis, delay, t)) is not None}
    if not fits:
        return None
    figure, axes = new_figure(2, 1, (7.2, 5.2), sharex=True)
    for region, one in zip(("flexion", "extension"), axes, strict=True):
        found = {t: fit["pip", region] for t, fit in fits.items()}
        names = next(iter(found.values())).runs
        grouped_bars(
            one, names, {f"{t} %": (result.r2.values, THRESHOLD_COLOURS[t]) for t, result in found.items()}
        )
        one.set_ylim(0, 1.02)
        label(one, "", "R2 (–)", f"PIP, {region}, delay by {DELAY_TITLES[delay]}")
    axes[-1].set_xlabel("run", fontsize=9)
    legend_below(figure, axes[0])
    return figure


def aligned(analysis: ThesisAnalysis, delay: Delay, regions: tuple[str, ...]) -> Figure | None:
    """LHS and tension of the average period, shifted by the delay of the last of the regions."""
    run = example_run(analysis)
    spec = FitSpec("flexion-extension", delay, 10)
    if run is None or run.curves is None or spec not in run.fits:
        return None
    shift = run.fits[spec]["pip", regions[-1]].delay_s
    if not np.isfinite(shift):
        return None
    figure, (axes,) = new_figure()
    time, lhs, tension = _phase_time(run.curves), normalise(run.curves.lhs["pip"]), _tension(run)
    moved = np.interp((time - shift) % run.curves.period_s, time, tension, period=run.curves.period_s)
    axes.plot(time, lhs, color=MEASURED, lw=1, label="LHS of the PIP equation")
    speed = run.curves.speed["pip"]
    labels = recognise(speed, speed_threshold(speed, spec.threshold))
    colours = {"flexion": CANDIDATE, "extension": "#7BD3B9"}
    for region in regions:
        mask = consecutive_mask(labels, region)  # type: ignore[arg-type]
        if mask is not None:
            axes.plot(time, np.where(mask, lhs, np.nan), color=colours[region], lw=4, label=f"LHS, {region}")
    axes.plot(time, tension, color=MODELLED, ls=":", lw=1.2, label=tension_words(run))
    axes.plot(time, moved, color=RESIDUAL, ls="--", label=f"the same, {1e3 * shift:.0f} ms later")
    title = f"Delay by {DELAY_TITLES[delay]}, run {run.name}"
    label(axes, "time in the period (s)", "normalised (–)", title)
    legend(axes)
    return figure


def mean_r2(analysis: ThesisAnalysis) -> Figure | None:
    """Average R2 by region, delay method and threshold."""
    figure, axes = new_figure(1, 2, (7.2, 3.6), sharey=True)
    at = np.arange(len(THESIS_DELAYS), dtype=float)
    for region, one in zip(("flexion", "extension"), axes, strict=True):
        for number, threshold in enumerate(THRESHOLDS_PERCENT):
            fits = [_cable_fit(analysis, delay, threshold) for delay in THESIS_DELAYS]
            spreads = [None if fit is None else fit["pip", region].r2 for fit in fits]
            one.bar(
                at + (number - 1) * 0.27,
                [np.nan if s is None else s.mean for s in spreads],
                0.27,
                yerr=[0.0 if s is None or not np.isfinite(s.deviation) else s.deviation for s in spreads],
                error_kw={"lw": 1, "ecolor": FLOOR if threshold == 30 else SECOND},
                color=THRESHOLD_COLOURS[threshold],
                label=f"{threshold} %",
            )
        one.set_xticks(at, [DELAY_TITLES[d] for d in THESIS_DELAYS])
        label(one, "", "mean R2 over runs (–)", f"PIP, {region}")
        one.set_ylim(0, 1.05)
        one.yaxis.set_major_locator(MaxNLocator(6))
    legend_below(figure, axes[0])
    return figure
