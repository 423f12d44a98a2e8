"""``fingerlab diagnose``: where the model fails and which effect is missing."""

from __future__ import annotations

from pathlib import Path

import click

from fingerlab.cli.common import json_option, progress_bar, refuse_existing, write_json
from fingerlab.identify.results import Candidate, Diagnosis

SHOWN_CANDIDATES = 8

VERDICTS = {
    "nothing_missing": "Nothing is missing: what the model leaves is within the repeatability of the bench.",
    "missing_effect": "An effect is missing.",
    "not_in_catalogue": "Something reproducible is missing that no effect of the catalogue explains.",
}


@click.command(short_help="Where the model fails and which effect is missing.")
@click.argument(
    "sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="S.h5 [S2.h5 ...]"
)
@click.option(
    "--add", "added", multiple=True, metavar="ID", help="Effect that the model holds already; repeatable."
)
@json_option
def diagnose(sessions: tuple[Path, ...], added: tuple[str, ...], json_target: str | None) -> None:
    """Compare model and measurement, rank the effects of the catalogue, and say which is missing.

    Scores are held-out errors in units of the bench's repeatability: 1.0 is the floor.
    """
    from fingerlab.identify.diagnosis import diagnose as run
    from fingerlab.sessions import check_session, open_session

    if json_target not in (None, "-"):
        refuse_existing(Path(str(json_target)))
    opened = [open_session(path) for path in sessions]
    for session in opened:
        check_session(session).raise_first()
    bar, report = progress_bar("Diagnosing")
    with bar:
        result = run(opened, added, progress=report, with_curves=False)
    if json_target is not None:
        write_json(result.to_json(), json_target)
    if json_target != "-":
        _print(result)


def _print(result: Diagnosis) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    held = f" with {', '.join(result.model)}" if result.model else ""
    console.print(f"\n[bold]Nominal model{held}[/bold]: error {result.score:.2f} floors on held-out runs")
    errors = Table("equations", "error (rms)", "floor", "R2", "unit", box=None)
    for name, error in result.errors.items():
        errors.add_row(
            name.replace("_", " "), f"{error.rmse:.3g}", f"{error.floor:.3g}", f"{error.r2:.4f}", error.unit
        )
    console.print(errors)
    console.print(f"\n[bold]{VERDICTS[result.verdict]}[/bold]")
    table = Table("effect", "probability", "score", "in the set", "detectable", box=None)
    for candidate in result.candidates[:SHOWN_CANDIDATES]:
        table.add_row(*_row(candidate))
    console.print(table)
    for verdict, share in (
        ("nothing missing", result.probability_nothing),
        ("not in the catalogue", result.probability_unknown),
    ):
        console.print(f"{verdict}: {_percent(share)}")
    if result.verdict == "missing_effect":
        for candidate in result.candidates:
            if candidate.in_set:
                console.print(f"\n[bold]{candidate.title}[/bold]: {candidate.explanation}")
        steps = [f"{'as given' if s.added is None else '+ ' + s.added} {s.score:.2f}" for s in result.path]
        console.print(f"\nError path (floors): {'  ->  '.join(steps)}")
    if result.next_experiment is not None:
        proposal = result.next_experiment
        console.print(
            f"Next experiment: {proposal['phase']}, {proposal['trajectory']}; separates "
            f"{' from '.join(proposal['separates'])} by {proposal['expected_separation']:.1f} nats"
        )
    console.print(f"{result.seconds:.1f} s", style="dim")


def _row(candidate: Candidate) -> tuple[str, ...]:
    return (
        candidate.title,
        _percent(candidate.probability),
        f"{candidate.score:.2f}",
        "yes" if candidate.in_set else "",
        "yes" if candidate.detectable else "no",
    )


def _percent(share: float) -> str:
    if share <= 0 or share >= 1:
        return f"{100 * share:.0f} %"
    return "< 0.1 %" if share < 0.001 else "> 99.9 %" if share > 0.999 else f"{100 * share:.1f} %"
