"""Figures of the contact part of the thesis' analysis."""

from __future__ import annotations

from matplotlib.figure import Figure

from fingerlab.report.force_figures import amplitude_bars, angle_figure, force_in_time, normalised_force
from fingerlab.report.onair_figures import DELAY_TITLES
from fingerlab.signals.periods import Labels, recognise, speed_threshold
from fingerlab.thesis.analysis import ThesisAnalysis
from fingerlab.thesis.contact import FINAL, PredictionSpec
from fingerlab.thesis.traces import FOUR_REGIONS, THESIS_DELAYS, FitSpec


def figure_4_4(analysis: ThesisAnalysis) -> Figure | None:
    """Force with the parameters of four regions: the jumps."""
    labels = None
    shown = analysis.example_contact
    for run in analysis.contact:
        if shown is not None and run.name == shown.run and run.curves is not None:
            speed = run.curves.speed["pip"]
            labels = recognise(speed, speed_threshold(speed, FOUR_REGIONS.threshold))
    spec = PredictionSpec("pip", FOUR_REGIONS, None)
    return _forces(analysis, {"modelled": spec}, "Four regions", labels)


def figure_4_8(analysis: ThesisAnalysis) -> Figure | None:
    """Force with one set of parameters throughout."""
    specs = {
        f"{region} parameters": PredictionSpec("pip", FOUR_REGIONS, region)
        for region in ("extension", "flexion")
    }
    return _forces(analysis, specs, "One set of parameters")


def figure_4_16(analysis: ThesisAnalysis) -> Figure | None:
    """Flexion parameters at 30 %, by delay method."""
    return _delays(analysis, "flexion", 30)


def figure_4_17(analysis: ThesisAnalysis) -> Figure | None:
    """Extension parameters at 10 %, by delay method."""
    return _delays(analysis, "extension", 10)


def _delays(analysis: ThesisAnalysis, region: str, threshold: int) -> Figure | None:
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


def figure_4_18(analysis: ThesisAnalysis) -> Figure | None:
    """Modelled peak as a part of the measured one, by run."""
    runs = [run for run in analysis.contact if FINAL in run.predictions]
    if not runs:
        return None
    predictions = [run.predictions[FINAL] for run in runs]
    return amplitude_bars([run.name for run in runs], predictions, "Extension parameters, findsignal 10 %")


def figure_4_19(analysis: ThesisAnalysis) -> Figure | None:
    """Normalised force of one run."""
    for run in analysis.contact:
        if FINAL in run.predictions:
            return normalised_force(run.predictions[FINAL], f"Extension, findsignal 10 %, run {run.name}")
    return None


def figure_5_2(analysis: ThesisAnalysis) -> Figure | None:
    """Force for each contact angle."""
    for run in analysis.contact:
        prediction = run.predictions.get(FINAL)
        if prediction is not None and len(prediction.measured) and analysis.sweep:
            title = f"Contact force leaning towards the base, run {run.name}"
            return angle_figure(prediction, analysis.sweep, title)
    return None
