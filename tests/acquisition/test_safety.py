"""Checks trip at their limit and not before it; each is told in one sentence."""

from __future__ import annotations

import math
from dataclasses import fields

import pytest

from fingerlab.acquisition.control.machine import SetUp
from fingerlab.acquisition.control.plausibility import safety_checks
from fingerlab.acquisition.control.safety import (
    EncoderJump,
    EncoderStuck,
    FollowingError,
    Late,
    Reading,
    Rise,
    Safety,
    Stuck,
    Watchdog,
)
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.core.errors import UserError
from fingerlab.rig.file import Rig, default_rig, parse_rig
from fingerlab.rig.limits import Limits, limits_table

UNITS = BenchUnits.from_rig(default_rig())
PRESS, ALONE = SetUp("contact", "flexion"), SetUp("motor_bench", "none")


def healthy(index: int = 0, position: float = 0.4) -> Reading:
    reading = Reading()
    reading.index, reading.lateness = index, 0.0
    reading.position = reading.reference = position
    reading.speed, reading.current, reading.torque, reading.tension = 1.0, 0.3, 0.04, 2.6
    reading.mcp, reading.pip, reading.force = 0.1, 0.2, 1.0
    reading.raw = (0.6 + 1e-4 * index, 2.0 + 1e-4 * index, 2.1 + 1e-4 * index, 0.5, 500.0)
    return reading


@pytest.fixture
def safety() -> Safety:
    return safety_checks(Limits(), 1000.0, UNITS, PRESS)


def test_a_healthy_bench_has_no_fault(safety: Safety) -> None:
    for k in range(3000):
        assert safety.fault(healthy(k, 0.4 + 0.2 * math.sin(0.01 * k))) is None


@pytest.mark.parametrize(
    ("attribute", "limit", "words"),
    [
        ("current", 3.0, "current"),
        ("torque", 0.4, "torque"),
        ("speed", 20.0, "speed"),
        ("force", 10.0, "force"),
        ("mcp", math.radians(95), "MCP"),
        ("pip", math.radians(95), "PIP"),
        ("position", math.radians(160), "position"),
        ("current", -3.0, "current"),
        ("torque", -0.4, "torque"),
        ("speed", -20.0, "speed"),
        ("force", -1.0, "force"),
        ("mcp", math.radians(-60), "MCP"),
        ("pip", math.radians(-70), "PIP"),
        ("position", math.radians(-20), "position"),
    ],
)
def test_each_quantity_trips_just_beyond_its_limit(
    safety: Safety, attribute: str, limit: float, words: str
) -> None:
    reading = healthy()
    setattr(reading, attribute, limit * 0.9999)
    safety.reset()
    assert safety.fault(reading) is None
    setattr(reading, attribute, limit * 1.0001)
    safety.reset()  # so that only the value counts, not the jump to it
    sentence = safety.fault(reading)
    assert sentence is not None
    assert words in sentence
    assert sentence.count(".") >= 1


@pytest.mark.parametrize("attribute", ["position", "speed", "current", "torque", "mcp", "pip", "force"])
def test_a_sensor_that_gives_no_number_is_a_fault_at_once(safety: Safety, attribute: str) -> None:
    for bad in (math.nan, math.inf, -math.inf):
        reading = healthy()
        setattr(reading, attribute, bad)
        assert safety.fault(reading) is not None


def test_without_a_finger_its_sensors_are_not_asked() -> None:
    safety = safety_checks(Limits(), 1000.0, UNITS, ALONE)
    reading = healthy()
    reading.mcp = reading.pip = reading.force = math.nan
    assert safety.fault(reading) is None


def test_tension_may_rise_at_its_limit_over_ten_samples_and_no_faster() -> None:
    for slope, tripped in ((1999.0, False), (2001.0, True)):
        check, reading = Rise("tension", 2000.0, 1e-3, "cable tension", "N/s"), healthy()
        faults = []
        for k in range(30):
            reading.tension = slope * 1e-3 * k
            faults.append(check.fault(reading))
        assert any(faults) == tripped


def test_a_rise_over_lost_cycles_took_their_time_too() -> None:
    check, reading = Rise("tension", 2000.0, 1e-3, "cable tension", "N/s"), healthy()
    for k in range(200):  # 1500 N/s, every other cycle lost
        reading.tension, reading.lost = 3.0 * k, 1
        assert check.fault(reading) is None


def test_a_motor_without_a_cable_may_accelerate_as_its_torque_lets_it() -> None:
    """A chirp of 25 degrees to 4 Hz takes J a = 3e-4 * 276 = 0.083 N m, and 2 pi 4 times that a second."""
    safety = safety_checks(Limits(), 1000.0, UNITS, ALONE)
    for k in range(1000):
        reading = healthy(k)
        reading.torque = 0.083 * math.sin(8.0 * math.pi * 1e-3 * k)
        reading.tension = reading.torque / 0.002  # as on a small drum: 1040 N/s
        assert safety.fault(reading) is None


