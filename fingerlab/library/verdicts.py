"""What earlier batches found out about the sessions of a folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fingerlab.core.errors import UserError
from fingerlab.library.facts import SessionFacts

if TYPE_CHECKING:
    from fingerlab.batch.rows import Row


@dataclass(frozen=True)
class Verdict:
    """A session's diagnosis as a table of ``fingerlab batch`` holds it.

    Attributes:
        verdict: ``missing_effect``, ``nothing_missing`` or ``not_in_catalogue``, as in the table.
        effects: one of which is missing; where nothing is, those that the session could not have shown.
        probability: of the verdict. score: final error over its floor, None where there is none.
        table: the file it stands in. outdated: whether the session was written after the table.
    """

    verdict: str
    effects: tuple[str, ...]
    probability: float | None
    score: float | None
    table: Path
    outdated: bool


def find_verdicts(folder: Path, facts: Sequence[SessionFacts]) -> dict[Path, Verdict]:
    """The newest verdict on each session, from every batch table in the folder itself.

    A table names its sessions relative to the folder it was made of. That folder is looked for where it
    was and, for a tree that has moved as a whole, beside the table.
    """
    by_place = {_place(one.path): one for one in facts if not one.problem}
    tables = sorted((p for p in folder.glob("*.parquet") if p.is_file()), key=lambda p: p.stat().st_mtime)
    found: dict[Path, Verdict] = {}
    if not tables:
        return {}
    from fingerlab.batch.table import read_table  # slow to import, and most folders hold no table

    for table in tables:
        try:
            contents = read_table(table)
        except UserError:
            continue  # somebody else's table
        if contents is None:
            continue
        written = table.stat().st_mtime
        for row in contents.rows:
            name = str(row["session"])
            for root in (Path(contents.folder), table.parent):
                one = by_place.get(_place(root / name))
                if one is not None:
                    verdict = _verdict(row, table, one.modified > written)
                    if verdict is not None:
                        found[one.path] = verdict
                    break
    return found


def _place(path: Path) -> str:
    return str(path.resolve())


def _verdict(row: Row, table: Path, outdated: bool) -> Verdict | None:
    if not row.get("verdict"):
        return None  # it could not be diagnosed; the table says why
    return Verdict(
        str(row["verdict"]),
        tuple(str(effect) for effect in row.get("set") or ()),
        row.get("probability"),
        row.get("final_score"),
        table,
        outdated,
    )
