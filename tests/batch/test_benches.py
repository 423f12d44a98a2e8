"""Which effects two benches share: how they are named, and what is told of sessions of known strengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fingerlab.batch.benches import folders_of, group_of, shared_effects, two_groups
from fingerlab.batch.table import Row
from fingerlab.core.errors import UserError
from fingerlab.report.time_words import shared_cells, shared_csv, shared_json, shared_sentence

COLUMN = "motor_coulomb_friction.coulomb"
UNITS = {f"param.{COLUMN}": "N m", f"alone.{COLUMN}": "N m"}


def session(bench: str, number: int, strength: float, found: bool, error: float = 1e-4) -> Row:
    value = max(strength + error * float(np.random.default_rng(number).standard_normal()), 0.0)
    kinds = ("alone", "param") if found else ("alone",)
    numbers: dict[str, Any] = {}
    for kind in kinds:
        numbers |= {f"{kind}.{COLUMN}": value, f"{kind}.{COLUMN}.low": value - 1.645 * error}
        numbers[f"{kind}.{COLUMN}.high"] = value + 1.645 * error
    return {
        "session": f"{bench}/s{number}.h5", "sha256": f"{bench}{number}", "error": None, "set": [],
        "created": f"2026-05-0{number + 1}T10:00:00+00:00",
        "final_model": ["motor_coulomb_friction"] if found else [], **numbers,
    }  # fmt: skip


def benches(first: float, second: float, count: int = 4) -> list[Row]:
    return [
        session(name, number + 4 * (name == "right"), strength, strength > 0)
        for name, strength in (("left", first), ("right", second))
        for number in range(count)
    ]


@pytest.mark.parametrize(
    ("first", "second", "likeliest"),
    [(5e-3, 5e-3, "same"), (5e-3, 8e-3, "differs"), (5e-3, 0.0, "first"), (0.0, 3e-3, "second")],
)
def test_who_has_an_effect_is_told_with_its_strengths(first: float, second: float, likeliest: str) -> None:
    groups = two_groups(benches(first, second), "left", "right")
    (found,) = shared_effects(*groups, UNITS)
    assert found.likeliest == likeliest
    assert found.chances[likeliest] > 0.9
    assert sum(found.chances.values()) == pytest.approx(1.0)
    (strength,) = found.strengths
    assert strength.first.low <= first <= strength.first.high
    assert strength.second.low <= second <= strength.second.high
    assert found.found == (4 * (first > 0), 4, 4 * (second > 0), 4)


def test_one_session_each_that_hardly_differ_leave_it_open() -> None:
    rows = [session("left", 0, 5.0e-3, True, 4e-4), session("right", 4, 6.2e-3, True, 4e-4)]
    groups = two_groups(rows, "left", "right")
    (found,) = shared_effects(*groups, UNITS)
    assert max(found.chances["same"], found.chances["differs"]) < 0.85
    assert found.chances["first"] + found.chances["second"] < 0.05


def test_the_words_and_the_tables_say_the_same() -> None:
    groups = two_groups(benches(5e-3, 0.0), "left", "right")
    (found,) = shared_effects(*groups, UNITS)
    said = shared_sentence(found, *groups)
    assert said.startswith("Coulomb friction in motor and gearbox is on left only: ")
    assert "found in 4 of 4 sessions of left and in 0 of 4 of right" in said
    (cells,) = shared_cells(found)
    assert cells[1] == "first only"
    assert shared_json(found, *groups)["sentence"] == said
    head, line = shared_csv([found]).splitlines()
    row = dict(zip(head.split(","), line.split(","), strict=True))
    assert (row["told"], row["unit"], row["found_first"]) == ("first", "N m", "4")
    assert float(row["first_low"]) < 5e-3 < float(row["first_high"])


def test_a_bench_is_a_folder_or_a_pattern_of_names() -> None:
    rows = benches(5e-3, 5e-3)
    assert folders_of(rows) == ["left", "right"]
    assert [row["session"] for row in group_of(rows, "left/").rows] == [f"left/s{k}.h5" for k in range(4)]
    assert len(group_of(rows, "*/s[45].h5").rows) == 2
    with pytest.raises(UserError, match="No session with a verdict and a time is in 'middle'"):
        group_of(rows, "middle")
    with pytest.raises(UserError, match="is in both 'left' and"):
        two_groups(rows, "left", "*s0*")


def test_a_session_whose_model_holds_another_effect_tells_of_none() -> None:
    """Joint friction fitted alone takes up the motor's: what it seems to be there counts as none."""
    rows = benches(5e-3, 5e-3)
    for row in rows:
        if row["session"].startswith("right"):
            row |= {"final_model": ["backlash"], f"alone.{COLUMN}": 5e-3}
            for end in ("", ".low", ".high"):
                del row[f"param.{COLUMN}{end}"]
    found = {one.effect: one for one in shared_effects(*two_groups(rows, "left", "right"), UNITS)}
    assert found["motor_coulomb_friction"].likeliest == "first"
    assert found["backlash"].chances == {}  # no session tells its strength
