"""The figures that the thesis drew of its analysis, by name.

Each function takes a :class:`ThesisAnalysis` and returns a figure, or None where the session cannot give
it: no contact run, no static region, nothing that repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from matplotlib.figure import Figure

from fingerlab.report.contact_figures import (
    figure_4_4,
    figure_4_8,
    figure_4_16,
    figure_4_17,
    figure_4_18,
    figure_4_19,
    figure_5_2,
)
from fingerlab.report.onair_figures import (
    figure_4_1,
    figure_4_2,
    figure_4_3,
    figure_4_5,
    figure_4_6,
    figure_4_7,
    figure_4_9,
    figure_4_10,
    figure_4_11,
    figure_4_12,
    figure_4_13,
    figure_4_14,
    figure_4_15,
)
from fingerlab.thesis.analysis import ThesisAnalysis

FIGURES: Mapping[str, Callable[[ThesisAnalysis], Figure | None]] = {
    "figure-4-01-filtering": figure_4_1,
    "figure-4-02-regions": figure_4_2,
    "figure-4-03-r2-four-regions": figure_4_3,
    "figure-4-04-force-four-regions": figure_4_4,
    "figure-4-05-plane-extension": figure_4_5,
    "figure-4-06-plane-static": figure_4_6,
    "figure-4-07-speeds-in-contact": figure_4_7,
    "figure-4-08-force-single-set": figure_4_8,
    "figure-4-09-lhs-and-tension": figure_4_9,
    "figure-4-10-delays": figure_4_10,
    "figure-4-11-r2-cross-correlation": figure_4_11,
    "figure-4-12-aligned-cross-correlation": figure_4_12,
    "figure-4-13-aligned-findsignal": figure_4_13,
    "figure-4-14-r2-findsignal": figure_4_14,
    "figure-4-15-r2-means": figure_4_15,
    "figure-4-16-force-flexion-delays": figure_4_16,
    "figure-4-17-force-extension-delays": figure_4_17,
    "figure-4-18-amplitudes": figure_4_18,
    "figure-4-19-normalised-force": figure_4_19,
    "figure-5-02-contact-angle": figure_5_2,
}
"""File name without suffix -> function, in the order of the thesis."""


def thesis_figures(analysis: ThesisAnalysis) -> Mapping[str, Figure]:
    """Every figure that the session can give, by name."""
    drawn = {name: make(analysis) for name, make in FIGURES.items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}
