"""``fingerlab report``: the whole comparison as one self-contained page, as PDF, and its figures."""

from __future__ import annotations

from pathlib import Path

import click

from fingerlab.cli.common import (
    PATH,
    added_option,
    json_option,
    progress_bar,
    refuse_taken_early,
    sessions_argument,
    tell_own_effects,
    write_json,
)
from fingerlab.core.errors import UserError
from fingerlab.core.files import refuse_taken


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
@click.option(
    "--figures",
    metavar="DIR",
    type=PATH,
    help="Every figure of the report as PNG, SVG and PDF into a folder.",
)
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
    from fingerlab.report.page import Extras, write_report
    from fingerlab.report.story import diagnose_each, story
    from fingerlab.sessions import open_session

    _check_places(out, pdf, figures, equation, json_target)
    opened = [open_session(path) for path in sessions]
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
        told = [step.to_json() for step in story((*before, result))]
        write_json({**result.to_json(), "story": told, "report": str(out), **more}, json_target)


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
    given = {option: path for option, path in places.items() if path is not None}
    for option, path in given.items():
        twin = next((o for o, p in given.items() if o != option and p.absolute() == path.absolute()), None)
        if twin is not None:
            raise UserError(f"{option} and {twin} both name {path}; give each a name of its own.")
        refuse_taken(path)
    if pdf is not None and pdf.suffix.lower() != ".pdf":
        raise UserError(f"--pdf names {pdf}; a PDF's name ends with .pdf.")
    if equation is not None:
        from fingerlab.report.equation_text import check_ending

        check_ending(equation)
    refuse_taken_early(None, figures)
