"""What a folder of sessions holds, read in the background. No Qt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fingerlab.core.errors import UserError
from fingerlab.library.index import SessionFacts, scan
from fingerlab.library.notes import Notebook, Verdict, find_verdicts

from .background import IsCancelled, Tell


@dataclass(frozen=True)
class Found:
    """What a scan of a folder brought: facts, notes, verdicts, and what is wrong with the side file."""

    folder: Path
    facts: tuple[SessionFacts, ...]
    notebook: Notebook
    verdicts: dict[Path, Verdict]
    trouble: str


def look_through(folder: Path, known: Sequence[SessionFacts], tell: Tell, cancelled: IsCancelled) -> Found:
    """Read a folder anew; in the background."""

    def found(facts: SessionFacts, share: float) -> None:
        tell((facts.name, share))

    facts = scan(folder, known, found, cancelled)
    notebook, trouble = Notebook(folder), ""
    try:
        notebook.read()
    except UserError as error:
        trouble = str(error)
    return Found(folder, facts, notebook, find_verdicts(folder, facts), trouble)
