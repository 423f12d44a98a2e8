"""Figures of ``predict``: a model file's parameters against the load cell."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from fingerlab.report.force_figures import amplitude_bars, angle_figure, force_in_time, normalised_force
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.contact import SessionPrediction
from fingerlab.thesis.traces import JOINT_TITLES


def prediction_figures(result: SessionPrediction) -> Mapping[str, Figure]:
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
    return figures
