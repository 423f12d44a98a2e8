"""The figure of a feed-forward trial: wanted and measured force, and the error of each model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from fingerlab.prediction.trial import Trial
from fingerlab.report.figure_style import CANDIDATE, MEASURED, MODELLED, label, legend_below, new_figure


def trial_figures(trial: Trial) -> Mapping[str, Figure]:
    """One figure: the force above, the error below; every run thin, the mean of a model's runs thick."""
    figure, (above, below) = new_figure(2, 1, size=(7.2, 5.4))

    for model, colour in ((trial.nominal, MODELLED), (trial.found, CANDIDATE)):
        if model is None:
            continue
        length = min(len(run.error.time) for run in model.runs)
        time, wanted = model.runs[0].error.time[:length], model.runs[0].error.wanted[:length]
        measured = np.stack([run.error.measured[:length] for run in model.runs])
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
    return {"force-trial": figure}
