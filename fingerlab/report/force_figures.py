"""Figures of endpoint force, measured and modelled; and all that the thesis drew of its analysis, by name.

Each function of the thesis' figures takes a :class:`ThesisAnalysis` and returns a figure, or None where the
session cannot give it: no contact run, no static region, nothing that repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fingerlab.core.text import r2_text
from fingerlab.prediction.comparing import ComparedModel, ModelComparison
from fingerlab.prediction.predict import Curve, ExtendedPrediction, RunPrediction
from fingerlab.prediction.trial import Trial
from fingerlab.report.diagnosis_words import effect_title, in_sentence
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
    named_rows,
    new_figure,
    score_bars,
    titled,
)
from fingerlab.report.onair_figures import (
    DELAY_TITLES,
    aligned,
    delays_by_run,
    filtering,
    lhs_and_tension,
    mean_r2,
    r2_of_regions,
    r2_with_delay,
    region_patches,
    regions_of_speed,
    run_ticks,
    shade,
    speeds_in_contact,
    tension_plane,
)
from fingerlab.sessions.model import Array
from fingerlab.signals.periods import REGION_TITLES, Labels, normalise, recognise, speed_threshold
from fingerlab.thesis.analysis import ThesisAnalysis
from fingerlab.thesis.contact import FINAL, PredictionSpec, SessionPrediction
from fingerlab.thesis.prediction import AngleStep, ForcePrediction
from fingerlab.thesis.traces import FOUR_REGIONS, JOINT_TITLES, THESIS_DELAYS, FitSpec, RunExcerpt

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


STRETCH_S = 5.0
"""Time shown of a run, s."""
VARIANT_COLOURS = {"extended": CANDIDATE, "nominal": MODELLED}


def extended_figures(result: ExtendedPrediction, source: str = "") -> Mapping[str, Figure]:
    """Force with its interval, what is missed, peaks by run and normalised force, for each variant.

    Args:
        source: told above each, of these and of the other figures: session with its day, and model.
    """
    figures: dict[str, Figure] = {}
    figures["force"] = force_figure({name: runs[0] for name, runs in result.runs.items()})
    for name, runs in result.runs.items():
        title = f"{name} model"
        predictions = [run.numbers["both"].prediction for run in runs]
        figures[f"peaks-{name}"] = amplitude_bars([run.run for run in runs], predictions, title)
        normalised = normalised_force(predictions[0], f"{title}, run {runs[0].run}")
        if normalised is not None:
            figures[f"normalised-{name}"] = normalised
    return titled(figures, _titles(figures), source or result.session.name)


FORCE_TITLES = {
    "force-error": "Error of the endpoint force, by model",
    "force-trial": "Endpoint force of a feed-forward trial, wanted and measured",
    "force": "Endpoint force, measured and modelled",
    "peaks": "Mean peak of the endpoint force, by run",
    "normalised": "Endpoint force over the average period, each scaled from 0 to 1",
    "contact-angle": "Endpoint force by the angle of contact",
    "error": "Error over all equations, by model",
}
"""What a figure shows, by what its name begins with."""


def _titles(figures: Iterable[str]) -> dict[str, str]:
    return {
        name: next(title for start, title in FORCE_TITLES.items() if name.startswith(start))
        for name in figures
    }


def force_figure(runs: Mapping[str, RunPrediction]) -> Figure:
    """Measured and modelled force above, measured less modelled with the interval below.

    Args:
        runs: one run by each variant; the 90 % interval of the first is drawn.
    """
    banded = next(iter(runs))
    figure, (above, below) = new_figure(2, 1, sharex=True, height_ratios=[3, 2])
    for name, run in runs.items():
        curve = _start_of(run.curves[0])
        colour = VARIANT_COLOURS.get(name, MODELLED)
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
    legend_below(figure, above)
    return figure


def _start_of(curve: Curve) -> Curve:
    part = slice(0, int(np.searchsorted(curve.time, curve.time[0] + STRETCH_S, "right")))
    return Curve(curve.time[part], curve.measured[part], curve.modelled[part], curve.half_width[part])


def comparison_figures(result: ModelComparison, source: str) -> Mapping[str, Figure]:
    """Error in floors and, where there are contact runs, error of the force and its interval, by model."""
    figures = {"error": error_figure(result.models)}
    runs = [run for model in result.models for run in model.forces]
    if runs and all(np.isfinite(run.numbers["both"].value("rmse")) for run in runs):
        figures["force-error"] = force_error_figure(result.models)
    return titled(figures, _titles(figures), source)


def _axis_words(model: ComparedModel) -> str:
    """Name of the model and its effects, for an axis."""
    titles = [in_sentence(effect_title(name)) for name in model.effects]
    return f"{model.name}\n{', '.join(titles)}" if titles else model.name


def error_figure(models: Sequence[ComparedModel]) -> Figure:
    """Error over all equations in multiples of the floor, one bar a model."""
    colours = [CANDIDATE if m.effects else MODELLED for m in models]
    names = [_axis_words(m) for m in models]
    figure, axes = score_bars(names, [m.score for m in models], colours, (7.2, 1.2 + 0.5 * len(models)))
    label(axes, "error on runs left out of the fit, in multiples of the floor", "")
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
    named_rows(axes, [_axis_words(m) for m in models])
    label(axes, "error of the endpoint force (mN, rms)", "")
    legend_below(figure, axes)
    return figure


def trial_figures(trial: Trial, source: str) -> Mapping[str, Figure]:
    """One figure: the force above, the error below; every run thin, the mean of a model's runs thick."""
    figure, (above, below) = new_figure(2, 1, size=(7.2, 5.4))
    for model, colour in ((trial.nominal, MODELLED), (trial.found, CANDIDATE)):
        if model is None:
            continue
        time, wanted, measured = model.courses
        above.plot(time, measured.mean(axis=0), color=colour, lw=1.4, label=f"measured, {model.model} model")
        below.plot(time, 1e3 * (measured - wanted).T, color=colour, lw=0.5, alpha=0.5)
        below.plot(time, 1e3 * (measured.mean(axis=0) - wanted), color=colour, lw=1.4)
        above.plot(
            time, wanted, color=MEASURED, lw=1.0, ls="--", label="wanted" if colour is CANDIDATE else None
        )
    if trial.found is None:
        above.lines[-1].set_label("wanted")
    below.axhline(0.0, color=MEASURED, lw=0.6)
    label(above, "", "force (N)")
    label(below, "time (s)", "measured less wanted (mN)")
    legend_below(figure, above)
    return titled({"force-trial": figure}, FORCE_TITLES, source)


