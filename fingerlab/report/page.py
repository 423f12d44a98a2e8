"""The whole comparison as one self-contained page: nothing is loaded from elsewhere, nothing runs in it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from fingerlab.core.errors import UserError
from fingerlab.core.files import OutputSet
from fingerlab.core.progress import Progress, Watch
from fingerlab.core.text import estimate_text, score_text
from fingerlab.diagnosis.answer.error_parts import EQUATIONS, Comparison, equation_of
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis
from fingerlab.report import diagnosis_words as words
from fingerlab.report import page_tables as tables
from fingerlab.report.budget_words import budget_table, main_family, mend_rows, mending_sentence
from fingerlab.report.content import Analysis, Content, Prediction, gather
from fingerlab.report.diagnosis_figures import (
    DrawnStretch,
    budget_figure,
    chosen_stretches,
    comparison_figure,
    failure_stretch,
    fingerprint_figure,
    path_figure,
    where_figure,
)
from fingerlab.report.equation_text import (
    VALUES_TITLE,
    WRITERS,
    equation_figures,
    equation_text,
    html_words,
    si_note,
    to_latex,
)
from fingerlab.report.figure_style import NamedFigure, Pictures, save_figures
from fingerlab.report.line_units import line_units
from fingerlab.report.page_tables import calibration_rows, calibration_sentence, rig_hash, versions
from fingerlab.report.pdf import pdf_of_page
from fingerlab.report.recording_words import next_experiment_words, paired_sentence
from fingerlab.report.score_words import (
    aside_sentence,
    error_rows_of_story,
    path_sentence,
    row_words,
    score_table,
    story,
    story_sentence,
)
from fingerlab.sessions.model import Session

FEWEST_CANDIDATES = 2
"""Effects whose evidence is drawn: every one of the set, and at least so many, best first."""


@dataclass(frozen=True)
class Extras:
    """What may be written beside the page: the same as PDF, every figure as files, the model's equations."""

    pdf: Path | None = None
    figures: Path | None = None
    equation: Path | None = None


def write_report(
    sessions: Sequence[Session],
    path: Path,
    added: Sequence[str] = (),
    diagnosis: Diagnosis | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    extras: Extras | None = None,
    before: Sequence[Diagnosis] = (),
) -> Path:
    """Write the report of a comparison: as a page, or as PDF where ``path`` ends with ``.pdf``.

    Args:
        sessions: at least one. path: what to write; nothing is overwritten.
        added: effects that the model holds already.
        diagnosis: of these sessions with these effects and with curves; worked out where it is None.
        progress: called with the share done (0 to 1) and what is being done.
        cancelled: asked now and then; True stops the work and leaves no file.
        extras: further files of the same content; all of them appear together, or none.
        before: diagnoses of the models that led to this one, the first model's first; worked out with it.

    Returns:
        ``path``.

    Raises:
        UserError: a place is taken or cannot be written to, or the sessions cannot be analysed.
        Cancelled: ``cancelled`` answered True.
    """
    watch, extras = Watch(progress, cancelled), extras or Extras()

    def part(low: float, high: float) -> Progress:
        return lambda share, what: watch.tell(low + (high - low) * share, what)

    try:
        # Claimed before the work, so that a place that cannot be written to is found out at once.
        with OutputSet() as outputs:
            places = {place: outputs.claim(place) for place in (path, extras.pdf, extras.equation) if place}
            started = 0.0 if diagnosis is not None else 0.5
            if diagnosis is None:
                *before, diagnosis = diagnose_each(sessions, added, part(0.0, started), cancelled)
            content = gather(sessions, diagnosis, part(started, 0.75), before)
            page = render(content, part(0.75, 0.9))
            _write_files(places, page, content)
            if extras.figures is not None:
                save_figures(page.figures, extras.figures, outputs, page.title)
            part(0.9, 1.0)(1.0, "written")
    except OSError as error:
        raise UserError(
            f"{error.filename or path} cannot be written ({error.strerror}); "
            "choose a place with room and write access."
        ) from None
    return path


def _write_files(parts: Mapping[Path, Path], page: Page, content: Content) -> None:
    for place, part in parts.items():
        kind = place.suffix.lower()
        if kind == ".pdf":
            part.write_bytes(pdf_of_page(page.text, page.figures, page.title))
        elif kind in WRITERS:
            text = equation_text(content.equation_or_refuse(), place, page.title, content.model_words())
            part.write_text(text, encoding="utf-8", newline="\n")
        else:
            part.write_text(page.text, encoding="utf-8", newline="\n")


@dataclass(frozen=True)
class Page:
    """The page as text, well-formed as XML too, and its figures by the id that they have in it."""

    title: str
    text: str
    figures: Mapping[str, NamedFigure]


