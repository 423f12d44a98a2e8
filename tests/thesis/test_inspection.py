"""What the Fit tab shows: kinematic moment arms, regions in time, and how sure a line is at each tension."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.thesis.inspection import Inspection, inspect_session, kinematic_arms, region_spans
from fingerlab.thesis.traces import FitSpec, RegressionSums, fit_line

from . import invented as made

SIGN = -1  # of the extension cable


def _kinematic_run(name: str, zero: float):  # type: ignore[no-untyped-def]
    """Angles at frequencies of their own, so that each arm shows; the pulley winds what they ask for."""
    time = np.arange(20_000) / made.RATE
    mcp, pip = 0.3 * np.sin(2 * np.pi * time), 0.2 * np.sin(4 * np.pi * time + 0.4)
    wound = zero + SIGN * (0.011 * mcp + 0.0065 * pip)
    tension = made.sine_tension()
    channels = {
        "motor_position": wound / made.RADIUS,
        "motor_torque": tension * made.RADIUS,
        "mcp_angle": mcp,
        "pip_angle": pip,
    }
    return made.run(name, channels)


def test_arms_that_wound_the_cable_come_back_whatever_the_motors_zero() -> None:
    session = made.session(_kinematic_run("001", 0.0), _kinematic_run("002", 0.05))
    arms = inspect_session(session, FitSpec("whole")).kinematic["extension"]
    assert arms["mcp"].value == pytest.approx(0.011, rel=1e-6)
    assert arms["pip"].value == pytest.approx(0.0065, rel=1e-6)
    assert arms["mcp"].low <= 0.011 + 1e-9
    assert arms["mcp"].high >= 0.011 - 1e-9


def test_one_run_has_no_interval_and_angles_that_move_as_one_no_arms() -> None:
    one = made.session(_kinematic_run("001", 0.0))
    assert np.isnan(inspect_session(one, FitSpec("whole")).kinematic["extension"]["pip"].low)
    together = made.session(made.run("001", made.on_air(made.sine_tension())))
    assert inspect_session(together, FitSpec("whole")).kinematic == {}
    assert kinematic_arms([]) is None


def test_interval_of_the_line_is_that_of_the_intercept_from_any_origin() -> None:
    """The line's level at x0 is the intercept of the same samples counted from x0."""
    random = np.random.default_rng(5)
    x = random.uniform(1.0, 5.0, (8, 40))
    y = 0.3 - 0.7 * x + random.normal(0, 0.1, (8, 40)) + random.normal(0, 0.1, (8, 1))
    line = fit_line(RegressionSums.of_rows(x, y))
    assert line is not None
    for origin in (0.0, 1.5, 3.0, 6.0):
        shifted = fit_line(RegressionSums.of_rows(x - origin, y))
        assert shifted is not None
        estimate = shifted.intercept_estimate("N m")
        half = line.half_width(np.array([origin]))[0]
        assert half == pytest.approx((estimate.high - estimate.low) / 2, rel=1e-9)


def test_regions_follow_one_another_and_fill_the_period() -> None:
    speed = np.sin(2 * np.pi * np.arange(400) / 400)
    spans = region_spans(speed, 0.5, 2.0)
    # |sin| > 1/2 between 30 and 150 degrees: a sixth of a turn of standstill on either side.
    assert [name for name, _, _ in spans] == ["static_2", "flexion", "static_1", "extension", "static_2"]
    assert spans[1][1:] == pytest.approx((2.0 / 12, 10.0 / 12), abs=0.01)
    assert spans[0][1] == 0.0
    assert spans[-1][2] == pytest.approx(2.0)
    assert all(a[2] == b[1] for a, b in itertools.pairwise(spans))


@pytest.fixture(scope="module")
def late() -> Inspection:
    """Angles 40 ms after the tension."""
    runs = [made.run(f"{n:03d}", made.on_air(made.sine_tension(), delay=40)) for n in (1, 2, 3)]
    return inspect_session(made.session(*runs), FitSpec("flexion-extension", "findsignal"))


def test_the_points_are_those_of_the_line(late: Inspection) -> None:
    plane = late.views["002"].planes["pip", "extension"]
    assert plane.lhs == pytest.approx(SIGN * made.B * plane.tension + made.L_PIP, abs=3e-5)
    assert plane.line == pytest.approx(SIGN * made.B * plane.x + made.L_PIP, abs=3e-5)
    assert plane.pooled == pytest.approx(plane.line, abs=1e-6)


def test_delays_of_each_run_and_region(late: Inspection) -> None:
    assert set(late.delays_s["pip"]) == {"flexion", "extension"}
    assert late.delays_s["pip"]["extension"] == pytest.approx((0.04,) * 3, abs=0.002)


def test_a_region_has_no_delay_of_a_whole_run() -> None:
    with pytest.raises(UserError, match="choose regions"):
        inspect_session(made.session(_kinematic_run("001", 0.0)), FitSpec("whole", "findsignal"))
