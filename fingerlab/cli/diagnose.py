"""``diagnose`` and ``report``: which effect is missing, in the terminal, as JSON, and as a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fingerlab.cli.common import (
    NEW_FILE,
    PATH,
    added_option,
    figures_option,
    json_option,
    open_each,
    progress_bar,
    refuse_same_place,
    result_table,
    sessions_argument,
    table_console,
    tell_own_effects,
    write_json,
    write_results,
)
from fingerlab.core.errors import UserError
from fingerlab.core.files import refuse_taken
from fingerlab.core.progress import second_process

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from rich.console import Console
    from rich.table import Table

    from fingerlab.diagnosis.answer.results import Diagnosis
    from fingerlab.diagnosis.draft.laws import DraftLaw
    from fingerlab.diagnosis.gram.reduction import Reduction
    from fingerlab.models.file import SavedModel
    from fingerlab.sessions import Session


@click.command(short_help="Where the model fails and which effect is missing.")
@sessions_argument
@added_option
@click.option(
    "--hold",
    "held",
    multiple=True,
    metavar="NAME=VALUE",
    help="Hold a parameter of the model at a value (SI), such as arm_mcp@flexion=0.0105; repeatable.",
)
@click.option(
    "--save",
    "model_file",
    metavar="M.json",
    type=NEW_FILE,
    help="Keep the model with the effects of --add; without --add, with those that the diagnosis adds.",
)
@figures_option("Draw the error path, where the model fails, and the effects' fingerprints into a folder.")
@click.option(
    "--draft",
    is_flag=True,
    help="Draft a law for what the catalogue does not explain; takes some seconds more.",
)
@click.option(
    "--draft-effect",
    "own_file",
    metavar="FILE.py",
    type=PATH,
    help="Write the best drafted law as an effect of your own, to be edited.",
)
@click.option(
    "--budget", is_flag=True, help="Tell what each error is made of, and what on the bench would mend it."
)
@json_option
def diagnose(
    sessions: tuple[Path, ...],
    added: tuple[str, ...],
    held: tuple[str, ...],
    model_file: Path | None,
    figures: Path | None,
    draft: bool,
    own_file: Path | None,
    budget: bool,
    json_target: str | None,
) -> None:
    """Compare model and measurement, rank the effects of the catalogue, and say which is missing.

    Errors are those on runs left out of the fit, in multiples of the bench's own repeatability: 1 is the
    floor. A saved model predicts the endpoint force ('fingerlab predict') and can be compared with others
    ('fingerlab compare').
    """
    fixed = dict(map(_held, held))
    refuse_same_place({"--save": model_file, "--draft-effect": own_file, "--json": json_target})
    if own_file is not None:
        _check_own_file(own_file)
    laws: tuple[DraftLaw, ...] | None = None
    # Curves are kept by one process only, so that a second one would have nothing to do.
    with second_process(() if figures else sessions, "fingerlab.diagnosis.gram.reduction") as executor:
        from fingerlab.diagnosis import DiagnosisOptions
        from fingerlab.diagnosis import diagnose as run

        opened = open_each(sessions)
        tell_own_effects()
        bar, report = progress_bar("Diagnosing")
        with bar:
            curves = figures is not None
            kept = _to_draft_from(opened, executor) if draft or own_file is not None else None
            options = DiagnosisOptions(held=fixed, kept=kept, executor=executor)
            result = run(opened, added, report, with_curves=curves, options=options)
        if kept is not None:
            laws = _laws(kept, result)
    effects = added or result.final_model
    saved = None if model_file is None else (_model(opened, effects, fixed), model_file)
    if json_target != "-":
        _print(result, opened[0].rig.line_radius, budget)
        if laws is not None:
            _print_laws(laws, result)
    drawn = None
    if figures is not None:
        from fingerlab.report.diagnosis_figures import diagnosis_figures

        drawn = (diagnosis_figures(result, opened), figures)
    answer = (
        result.to_json() if laws is None else {**result.to_json(), "draft": [law.to_json() for law in laws]}
    )
    write_results(answer, json_target, saved, drawn)
    if own_file is not None and laws:
        from fingerlab.diagnosis.draft.own_file import own_effect_text
        from fingerlab.effects.own import how_to_let_in, save_own

        save_own(own_file, own_effect_text(own_file, laws[0]), choose=False)
        click.echo(f"{own_file} is written; {how_to_let_in(own_file)}.", err=True)
    elif own_file is not None:
        click.echo(f"No law was drafted, so that {own_file} is not written.", err=True)


def _check_own_file(path: Path) -> None:
    """Find out before the work that no effect could be written there.

    Raises:
        UserError: the name makes no effect's id, or the place is taken.
    """
    from fingerlab.effects.own import own_name

    own_name(path)
    refuse_taken(path)


def _to_draft_from(sessions: Sequence[Session], executor: Executor | None) -> Reduction:
    from fingerlab.diagnosis.gram.reduction import Reduction

    return Reduction(sessions, executor)


def _laws(kept: Reduction, result: Diagnosis) -> tuple[DraftLaw, ...]:
    """Laws drafted from what the diagnosis leaves."""
    from fingerlab.core.progress import Watch
    from fingerlab.diagnosis.draft.laws import draft_laws

    best_first = [c.effect for c in sorted(result.candidates, key=lambda c: c.score)]
    bar, report = progress_bar("Drafting a law")
    with bar:
        return draft_laws(kept, result.last, result.fitted, best_first, Watch(report, None))


def _print_laws(laws: Sequence[DraftLaw], result: Diagnosis) -> None:
    from rich.text import Text

    from fingerlab.diagnosis.draft.laws import nothing_drafted

    console = table_console()
    console.print(Text(f"\n{'Drafted laws, best first:' if laws else nothing_drafted(result.last)}"))
    for number, law in enumerate(laws, 1):
        console.print(Text(f"{number}. {law.title}", style="bold"))
        console.print(Text(law.story))
    if laws:
        console.print(
            Text("To go on with the first: --draft-effect FILE.py; see 'fingerlab effects --help'.")
        )


def _held(text: str) -> tuple[str, float]:
    """Name and value of what is to be held.

    Raises:
        UserError: it is not written so.
    """
    name, _, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not name or not math.isfinite(value):
        raise UserError(f"--hold is '{text}'; give a name and a number, such as arm_mcp@flexion=0.0105.")
    return name, value


def _model(sessions: Sequence[Session], effects: Sequence[str], held: Mapping[str, float]) -> SavedModel:
    """The model with these effects, ready to be written."""
    from fingerlab.prediction import fit_extended, model_of_extended

    bar, report = progress_bar("Fitting the model to save")
    with bar:
        return model_of_extended(fit_extended(sessions, effects, report, held))


def _print(result: Diagnosis, radius: float, budget: bool) -> None:
    """The answer on the terminal, made to fit 80 columns: verdict first, then what it rests on.

    ``radius``: of the arc as which a linear axis is told, m; 0: it turns. ``budget``: whether what errors are
    made of is wanted.
    """
    from rich.text import Text

    from fingerlab.diagnosis.score.calibration import Verdict
    from fingerlab.report import diagnosis_words as words
    from fingerlab.report.line_units import LineUnits
    from fingerlab.report.recording_words import next_experiment_sentence, paired_sentence
    from fingerlab.report.score_words import how_to_add, machine_sentence, path_sentence, score_words

    console, result = table_console(), LineUnits(radius).diagnosis(result)
    console.print(Text(f"\n{words.verdict_sentence(result)}\n", style="bold"))
    console.print(_errors(result))
    if result.score_parts:
        console.print(Text(score_words(result)))
    console.print()
    if budget:
        _print_budget(console, result)
    console.print(_ranking(result))
    starred = "; * cannot be ruled out" if result.set else ""
    console.print(f"error: in floors, with that effect in the model{starred}\n")
    if radius:
        console.print(Text(f"{LineUnits(radius).arc}\n"))
    for candidate in words.suspected(result):
        console.print(Text(f"{candidate.title}: {candidate.explanation}\n"))
    strange = result.verdict == Verdict.NOT_IN_CATALOGUE and result.set
    if len(result.set) > 1 or strange or words.not_shown(result) or words.needed_together(result):
        console.print(Text(words.set_sentence(result)))
    if words.as_good_sentence(result):
        console.print(Text(words.as_good_sentence(result)))
    if result.paired:
        console.print(Text(paired_sentence(result)))
    if words.worth_adding(result):
        console.print(Text(path_sentence(result)))
    if machine_sentence(result):
        console.print(Text(machine_sentence(result, radius)))
    if how_to_add(result):
        console.print(Text(how_to_add(result)))
    if result.bench:
        console.print(Text("\nThe bench:"))
        for finding in result.bench:
            console.print(Text(f"- {finding.text}"))
        console.print()
    proposal = next_experiment_sentence(result, radius)
    if proposal is not None:
        console.print(Text(proposal))
    hidden = words.hidden_sentence(result)
    if hidden:
        console.print(Text(hidden))
    console.print(Text(words.calibration_sentence(result), style="dim"))
    console.print(Text(f"{result.seconds:.1f} s", style="dim"))


def _print_budget(console: Console, result: Diagnosis) -> None:
    """Every part of each error, then what is worth mending."""
    from rich.text import Text

    from fingerlab.report.budget_words import budget_table, mend_rows, mending_sentence

    budget = budget_table(result.budget)
    if budget is None:
        return
    columns = ("part", *(f">{title.lower()}" for title in budget.families))
    table = result_table(*columns, box=None, pad_edge=False, title="Of the squared error, %", title_style="")
    for row in budget.rows:
        table.add_row(row.title, *row.shares)
    table.add_row("error (rms)", *budget.errors)
    console.print(table)
    console.print(Text(mending_sentence(result)))
    for title, share, after, how in mend_rows(result)[1:]:
        console.print(Text(f"- {title}, {share}: {after} without it. {how}".rstrip()))
    console.print()


def _errors(result: Diagnosis) -> Table:
    from fingerlab.core.text import score_text
    from fingerlab.report.diagnosis_words import judged_on
    from fingerlab.report.page_tables import error_rows

    title = f"Error on {judged_on(result).rstrip(',')}: {score_text(result.score)} times the floor"
    columns = ("equations", ">error (rms)", ">floor", "unit", ">error / floor", ">R2")
    table = result_table(*columns, box=None, pad_edge=False, title=title, title_style="")
    for row in error_rows(result.errors):
        table.add_row(row.title, row.error, row.floor, row.unit, row.times, row.r2)
    return table


def _ranking(result: Diagnosis) -> Table:
    """What is probable, with the ids that ``--add`` takes."""
    from rich.table import Table

    from fingerlab.report.page_tables import short_ranking

    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("probability", no_wrap=True, justify="right")
    table.add_column("error", no_wrap=True, justify="right")
    table.add_column("", no_wrap=True)
    table.add_column("effect or outcome")
    table.add_column("id", no_wrap=True)
    for row in short_ranking(result):
        table.add_row(row.chance, row.score, "*" if row.in_set else "", row.title, row.effect)
    return table


@click.command(short_help="Write the whole comparison as one page, and as PDF.")
@sessions_argument
@click.option(
    "--out",
    required=True,
    metavar="R.html",
    type=PATH,
    help="Page to write; a name that ends with .pdf makes it a PDF.",
)
@click.option("--pdf", metavar="R.pdf", type=PATH, help="The same as PDF, too.")
@figures_option("Every figure of the report as PNG, SVG and PDF into a folder.")
@click.option(
    "--equation",
    metavar="E.md",
    type=PATH,
    help="Equations of the model that the diagnosis ends at, with numbers: Markdown (.md) or LaTeX (.tex).",
)
@added_option
@json_option
def report(
    sessions: tuple[Path, ...],
    out: Path,
    pdf: Path | None,
    figures: Path | None,
    equation: Path | None,
    added: tuple[str, ...],
    json_target: str | None,
) -> None:
    """Compare model and measurement and write all of it as one page, with its figures inside.

    The page needs no other file and no network. The JSON is that of 'fingerlab diagnose' and names what was
    written.
    """
    from fingerlab.report.page import Extras, diagnose_each, write_report
    from fingerlab.report.score_words import story

    _check_places(out, pdf, figures, equation, json_target)
    opened = open_each(sessions)
    tell_own_effects()
    extras = Extras(pdf, figures, equation)
    bar, tell = progress_bar("Writing the report")
    with bar:
        *before, result = diagnose_each(opened, added, lambda share, what: tell(0.45 * share, what))
        write_report(
            opened, out, added, result,
            progress=lambda s, what: tell(0.45 + 0.55 * s, what), extras=extras, before=before,
        )  # fmt: skip
    for path in (out, pdf):
        if path is not None:
            click.echo(f"{path} written, {path.stat().st_size / 1e6:.1f} MB.", err=True)
    if json_target is not None:
        written = {"pdf": pdf, "figures": figures, "equation": equation}
        more = {name: str(path) for name, path in written.items() if path is not None}
        steps = [step.to_json() for step in story((*before, result))]
        write_json({**result.to_json(), "story": steps, "report": str(out), **more}, json_target)


def _check_places(
    out: Path, pdf: Path | None, figures: Path | None, equation: Path | None, json_target: str | None
) -> None:
    """Find out before the work that a result could not be written.

    Raises:
        UserError: two results have one name, a place is taken, or a name says the wrong kind.
    """
    places = {"--out": out, "--pdf": pdf, "--equation": equation}
    if json_target not in (None, "-"):
        places["--json"] = Path(str(json_target))
    refuse_same_place(places)
    for path in places.values():
        if path is not None:
            refuse_taken(path)
    if out.suffix.lower() not in (".html", ".htm", ".pdf"):
        raise UserError(f"--out names {out}; a page's name ends with .html, or with .pdf for a PDF.")
    if pdf is not None and pdf.suffix.lower() != ".pdf":
        raise UserError(f"--pdf names {pdf}; a PDF's name ends with .pdf.")
    if equation is not None:
        from fingerlab.report.equation_text import check_ending

        check_ending(equation)
