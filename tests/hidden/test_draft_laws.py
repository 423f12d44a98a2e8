"""How trials of drafted laws are counted, on entries whose answers are known."""

from __future__ import annotations

from typing import Any

from fingerlab.twin.effects import EFFECTS
from tests.hidden import draft_laws


def law(where: str, variables: list[str], score: float, beside: tuple[str, ...] = ()) -> dict[str, Any]:
    return {
        "terms": [{"where": where, "variables": variables, "words": "words"}],
        "score": score,
        "beside": list(beside),
        "catalogue": {"effect": None, "score": 4.0},
        "title": "a law",
    }


def entry(effect: str, score: float, last: float, laws: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "effect": effect,
        "seed": 1,
        "score": score,
        "last": last,
        "path": [],
        "laws": laws,
        "seconds": 1.0,
    }


def test_every_effect_has_a_place_and_variables() -> None:
    assert set(draft_laws.TRUE) == set(EFFECTS)


def test_a_law_is_right_by_its_place_and_by_what_it_depends_on() -> None:
    assert draft_laws.is_right("viscous_friction", law("joints", ["joint speed"], 1.0))
    assert not draft_laws.is_right("viscous_friction", law("motor", ["motor speed"], 1.0))
    assert not draft_laws.is_right("capstan_friction", law("motor", ["direction"], 1.0))
    assert draft_laws.is_right("capstan_friction", law("motor", ["tension", "direction"], 1.0))


def test_the_figures_count_what_could_show() -> None:
    right, wrong = law("joints", ["joint speed"], 1.1), law("cable", ["time"], 1.6, ("backlash",))
    entries = [
        entry("viscous_friction", 6.0, 3.0, [right]),
        entry("viscous_friction", 6.0, 3.0, [wrong, right]),
        entry("coulomb_friction", 5.0, 1.1, []),  # a neighbour explains it
        entry("gravity_tilt", 1.1, 1.1, []),  # nothing is seen of it
        entry("", 1.0, 1.0, []),
        entry("", 1.0, 1.0, [wrong]),
        {"effect": "backlash", "seed": 1, "failed": "UserError: no"},
    ]
    figures = dict(draft_laws.figures(entries))
    assert [share.split(" (")[0] for share in figures.values()] == [
        "5", "1 of 5", "1 of 5", "2 of 3", "1 of 3", "1 of 3", "2 of 3", "2 of 2", "1 of 2",
    ]  # fmt: skip
    page = draft_laws.markdown(entries, "a command")
    assert page.count("\n| viscous_friction | 1 | 6.00 |") == 2
    assert "beside backlash" in page
    assert "failed: UserError" in page
