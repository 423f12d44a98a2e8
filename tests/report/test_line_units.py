"""Units of a linear axis told as an arc of radius r: x = r q, F = T / r, so m = J / r^2, c and k alike."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fingerlab.core.text import ParameterEstimate, amount
from fingerlab.diagnosis.answer.error_parts import Comparison
from fingerlab.diagnosis.answer.residual_profiles import profile
from fingerlab.report.line_units import LineUnits
from fingerlab.report.parameter_words import held_words
from fingerlab.rig.file import Motor, Rig

RADIUS = 0.02
LINE = LineUnits(RADIUS)


@pytest.mark.parametrize(
    ("si", "unit", "power"),
    [
        ("N m", "N", -1), ("rad", "m", 1), ("rad/s", "m/s", 1), ("rad/s^2", "m/s^2", 1),
        ("kg m^2", "kg", -2), ("N m s/rad", "N s/m", -2), ("N m/rad", "N/m", -2),
        ("N m s^2/rad^2", "N s^2/m^2", -3), ("N m/rad^3", "N/m^3", -4), ("1/rad", "1/m", -1),
        ("N", "N", 0), ("m", "m", 0), ("s", "s", 0), ("1", "1", 0), ("kg", "kg", 0),
    ],
)  # fmt: skip
def test_a_unit_goes_by_powers_of_the_radius(si: str, unit: str, power: int) -> None:
    line, factor = LINE.unit(si)
    assert line == unit
    assert factor == pytest.approx(RADIUS**power)
    assert LineUnits().unit(si) == (si, 1.0)  # an axis that turns


def test_degrees_and_turns_are_ways() -> None:
    assert LINE.unit("deg") == ("m", pytest.approx(math.radians(1.0) * RADIUS))
    # Three to a turn of 2 pi r = 125.7 mm: every 41.9 mm, 23.87 to a metre.
    unit, factor = LINE.unit("1/turn")
    assert (unit, 3.0 * factor) == ("1/m", pytest.approx(23.87, abs=0.01))


def test_the_screen_shows_values_of_the_arc_along_the_line() -> None:
    """2 rad/s at 20 mm are 40 mm/s; 60 rad/s are 1.2 m/s; 3 mN m are 0.15 N."""
    slow, fast, force = LINE.screen("rad/s", 2.0), LINE.screen("rad/s", 60.0), LINE.screen("N m", 3e-3)
    assert (slow.symbol, 2.0 * slow.factor) == ("mm/s", pytest.approx(40.0))
    assert (fast.symbol, 60.0 * fast.factor) == ("m/s", pytest.approx(1.2))
    assert (force.symbol, 3e-3 * force.factor) == ("N", pytest.approx(0.15))
    assert amount(0.5, "m/s") == "500 mm/s"


@pytest.mark.parametrize(
    ("of_arc", "along"),
    [
        ("a torque of 152 ± 6 mN m at a motor speed", "a force of 7.6 ± 0.3 N at a speed"),
        ("friction torque at the gearbox output 34 N m;", "friction force 1700 N;"),
        ("travel 0.5° (0.4 to 0.9).", "travel 0.17 mm (0.14 to 0.31)."),
        ("stiffness 26.59 ± 0.10 mN m/rad", "stiffness 66.5 ± 0.2 N/m"),
        ("viscous friction −4 mN m s/rad", "viscous friction −10 N s/m"),
        ("inertia J 12.00 ± 0.04 kg cm²", "mass 3.000 ± 0.010 kg"),
        ("90 °/s, 1.2 floors, 0.3 s and 12 %", "31 mm/s, 1.2 floors, 0.3 s and 12 %"),
        ("with its angle: run 001 at 2 N", "with its position: run 001 at 2 N"),
    ],
)  # fmt: skip
def test_a_sentence_has_the_amounts_of_the_line(of_arc: str, along: str) -> None:
    assert LINE.sentence(of_arc) == along
    assert LineUnits().sentence(of_arc) == of_arc


def test_what_is_held_is_told_along_the_line() -> None:
    assert held_words({"bench_inertia": 1.2e-3}, 0.01) == "mass held at 12 kg"
    assert held_words({"bench_inertia": 1.2e-3}) == "inertia J held at 12 kg cm²"


def test_curves_and_what_they_are_drawn_over() -> None:
    """A torque of 0.3 N m in the sense of the speed of a sine of 2 rad at 1 rad/s."""
    time = np.linspace(0.0, 60.0, 3000)
    angle, speed = 2.0 * np.sin(time), 2.0 * np.cos(time)
    torque = 0.3 * np.sign(speed)
    places = {"motor angle": angle, "motor speed": speed, "motor acceleration": -angle}
    arc = Comparison("motor_torque", "s", "001", "motor_bench", time, torque, 0.0 * time, "N m", 0.01, places)
    line = LINE.comparison(arc)
    assert (line.equation, line.unit) == ("motor_force", "N")
    assert np.abs(line.measured) == pytest.approx(15.0)  # 0.3 N m / 20 mm
    assert line.floor == pytest.approx(0.5)
    assert line.coordinates["position"] == pytest.approx(RADIUS * angle)
    assert line.coordinates["speed"] == pytest.approx(RADIUS * speed)
    over = profile((line,), "motor_force", "axis_speed")
    assert over is not None
    assert over.mean[[0, -1]] == pytest.approx([-15.0, 15.0])
    assert over.edges[[0, -1]] == pytest.approx([-0.04, 0.04], rel=0.01)  # m/s
    # The phase of a stroke is the same one; the arc's own coordinates are not offered beside it.
    phases = [profile((one,), one.equation, "phase") for one in (arc, line)]
    assert phases[0] is not None
    assert phases[1] is not None
    assert phases[1].mean == pytest.approx(phases[0].mean / RADIUS, nan_ok=True)
    assert profile((line,), "motor_force", "motor_speed") is None
    assert LineUnits().comparison(arc) is arc


def test_an_estimate_keeps_its_share() -> None:
    found = LINE.estimate(ParameterEstimate(0.004, "N m s/rad", 0.003, 0.006))
    assert vars(found) == {
        "value": pytest.approx(10.0),
        "unit": "N s/m",
        "low": 7.5,
        "high": pytest.approx(15.0),
    }


def test_channels_and_constants_have_the_words_and_units_of_the_line() -> None:
    """At 20 mm 3 mN m are 0.15 N and 1 rad is 20 mm; 1.2e-3 kg m2 are 3 kg, 0.1 N m/A times 4 are 20 N/A."""
    assert [LINE.called(name) for name in ("motor_position", "motor_torque", "temperature_case")] == [
        "position", "force", "temperature case",
    ]  # fmt: skip
    assert LineUnits().called("motor_torque") == "motor torque"
    position, force = LINE.channel("motor_position", 1.0), LINE.channel("motor_torque", 3e-2)
    assert (position.symbol, position.factor) == ("mm", pytest.approx(20.0))
    assert (force.symbol, 3e-2 * force.factor) == ("N", pytest.approx(1.5))
    assert LINE.channel("motor_current", 2.0).symbol == "A"
    rig = Rig(None, Motor(torque_constant=0.1, gear_ratio=4.0, inertia=1.2e-3))
    told = {one.name: (one.key, one.unit, one.value) for one in LINE.constants(rig)}
    assert told == {
        "force constant": ("torque_constant", "N/A", pytest.approx(20.0)),
        "mass": ("inertia", "kg", pytest.approx(3.0)),
    }
    arc = {one.name: (one.unit, one.value) for one in LineUnits().constants(rig)}
    assert arc == {
        "torque constant": ("N m/A", 0.1), "gear ratio": ("", 4.0), "inertia": ("kg m^2", 1.2e-3),
    }  # fmt: skip


def test_what_is_still_told_of_the_arc_is_explained() -> None:
    assert LINE.file == (
        "The axis is linear, kept as an arc of 20 mm: 1 N m is 50 N and 1 deg is 0.349 mm. The file and what "
        "is exported of it are told so."
    )
    assert "1 N m is 50 N, 1 deg is 0.349 mm and 1 N m s/rad is 2500 N s/m. Equations" in LINE.arc
    assert LineUnits().file == LineUnits().arc == ""
