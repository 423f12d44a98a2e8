"""What the report tells beside the diagnosis, worked out before any of it is written.

The thesis' analysis or the motor-bench equation, the endpoint force that the model predicts, its equations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import (
    amount,
    estimate_text,
    in_words,
    mean_and_deviation,
    plus_minus,
    r2_text,
    with_minus,
)
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.file import ParameterEstimate
from fingerlab.prediction import fit_extended, predict_extended
from fingerlab.prediction.extended import EQUATION_WORDS, EQUATIONS, Equation, ExtendedModel
from fingerlab.prediction.predict import RunPrediction, interval_over, spread_over
from fingerlab.report import diagnosis_words as words
from fingerlab.report.equation import FinalEquation, final_equation
from fingerlab.report.figure_style import LABEL_SIZE
from fingerlab.report.force_figures import FIGURES, force_figure
from fingerlab.report.line_units import LineUnits
from fingerlab.sessions.model import Session
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.analysis import PublishedQuantity, ThesisAnalysis, thesis_analysis
from fingerlab.thesis.fitting import MotorBenchFit, fit_motor_bench, motor_bench_runs
from fingerlab.thesis.traces import FOUR_REGIONS, JOINT_TITLES

CAPTIONS: Mapping[str, str] = {
    "figure-4-02-regions": "Joint speed of a run on air and the regions that it falls into: flexion, "
    "extension, and the two standstills between them.",
    "figure-4-05-plane-extension": "Joint torque (LHS of the PIP equation) against cable tension while the "
    "finger extends. The slope of the line is the moment arm, its intercept the friction loss.",
    "figure-4-03-r2-four-regions": "How well a straight line of torque on tension fits in each region, by "
    "run. In the standstills neither changes much, so that little is left to fit.",
    "figure-4-08-force-single-set": "Endpoint force in contact: what the load cell read, and what the PIP "
    "equation predicts from the motor with one set of parameters throughout.",
    "figure-4-18-amplitudes": "Mean peak of the force in each contact run, modelled beside measured.",
    "figure-4-19-normalised-force": "The same force over one average period, both scaled to run from 0 to 1: "
    "the shape, whatever the size.",
    "figure-5-02-contact-angle": "The force that the PIP equation predicts if the contact force leans away "
    "from the load cell's axis.",
}
"""The figures that the page takes over from the thesis, in order, each with a caption."""

FIGURE_WIDTH, LONGEST_TITLE = 5.2, 48  # inches; letters that fit it


@dataclass(frozen=True)
class Analysis:
    """What the template shows of it.

    Attributes:
        session: file name. note: a sentence where the analysis was not possible, else empty.
        cable: the cable whose runs gave the moment arms; empty on a motor bench.
        fits: joint, region, moment arm, friction loss, R2. bench: parameter and value with its origin.
        by_run: run and R2 of the motor-bench equation.
        figures: name, figure and caption.
        numbers: quantity, ours, published; both with unit.
    """

    session: str
    note: str = ""
    cable: str = ""
    fits: tuple[tuple[str, str, str, str, str], ...] = ()
    bench: tuple[tuple[str, str], ...] = ()
    by_run: tuple[tuple[str, str], ...] = ()
    figures: tuple[tuple[str, Figure, str], ...] = ()
    numbers: tuple[tuple[str, str, str], ...] = ()


def analyse(sessions: Sequence[Session], progress: Progress) -> Analysis | None:
    """The analysis of the first session that allows one; None where none has suitable runs.

    Args:
        progress: called with the share done and what is being done; may raise ``Cancelled``.
    """
    for session in sessions:
        if any(run.phase == "on_air" and run.cable_sign for run in session.runs):
            return _of_finger(session, progress)
    for session in sessions:
        if motor_bench_runs(session):
            return _of_motor_bench(session, progress)
    return None


def _of_finger(session: Session, progress: Progress) -> Analysis:
    try:
        analysis = thesis_analysis(session, progress)
    except UserError as error:
        return Analysis(session.path.name, note=str(error))
    return Analysis(
        session.path.name,
        cable=analysis.cable,
        fits=_fit_rows(analysis),
        figures=_figures(analysis),
        numbers=tuple(_number_row(q) for q in analysis.quantities if math.isfinite(q.value)),
    )


def _fit_rows(analysis: ThesisAnalysis) -> tuple[tuple[str, str, str, str, str], ...]:
    rows = []
    for (joint, region), result in analysis.fits[FOUR_REGIONS].cables[analysis.cable].items():
        found = result.pooled
        values = (
            ("not found", "–", "–")
            if found is None
            else (with_minus(in_words(found.moment_arm)), with_minus(in_words(found.loss)), r2_text(found.r2))
        )
        rows.append((JOINT_TITLES[joint], REGION_TITLES[region], *values))
    return tuple(rows)


def _figures(analysis: ThesisAnalysis) -> tuple[tuple[str, Figure, str], ...]:
    drawn = ((name, FIGURES[name][1](analysis), caption) for name, caption in CAPTIONS.items())
    return tuple((name, _smaller(figure), caption) for name, figure, caption in drawn if figure is not None)


def _smaller(figure: Figure) -> Figure:
    """Drawn for half the page's width, where the thesis' figures have the whole: letters keep their size."""
    for axes in figure.axes:
        title = axes.get_title(loc="left")
        if len(title) > LONGEST_TITLE:
            axes.set_title(title.replace(": ", ":\n"), loc="left", fontsize=LABEL_SIZE)
    width, height = figure.get_size_inches()
    figure.set_size_inches(min(width, FIGURE_WIDTH), height * min(1.0, FIGURE_WIDTH / width) ** 0.5)
    return figure


def _number_row(quantity: PublishedQuantity) -> tuple[str, str, str]:
    unit = "" if quantity.unit == "1" else f" {quantity.unit}"
    ours = plus_minus(quantity.value, quantity.deviation)
    if quantity.unit == "1" and quantity.value < -10:
        ours = "below -10"
    return quantity.title, with_minus(ours + unit), with_minus(_printed(quantity, unit))


def _printed(quantity: PublishedQuantity, unit: str) -> str:
    """The published number as the thesis printed it: two decimals at least where it is below 1.

    Its deviation has as many decimals as the number itself.
    """
    if quantity.published is None:
        return "–"
    numbers = [v for v in (quantity.published, quantity.published_deviation) if v is not None]
    least = 2 if abs(quantity.published) < 1 else 0
    decimals = max(least, *(len(f"{v:g}".partition(".")[2]) for v in numbers))
    return " ± ".join(f"{v:.{decimals}f}" for v in numbers) + unit


def _of_motor_bench(session: Session, progress: Progress) -> Analysis:
    try:
        fit = fit_motor_bench(session, progress)
    except UserError as error:
        return Analysis(session.path.name, note=str(error))
    return Analysis(
        session.path.name,
        bench=_bench_rows(fit, session.rig.line_radius),
        by_run=tuple((run, r2_text(r2)) for run, r2 in fit.run_r2.items()),
    )


def _bench_rows(fit: MotorBenchFit, radius: float) -> tuple[tuple[str, str], ...]:
    titles = {"inertia": "Inertia J", "gain": "Gain on the load", "offset": "Offset"}
    line = LineUnits(radius)
    titles = {name: line.title(title) for name, title in titles.items()}
    rows = [
        (
            titles[name],
            estimate_text(line.estimate(value)) + (", fixed by the rig" if name in fit.fixed else ""),
        )
        for name, value in fit.parameters.items()
    ]
    error = amount(fit.rmse / radius, "N") if radius else f"{1e3 * fit.rmse:.1f} mN m"
    rows += [(titles[name], "the recordings cannot show it") for name in fit.absent]
    return (*rows, ("R2 over all runs", r2_text(fit.r2)), ("Error", error))


VARIANT_TITLES = {"nominal": "Nominal model", "extended": "Extended model"}


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
    sessions: Sequence[Session],
    effects: Sequence[str],
    progress: Progress,
    held: Mapping[str, float] | None = None,
) -> ExtendedModel | None:
    """The model with these effects, fitted to all runs; None where these runs do not allow it.

    Args:
        progress: called with the share done and what is being done; may raise ``Cancelled``.
    """
    try:
        return fit_extended(sessions, effects, progress, held)
    except UserError:
        return None


def predict_force(sessions: Sequence[Session], model: ExtendedModel | None) -> Prediction | None:
    """The force of the first session's contact runs; None where there is no contact run anywhere."""
    for session in sessions:
        if not session.contact_runs():
            continue
        name = session.path.name
        if model is None:
            return Prediction(name, note="The model could not be fitted to these runs as a whole.")
        try:
            found = predict_extended(session, model, "the model of this report")
        except UserError as error:
            return Prediction(name, note=str(error))
        runs = next(iter(found.runs.values()))
        return Prediction(
            name,
            held_out=all(run.held_out for run in runs),
            rows=tuple(
                _force_row(title, equation, tried)
                for title, tried in reversed(list(found.runs.items()))
                for equation in EQUATIONS
            ),
            figure=force_figure({title: tried[0] for title, tried in found.runs.items()}),
            run=runs[0].run,
        )
    return None


