"""What a feed-forward trial shows, in sentences for terminal and window."""

from __future__ import annotations

import math

from fingerlab.core.text import number
from fingerlab.prediction.trial import CAUSES, ModelForce, Trial

MENTIONED = 0.1
"""Share of the squared error from which on a cause is named (assumed)."""


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


def _interval(trial: Trial) -> str:
    if not math.isfinite(trial.low):
        return " (no interval: it takes two pairs of runs or more)"
    return f" (90 % interval {100 * trial.low:.0f} to {100 * trial.high:.0f} %)"


def foretold_sentence(trial: Trial) -> str:
    """What the found model had foretold of it; empty where it foretold nothing."""
    if not math.isfinite(trial.foretold_ratio) or trial.nominal is None or trial.found is None:
        return ""
    return (
        f"The found model had foretold {_mn(trial.nominal.foretold_rms)} with the nominal torque and "
        f"{_mn(trial.found.foretold_rms)} with its own: {100 * trial.foretold_ratio:.0f} %."
    )


def rest_sentence(model: ModelForce) -> str:
    """What is left of one model's error, by cause; the largest first."""
    named = sorted(model.parts.items(), key=lambda one: -one[1])
    told = [f"{100 * share:.0f} % {CAUSES[cause]}" for cause, share in named if share >= MENTIONED]
    return f"Of what the {model.model} model leaves ({_mn(model.rms)}, squared): {', '.join(told)}."


def _mn(newtons: float) -> str:
    return f"{number(1e3 * newtons, 1)} mN"