def test_the_tensions_rise_is_among_the_checks_of_every_experiment_with_a_cable() -> None:
    for set_up in (PRESS, SetUp("free", "extension")):
        safety, faults = safety_checks(Limits(), 1000.0, UNITS, set_up), []
        for k in range(30):
            reading = healthy(k)
            reading.tension = 2.5 * k  # 2500 N/s
            faults.append(safety.fault(reading))
        assert "tension" in str(next(filter(None, faults)))


def test_an_encoder_jump_is_seen_in_its_own_sample_and_lost_cycles_are_allowed_for() -> None:
    check = EncoderJump(0.1)
    assert check.fault(healthy(0, 0.0)) is None
    assert check.fault(healthy(1, 0.099)) is None
    assert "encoder jumped" in str(check.fault(healthy(2, 0.2)))
    after_a_gap = healthy(7, 0.6)
    after_a_gap.lost = 4
    assert check.fault(after_a_gap) is None


def test_an_encoder_that_stands_still_under_current_trips_after_its_time() -> None:
    check, reading = EncoderStuck(1.5, 0.5, 30), healthy()
    reading.current = 1.0
    check.fault(reading)
    reading.current = 1.6
    assert [check.fault(reading) is None for _ in range(31)] == [True] * 29 + [False] * 2
    reading.current = 1.4
    assert all(check.fault(reading) is None for _ in range(100))


def test_a_motor_that_holds_against_a_steady_load_has_no_stuck_encoder() -> None:
    check, reading = EncoderStuck(1.5, 0.5, 30), healthy()
    for k in range(2000):
        reading.current = 2.5 + 0.2 * math.sin(0.01 * k)
        assert check.fault(reading) is None


@pytest.mark.parametrize(
    ("force", "current", "trips"),
    [
        (1.0, 1.5, False),  # held by friction: it presses as before
        (1.4, 1.5, True),  # it turned unseen: the load cell tells
        (0.0, 1.5, True),  # let go of the load cell
        (1.0, 0.45, True),  # no friction holds 2.1 A of 2.5
    ],
)
def test_a_pressing_motor_may_be_held_by_friction_but_not_turn_unseen(
    force: float, current: float, trips: bool
) -> None:
    check, reading = EncoderStuck(1.5, 0.5, 30, load_cell=True), healthy()
    reading.current = current
    check.fault(reading)
    reading.current, reading.force = 2.5, force
    assert any(check.fault(reading) is not None for _ in range(60)) == trips


def test_a_stuck_sensor_is_told_from_a_finger_at_rest() -> None:
    check, reading = Stuck(1, "position", 0.17, 500, "MCP sensor"), healthy()
    assert all(check.fault(reading) is None for _ in range(2000))  # nothing moves
    faults = []
    for k in range(2000):
        reading.position = 0.4 + 0.1 * math.sin(0.01 * k)  # 0.2 rad from end to end
        faults.append(check.fault(reading))
    assert "MCP" in str(next(filter(None, faults)))


def test_the_motor_may_be_away_from_its_command_for_a_moment_only() -> None:
    check, reading = FollowingError(0.4, 100), healthy()
    reading.reference = reading.position + 0.41
    assert [check.fault(reading) is None for _ in range(100)] == [True] * 99 + [False]


def test_late_cycles_are_forgiven_one_by_one_and_not_in_a_row() -> None:
    check, reading = Late(0.02, 50, 1e-3), healthy()
    for k in range(501):
        reading.lateness = 0.003 if k % 2 else 0.0
        assert check.fault(reading) is None
    reading.lateness = 0.003
    assert [check.fault(reading) is None for _ in range(50)] == [True] * 49 + [False]
    reading.lateness, reading.lost = math.nan, 21
    assert "21 ms" in str(check.fault(reading))


def test_the_watchdog_counts_samples_and_nothing_else() -> None:
    dog = Watchdog("window", 500)
    assert dog.fault(1, 0) is None
    assert dog.fault(1, 500) is None
    assert "window" in str(dog.fault(1, 501))
    assert dog.fault(2, 10_000) is None


def test_every_limit_has_a_unit_and_a_source() -> None:
    for row in limits_table(Limits()):
        assert row.unit
        assert row.source
    assert {row.name for row in limits_table(Limits())} == {f.name for f in fields(Limits)} - {"sources"}


def test_a_rig_file_sets_limits_of_bench_and_loop_one_by_one() -> None:
    text = "[limits]\ncurrent = 2.0\nmcp_high = { value = 45.0, unit = 'deg' }\nlate_time = 0.05\n"
    rig = parse_rig(text, "rig.toml")
    limits = Rig.from_json(rig.to_json()).limits
    assert limits.current == 2.0
    assert limits.mcp_high == pytest.approx(0.7853981634)
    assert limits.late_time == 0.05
    assert limits.speed == Limits().speed
    assert limits.recorder_time == Limits().recorder_time


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("curent = 2.0", "unknown 'curent'"),
        ("current = 'two'", "finite number"),
        ("current = nan", "finite number"),
        ("late_time = -1.0", "late_time is -1; it should be above zero"),
        ("late_time = {value = 20, unit = 'm'}", "in 'm'; it should be in 's'"),
        ("mcp_low = 3.0", "not below mcp_high"),
    ],
)
def test_bad_limits_are_one_sentence(text: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        parse_rig(f"[limits]\n{text}\n", "rig.toml")
