"""Exports hold the numbers of the session, in files that other programs open."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from scipy.io import loadmat

from fingerlab.core.errors import UserError
from fingerlab.sessions import content_hash, exporting, open_session
from fingerlab.sessions.exporting import export_session
from fingerlab.sessions.model import Run


@pytest.fixture
def session(make_session):
    def add(file):
        file.attrs["future"] = float("nan")
        file["settings/gains"] = np.eye(3)
        file["runs/001/markers"] = np.arange(7)
        file["runs/001/thermistor"] = np.linspace(20, 30, 4000)
        file["runs/001/thermistor"].attrs["units"] = "degC"
        file["runs/002/raw/pip"] = np.arange(4000)
        file["runs/002/raw/pip"].attrs["units"] = "count"

    return open_session(make_session(change=add))


@pytest.mark.parametrize(("kind", "separator"), [("csv", ","), ("txt", "\t")])
def test_delimited_text(tmp_path, session, kind, separator):
    files = export_session(session, kind, tmp_path / "out")
    assert sorted(path.name for path in files) == [
        f"session-001.{kind}", f"session-002.{kind}", "session-extra.h5", "session.json",
    ]  # fmt: skip
    for run in session.runs:
        path = tmp_path / "out" / f"session-{run.name}.{kind}"
        table = pd.read_csv(path, sep=separator)
        assert list(table.columns[:3]) == ["time (s)", "motor_command (rad)", "motor_position (rad)"]
        for (name, values), column in zip(run.load().items(), table.columns, strict=True):
            assert column.startswith(f"{name} (")
            np.testing.assert_array_equal(table[column].to_numpy(dtype=float), values)


def test_parquet(tmp_path, session):
    export_session(session, "parquet", tmp_path)
    run = session.runs[0]
    table = pq.read_table(tmp_path / "session-001.parquet")
    assert table.schema.field("mcp_angle").metadata == {b"units": b"rad"}
    assert table.schema.metadata[b"phase"] == b"on_air"
    assert table.column_names == list(run.units)
    for name, values in run.load().items():
        np.testing.assert_array_equal(table[name].to_numpy(), values)


def test_matlab(tmp_path, session):
    export_session(session, "mat", tmp_path)
    data = loadmat(tmp_path / "session.mat", squeeze_me=True, struct_as_record=False)
    run = data["run_002"]
    assert run.phase == "contact"
    assert run.sample_rate_hz == 1000.0
    assert run.units.motor_torque == "N m"
    assert json.loads(run.trajectory)["kind"] == "sine"
    np.testing.assert_array_equal(run.mcp_angle, session.runs[1].channel("mcp_angle"))
    np.testing.assert_array_equal(run.raw_pip, np.arange(4000))
    assert data["session"].title == "Ring finger, Łódź"
    assert json.loads(str(data["session"].rig))["motor"]["gear_ratio"] == 4.3


def test_what_is_no_sample_stands_beside(tmp_path, session):
    export_session(session, "csv", tmp_path)
    metadata = json.loads((tmp_path / "session.json").read_text(encoding="utf-8"))
    assert metadata["sha256"] == content_hash(session)
    assert metadata["rig"]["finger"]["proximal_mass"] == 0.012
    assert metadata["attributes"]["future"] is None
    first = metadata["runs"][0]
    assert first["file"] == "session-001.csv"
    assert first["units"]["thermistor"] == "degC"
    assert (first["phase"], first["cable"], first["samples"]) == ("on_air", "extension", 4000)
    with h5py.File(tmp_path / "session-extra.h5") as file:
        np.testing.assert_array_equal(file["settings/gains"][:], np.eye(3))
        assert file["runs/001/markers"][:].tolist() == list(range(7))
        assert list(file["runs/001"]) == ["markers"]


def test_long_runs_are_written_in_pieces(tmp_path, session, monkeypatch):
    monkeypatch.setattr(exporting, "PIECE_SAMPLES", 999)
    export_session(session, "csv", tmp_path)
    assert len(pd.read_csv(tmp_path / "session-001.csv")) == 4000
    export_session(session, "parquet", tmp_path / "p")
    assert pq.read_table(tmp_path / "p" / "session-001.parquet").num_rows == 4000


def test_nothing_is_overwritten_or_left_half(tmp_path, session):
    out = tmp_path / "out"
    out.mkdir()
    (out / "session-002.csv").write_text("precious")
    with pytest.raises(UserError, match=r"session-002\.csv exists already and is not overwritten"):
        export_session(session, "csv", out)
    assert [path.name for path in out.iterdir()] == ["session-002.csv"]
    assert (out / "session-002.csv").read_text() == "precious"


def test_places_that_cannot_be(tmp_path, session):
    (tmp_path / "file").write_text("x")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(UserError, match="is a file; give a folder"):
        export_session(session, "csv", tmp_path / "file")
    with pytest.raises(UserError, match="does not exist; make it first"):
        export_session(session, "csv", tmp_path / "no" / "out")
    with pytest.raises(UserError, match="no export to 'xlsx'; choose one of csv, mat, parquet, txt"):
        export_session(session, "xlsx", tmp_path)
    assert sorted(tmp_path.iterdir()) == before


def test_a_bad_sample_leaves_neither_files_nor_folder(tmp_path, make_session):
    def spoil(file):
        file["runs/002/pip_angle"][9] = np.nan

    bad = open_session(make_session("bad.h5", spoil))
    for kind in ("csv", "mat", "parquet"):
        with pytest.raises(UserError, match="'pip_angle' holds NaN at sample 9"):
            export_session(bad, kind, tmp_path / "out")
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_disk_that_fills_up(tmp_path, session, monkeypatch, kind):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Run, "load", full)
    with pytest.raises(UserError, match=r"out cannot be written \(No space left on device\)"):
        export_session(session, kind, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_files_appear_together_or_not_at_all(tmp_path, session, monkeypatch):
    real, moved = Path.replace, []

    def fail_at_the_third(self, target):
        if len(moved) == 2:
            raise OSError(28, "No space left on device")
        moved.append(target)
        return real(self, target)

    monkeypatch.setattr(Path, "replace", fail_at_the_third)
    with pytest.raises(UserError, match="No space left"):
        export_session(session, "csv", tmp_path / "out")
    assert len(moved) == 2
    assert not (tmp_path / "out").exists()