def _force_row(variant: str, equation: Equation, runs: Sequence[RunPrediction]) -> tuple[str, ...]:
    r2 = spread_over(runs, equation, "r2")  # as many nines as tell it from 1, and the deviation over the runs
    cells = [r2_text(r2.mean) if not r2.deviation > 0 else with_minus(plus_minus(r2.mean, r2.deviation))]
    for key, factor, digits in (("rmse", 1e3, 1), ("peak_measured", 1.0, 2), ("peak_modelled", 1.0, 2)):
        spread = spread_over(runs, equation, key)
        cells.append(with_minus(mean_and_deviation(factor * spread.mean, factor * spread.deviation, digits)))
    if equation == "both":
        half, inside = interval_over(runs)
        cells.append(f"± {1e3 * half:.1f}" if math.isfinite(half) else "–")
        cells.append(f"{100.0 * inside:.0f} %" if math.isfinite(inside) else "–")
    return (VARIANT_TITLES.get(variant, variant), EQUATION_WORDS[equation], *cells, *[""] * (6 - len(cells)))


@dataclass(frozen=True)
class Content:
    """All that the report tells, worked out: sessions, diagnosis, and what was fitted and predicted."""

    sessions: Sequence[Session]
    diagnosis: Diagnosis
    analysis: Analysis | None
    prediction: Prediction | None
    equation: FinalEquation | None
    bench: Mapping[str, ParameterEstimate]
    """What the fit gives for the bench itself, with the model that the diagnosis begins with."""
    models: Sequence[Diagnosis] = ()
    """Diagnoses of the models that led here, the last of which is ``diagnosis``."""

    def model_words(self) -> str:
        """The model that the diagnosis ends at."""
        return words.model_words(self.diagnosis.final_model, self.diagnosis)

    def equation_or_refuse(self) -> FinalEquation:
        """The equation.

        Raises:
            UserError: the model could not be fitted to these runs as a whole.
        """
        if self.equation is None:
            raise UserError(
                f"{self.sessions[0].path} has too few runs to fit {self.model_words()} as a whole; "
                "leave out '--equation'."
            )
        return self.equation


def gather(
    sessions: Sequence[Session], diagnosis: Diagnosis, progress: Progress, before: Sequence[Diagnosis] = ()
) -> Content:
    """Work out what the report tells beside the diagnosis, and beside those of the models ``before`` it."""
    analysis = analyse(sessions, lambda share, what: progress(0.5 * share, what))
    # A diagnosis without a fit of its own (as tests make it) has no model to write down.
    model = None
    if diagnosis.final_parameters:
        model = fitted_model(
            sessions,
            diagnosis.final_model,
            lambda share, what: progress(0.5 + 0.4 * share, what),
            diagnosis.held,
        )
    shown = {c.effect: c.parameters for c in diagnosis.candidates}
    same = model is not None and diagnosis.final_model == diagnosis.model
    progress(0.9, "predicting the endpoint force")
    return Content(
        sessions,
        diagnosis,
        analysis,
        predict_force(sessions, model) if diagnosis.final_parameters else None,
        None if model is None else final_equation(model, sessions[0].rig, shown),
        model.parameters if model is not None and same else diagnosis.parameters,
        (*before, diagnosis),
    )
