"""The report's part on prediction: endpoint force with the model that the diagnosis ends at."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from fingerlab.core.errors import UserError
from fingerlab.core.text import mean_and_deviation, plus_minus, r2_text, with_minus
from fingerlab.prediction import fit_extended, predict_extended
from fingerlab.prediction.extended import EQUATION_WORDS, EQUATIONS, ExtendedModel
from fingerlab.prediction.force import contact_runs
from fingerlab.prediction.predict import ExtendedPrediction, RunPrediction
from fingerlab.report.extended_figures import force_figure
from fingerlab.sessions.model import Session
from fingerlab.thesis.onair import Spread

Progress = Callable[[float, str], None]
VARIANT_TITLES = {"nominal": "Nominal model", "extended": "With the effects"}


@dataclass(frozen=True)
class Prediction:
    """What the template shows of it.

    Attributes:
        session: file name. note: a sentence where there is nothing to predict, else empty.
        held_out: whether every run was predicted by a fit that has not seen it.
        rows: model, equation, R2, error, peak of the load cell and of the model, half interval, share inside.
        figure: one run's force with its interval; None where there is none.
        run: name of the run drawn.
    """

    session: str
    note: str = ""
    held_out: bool = False
    rows: tuple[tuple[str, ...], ...] = ()
    figure: Figure | None = None
    run: str = ""


def fitted_model(
    sessions: Sequence[Session], effects: Sequence[str], progress: Progress
) -> ExtendedModel | None:
    """The model with these effects, fitted to all runs; None where these runs do not allow it.

    Args:
        progress: called with the share done and what is being done; may raise ``Cancelled``.
    """
    try:
        return fit_extended(sessions, effects, progress)
    except UserError:
        return None


def predict_force(sessions: Sequence[Session], model: ExtendedModel | None) -> Prediction | None:
    """The force of the first session's contact runs; None where there is no contact run anywhere."""
    for session in sessions:
        if not contact_runs(session):
            continue
        name = session.path.name
        if model is None:
            return Prediction(name, note="The model could not be fitted to these runs as a whole.")
        try:
            found = predict_extended(session, model, "the model of this report")
        except UserError as error:
            return Prediction(name, note=str(error))
        return _section(name, found)
    return None


def _section(name: str, found: ExtendedPrediction) -> Prediction:
    runs = next(iter(found.runs.values()))
    return Prediction(
        name,
        held_out=all(run.held_out for run in runs),
        rows=tuple(_rows(found)),
        figure=force_figure({title: kept[0] for title, kept in found.runs.items()}, next(iter(found.runs))),
        run=runs[0].run,
    )


def _rows(found: ExtendedPrediction) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name, runs in reversed(list(found.runs.items())):
        for equation in EQUATIONS:
            both = equation == "both"
            rows.append(
                (
                    VARIANT_TITLES.get(name, name),
                    EQUATION_WORDS[equation],
                    _r2(runs, equation),
                    _mean(runs, equation, "rmse", 1e3, 1),
                    _mean(runs, equation, "peak_measured", 1.0, 2),
                    _mean(runs, equation, "peak_modelled", 1.0, 2),
                    _over([r.half_width for r in runs], 1e3, "± {:.1f}") if both else "",
                    _over([r.coverage for r in runs], 100.0, "{:.0f} %") if both else "",
                )
            )
    return rows


def _r2(runs: Sequence[RunPrediction], equation: str) -> str:
    """With as many nines as tell it from 1, and the deviation over the runs."""
    spread = Spread(tuple(run.numbers[equation].value("r2") for run in runs))  # type: ignore[index]
    if not spread.deviation > 0:
        return r2_text(spread.mean)
    return with_minus(plus_minus(spread.mean, spread.deviation))


def _mean(runs: Sequence[RunPrediction], equation: str, key: str, factor: float, digits: int) -> str:
    spread = Spread(tuple(run.numbers[equation].value(key) for run in runs))  # type: ignore[index]
    return with_minus(mean_and_deviation(factor * spread.mean, factor * spread.deviation, digits))


def _over(values: Sequence[float], factor: float, pattern: str) -> str:
    mean = Spread(tuple(values)).mean
    return pattern.format(factor * mean) if math.isfinite(mean) else "–"
