"""A stepped recording made from a known line gives that line back, and the data sheets judge it."""

from __future__ import annotations

import json
import math

import h5py
import numpy as np
import pytest
from scipy import stats

from fingerlab.calibration import SENSORS, SteadyStep, StepTiming, calibrate_steps, find_steps
from fingerlab.calibration.line import count_steps
from fingerlab.calibration.offline import read_recording
from fingerlab.core.errors import UserError
from tests.cli.calling import run_main

LOAD_CELL = SENSORS["load-cell"]
THESIS_GAIN, THESIS_OFFSET = 11.194, -5.317  # thesis (2.1): F = 11.194 V - 5.317
TIMING = StepTiming()


def staircase(values, seed=0, noise=0.002, seconds=15.0, rate=20.0):
    """Volts at 20 Hz; while a weight is placed, in the first two seconds of a step, anything may happen."""
    random = np.random.default_rng(seed)
    time = np.arange(int(len(values) * seconds * rate)) / rate
    volts = np.asarray(values)[np.minimum((time / seconds).astype(int), len(values) - 1)]
    placing = np.mod(time, seconds) < 2.0
    return time, volts + random.normal(0, noise, time.size) + placing * random.normal(0, 0.5, time.size)


def thesis_volts():
    return (9.81 * np.arange(11) / 10 - THESIS_OFFSET) / THESIS_GAIN


def calibrate_line(time, volts, marks, sensor=LOAD_CELL):
    return calibrate_steps(sensor, find_steps(time, volts, len(marks), TIMING), marks)


def test_the_windows_are_those_of_the_thesis():
    """Thesis section 2.2: 5-10 s for zero load, 20-25 s for 0.1 kg."""
    assert TIMING.window(0) == (5.0, 10.0)
    assert TIMING.window(1) == (20.0, 25.0)
    time = np.arange(3300) / 20
    steps = find_steps(time, time, 11, TIMING)
    assert all(step.samples == 100 for step in steps)
    # Samples at 5.00, 5.05 ... 9.95 s have the mean 7.475 s.
    assert [step.volts for step in steps] == pytest.approx([7.475 + 15 * k for k in range(11)])


def test_the_thesis_line_comes_back():
    result = calibrate_line(*staircase(thesis_volts()), LOAD_CELL.default_marks(11))
    assert result.gain.value == pytest.approx(THESIS_GAIN, abs=0.02)
    assert result.offset.value == pytest.approx(THESIS_OFFSET, abs=0.02)
    assert result.gain.low < THESIS_GAIN < result.gain.high
    assert result.r2 > 0.9999
    assert result.suspect == ()
    # The thesis' line crosses zero at 5.317 / 11.194 V, inside the 0.45 to 0.55 V of the data sheet.
    assert result.zero_volts == pytest.approx(0.475, abs=0.001)
    assert result.apply(np.array([1.0]))[0] == pytest.approx(11.194 - 5.317, abs=0.02)


def test_line_and_intervals_are_those_of_linear_regression():
    """scipy.stats.linregress is an independent derivation of line, R2 and standard errors."""
    time, volts = staircase(thesis_volts(), noise=0.05)
    result = calibrate_line(time, volts, LOAD_CELL.default_marks(11))
    other = stats.linregress([step.volts for step in result.steps], 9.81 * np.arange(11) / 10)
    quantile = stats.t.ppf(0.95, 9)
    assert result.gain.value == pytest.approx(other.slope, rel=1e-9)
    assert result.offset.value == pytest.approx(other.intercept, rel=1e-9)
    assert result.r2 == pytest.approx(other.rvalue**2, rel=1e-9)
    assert result.gain.high - result.gain.value == pytest.approx(quantile * other.stderr, rel=1e-6)
    assert result.offset.value - result.offset.low == pytest.approx(
        quantile * other.intercept_stderr, rel=1e-6
    )


def test_nine_intervals_in_ten_hold_the_truth():
    marks = LOAD_CELL.default_marks(11)
    known = 9.81 * np.array(marks)
    random = np.random.default_rng(3)
    inside = 0
    for _ in range(400):
        volts = (known - THESIS_OFFSET) / THESIS_GAIN + random.normal(0, 0.003, 11)
        result = calibrate_steps(LOAD_CELL, [SteadyStep(v, 0.0, 100) for v in volts], marks)
        inside += result.gain.low <= THESIS_GAIN <= result.gain.high
    # Binomial(400, 0.9): 342 to 377 in all but one case of five hundred.
    assert 342 <= inside <= 377


def test_the_data_sheet_of_the_load_cell():
    """FC2231: 3.8 to 4.2 V over 44.5 N, which makes 10.6 to 11.7 N/V."""
    assert pytest.approx(10.6, abs=0.01) == LOAD_CELL.gain.low
    assert pytest.approx(11.7, abs=0.02) == LOAD_CELL.gain.high


