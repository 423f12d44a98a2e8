"""The committed table of wrong additions: its rows are those asked for, and its figures count them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.hidden import wrong_additions

PAGE = Path(__file__).resolve().parents[2] / wrong_additions.PAGE


def rows(columns: int) -> list[list[str]]:
    """Cells of the page's table with so many columns, without its heading."""
    lines = [line.split("|")[1:-1] for line in PAGE.read_text(encoding="utf-8").splitlines()]
    return [[cell.strip() for cell in line] for line in lines if len(line) == columns][2:]


def entry(effect: str, added: str, verdict: str, better: str) -> dict[str, Any]:
    """A row as the program keeps it."""
    came, _, gone = better.partition(" for ")
    told = None if better == "-" else [gone.split(" + "), came.split(" + "), 1.0]
    verdict, _, path = verdict.partition(": ")
    known = {"verdict": verdict.replace(" ", "_"), "path": path.replace(", ", " + ").split(" + ")}
    return {"effect": effect, "added": added, "better": told, **known}


def seeds() -> list[str]:
    return list(dict.fromkeys(seed for seed, *_ in rows(7)))


def test_each_effect_is_tried_with_its_two_relatives_and_itself() -> None:
    for of in seeds():
        added: dict[str, list[str]] = {}
        for seed, effect, one, *_ in rows(7):
            if seed == of:
                added.setdefault(effect, []).append(one)
        assert len(added) >= 14
        assert added == {effect: [*wrong_additions.relatives(effect), effect] for effect in added}


def test_the_figures_count_the_rows() -> None:
    for place, of in enumerate(seeds(), start=1):
        mine = [row[1:] for row in rows(7) if row[0] == of]
        entries = [entry(effect, added, verdict, better) for effect, added, _, verdict, better, _ in mine]
        counted = dict(wrong_additions.figures(entries))
        printed = {row[0]: row[place] for row in rows(1 + len(seeds()))}
        assert set(counted) == set(printed)
        named = "wrong effect added: the truth named or offered in exchange"  # rows do not tell all offered
        least, most = (int(one[named].split()[0]) for one in (counted, printed))
        assert 0 < least <= most
        assert {**counted, named: printed[named]} == printed
