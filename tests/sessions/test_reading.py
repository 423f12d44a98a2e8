"""Opening sessions that the project's own writer did not write."""

from __future__ import annotations

import gc
import hashlib
import pickle
import warnings
from pathlib import Path

import h5py
import numpy as np
import psutil
import pytest

from fingerlab.core.errors import UserError
from fingerlab.sessions import Run, content_hash, open_session


def test_what_is_in_the_file_is_in_the_session(make_session):
    session = open_session(make_session())
    assert session.title == "Ring finger, Łódź"
    assert session.created == "2026-11-01T09:00:00+01:00"
    assert session.rig.finger.mcp_stiffness == 0.12
    assert session.rig.tolerance_of("mcp_stiffness") == 0.1
    assert session.rig.tolerance_of("pip_stiffness") == 0.02
    run = session.runs[0]
    assert (run.name, run.phase, run.cable, run.cable_sign) == ("001", "on_air", "extension", -1)
    assert (run.length, run.sample_rate_hz, run.seconds) == (4000, 1000.0, 4.0)
    assert run.trajectory["amplitude_deg"] == 15.0
    assert run.units["motor_torque"] == "N m"
    assert [r.name for r in session.contact_runs()] == ["002"]


def test_samples_are_double_precision_and_can_be_cut(make_session):
    run = open_session(make_session()).runs[0]
    angle = run.channel("mcp_angle", 250, 252)
    assert angle.dtype == np.float64
    # A quarter of a second into a 1 Hz sine: its peak, -10 - 8 degrees.
    assert np.degrees(angle[0]) == pytest.approx(-18.0, abs=1e-5)
    assert run.channel("time", 3990, 99999).size == 10


def test_all_channels_are_read_with_the_file_opened_once(make_session, monkeypatch):
    run = open_session(make_session()).runs[0]
    opened = []
    real = h5py.File
    monkeypatch.setattr(h5py, "File", lambda *a, **k: opened.append(a) or real(*a, **k))
    data = run.load()
    assert len(opened) == 1
    assert set(data) == set(run.units)
    assert all(values.shape == (4000,) for values in data.values())


def test_the_file_is_not_kept_open(make_session):
    path = make_session()
    session = open_session(path)
    session.runs[0].load()
    assert str(path) not in [file.path for file in psutil.Process().open_files()]


def test_a_run_can_be_sent_to_another_process(make_session):
    run = open_session(make_session()).runs[0]
    again = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(again.channel("time"), run.channel("time"))


def test_runs_come_in_the_order_taken_beyond_999(make_session):
    def rename(file):
        file.move("runs/001", "runs/1000")
        file.move("runs/002", "runs/999")

    assert [run.name for run in open_session(make_session(change=rename)).runs] == ["999", "1000"]


def test_unknown_parts_and_later_minor_versions_are_accepted(make_session):
    def add(file):
        file.attrs["format_version"] = "1.4"
        file.attrs["future"] = 3.5
        file["settings/gains"] = np.eye(3)
        run = file["runs/001"]
        run.attrs["operator_mood"] = "good"
        run["thermistor"] = np.linspace(20, 30, 4000)
        run["thermistor"].attrs["units"] = "degC"
        run["markers"] = np.arange(7)
        run["raw/pip"] = np.zeros(4000, dtype=np.int16)

    session = open_session(make_session(change=add))
    run = session.runs[0]
    assert session.attributes["future"] == 3.5
    assert run.attributes["operator_mood"] == "good"
    assert run.units["thermistor"] == "degC"
    assert run.channel("thermistor")[-1] == 30.0
    assert run.channel("raw/pip").shape == (4000,)
    assert not run.has("markers")


def test_attributes_as_matlab_writes_them(make_session):
    """h5writeatt stores text as fixed-length bytes and numbers as arrays of one element."""

    def rewrite(file):
        run = file["runs/001"]
        run.attrs["phase"] = np.bytes_("on_air")
        run.attrs["sample_rate_hz"] = np.array([1000.0])
        run["mcp_angle"].attrs["units"] = np.bytes_("rad")
        file.attrs["title"] = np.bytes_("Zeigefinger, 15°".encode())

    session = open_session(make_session(change=rewrite))
    assert session.title == "Zeigefinger, 15°"
    assert session.runs[0].sample_rate_hz == 1000.0


def test_hash_is_that_of_the_file(make_session):
    path = make_session()
    assert content_hash(open_session(path)) == hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_channel_that_is_absent_is_named(make_session):
    run = open_session(make_session()).runs[0]
    with pytest.raises(UserError, match="Run 001 has no channel 'load_torque'; it holds time, motor_command"):
        run.channel("load_torque")


def test_a_file_that_goes_away_or_changes_is_one_sentence(make_session):
    path = make_session()
    run = open_session(path).runs[1]
    with h5py.File(path, "r+") as file:
        del file["runs/002/pip_angle"]
    with pytest.raises(UserError, match="has changed since it was opened"):
        run.channel("pip_angle")
    path.unlink()
    with pytest.raises(UserError, match="does not exist"):
        run.channel("mcp_angle")


def test_every_recording_from_outside_opens(shared_data: Path):
    counts = {path.name: len(open_session(path).runs) for path in sorted(shared_data.glob("*.h5"))}
    assert len(counts) >= 15
    assert counts["bench-thesis-protocol.h5"] == 20  # ten on-air and ten contact runs, as its README says
    assert counts["cable-tool.h5"] == 20  # five speeds by four loads


def test_a_run_in_memory_behaves_like_one_of_a_file():
    run = Run.from_arrays({"mcp_angle": [0.0, 0.1, 0.2], "extra": [1, 2, 3]}, sample_rate_hz=100.0)
    assert run.channel("time").tolist() == [0.0, 0.01, 0.02]
    assert run.units == {"mcp_angle": "rad", "extra": "", "time": "s"}
    assert run.load(["extra"], 1)["extra"].tolist() == [2.0, 3.0]
    with pytest.raises(UserError, match="of one length"):
        Run.from_arrays({"mcp_angle": [0.0], "pip_angle": [0.0, 1.0]})


def test_nothing_is_left_to_be_closed_by_the_garbage_collector(make_session):
    """The file from which HDF5 reads had been, with a warning at each reading."""
    path = make_session()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        open_session(path).runs[0].load()
        gc.collect()
    assert [str(one.message) for one in told if one.category is ResourceWarning] == []