def prediction_figures(result: SessionPrediction, source: str) -> Mapping[str, Figure]:
    """Force in time, peaks by run and normalised force for each cable and joint, and the angle sweep."""
    figures: dict[str, Figure] = {}
    for cable, joint in dict.fromkeys((s.cable, s.joint) for s in result.sets.values()):
        names = [n for n, s in result.sets.items() if (s.cable, s.joint) == (cable, joint)]
        words = {REGION_TITLES.get(result.sets[n].name, result.sets[n].name): n for n in names}
        title = f"{JOINT_TITLES[joint]} equation, {cable} cable"
        forces = {word: result.example_forces[name] for word, name in words.items()}
        run_title = f"{title}, run {result.example.run}"
        figures[f"force-{joint}-{cable}-cable"] = force_in_time(result.example, forces, run_title)
        single = [n for n in names if not result.sets[n].switches]
        if not single:
            continue
        predictions = [run.predictions[single[0]] for run in result.runs]
        region = REGION_TITLES[result.sets[single[0]].name]
        figures[f"peaks-{joint}-{cable}-cable"] = amplitude_bars(
            [run.name for run in result.runs], predictions, f"{title}, {region}"
        )
        normalised = normalised_force(predictions[0], f"{title}, {region}, run {result.runs[0].name}")
        if normalised is not None:
            figures[f"normalised-{joint}-{cable}-cable"] = normalised
    if result.sweep and result.sweep_set is not None:
        swept = next(r for r in result.runs if len(r.predictions[result.sweep_set].measured))
        figures["contact-angle"] = angle_figure(
            swept.predictions[result.sweep_set],
            result.sweep,
            f"Contact force leaning towards the base, run {swept.name}",
        )
    return titled(figures, _titles(figures), source)


def force_of_four_regions(analysis: ThesisAnalysis) -> Figure | None:
    """Force with the parameters of four regions: the jumps."""
    labels = None
    shown = analysis.example_contact
    for run in analysis.contact:
        if shown is not None and run.name == shown.run and run.curves is not None:
            speed = run.curves.speed["pip"]
            labels = recognise(speed, speed_threshold(speed, FOUR_REGIONS.threshold))
    spec = PredictionSpec("pip", FOUR_REGIONS, None)
    return _forces(analysis, {"modelled": spec}, "Four regions", labels)


def force_of_one_set(analysis: ThesisAnalysis) -> Figure | None:
    """Force with one set of parameters throughout."""
    specs = {
        f"{region} parameters": PredictionSpec("pip", FOUR_REGIONS, region)
        for region in ("extension", "flexion")
    }
    return _forces(analysis, specs, "One set of parameters")


def force_by_delay(analysis: ThesisAnalysis, region: str, threshold: int) -> Figure | None:
    """Force with the parameters of one region, by delay method."""
    specs = {
        DELAY_TITLES[delay]: PredictionSpec("pip", FitSpec("flexion-extension", delay, threshold), region)
        for delay in THESIS_DELAYS
    }
    return _forces(analysis, specs, f"{region.capitalize()} parameters, threshold {threshold} %")


