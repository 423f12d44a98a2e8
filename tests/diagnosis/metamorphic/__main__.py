"""The table of what changes in a verdict when recordings are told otherwise: nothing should.

    python -m tests.diagnosis.metamorphic TABLE.md SESSION.h5 ...

A session takes about a minute and a half on two quiet cores.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.sessions import open_session

from .changes import CHANGES


def furthest(one: Diagnosis, other: Diagnosis) -> float:
    """By how much the probability of an answer differs most."""
    mine, theirs = ({c.effect: c.probability for c in d.candidates} for d in (one, other))
    apart = [abs(mine.get(name, 0.0) - theirs.get(name, 0.0)) for name in {*mine, *theirs}]
    return max(*apart, abs(one.probability_nothing - other.probability_nothing), 0.0)


def rows(paths: Sequence[Path]) -> Iterator[str]:
    """Lines of the table, one for each session, as they are found."""
    first, *others = CHANGES
    yield "Largest change of a probability; in bold where the set is another one.\n\n"
    yield f"| recording | verdict | {' | '.join(others)} |\n|---|---|{'---:|' * len(others)}\n"
    for path in paths:
        session = open_session(path)
        usual = diagnose([CHANGES[first](session)], with_curves=False)
        cells = []
        for name in others:
            found = diagnose([CHANGES[name](session)], with_curves=False)
            cell = f"{furthest(usual, found):.3f}"
            same = set(found.set) == set(usual.set) and found.verdict == usual.verdict
            cells.append(cell if same else f"**{cell}**")
        said = ", ".join(step.added for step in usual.path if step.added) or usual.verdict.replace("_", " ")
        yield f"| {path.stem} | {said.replace('_', ' ')} | {' | '.join(cells)} |\n"


@click.command()
@click.argument("table", type=click.Path(dir_okay=False, path_type=Path))
@click.argument(
    "paths", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False, path_type=Path)
)
def main(table: Path, paths: tuple[Path, ...]) -> None:
    """Write TABLE for the sessions PATHS, line by line."""
    with table.open("w", encoding="utf-8") as file:
        for row in rows(paths):
            file.write(row)
            file.flush()


if __name__ == "__main__":
    main()
