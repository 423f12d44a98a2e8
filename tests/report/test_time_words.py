"""What became of a number, in a sentence, a table and the JSON."""

from __future__ import annotations

import csv
import io
from datetime import UTC, datetime, timedelta

import numpy as np

from fingerlab.batch.changes import NumberCourse, courses
from fingerlab.batch.table import Row
from fingerlab.report.time_words import course_json, course_sentence, courses_csv
from fingerlab.sessions.model import Array

LOSS, ARM = "param.loss_mcp@extension", "param.arm_mcp@extension"
MOTOR = "alone.motor_viscous_friction.viscous"
UNITS = {LOSS: "N m", ARM: "m", MOTOR: "N m s/rad"}


def one_course(column: str, values: Array, days: Array | None = None, error: float = 2e-5) -> NumberCourse:
    start, rng = datetime(2026, 5, 1, 9, tzinfo=UTC), np.random.default_rng(4)
    rows: list[Row] = []
    for k, value in enumerate(values):
        noisy = float(value + error * rng.standard_normal())
        when = start + timedelta(days=float(k if days is None else days[k]))
        numbers = {
            column: noisy,
            f"{column}.low": noisy - 1.645 * error,
            f"{column}.high": noisy + 1.645 * error,
        }
        known = {"session": f"d{k}.h5", "sha256": f"{k}", "created": when.isoformat()}
        rows.append(known | {"error": None, "final_model": []} | numbers)
    (found,) = courses(rows, UNITS)
    return found


AT = np.arange(8)


def test_a_step_says_between_which_sessions_and_what_it_reads_as() -> None:
    worse = course_sentence(one_course(LOSS, 2e-4 + 6e-4 * (AT >= 4)))
    assert worse.startswith("Between d3.h5 and d4.h5 (2026-05-05; of that moment ")
    assert "loss MCP, extension went from 0.2" in worse
    assert "as after damage or with a new part. Probability" in worse
    better = course_sentence(one_course(LOSS, 8e-4 - 6e-4 * (AT >= 4)))
    assert "as after a repair, cleaning or lubrication." in better
    laid = course_sentence(one_course(ARM, 1e-2 + 4e-4 * (AT >= 4)))
    assert "moment arm MCP, extension went from 10.0" in laid
    assert "as when a part is changed or a cable laid anew." in laid


def test_other_courses_say_what_they_read_as() -> None:
    assert "grows steadily, from 0.2" in course_sentence(one_course(LOSS, 2e-4 + 1e-3 * AT / 7.0))
    assert "as of what wears in or comes loose" in course_sentence(one_course(LOSS, 1e-3 - 8e-4 * AT / 7.0))
    odd = course_sentence(one_course(LOSS, 2e-4 + 8e-4 * (AT == 3)))
    assert "d3.h5 alone is off by 0.8" in odd
    days = np.array([0.0, 0.02, 0.04, 0.06, 3.0, 3.02, 3.04, 3.06])
    warm = 2e-3 - 1e-3 * (1.0 - np.exp(-(days % 3.0) * 1440.0 / 25.0))
    said = course_sentence(one_course(MOTOR, warm, days))
    assert "within each sitting and comes back after a pause, as with temperature." in said
    assert "stayed at 0.2" in course_sentence(one_course(LOSS, np.full(12, 2e-4)))


def test_what_cannot_be_told_is_said_with_what_it_may_be() -> None:
    few = course_sentence(one_course(LOSS, np.array([2e-4, 2e-4, 3e-4])))
    assert "but 3 sessions cannot tell how: step " in few
    none = course_sentence(one_course(LOSS, np.array([2e-4, 2.2e-4, 2.1e-4])))
    assert none.startswith("Loss MCP, extension: 3 sessions cannot tell whether it changed; steady ")
    last = course_sentence(one_course(LOSS, 2e-4 + 8e-4 * (AT == 7)))
    assert "but 8 sessions cannot tell how: " in last
    assert last.endswith("A session more would tell a step from one that went wrong.")


def test_a_new_effect_is_named_and_the_tables_hold_the_same_numbers() -> None:
    found = one_course(MOTOR, 2e-3 * (AT >= 5))
    assert "viscous friction in motor and gearbox is a new effect." in course_sentence(found)
    told = course_json(found)
    assert (told["told"], told["step_before"][0]["session"]) == ("new", "d5.h5")
    assert sum(told["chances"].values()) - 1.0 < 1e-9
    assert told["size"]["low"] < 2e-3 < told["size"]["high"]
    (row,) = csv.DictReader(io.StringIO(courses_csv([("left", [found])])))
    assert (row["bench"], row["told"], row["step_before"]) == ("left", "new", "d5.h5")
    assert row["unit"] == "N m s/rad"
    assert abs(float(row["last"]) / told["last"]["value"] - 1.0) < 1e-8
