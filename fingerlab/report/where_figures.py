"""Where a model fails, drawn: the residual of one equation over speed, angle, tension, phase, run."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fingerlab.diagnosis.answer.results import Comparison
from fingerlab.diagnosis.answer.where import COORDINATES, Profile, profile
from fingerlab.report.figure_style import FLOOR, RESIDUAL, label, legend_below, new_figure
from fingerlab.report.where_words import axis_title, coordinate_unit, residual_unit, worst_words

COLUMNS = 2
ROW_INCHES = 2.4
BAR_SHARE = 0.88
WORDS_SIZE, WORDS_WIDE = 7.5, 44
"""Points, and characters that fit over one picture."""


def where_figure(comparisons: Sequence[Comparison], equation: str) -> Figure | None:
    """One picture for each coordinate that the runs tell; None where they tell none."""
    made = [profile(comparisons, equation, name) for name in COORDINATES]
    found = [one for one in made if one is not None]
    if not found:
        return None
    rows = -(-len(found) // COLUMNS)
    figure, axes = new_figure(rows, COLUMNS, (7.2, 0.5 + ROW_INCHES * rows))
    for one, place in zip(found, axes, strict=False):
        _draw(place, one)
    for place in axes[len(found) :]:
        place.set_visible(False)
    handles, names = axes[0].get_legend_handles_labels()
    legend_below(figure, dict(zip(names, handles, strict=True)))
    return figure


def _draw(axes: Axes, found: Profile) -> None:
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
