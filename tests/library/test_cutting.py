"""Cutting and merging: the samples are the recording's own, and the recording stays as it was."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.library.index import RunStretch, cut_session, merge_sessions, rig_differences
from fingerlab.sessions import check_session, file_hash, open_session
from tests.conftest import RIG


def mark(file: h5py.File) -> None:
    run = file["runs/002"]
    run.attrs["started"] = "2026-11-01T09:00:30+01:00"
    run.attrs["operator_says"] = "fine"
    run.attrs["markers"] = json.dumps([{"time": 0.5, "note": "early"}, {"time": 1.5, "note": "touch"}])
    raw = run.create_dataset("raw/encoder_counts", data=np.arange(4000, dtype=np.int64) * 7)
    raw.attrs["units"] = "counts"


def test_a_cut_holds_the_samples_between_two_times_and_says_where_from(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = make_session("a.h5", mark)
    digest = file_hash(path)
    session = open_session(path)
    target = cut_session(session, RunStretch(session.runs[1], 1.0, 2.25), tmp_path / "cut.h5")
    assert file_hash(path) == digest
    made = open_session(target)
    [run] = made.runs
    with h5py.File(path) as file, h5py.File(target) as new:
        old = file["runs/002"]
        for name in ("motor_torque", "endpoint_force", "raw/encoder_counts"):
            assert np.array_equal(new[f"runs/001/{name}"][:], old[name][1000:2251])
        assert new["runs/001/raw/encoder_counts"].dtype.kind == "i"
        assert new["runs/001/raw/encoder_counts"].attrs["units"] == "counts"
        assert new.attrs["rig"] == file.attrs["rig"]
    assert run.channel("time")[[0, -1]] == pytest.approx([0.0, 1.25])
    assert run.attributes["started"] == "2026-11-01T09:00:31+01:00"
    assert run.attributes["operator_says"] == "fine"
    assert json.loads(run.attributes["markers"]) == [{"time": 0.5, "note": "touch"}]
    assert json.loads(run.attributes["taken_from"]) == {
        "session": "a.h5", "sha256": digest, "run": "002", "start_s": 1.0, "stop_s": 2.25,
    }  # fmt: skip
    assert not check_session(made).errors


def test_a_cut_overwrites_nothing_and_needs_samples(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    session = open_session(make_session("a.h5"))
    taken = tmp_path / "taken.h5"
    taken.write_text("mine", encoding="utf-8")
    with pytest.raises(UserError, match="not overwritten"):
        cut_session(session, RunStretch(session.runs[0], 1.0, 2.0), taken)
    assert taken.read_text(encoding="utf-8") == "mine"
    with pytest.raises(UserError, match="no two samples"):
        cut_session(session, RunStretch(session.runs[0], 1.0001, 1.0002), tmp_path / "new.h5")
    assert not (tmp_path / "new.h5").exists()
    assert not list(tmp_path.glob("*.part"))


def test_merged_runs_stand_in_the_order_taken_with_what_was_their_own(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    def later(file: h5py.File) -> None:
        file.attrs["created"] = "2026-11-01T10:00:00+01:00"
        file.attrs["operator"] = "Zoë"
        file.attrs["tags"] = '["late"]'

    def earlier(file: h5py.File) -> None:
        mark(file)
        file.attrs["operator"] = "Ann"
        file.attrs["tags"] = '["early"]'
        file.attrs["bench"] = "left"

    second, first = make_session("z.h5", later), make_session("y.h5", earlier)
    sessions = [open_session(second), open_session(first)]
    made = open_session(merge_sessions(sessions, tmp_path / "both.h5", "both"))
    assert [run.name for run in made.runs] == ["001", "002", "003", "004"]
    origins = [json.loads(run.attributes["taken_from"]) for run in made.runs]
    assert [(o["session"], o["run"]) for o in origins] == [
        ("y.h5", "001"), ("y.h5", "002"), ("z.h5", "001"), ("z.h5", "002"),
    ]  # fmt: skip
    assert [run.attributes["operator"] for run in made.runs] == ["Ann", "Ann", "Zoë", "Zoë"]
    assert made.runs[0].attributes["bench"] == "left"
    assert json.loads(made.attributes["tags"]) == ["early", "late"]
    assert (made.title, made.created) == ("both", "2026-11-01T09:00:00+01:00")
    assert np.array_equal(made.runs[3].channel("mcp_angle"), sessions[0].runs[1].channel("mcp_angle"))
    with pytest.raises(UserError, match="two or more"):
        merge_sessions(sessions[:1], tmp_path / "one.h5", "one")


def test_sessions_of_different_benches_are_not_merged(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    def other(file: h5py.File) -> None:
        file.attrs["rig"] = json.dumps({**RIG, "motor": {**RIG["motor"], "gear_ratio": 5.0}})

    sessions = [open_session(make_session("a.h5")), open_session(make_session("b.h5", other))]
    assert rig_differences(sessions) == ("motor.gear_ratio",)
    with pytest.raises(UserError, match=r"motor\.gear_ratio"):
        merge_sessions(sessions, tmp_path / "both.h5", "both")
    assert not (tmp_path / "both.h5").exists()
