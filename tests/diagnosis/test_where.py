"""Where a model fails, on residuals in closed form: friction by a sign, a stop beyond an angle, a bad run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.answer.error_parts import Comparison, ExcludedInterval
from fingerlab.diagnosis.answer.residual_profiles import COORDINATES, profile, stretches_in, worst_run
from fingerlab.report.budget_words import axis_title, bin_words, miss_words, worst_words
from fingerlab.report.diagnosis_figures import where_figure

RATE, SECONDS = 25.0, 40.0
AMPLITUDE, OMEGA = 0.5, 2 * np.pi * 0.37
FRICTION, FLOOR = 0.0048, 0.0004


def comparison(
    run: str, residual: np.ndarray, equation: str = "pip_torque", phase: str = "on_air", bench: bool = False
) -> Comparison:
    """A joint and a motor that swing as a sine; measured is the residual, modelled is zero."""
    time = np.arange(0.0, SECONDS, 1 / RATE)
    angle, speed = AMPLITUDE * np.sin(OMEGA * time), AMPLITUDE * OMEGA * np.cos(OMEGA * time)
    coordinates = {"motor angle": 1.0 + 2 * angle, "motor speed": 2 * speed, "tension": 3.0 + angle}
    if not bench:
        coordinates |= {"joint angle pip": angle, "joint speed pip": speed, "joint speed mcp": -speed}
    return Comparison(
        equation, "rig.h5", run, phase, time, residual * np.ones_like(time), np.zeros_like(time), "N m",
        FLOOR, coordinates=coordinates,
    )  # fmt: skip


TIME = np.arange(0.0, SECONDS, 1 / RATE)
RUBBING = FRICTION * np.sign(np.cos(OMEGA * TIME))


def test_friction_flips_its_sign_with_speed_and_has_one_size() -> None:
    found = profile([comparison("001", RUBBING)], "pip_torque", "speed")
    assert found is not None
    far = np.abs(found.centres) > 0.2 * AMPLITUDE * OMEGA
    assert found.mean[far] == pytest.approx(FRICTION * np.sign(found.centres[far]))
    assert found.rms[far] == pytest.approx(FRICTION)
    assert np.all(found.half[far] < 1e-12)
    assert axis_title(found) == "PIP joint speed"
    # The speeds of a sine, less the outermost half per cent at either end.
    largest = np.degrees(AMPLITUDE * OMEGA * np.cos(0.005 * np.pi))
    assert np.degrees(found.edges[-1]) == pytest.approx(largest, rel=0.01)


def test_over_the_stroke_it_flips_at_the_two_ends() -> None:
    found = profile([comparison("001", RUBBING)], "pip_torque", "phase")
    assert found is not None
    forth = np.cos(found.centres) > 0
    assert found.mean == pytest.approx(np.where(forth, FRICTION, -FRICTION), rel=0.05)


def test_of_the_mcp_equation_the_mcp_joint_counts() -> None:
    found = profile([comparison("001", RUBBING, "mcp_torque")], "mcp_torque", "speed")
    assert found is not None
    assert found.mean[0] == pytest.approx(FRICTION)  # its speed has the other sign


@pytest.mark.parametrize("coordinate", ["angle", "tension", "motor_angle"])
def test_a_stop_beyond_an_angle_is_found_there_and_named(coordinate: str) -> None:
    angle = AMPLITUDE * np.sin(OMEGA * TIME)
    stop = np.where(angle > 0.86 * AMPLITUDE, 0.02, 0.0)
    found = profile([comparison("001", stop)], "pip_torque", coordinate)
    assert found is not None
    assert found.worst == len(found.mean) - 1
    assert found.rms[found.worst] == pytest.approx(0.02)
    assert miss_words(found, found.worst) == "20.00 mN m, 50.0 floors"
    assert worst_words(found).startswith(f"Worst at {bin_words(found, found.worst)}")
    # Each swing has one such stretch, around the moment when the angle is largest.
    places = stretches_in(found, found.worst, comparison("001", stop))
    assert len(places) == int(SECONDS * OMEGA / (2 * np.pi) + 0.75)
    for start, end in places:
        turns = OMEGA * (start + end) / 2 / (2 * np.pi)
        assert turns % 1 == pytest.approx(0.25, abs=0.02)


def test_one_bad_run_is_named_and_found_in_any_coordinate() -> None:
    runs = [
        comparison("001", RUBBING),
        comparison("002", 3 * RUBBING, phase="contact"),
        comparison("003", RUBBING),
    ]
    found = profile(runs, "pip_torque", "run")
    assert found is not None
    assert found.rms == pytest.approx([FRICTION, 3 * FRICTION, FRICTION])
    assert worst_words(found) == "Worst at run 002, in contact: 14.40 mN m, 36.0 floors."
    assert stretches_in(found, 1, runs[0]) == []
    assert stretches_in(found, 1, runs[1]) == [(0.0, pytest.approx(SECONDS - 1 / RATE))]
    speeds = profile(runs, "pip_torque", "speed")
    assert speeds is not None
    assert worst_run(speeds, 2, runs) is runs[1]


def test_a_standstill_that_is_left_aside_is_no_failure() -> None:
    held = (TIME > 20.0) & (TIME < 24.0)
    run = comparison("001", np.where(held, 10 * FRICTION, RUBBING))
    at_rest = replace(run, aside=(ExcludedInterval("standstill", 20.0, 24.0),))
    for coordinate in ("time", "tension", "speed"):
        found = profile([at_rest], "pip_torque", coordinate)
        assert found is not None
        assert np.nanmax(found.rms) == pytest.approx(FRICTION)
        inside = [part for bin_ in range(len(found.mean)) for part in stretches_in(found, bin_, at_rest)]
        assert not any(start < 22.0 < stop for start, stop in inside)
    counted = profile([run], "pip_torque", "time")
    assert counted is not None
    assert np.nanmax(counted.rms) > 2 * FRICTION


def test_within_the_floor_nothing_stands_out() -> None:
    found = profile([comparison("001", FLOOR * np.sign(np.sin(7 * TIME)))], "pip_torque", "time")
    assert found is not None
    assert worst_words(found) == "Nowhere clearly beyond the floor."


def test_the_figure_has_a_picture_for_each_coordinate() -> None:
    figure = where_figure([comparison("001", RUBBING), comparison("002", 3 * RUBBING)], "pip_torque")
    assert figure is not None
    shown = [axes for axes in figure.axes if axes.get_visible()]
    of_a_line = {"position", "axis_speed"}  # of which a finger has none
    assert len(shown) == len(COORDINATES.keys() - of_a_line)
    speed = next(axes for axes in shown if axes.get_xlabel() == "PIP joint speed (°/s)")
    (mean,) = [line for line in speed.get_lines() if len(line.get_xdata()) > 2]
    slow = mean.get_xdata() < -20
    assert mean.get_ydata()[slow] == pytest.approx(-2e3 * FRICTION)  # mN m, the mean of both runs
    assert speed.get_ylabel() == "residual (mN m)"
    runs = next(axes for axes in shown if axes.get_xlabel() == "Run")
    assert [text.get_text() for text in runs.get_xticklabels()] == ["001", "002"]
    assert runs.get_title(loc="left").replace("\n", " ").startswith("Worst at run 002")
    assert where_figure([], "pip_torque") is None


def test_what_is_not_told_is_not_drawn() -> None:
    bench = [comparison("001", RUBBING, "motor_torque", "motor_bench", bench=True)]
    there = {name for name in COORDINATES if profile(bench, "motor_torque", name) is not None}
    assert there == {"phase", "tension", "motor_angle", "motor_speed", "time"}  # no joint, and one run alone
    assert profile(bench, "pip_torque", "phase") is None
    gaps = comparison("001", np.full(len(TIME), np.nan))
    assert profile([gaps], "pip_torque", "speed") is None
