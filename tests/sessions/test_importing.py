"""Text files of the bench become a session with the same numbers in SI."""

from __future__ import annotations

import json
import math
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from fingerlab.core.errors import UserError
from fingerlab.rig.file import default_rig
from fingerlab.sessions import check_session, open_session
from fingerlab.sessions.exporting import export_session
from fingerlab.sessions.importing import TextRun, describe, import_files, plan_import

HEADER = "time (s)\tcommand (deg)\tposition (deg)\ttorque (Nm)\tMCP (deg)\tPIP (deg)\tforce (N)"
ROWS = (
    "0.000\t0.0\t0.0\t0.012986\t90.0\t-45.0\t0.5",
    "0.001\t1.0\t0.9\t0.025972\t89.0\t-44.0\t0.6",
    "0.002\t2.0\t1.8\t0.038958\t88.0\t-43.0\t0.7",
)


def text_file(tmp_path, lines, name="a.txt"):
    path = tmp_path / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def import_one(tmp_path, path, mapping=None, rate=None, phase="on_air", cable="extension"):
    plans = plan_import([TextRun(path, phase, cable, {"kind": "sine"})], mapping, rate)
    return open_session(import_files(plans, tmp_path / "out.h5", default_rig(), "x")).runs[0]


def test_degrees_become_radians_and_the_current_follows(tmp_path):
    run = import_one(tmp_path, text_file(tmp_path, [HEADER, *ROWS]))
    assert run.channel("mcp_angle")[0] == math.pi / 2
    assert run.channel("pip_angle")[0] == -math.pi / 4
    assert run.channel("endpoint_force").tolist() == [0.5, 0.6, 0.7]
    # 30.2 mN m/A times 4.3 make 0.12986 N m/A.
    np.testing.assert_allclose(run.channel("motor_current"), [0.1, 0.2, 0.3], rtol=1e-12)
    assert json.loads(run.attributes["derived"]) == {
        "motor_current": "motor_torque / (torque_constant * gear_ratio)"
    }
    assert run.attributes["source_file"] == "a.txt"
    assert run.sample_rate_hz == 1000.0
    with h5py.File(tmp_path / "out.h5") as file:
        assert "gear_ratio" in file["runs/001/motor_current"].attrs["derived"]
        assert "derived" not in file["runs/001/motor_torque"].attrs


def test_decimal_comma_without_header_gives_the_same_run(tmp_path):
    plain = import_one(tmp_path, text_file(tmp_path, [HEADER, *ROWS])).load()
    (tmp_path / "out.h5").rename(tmp_path / "plain.h5")
    comma = import_one(tmp_path, text_file(tmp_path, [row.replace(".", ",") for row in ROWS])).load()
    assert set(plain) == set(comma)
    for name, values in comma.items():
        np.testing.assert_array_equal(values, plain[name])


def test_the_text_files_from_outside_agree_with_each_other(tmp_path, shared_data):
    """Both were written from one recording; only the torque noise differs between them."""
    sources = [
        TextRun(shared_data / name, "contact", "flexion", {"kind": "sine"})
        for name in ("text-header.txt", "text-decimal-comma.txt")
    ]
    target = import_files(plan_import(sources), tmp_path / "out.h5", default_rig(), "both")
    session = open_session(target)
    first, second = (run.load() for run in session.runs)
    assert [run.length for run in session.runs] == [10_000, 5_000]
    assert [run.sample_rate_hz for run in session.runs] == [1000.0, 1000.0]
    assert check_session(session).errors == ()
    for name in ("time", "motor_command", "motor_position", "motor_current"):
        assert first[name].shape == (10_000,)
        assert second[name].shape == (5_000,)
    np.testing.assert_array_equal(first["motor_command"][:5000], second["motor_command"])
    # The last row of the header file, by eye: 21.90575 degrees commanded, -9.72 and -17.12 degrees, -0.015 N.
    assert np.degrees(first["motor_command"][-1]) == pytest.approx(21.90575)
    assert np.degrees(first["mcp_angle"][-1]) == pytest.approx(-9.72)
    assert np.degrees(first["pip_angle"][-1]) == pytest.approx(-17.12)
    assert first["endpoint_force"][-1] == -0.015
    with xr.open_dataset(target, engine="h5netcdf", group="/runs/002") as data:
        assert data["mcp_angle"].attrs["units"] == "rad"
        assert data.sizes["time"] == 5_000


def test_export_to_text_and_import_again_is_exact(tmp_path, make_session):
    def add(file):
        file["runs/001/thermistor"] = np.random.default_rng(5).normal(25, 1, 4000)
        file["runs/001/thermistor"].attrs["units"] = "degC"
        file["runs/001/raw/pip"] = np.arange(4000, dtype=np.int16)
        file["runs/001/raw/pip"].attrs["units"] = "count"

    original = open_session(make_session(change=add))
    export_session(original, "txt", tmp_path / "text")
    sources = [
        TextRun(tmp_path / "text" / f"session-{run.name}.txt", run.phase, run.cable, run.trajectory)
        for run in original.runs
    ]
    again = open_session(import_files(plan_import(sources), tmp_path / "again.h5", original.rig, "again"))
    for before, after in zip(original.runs, again.runs, strict=True):
        assert dict(after.units) == dict(before.units)
        assert after.sample_rate_hz == before.sample_rate_hz
        for name, values in before.load().items():
            np.testing.assert_array_equal(after.channel(name), values)


