"""The figures that the thesis drew of its analysis, by name.

Each function takes a :class:`ThesisAnalysis` and returns a figure, or None where the session cannot give
it: no contact run, no static region, nothing that repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from matplotlib.figure import Figure

from fingerlab.report.force_figures import amplitude_bars, angle_figure, force_in_time, normalised_force
from fingerlab.report.onair_figures import (
    DELAY_TITLES,
    aligned,
    delays_by_run,
    filtering,
    lhs_and_tension,
    mean_r2,
    r2_of_regions,
    r2_with_delay,
    regions_of_speed,
    speeds_in_contact,
    tension_plane,
)
from fingerlab.signals.periods import Labels, recognise, speed_threshold
from fingerlab.thesis.analysis import ThesisAnalysis
from fingerlab.thesis.contact import FINAL, PredictionSpec
from fingerlab.thesis.traces import FOUR_REGIONS, THESIS_DELAYS, FitSpec


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


FIGURES: Mapping[str, Callable[[ThesisAnalysis], Figure | None]] = {
    "figure-4-01-filtering": filtering,
    "figure-4-02-regions": regions_of_speed,
    "figure-4-03-r2-four-regions": r2_of_regions,
    "figure-4-04-force-four-regions": force_of_four_regions,
    "figure-4-05-plane-extension": partial(tension_plane, region="extension"),
    "figure-4-06-plane-static": partial(tension_plane, region="static_1"),
    "figure-4-07-speeds-in-contact": speeds_in_contact,
    "figure-4-08-force-single-set": force_of_one_set,
    "figure-4-09-lhs-and-tension": lhs_and_tension,
    "figure-4-10-delays": delays_by_run,
    "figure-4-11-r2-cross-correlation": partial(r2_with_delay, delay="finddelay"),
    "figure-4-12-aligned-cross-correlation": partial(
        aligned, delay="finddelay", regions=("flexion", "extension")
    ),
    "figure-4-13-aligned-findsignal": partial(aligned, delay="findsignal", regions=("extension",)),
    "figure-4-14-r2-findsignal": partial(r2_with_delay, delay="findsignal"),
    "figure-4-15-r2-means": mean_r2,
    "figure-4-16-force-flexion-delays": partial(force_by_delay, region="flexion", threshold=30),
    "figure-4-17-force-extension-delays": partial(force_by_delay, region="extension", threshold=10),
    "figure-4-18-amplitudes": peaks_by_run,
    "figure-4-19-normalised-force": normalised,
    "figure-5-02-contact-angle": contact_angles,
}
"""File name without suffix -> function, in the order of the thesis."""


def thesis_figures(analysis: ThesisAnalysis) -> Mapping[str, Figure]:
    """Every figure that the session can give, by name."""
    drawn = {name: make(analysis) for name, make in FIGURES.items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}
