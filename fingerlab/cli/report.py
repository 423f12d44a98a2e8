"""``fingerlab report``: the whole comparison as one self-contained page."""

from __future__ import annotations

from pathlib import Path

import click

from fingerlab.cli.common import json_option, progress_bar, refuse_existing, tell_own_effects, write_json
from fingerlab.errors import UserError


@click.command(short_help="Write the whole comparison as one page.")
@click.argument(
    "sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="S.h5 [S2.h5 ...]"
)
@click.option(
    "--out", required=True, metavar="R.html", type=click.Path(path_type=Path), help="Page to write."
)
@click.option(
    "--add", "added", multiple=True, metavar="ID", help="Effect that the model holds already; repeatable."
)
@json_option
def report(sessions: tuple[Path, ...], out: Path, added: tuple[str, ...], json_target: str | None) -> None:
    """Compare model and measurement and write all of it as one page, with its figures inside.

    The page needs no other file and no network. The JSON is that of 'fingerlab diagnose' and names the page.
    """
    from fingerlab.identify.diagnosis import diagnose
    from fingerlab.report.page import write_report
    from fingerlab.sessions import open_session

    refuse_existing(out)
    if json_target not in (None, "-"):
        refuse_existing(Path(str(json_target)))
        if Path(str(json_target)).absolute() == out.absolute():
            raise UserError(f"--out and --json both name {out}; give the JSON a name of its own.")
    opened = [open_session(path) for path in sessions]
    tell_own_effects()
    bar, tell = progress_bar("Writing the report")
    with bar:
        result = diagnose(opened, added, progress=lambda share, what: tell(0.55 * share, what))
        write_report(opened, out, added, result, progress=lambda share, what: tell(0.55 + 0.45 * share, what))
    click.echo(f"{out} written, {out.stat().st_size / 1e6:.1f} MB.", err=True)
    if json_target is not None:
        write_json({**result.to_json(), "report": str(out)}, json_target)