def test_the_rate_comes_from_time_or_from_the_user(tmp_path):
    lines = [f"{i / 3000:.4f}\t1\t1\t1\t1\t1\t1" for i in range(3000)]
    run = import_one(tmp_path, text_file(tmp_path, lines))
    assert run.sample_rate_hz == 3000.0  # although time is rounded to a third of a step
    (tmp_path / "out.h5").unlink()
    mapping = "motor_command=2,motor_position=3,motor_torque=4,mcp_angle=5,pip_angle=6"
    run = import_one(tmp_path, text_file(tmp_path, lines), mapping, rate=250.0)
    assert run.channel("time")[-1] == 2999 / 250
    assert not run.has("endpoint_force")


@pytest.mark.parametrize("name", ["text-header.txt", "text-decimal-comma.txt"])
def test_what_the_motor_was_told_is_read_from_its_command(shared_data: Path, name: str) -> None:
    """By eye: the command goes from 7 to 37 degrees and back once a second."""
    (plan,) = plan_import([TextRun(shared_data / name, "on_air", "extension")])
    told = dict(plan.trajectory)
    assert told.pop("kind") == "sine"
    assert told == pytest.approx({"frequency_hz": 1.0, "amplitude_deg": 15.0, "offset_deg": 22.0}, rel=1e-3)
    assert "  trajectory <- sine, 15°, 1 Hz, about 22° (read from motor_command)" in describe(plan)


def test_a_command_that_says_nothing_leaves_the_trajectory_unknown(tmp_path: Path) -> None:
    (plan,) = plan_import([TextRun(text_file(tmp_path, [HEADER, *ROWS]), "on_air", "extension")])
    assert plan.trajectory == {"kind": "unknown"}
    assert "trajectory" not in "\n".join(describe(plan))


def test_long_files_are_read_in_blocks(tmp_path):
    """65,536 lines are read together; a row that is cut off behind them is told by the run."""
    lines = [f"{i / 1000:.3f}\t{i}\t0\t0\t0\t0\t0" for i in range(70_001)]
    path = text_file(tmp_path, [*lines, "70.001\t70001"])
    run = import_one(tmp_path, path)
    np.testing.assert_array_equal(run.channel("motor_command"), np.arange(70_001) * (math.pi / 180))
    assert run.attributes["left_out"] == (
        "1 of 70,002 rows is left out: 1 cut off at the end of the file (line 70002)"
    )


def test_the_plan_shows_every_column(tmp_path):
    path = text_file(tmp_path, [HEADER, *ROWS])
    mapping = "time=1,motor_command=2,motor_position=3,motor_torque=4,mcp_angle=5,pip_angle=6:deg:-1"
    (plan,) = plan_import([TextRun(path, "contact", "flexion", {})], mapping)
    text = "\n".join(describe(plan))
    assert "7 columns, separated by tab, decimal point, a header; 1000 samples a second" in text
    assert "pip_angle <- column 6 [deg], times -0.0174533 to rad" in text
    assert "motor_current <- motor_torque / (torque_constant * gear_ratio) (derived)" in text
    assert "not used: column 7" in text


@pytest.mark.parametrize(
    ("lines", "options", "sentence"),
    [
        ([HEADER, ROWS[0], ROWS[1][:-4], ROWS[2]], {}, "line 3 has 6 columns where the first row has 7"),
        ([HEADER, *ROWS, ROWS[0]], {}, r"a\.txt: time runs backwards at sample 3"),
        ([HEADER, ROWS[0], ROWS[0]], {}, "line 3, column 1 holds the time of the row before"),
        ([HEADER, *ROWS, "0.003\t1\t1\tnan\t1\t1\t1"], {}, r"line 5, column 4 holds nan; .*\(1 of 4 rows"),
        ([HEADER, *ROWS], {"mapping": "time=1,motor_torque=4"}, "gives no 'motor_command'"),
        ([HEADER, *ROWS], {"mapping": "mcp_angle=5"}, "gives no time; map its column"),
        ([HEADER, *ROWS], {"rate": 500.0}, "holds 1000 samples a second by its time column, not 500"),
        ([HEADER, ROWS[0]], {}, "holds one row; give its samples a second"),
    ],
)  # fmt: skip
def test_what_cannot_be_imported_leaves_nothing(tmp_path, lines, options, sentence):
    path = text_file(tmp_path, lines)
    with pytest.raises(UserError, match=sentence):
        import_one(tmp_path, path, **options)
    assert list(tmp_path.iterdir()) == [path]