def _forces(
    analysis: ThesisAnalysis, specs: dict[str, PredictionSpec], title: str, labels: Labels | None = None
) -> Figure | None:
    shown = analysis.example_contact
    found = {
        name: analysis.example_forces[spec] for name, spec in specs.items() if spec in analysis.example_forces
    }
    if shown is None or not found:
        return None
    return force_in_time(shown, found, f"{title}, PIP equation, run {shown.run}", labels)


def peaks_by_run(analysis: ThesisAnalysis) -> Figure | None:
    """Modelled peak as a part of the measured one, by run."""
    runs = [run for run in analysis.contact if FINAL in run.predictions]
    if not runs:
        return None
    predictions = [run.predictions[FINAL] for run in runs]
    return amplitude_bars([run.name for run in runs], predictions, "Extension parameters, findsignal 10 %")


def normalised(analysis: ThesisAnalysis) -> Figure | None:
    """Normalised force of one run."""
    for run in analysis.contact:
        if FINAL in run.predictions:
            return normalised_force(run.predictions[FINAL], f"Extension, findsignal 10 %, run {run.name}")
    return None


def contact_angles(analysis: ThesisAnalysis) -> Figure | None:
    """Force for each contact angle."""
    for run in analysis.contact:
        prediction = run.predictions.get(FINAL)
        if prediction is not None and len(prediction.measured) and analysis.sweep:
            title = f"Contact force leaning towards the base, run {run.name}"
            return angle_figure(prediction, analysis.sweep, title)
    return None


FIGURES: Mapping[str, tuple[str, Callable[[ThesisAnalysis], Figure | None]]] = {
    "figure-4-01-filtering": ("Filtering of the MCP angle", filtering),
    "figure-4-02-regions": ("Joint speeds on air with their regions", regions_of_speed),
    "figure-4-03-r2-four-regions": ("R2 of the line in each of four regions", r2_of_regions),
    "figure-4-04-force-four-regions": (
        "Endpoint force with the parameters of four regions",
        force_of_four_regions,
    ),
    "figure-4-05-plane-extension": (
        "Joint torque against cable tension in extension",
        partial(tension_plane, region="extension"),
    ),
    "figure-4-06-plane-static": (
        "Joint torque against cable tension at standstill",
        partial(tension_plane, region="static_1"),
    ),
    "figure-4-07-speeds-in-contact": ("Joint speeds in contact", speeds_in_contact),
    "figure-4-08-force-single-set": (
        "Endpoint force with one set of parameters throughout",
        force_of_one_set,
    ),
    "figure-4-09-lhs-and-tension": ("Joint torque and cable tension over one period", lhs_and_tension),
    "figure-4-10-delays": ("Delay of each run by cross-correlation", delays_by_run),
    "figure-4-11-r2-cross-correlation": (
        "R2 with the delay by cross-correlation",
        partial(r2_with_delay, delay="finddelay"),
    ),
    "figure-4-12-aligned-cross-correlation": (
        "Torque and tension, shifted by cross-correlation",
        partial(aligned, delay="finddelay", regions=("flexion", "extension")),
    ),
    "figure-4-13-aligned-findsignal": (
        "Torque and tension, shifted by least squares (findsignal)",
        partial(aligned, delay="findsignal", regions=("extension",)),
    ),
    "figure-4-14-r2-findsignal": (
        "R2 with the delay by least squares (findsignal)",
        partial(r2_with_delay, delay="findsignal"),
    ),
    "figure-4-15-r2-means": ("Mean R2 by region, method of the delay and threshold", mean_r2),
    "figure-4-16-force-flexion-delays": (
        "Endpoint force with the parameters of flexion, by method of the delay",
        partial(force_by_delay, region="flexion", threshold=30),
    ),
    "figure-4-17-force-extension-delays": (
        "Endpoint force with the parameters of extension, by method of the delay",
        partial(force_by_delay, region="extension", threshold=10),
    ),
    "figure-4-18-amplitudes": (FORCE_TITLES["peaks"], peaks_by_run),
    "figure-4-19-normalised-force": (FORCE_TITLES["normalised"], normalised),
    "figure-5-02-contact-angle": (FORCE_TITLES["contact-angle"], contact_angles),
}
"""File name without suffix -> what it shows, and function, in the order of the thesis."""


def thesis_figures(analysis: ThesisAnalysis, source: str) -> Mapping[str, Figure]:
    """Every figure that the session can give, by name."""
    drawn = {name: make(analysis) for name, (_, make) in FIGURES.items()}
    titles = {name: title for name, (title, _) in FIGURES.items()}
    return titled({name: figure for name, figure in drawn.items() if figure is not None}, titles, source)
