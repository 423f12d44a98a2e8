"""What a feed-forward trial shows: sentences for terminal and window, and its figure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from fingerlab.core.text import number
from fingerlab.prediction.trial import CAUSES, ModelForce, Trial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MENTIONED = 0.1
"""Share of the squared error from which on a cause is named (assumed)."""
WHOLE = 0.99
"""Share of a found torque from which on it was sent whole, for words."""


def trial_sentence(trial: Trial) -> str:
    """By how much the error fell; of one model alone its error."""
    if trial.nominal is None or trial.found is None:
        one = trial.found or trial.nominal
        assert one is not None
        return (
            f"With the {one.model} model the force missed what was wanted by {_mn(one.rms)} (rms). By how "
            "much a found model lowers it takes runs of both models: record with --ab."
        )
    before, after = _mn(trial.nominal.rms), _mn(trial.found.rms)
    interval = _interval(trial)
    if trial.low > 1.0:
        return f"The force error rose from {before} to {after}{interval}: the nominal model does better here."
    if math.isfinite(trial.high) and trial.high >= 1.0:
        return f"The force error went from {before} to {after}{interval}: no difference can be told."
    return f"The force error fell from {before} to {after}, to {100 * trial.ratio:.0f} %{interval}."


def result_sentences(trial: Trial) -> tuple[str, ...]:
    """All that a trial shows: how far the error fell, what was predicted, and what each model leaves."""
    models = [one for one in (trial.nominal, trial.found) if one is not None]
    sentences = (
        trial_sentence(trial), share_sentence(trial), predicted_sentence(trial), *map(rest_sentence, models)
    )  # fmt: skip
    return tuple(sentence for sentence in sentences if sentence)


def trial_row(model: ModelForce) -> tuple[str, ...]:
    """One model in a table: name, runs, error, predicted, largest, run to run (mN), then each cause (%)."""
    predicted = number(1e3 * model.predicted_rms, 1) if math.isfinite(model.predicted_rms) else "–"
    repeats = number(1e3 * model.repeatability, 1) if len(model.runs) > 1 else "–"
    error, peak = (number(1e3 * value, 1) for value in (model.rms, model.peak))
    causes = (number(100.0 * model.parts[cause], 0) for cause in CAUSES)
    return model.model, str(len(model.runs)), error, predicted, peak, repeats, *causes


def _interval(trial: Trial) -> str:
    if not math.isfinite(trial.low):
        return " (no interval: it takes two pairs of runs or more)"
    return f" (90 % interval {100 * trial.low:.0f} to {100 * trial.high:.0f} %)"


def predicted_sentence(trial: Trial) -> str:
    """What the found model had foretold of it; empty where it foretold nothing."""
    if not math.isfinite(trial.predicted_ratio) or trial.nominal is None or trial.found is None:
        return ""
    return (
        f"The found model had foretold {_mn(trial.nominal.predicted_rms)} with the nominal torque and "
        f"{_mn(trial.found.predicted_rms)} with its own: {100 * trial.predicted_ratio:.0f} %."
    )


def share_sentence(trial: Trial) -> str:
    """How far the found torque was sent; empty where it was sent whole."""
    share = trial.found_share
    if not math.isfinite(share) or share > WHOLE:
        return ""
    if share == 0.0:
        return (
            "In practice the found torque, but for less than a tenth, missed no less than the nominal one, "
            "which was therefore sent for both."
        )
    return f"Practice bore out {100 * share:.0f} % of the way from the nominal torque to the found one."


def rest_sentence(model: ModelForce) -> str:
    """What is left of one model's error, by cause; the largest first."""
    named = sorted(model.parts.items(), key=lambda one: -one[1])
    causes = [f"{100 * share:.0f} % {CAUSES[cause]}" for cause, share in named if share >= MENTIONED]
    return f"Of what the {model.model} model leaves ({_mn(model.rms)}, squared): {', '.join(causes)}."


def _mn(newtons: float) -> str:
    return f"{number(1e3 * newtons, 1)} mN"


def trial_figures(trial: Trial) -> Mapping[str, Figure]:
    """One figure: the force above, the error below; every run thin, the mean of a model's runs thick."""
    from fingerlab.report.figure_style import CANDIDATE, MEASURED, MODELLED, label, legend_below, new_figure

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
    return {"force-trial": figure}