@pytest.mark.parametrize(
    ("gain", "offset", "words"),
    [
        (9.0, -4.4, "The gain of 9 N/V is outside 10.6 to 11.71 N/V"),
        (12.5, -6.2, "The gain of 12.5 N/V is outside"),
        (11.0, -6.6, "The reading at no load of 0.6 V is outside 0.45 V to 0.55 V"),
        (-11.0, 22.0, "The gain of -11 N/V is outside"),
    ],
)
def test_a_calibration_outside_the_data_sheet_is_suspect(gain, offset, words):
    volts = (9.81 * np.arange(11) / 10 - offset) / gain
    result = calibrate_line(*staircase(volts, noise=1e-4), LOAD_CELL.default_marks(11))
    assert any(words.split(" is outside")[0] in sentence for sentence in result.suspect)


def test_a_forgotten_weight_and_an_unsteady_step_are_suspect():
    volts = thesis_volts()
    volts[5] = volts[4]  # half a kilogram was never placed: 0.98 N off, the data sheet allows 0.445 N
    time, readings = staircase(volts)
    readings[int(20 * 97.4) :][:40] += 0.3  # someone bumps the bench in the middle of step 7
    result = calibrate_line(time, readings, LOAD_CELL.default_marks(11))
    text = " ".join(result.suspect)
    assert "Step 6 lies" in text
    assert "Step 7 is not steady" in text


def test_many_steps_that_one_wrong_mark_draws_off_the_line_are_one_sentence():
    marks = SENSORS["mcp"].default_marks(7)
    volts = 2.6 + np.array((*marks[:6], 20.0)) / 42  # the last mark was never reached
    text = " ".join(calibrate_line(*staircase(volts), marks, SENSORS["mcp"]).suspect)
    assert text.count("off the line") == 1
    # Least squares of the seven points: residuals of -18.75, -15, ..., -3.75, 0 and 56.25 degrees.
    assert "Steps 1 to 5, 7 lie up to 56.25° off the line" in text


def test_an_angle_sensor_in_degrees_and_either_way_round():
    """KMA210: 180 degrees over 90 % of the supply are 40 degrees a volt at 5 V, 44.4 at 4.5 V."""
    sensor = SENSORS["mcp"]
    marks = sensor.default_marks(7)
    assert marks == (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0)
    for sign in (1, -1):
        volts = 2.6 + sign * np.array(marks) / 42
        result = calibrate_line(*staircase(volts), marks, sensor)
        assert math.degrees(result.gain.value) == pytest.approx(sign * 42.0, abs=0.05)
        assert result.suspect == ()
    assert math.degrees(sensor.gain.low) == pytest.approx(40 * 5 / 5.5)
    off = calibrate_line(*staircase(0.1 + np.array(marks) / 60), marks, sensor)
    assert any("60" in sentence and "°/V" in sentence for sentence in off.suspect)
    assert any(
        "The reading of 0." in sentence for sentence in off.suspect
    )  # 0.1 V is below 5 % of the supply


def test_steps_that_are_not_there():
    time, volts = staircase(thesis_volts()[:4])
    assert count_steps(time, TIMING) == 4
    assert count_steps(time[time < 55.0], TIMING) == 4  # the last central part ends at 55 s
    assert count_steps(time[time < 54.9], TIMING) == 3
    with pytest.raises(UserError, match="holds 4 steps of 15 s, but 11 known values"):
        find_steps(time, volts, 11, TIMING)
    with pytest.raises(UserError, match="at least three"):
        calibrate_line(time, volts, (0.0, 0.1))
    with pytest.raises(UserError, match="read the same"):
        calibrate_line(time, np.ones_like(time), (0.0, 0.1, 0.2))
    with pytest.raises(UserError, match="do not lie in a step"):
        StepTiming(15.0, 20.0)
    with pytest.raises(UserError, match="it should have at least two"):
        find_steps(np.arange(0, 60, 10.0), np.arange(6.0), 3, TIMING)


def write_text(path, time, volts, header="time (s)\tload cell (V)"):
    np.savetxt(path, np.c_[time, volts], delimiter="\t", header=header, comments="", fmt="%.6f")
    return path


