"""The page's part on the thesis' analysis, or on the motor-bench equation where there is no finger."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from fingerlab.core.errors import UserError
from fingerlab.core.text import estimate_text, in_words, plus_minus, r2_text, with_minus
from fingerlab.report.figure_style import LABEL_SIZE
from fingerlab.report.thesis_figures import FIGURES
from fingerlab.sessions.model import Session
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.analysis import PublishedQuantity, ThesisAnalysis, thesis_analysis
from fingerlab.thesis.motor_bench import MotorBenchFit, fit_motor_bench, motor_bench_runs
from fingerlab.thesis.traces import FOUR_REGIONS, JOINT_TITLES

Progress = Callable[[float, str], None]

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
    drawn = ((name, FIGURES[name](analysis), caption) for name, caption in CAPTIONS.items())
    return tuple((name, _smaller(figure), caption) for name, figure, caption in drawn if figure is not None)


def _smaller(figure: Figure) -> Figure:
    """Drawn for half the page's width, where the thesis' figures have the whole: letters keep their size."""
    for axes in figure.axes:
        words = axes.get_title(loc="left")
        if len(words) > LONGEST_TITLE:
            axes.set_title(words.replace(": ", ":\n"), loc="left", fontsize=LABEL_SIZE)
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
        bench=_bench_rows(fit),
        by_run=tuple((run, r2_text(r2)) for run, r2 in fit.run_r2.items()),
    )


def _bench_rows(fit: MotorBenchFit) -> tuple[tuple[str, str], ...]:
    titles = {"inertia": "Inertia J", "gain": "Gain on the load", "offset": "Offset"}
    rows = [
        (titles[name], estimate_text(value) + (", fixed by the rig" if name in fit.fixed else ""))
        for name, value in fit.parameters.items()
    ]
    rows += [(titles[name], "the recordings cannot show it") for name in fit.absent]
    return (*rows, ("R2 over all runs", r2_text(fit.r2)), ("Error", f"{1e3 * fit.rmse:.1f} mN m"))