def render(content: Content, progress: Progress) -> Page:
    """The page."""
    sessions, analysis, line = content.sessions, content.analysis, line_units(content.sessions)
    diagnosis, models = line.diagnosis(content.diagnosis), [line.diagnosis(one) for one in content.models]
    radius = line.radius
    pictures = Pictures(progress, _picture_count(diagnosis, analysis))
    title = " + ".join(dict.fromkeys(s.title or s.path.stem for s in sessions))
    templates = Environment(
        loader=FunctionLoader(partial(_resource, "report")),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = templates.get_template("page.html.j2").render(
        title=title,
        versions=versions(),
        written=datetime.now().astimezone().isoformat(timespec="seconds"),
        style=Markup(_resource("report", "page.css")),
        colours=tomllib.loads(_resource("style", "colours.toml")),
        diagnosis=diagnosis,
        how_judged=words.how_judged(diagnosis),
        judged_on=words.judged_on(diagnosis).rstrip(",") + ",",
        story=story(models),
        story_sentence=story_sentence(models),
        story_errors=error_rows_of_story(models),
        score_table=score_table(diagnosis),
        aside=aside_sentence(diagnosis),
        row_words=row_words(diagnosis),
        budget=budget_table(diagnosis.budget),
        budget_picture=_budget_picture(diagnosis, pictures),
        mending=mending_sentence(diagnosis),
        mend_rows=mend_rows(diagnosis),
        verdict=words.verdict_sentence(diagnosis),
        model=words.model_words(diagnosis.model, diagnosis),
        final_model=content.model_words(),
        score=score_text(diagnosis.score),
        errors=tables.error_rows(diagnosis.errors),
        ranking=tables.short_ranking(diagnosis),
        every_effect=tables.all_effects(diagnosis),
        set_sentence=words.set_sentence(diagnosis),
        as_good=words.as_good_sentence(diagnosis),
        paired=paired_sentence(diagnosis),
        calibration_sentence=words.calibration_sentence(diagnosis),
        path_sentence=path_sentence(diagnosis),
        path_figure=pictures.draw(path_figure(diagnosis.path, diagnosis.model), "Error path"),
        failure=words.failure_sentence(diagnosis.failure),
        failure_picture=_failure_picture(diagnosis, pictures, len(sessions) > 1),
        profile_picture=_profile_picture(diagnosis, pictures),
        equations=_equations(diagnosis, pictures, len(sessions) > 1),
        candidates=[_candidate(c, pictures, radius) for c in _drawn_candidates(diagnosis)],
        next_experiment=next_experiment_words(diagnosis, radius),
        model_rows=tables.model_rows(content.bench, radius),
        arc=line.arc,
        prediction=content.prediction,
        prediction_picture=_prediction_picture(content.prediction, pictures),
        equation=_equation(content, pictures, title),
        finger=any(session.rig.finger is not None for session in sessions),
        sessions=[_session(session) for session in sessions],
        no_calibration=calibration_sentence(sessions),
        files=tables.file_rows(sessions),
        analysis=analysis,
        analysis_figures=[
            {"picture": pictures.draw(figure, name.replace("-", " ")), "caption": caption}
            for name, figure, caption in (() if analysis is None else analysis.figures)
        ],
    )
    return Page(title, text, pictures.drawn)


def _prediction_picture(prediction: Prediction | None, pictures: Pictures) -> dict[str, Any] | None:
    if prediction is None or prediction.figure is None:
        return None
    caption = f"Run {prediction.run} of {prediction.session}: the first seconds, both equations together."
    return {"picture": pictures.draw(prediction.figure, "Endpoint force predicted"), "caption": caption}


def _equation(content: Content, pictures: Pictures, title: str) -> dict[str, Any] | None:
    if content.equation is None:
        return None
    drawn = equation_figures(content.equation)
    return {
        "parts": [
            {
                "title": part.title,
                "note": html_words(part.note),
                "picture": pictures.draw(drawn[part.title], f"Equations, {part.title}", outlines=True)
                if part.title in drawn
                else None,
            }
            for part in content.equation.parts
        ],
        "rows": [(v.title, estimate_text(v.estimate)) for v in content.equation.values],
        "values_title": VALUES_TITLE,
        "units": si_note(content.equation),
        "latex": to_latex(content.equation, title, content.model_words()),
    }


def _picture_count(diagnosis: Diagnosis, analysis: Analysis | None) -> int:
    equations = len({c.equation for c in diagnosis.comparisons})
    return (
        3
        + bool(diagnosis.budget)
        + 2 * equations
        + len(_drawn_candidates(diagnosis))
        + (0 if analysis is None else len(analysis.figures))
    )


def _drawn_candidates(diagnosis: Diagnosis) -> list[Candidate]:
    unseen = words.not_shown(diagnosis)
    best = [c for c in words.shown_best_first(diagnosis) if c.effect not in unseen]
    return best[: max(FEWEST_CANDIDATES, len(words.suspects(diagnosis)))]


def _candidate(candidate: Candidate, pictures: Pictures, radius: float) -> dict[str, Any]:
    print_ = candidate.fingerprint
    return {
        "title": candidate.title,
        "row": tables.outcome_of(candidate),
        "parameters": tables.parameter_rows(candidate, radius),
        "equations": words.listed([words.FAMILY_TITLES.get(e, e).lower() for e in candidate.equations]),
        "picture": None
        if print_ is None
        else pictures.draw(fingerprint_figure(print_, candidate.title), f"Fingerprint of {candidate.title}"),
        "where": ""
        if print_ is None
        else f"{equation_of(print_.equation).title} against {print_.coordinate}",
    }


def _failure_picture(diagnosis: Diagnosis, pictures: Pictures, many: bool) -> dict[str, Any] | None:
    failure = diagnosis.failure
    shown = None if failure is None else failure_stretch(diagnosis.comparisons, failure)
    if failure is None or shown is None:
        return None
    title = equation_of(failure.equation).title
    figure = comparison_figure(shown, failure)
    return {"picture": pictures.draw(figure, f"{title} where it is worst"), "caption": _caption(shown, many)}


def _profile_picture(diagnosis: Diagnosis, pictures: Pictures) -> dict[str, Any] | None:
    """The residual of the equation that fails worst, over everything that it may depend on."""
    if diagnosis.failure is None:
        return None
    figure = where_figure(diagnosis.comparisons, diagnosis.failure.equation)
    if figure is None:
        return None
    title = equation_of(diagnosis.failure.equation).title
    return {
        "picture": pictures.draw(figure, f"Where the {words.in_sentence(title)} is off"),
        "caption": f"{title}, residual in bins over all runs; above each, where it is largest.",
    }


def _budget_picture(diagnosis: Diagnosis, pictures: Pictures) -> dict[str, Any] | None:
    if not diagnosis.budget:
        return None
    family = main_family(diagnosis.budget)
    title = words.in_sentence(words.FAMILY_TITLES.get(family, family))
    drawn = budget_figure(diagnosis.budget[family], family)
    return {
        "picture": pictures.draw(drawn, f"Error budget of the {title}"),
        "caption": f"The squared error of the {title}, from all of it down to nothing.",
    }


def _equations(diagnosis: Diagnosis, pictures: Pictures, many: bool) -> list[dict[str, Any]]:
    result = []
    present = {c.equation for c in diagnosis.comparisons}
    # Forces at the fingertip come last.
    known = sorted(EQUATIONS, key=lambda name: EQUATIONS[name].family == "endpoint_force")
    for equation in [*(e for e in known if e in present), *sorted(present - set(EQUATIONS))]:
        title, note = equation_of(equation).title, equation_of(equation).note
        stretches = chosen_stretches(diagnosis.comparisons, equation)
        drawn = [
            {
                "picture": pictures.draw(comparison_figure(s), f"{title}, {_caption(s, many)}"),
                "caption": f"{kind}: {_caption(s, many)}",
            }
            for s, kind in zip(stretches, ("Largest misfit", "Typical"), strict=False)
        ]
        if drawn:
            result.append({"title": title, "note": note, "pictures": drawn})
    return result


def _caption(shown: DrawnStretch, many: bool) -> str:
    one: Comparison = shown.comparison
    name = f"{Path(one.session).name}, run {one.run}" if many else f"run {one.run}"
    return f"{name}, {words.PHASE_WORDS.get(one.phase, one.phase)}, {shown.start:.1f} to {shown.stop:.1f} s"


def _session(session: Session) -> dict[str, Any]:
    return {
        "title": session.title or session.path.stem,
        "run_count": len(session.runs),
        "facts": tables.facts(session),
        "runs": tables.run_rows(session),
        "rig": tables.rig_rows(session),
        "rig_hash": rig_hash(session),
        "calibrations": calibration_rows(session),
    }


def _resource(folder: str, name: str) -> str:
    return resources.files("fingerlab.resources").joinpath(folder, name).read_text(encoding="utf-8")


OTHERS_SHARE = 0.6
"""Of the time: what the models before the last one take, of which no curves are drawn (assumed)."""


def diagnose_each(
    sessions: Sequence[Session],
    added: Sequence[str],
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> list[Diagnosis]:
    """The diagnoses of every model from the nominal one to that with all ``added``; the last has curves.

    Raises:
        UserError: as :func:`fingerlab.diagnosis.diagnose`.
        Cancelled: ``cancelled`` answered True.
    """
    # Where they are wanted: a report of diagnoses that are there needs none of them.
    from fingerlab.diagnosis import DiagnosisOptions, diagnose
    from fingerlab.diagnosis.gram.reduction import Reduction
    from fingerlab.effects import effect

    for name in added:
        effect(name)  # an id that nobody knows is told now, and not after the first diagnosis
    watch, kept, found = Watch(progress, cancelled), Reduction(sessions), list[Diagnosis]()
    for number in range(len(added) + 1):
        last = number == len(added)
        low = OTHERS_SHARE * number / max(len(added), 1)
        high = 1.0 if last else OTHERS_SHARE * (number + 1) / len(added)

        def part(share: float, what: str, low: float = low, high: float = high) -> None:
            watch.tell(low + (high - low) * share, what)

        found.append(diagnose(sessions, added[:number], part, cancelled, last, DiagnosisOptions(kept=kept)))
    return found