def test_text_and_session_give_the_same_readings(tmp_path, make_session):
    time, volts = staircase(thesis_volts())

    def add(file):
        run = file["runs/001"]
        for name in list(run):
            del run[name]
        for name, values, unit in (("time", time, "s"), ("motor_position", 0 * time, "rad"),
                                   ("motor_torque", 0 * time, "N m"), ("raw/load_cell", 1000 * volts, "mV"),
                                   ("raw/mcp", volts, "V")):  # fmt: skip
            run[name] = values
            run[name].attrs["units"] = unit

    session = make_session(change=add, phases=(("motor_bench", "none"),))
    text = write_text(tmp_path / "a.txt", time, volts)
    from_text = read_recording(text, LOAD_CELL)
    from_session = read_recording(session, LOAD_CELL)
    np.testing.assert_allclose(from_session.volts, from_text.volts, atol=1e-6)
    np.testing.assert_allclose(from_session.time, time)
    assert "raw/mcp" in read_recording(session, SENSORS["mcp"]).source
    assert "raw/mcp" in read_recording(session, LOAD_CELL, "mcp").source
    with pytest.raises(UserError, match="does not hold the raw volts of the pip sensor"):
        read_recording(session, SENSORS["pip"])
    with pytest.raises(UserError, match="has no run 007"):
        read_recording(session, LOAD_CELL, run="007")


def test_a_column_that_cannot_be_told(tmp_path):
    time, volts = staircase(thesis_volts())
    path = tmp_path / "b.txt"
    np.savetxt(path, np.c_[time, volts, volts], header="t;one (V);two (A)", comments="", delimiter=";")
    with pytest.raises(UserError, match="has 3 columns; say with --column"):
        read_recording(path, LOAD_CELL)
    assert read_recording(path, LOAD_CELL, "one").volts[0] == pytest.approx(volts[0])
    assert read_recording(path, LOAD_CELL, "2").volts[0] == pytest.approx(volts[0])
    with pytest.raises(UserError, match="is in 'A'; it should be in V or mV"):
        read_recording(path, LOAD_CELL, "two")
    with pytest.raises(UserError, match="there is no column 9 of volts"):
        read_recording(path, LOAD_CELL, "9")
    with pytest.raises(UserError, match="has no column 'three'"):
        read_recording(path, LOAD_CELL, "three")


def test_the_command_writes_the_line_and_its_judgement(tmp_path, capsys):
    path = write_text(tmp_path / "a.txt", *staircase(thesis_volts()))
    code, out, err = run_main(["calibrate", path, "--sensor", "load-cell", "--json", "-"], capsys)
    assert (code, err) == (0, "")
    result = json.loads(out)
    assert result["gain"]["value"] == pytest.approx(THESIS_GAIN, abs=0.02)
    assert result["gain"]["unit"] == "N/V"
    assert result["thesis"] == {"gain": 11.194, "offset": -5.317}
    assert len(result["steps"]) == 11
    code, out, _ = run_main(["calibrate", path, "--sensor", "load-cell"], capsys)
    assert code == 0
    assert "10.6 to 11.7 N/V" in out
    assert "Nothing speaks against it." in out


def test_two_recordings_share_one_line(tmp_path, capsys):
    """The thesis took the angle sensors twice."""
    marks = "0,30,45,60,90"
    volts = 0.5 + np.array([0, 30, 45, 60, 90]) / 40
    paths = [write_text(tmp_path / f"{i}.txt", *staircase(volts, seed=i), header="t\tvolts") for i in (1, 2)]
    arguments = ["calibrate", *paths, "--sensor", "pip", "--marks", marks, "--json", "-"]
    code, out, _ = run_main(arguments, capsys)
    result = json.loads(out)
    assert code == 0
    assert len(result["steps"]) == 10
    assert math.degrees(result["gain"]["value"]) == pytest.approx(40, abs=0.05)


@pytest.mark.parametrize(
    ("extra", "sentence"),
    [
        (["--marks", "0,a"], "--marks '0,a' is no list of numbers"),
        (["--marks", "0,0.1"], "at least three are needed"),
        (["--centre", "30"], "do not lie in a step"),
        (["--column", "7"], "there is no column 7 of volts"),
        (["--sensor", "thermometer"], "Invalid value for '--sensor'"),
    ],
)
def test_bad_use_is_one_sentence(tmp_path, capsys, extra, sentence):
    path = write_text(tmp_path / "a.txt", *staircase(thesis_volts()))
    code, out, err = run_main(["calibrate", path, "--sensor", "load-cell", *extra], capsys)
    assert code == 2
    assert out == ""
    assert sentence in err
    assert len(err.splitlines()) == 1


def test_a_file_that_is_no_recording(tmp_path, capsys, make_session):
    (tmp_path / "words.txt").write_text("no numbers here\nnone at all\n", encoding="utf-8")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    for name in ("words.txt", "other.h5", "absent.txt"):
        code, out, err = run_main(["calibrate", tmp_path / name, "--sensor", "mcp"], capsys)
        assert (code, out) == (2, "")
        assert name in err
        assert len(err.splitlines()) == 1
