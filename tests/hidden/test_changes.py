"""How trials of changing benches are drawn and counted; sequences whose answer is plain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.hidden import changes
from tests.hidden.changing_benches import KINDS, Plan, bench_of, drawn, drawn_pair, plans


def entry(kind: str, told: str, right: bool = True, **more: Any) -> dict[str, Any]:
    known: dict[str, Any] = {"place": 3, "sessions": 7, "certain": 10.0, "end": False, "chance": 0.95}
    known |= {"kind": kind, "told": told, "first": told, "right": right, "at": 3}
    return known | {"covered": True, "alarms": []} | more


def test_the_figures_count_alarms_kinds_moments_and_sizes() -> None:
    entries = [
        entry("nothing", "steady"),
        entry("nothing", "odd", alarms=["odd"]),
        entry("step", "step"),
        entry("step", "open", first="step", at=5),
        entry("new", "new", covered=False),
        entry("wear", "step", certain=4.0),
        entry("step", "open", end=True),
    ]
    shares = [share.split(" (")[0] for _, share in changes.figures(entries)]
    assert shares == [
        "1 of 2", "-", "4 of 4", "3 of 4", "3 of 3", "3 of 4", "2 of 3", "2 of 3", "2 of 3", "2 of 3",
        "1 of 2", "1 of 1",
    ]  # fmt: skip
    page = changes.markdown(entries, [], [], [], "a command")
    assert "| step | 6 to 12 | 2 | 2 of 2 (100 %) | 1 | 1 | 0 |" in page
    assert "| wear | 3 to 6 | 1 | 0 of 1 (0 %) | 0 | 0 | 1 |" in page


@pytest.mark.parametrize("kind", KINDS)
def test_a_drawn_bench_has_the_change_that_it_says(kind: str) -> None:
    case = drawn(kind, 5, 8)
    assert len(case.rows) == 8
    assert (case.column == "") == (kind == "nothing")
    if case.place >= 0 and case.column.count(".") < 2:
        values = np.array([row[case.column] for row in case.rows])
        odd = np.arange(8) == case.place if kind == "odd" else np.arange(8) >= case.place
        assert values[odd].mean() - values[~odd].mean() == pytest.approx(case.size, abs=abs(case.size))


def test_an_effect_that_came_or_went_is_told_as_that() -> None:
    for kind in ("new", "gone"):
        case = next(c for k in range(1, 40) if 2 < (c := drawn(kind, k, 8)).place < 6 and c.certain > 15.0)
        said = changes.judged(case)
        assert (said["told"], said["right"], said["at"]) == (kind, True, case.place)
        assert said["alarms"]


def test_an_effect_on_one_of_two_drawn_benches() -> None:
    first, second, effect = drawn_pair("first", 3, 4)
    assert any(effect in row["final_model"] for row in first)
    assert not any(row["final_model"] for row in second)
    assert changes.judged_pair("first", 3, 4)["told"] == "first"


def test_a_simulated_sequence_is_one_machine_and_its_plan_has_a_place() -> None:
    one, other = bench_of(7), bench_of(7, arms=1.05)
    assert one.known == other.known
    assert other.numbers["arms"]["extension"][0] == pytest.approx(1.05 * one.numbers["arms"]["extension"][0])
    for plan in plans(3):
        assert isinstance(plan, Plan)
        assert len(plan.strengths) == len(plan.days) == len(plan.arms)
        assert list(plan.days) == sorted(plan.days)
        if plan.kind == "new":
            assert all(s == 0.0 for s in plan.strengths[: plan.place])
            assert all(s > 0.0 for s in plan.strengths[plan.place :])
