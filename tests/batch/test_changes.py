"""A change of the bench: where it was put it is found, and where nothing was put none is told."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from fingerlab.batch.changes import beside, changes, courses, weigh_found
from fingerlab.batch.laws import Course, Prior, course
from fingerlab.batch.table import Row
from fingerlab.report.time_words import change_sentence
from fingerlab.sessions.model import Array

DAYS = np.arange(10.0)
UNITS = {"alone.coulomb_friction.coulomb_pip": "N m", "param.arm_mcp@extension": "m"}


def weigh(days: Array, values: Array, change: float = 0.5) -> Course | None:
    """The course of a number whose sessions tell no interval, and of which one would matter."""
    return course(days, values, np.full(len(values), np.nan), Prior(0.0, 1.0, False, change))


def row(day: int, model: tuple[str, ...] = (), **values: float) -> Row:
    when = datetime.fromtimestamp(86400.0 * (20000 + day), UTC).isoformat()
    known = {"session": f"s{day}.h5", "sha256": f"{day}", "created": when, "error": None, "score": 1.0}
    return known | {"final_score": 1.0, "final_model": list(model)} | values


def test_steady_numbers_are_seldom_told_to_have_changed() -> None:
    """Of twelve quantities in ten sessions, as many as a bench has, few in a hundred benches show a step."""
    rng = np.random.default_rng(2)
    told = [
        any(w is not None and w.step > 0.5 for w in (weigh(DAYS, rng.standard_normal(10), 1 / 13),))
        for _ in range(12 * 80)
    ]
    benches = np.array(told).reshape(80, 12).any(axis=1)
    assert benches.mean() < 0.05


def test_the_probability_of_a_step_is_how_often_there_was_one() -> None:
    """Benches are drawn from what is assumed beforehand; of those told 0.5 to 0.9, so many have a step."""
    rng = np.random.default_rng(3)
    said, were = [], []
    for _ in range(600):
        scatter, step = 0.03 * abs(rng.standard_cauchy()), rng.random() < 0.5
        values = 2.0 * rng.standard_normal() + scatter * rng.standard_normal(8)
        if step:
            size = rng.standard_normal() * rng.choice((1 / 27, 1 / 9, 1 / 3, 1.0, 3.0))
            values = values + size * (np.arange(8) >= rng.integers(1, 8))
        found = weigh(DAYS[:8], values, 0.5)
        assert found is not None
        said.append(found.step / (found.step + found.chances["steady"] * 0.3))  # a step is 0.3 of all changes
        were.append(step)
    between = (np.array(said) > 0.5) & (np.array(said) < 0.9)
    assert between.sum() > 30
    assert np.array(were)[between].mean() == pytest.approx(np.array(said)[between].mean(), abs=0.15)


@pytest.mark.parametrize("place", [2, 5, 8])
def test_a_step_is_found_where_it_is(place: int) -> None:
    values = np.random.default_rng(4).standard_normal(10) + 9.0 * (np.arange(10) >= place)
    found = weigh(DAYS, values)
    assert found is not None
    assert found.step > 0.95
    assert found.place == place
    assert found.places[place] > 0.8


def test_a_slope_is_a_drift_and_no_step() -> None:
    found = weigh(DAYS, 2.0 * DAYS + np.random.default_rng(5).standard_normal(10))
    assert found is not None
    assert found.chances["wear"] > 0.85
    assert found.step < 0.1


def test_one_session_that_went_wrong_is_no_change() -> None:
    values = np.random.default_rng(6).standard_normal(10)
    values[4] += 30.0
    found = weigh(DAYS, values)
    assert found is not None
    assert found.step < 0.3


def test_yes_and_no_by_counting() -> None:
    """Two of two before, none of three after: five factors of rates by hand, as Beta functions."""
    found = weigh_found(np.arange(5.0), [True, True, False, False, False], 0.5)
    assert found is not None
    # Jeffreys: yes k of n has B(k + 1/2, n - k + 1/2) / pi. Places 2 and 3.
    steady = 3 / 256  # B(5/2, 7/2) / pi
    at_2 = (3 / 8) * (5 / 16)
    at_3 = (1 / 16) * (3 / 8)
    factor = 0.5 * (at_2 + at_3) / steady
    assert found.step == pytest.approx(factor / (1.0 + factor), rel=1e-9)
    assert found.place == 2
    assert found.certain_place == pytest.approx(at_2 / (at_2 + at_3))


def test_too_few_sessions_or_one_time_tell_nothing() -> None:
    assert weigh(np.arange(2.0), np.array([0.0, 9.0])) is None
    assert weigh(np.zeros(8), np.arange(8.0)) is None
    assert weigh_found(np.arange(4.0), [False, False, True, True]) is None


def test_a_new_effect_is_named_with_its_strength_and_not_twice() -> None:
    rng = np.random.default_rng(7)
    friction = {"coulomb_friction"}
    rows = [
        row(
            day,
            tuple(friction) if day >= 4 else (),
            **{
                "alone.coulomb_friction.coulomb_pip": (2e-3 if day >= 4 else 0.0) + 1e-5 * rng.random(),
                "param.arm_mcp@extension": 0.01 + 1e-5 * rng.standard_normal(),
            },
        )
        for day in range(9)
    ]
    (found,) = changes(rows, UNITS)
    assert (found.kind, found.effect, found.before, found.after) == (
        "new", "coulomb_friction", "s3.h5", "s4.h5",
    )  # fmt: skip
    assert found.found == (0, 4, 5, 5)
    assert found.second is not None
    assert found.second.value == pytest.approx(2e-3, rel=0.02)
    said = change_sentence(found)
    assert (
        "a new effect appeared, Coulomb joint friction, missing in 0 of 4 sessions before and in 5 of 5"
        in said
    )
    assert "PIP friction, Coulomb went from" in said
    assert "(2024-10-08)" in said


def test_numbers_that_lean_on_what_is_missing_are_not_named_beside_it() -> None:
    """Another friction, fitted alone, takes up what the missing one does; an arm shifts a little."""
    rng = np.random.default_rng(17)
    rows = [
        row(
            day,
            ("coulomb_friction",) if day >= 4 else (),
            **{
                "alone.coulomb_friction.coulomb_pip": 2e-3 * (day >= 4) + 1e-5 * rng.random(),
                "alone.viscous_friction.viscous_pip": 4e-3 * (day >= 4) + 1e-7 * rng.random(),
                "param.arm_mcp@extension": 0.01 + 1e-4 * (day >= 4) + 1e-7 * rng.standard_normal(),
            },
        )
        for day in range(8)
    ]
    (found,) = changes(rows, UNITS)
    assert (found.kind, found.effect) == ("new", "coulomb_friction")
    assert set(found.others) == {"alone.viscous_friction.viscous_pip", "param.arm_mcp@extension"}
    assert "With it moved 2 other numbers." in change_sentence(found)
    leaning = {one.column: one.leans_on for one in courses(rows, UNITS)}
    assert leaning["alone.viscous_friction.viscous_pip"] == ("coulomb_friction",)
    assert leaning["alone.coulomb_friction.coulomb_pip"] == ()


def test_the_same_effect_that_grows_is_told_to_grow() -> None:
    rng = np.random.default_rng(8)
    rows = [
        row(
            day,
            ("coulomb_friction",),
            **{"alone.coulomb_friction.coulomb_pip": (4e-3 if day >= 5 else 2e-3) + 1e-4 * rng.random()},
        )
        for day in range(10)
    ]
    (found,) = changes(rows, UNITS)
    assert (found.kind, found.found) == ("grown", (5, 5, 5, 5))
    assert "the same effect has grown" in change_sentence(found)


def test_an_arm_that_moved_is_a_change_of_the_bench() -> None:
    rng = np.random.default_rng(9)
    arms = [0.0100 + (day >= 6) * 0.0004 + 1e-5 * rng.standard_normal() for day in range(10)]
    rows = [row(day, **{"param.arm_mcp@extension": arm}) for day, arm in enumerate(arms)]
    (found,) = changes(rows, UNITS)
    assert (found.kind, found.effect, found.after) == ("moved", "", "s6.h5")
    assert "moment arm MCP, extension went from 9.999" in change_sentence(found)


def test_the_other_joint_of_an_effect_that_came_is_part_of_the_same_change() -> None:
    rng = np.random.default_rng(19)
    rows = [
        row(
            day,
            ("coulomb_friction",) if day >= 4 else (),
            **{
                f"alone.coulomb_friction.coulomb_{joint}": size * (day >= 4) + 1e-5 * rng.random()
                for joint, size in (("mcp", 2e-3), ("pip", 1.4e-3))
            },
        )
        for day in range(8)
    ]
    found, told = changes(rows, UNITS), courses(rows, UNITS)
    assert [change.kind for change in found] == ["new"]
    assert [one.course.verdict for one in told if one.effect == "coulomb_friction"] == ["new", "new"]
    assert beside(told, found) == []
