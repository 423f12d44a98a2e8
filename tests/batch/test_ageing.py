"""Trends over months: numbers that are known beforehand."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from fingerlab.batch.followed import ageing_rows, trend, trends
from fingerlab.batch.table import Row, recorded_at

DAYS = np.array([0.0, 20.0, 45.0, 61.0, 90.0, 122.0, 150.0, 200.0])
YEAR_OF_MONTHS = 365.25 / 12


def row(day: int, **values: object) -> Row:
    when = datetime.fromtimestamp(86400.0 * (20000 + day), UTC).isoformat()
    return {"session": f"s{day}", "sha256": f"{day}", "created": when, "error": None, "score": 1.0, **values}


def test_a_straight_line_has_its_slope_and_no_width() -> None:
    found = trend(DAYS, 3.0 + 0.2 * DAYS / YEAR_OF_MONTHS)
    assert found == pytest.approx((0.2, 0.2, 0.2))


def test_one_session_that_went_wrong_does_not_turn_the_trend() -> None:
    values = 3.0 + 0.2 * DAYS / YEAR_OF_MONTHS
    values[3] += 50.0
    found = trend(DAYS, values)
    assert found is not None
    assert found[0] == pytest.approx(0.2)
    least_squares = np.polyfit(DAYS / YEAR_OF_MONTHS, values, 1)[0]
    assert abs(least_squares - 0.2) > 0.4


def test_nine_intervals_in_ten_hold_the_slope() -> None:
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(400):
        found = trend(DAYS, 0.1 * DAYS / YEAR_OF_MONTHS + rng.standard_normal(len(DAYS)))
        assert found is not None
        inside += found[1] <= 0.1 <= found[2]
    assert 0.86 < inside / 400 < 0.95


def test_three_times_are_too_few_whatever_the_number_of_sessions() -> None:
    assert trend(DAYS[:3], DAYS[:3]) is None
    assert trend(np.repeat(DAYS[:3], 4), np.arange(12.0)) is None
    assert trend(DAYS[:4], DAYS[:4]) is not None


def test_only_sessions_with_a_time_and_an_answer_count_and_copies_once() -> None:
    rows = [
        row(30),
        row(0),
        row(60, error="broken"),
        {**row(90), "created": "yesterday"},
        {**row(0), "session": "copy of s0"},
    ]
    assert [r["session"] for r in ageing_rows(rows)] == ["s0", "s30"]


def test_a_quantity_that_only_some_sessions_have_is_followed_over_those() -> None:
    key = "alone.motor_coulomb_friction.coulomb"
    rows = [row(int(day), **({key: 1e-3 * day} if day > 30 else {})) for day in DAYS]
    found = {t.column: t for t in trends(rows, {key: "N m"})}
    assert found[key].sessions == 6
    assert found[key].unit == "N m"
    assert found[key].per_month == pytest.approx(1e-3 * YEAR_OF_MONTHS)
    assert found[key].changes
    assert not found["score"].changes


def test_times_are_compared_in_utc() -> None:
    assert recorded_at("2026-03-29T01:30:00+01:00") == datetime(2026, 3, 29, 0, 30, tzinfo=UTC)
    assert recorded_at("2026-03-29T01:30:00Z") == recorded_at("2026-03-29T01:30:00")
    assert recorded_at("last spring") is None
    assert recorded_at(None) is None
