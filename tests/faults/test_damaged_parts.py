"""No good run is lost: where one run's part is damaged, the others come back under their numbers."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from fingerlab.sessions import open_session
from fingerlab.sessions.format import CHANNEL_UNITS
from fingerlab.sessions.recording_files import (
    CLOSED,
    LOCK,
    PART_SUFFIX,
    PartHeader,
    PartWriter,
    recording_folder,
)
from tests.conftest import RIG

UNITS = {name: unit for name, unit in CHANNEL_UNITS.items() if not name.endswith(("force", "load_torque"))}
SAMPLES = 9000


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A session of three runs whose recorder was killed in the rest after the third."""
    path = tmp_path / "s.h5"
    folder = recording_folder(path)
    folder.mkdir()
    (folder / LOCK).touch()
    root = {"title": "t", "created": "2026-11-01T09:00:00+01:00", "rig": json.dumps(RIG)}
    run = {
        "phase": "on_air",
        "cable": "extension",
        "sample_rate_hz": 1000.0,
        "trajectory": '{"kind": "sine"}',
    }
    for number in (1, 2, 3):
        writer = PartWriter(folder / f"{number:03d}{PART_SUFFIX}", PartHeader(root, run), UNITS)
        time = np.arange(SAMPLES) / 1000
        writer.append({name: time if name == "time" else np.sin(number * time) for name in UNITS})
        writer.finish("clean", "", True)
    return path


def damaged(content: bytes, how: str) -> bytes:
    if how == "cut":
        return content[: len(content) // 2]
    if how == "head":
        return content[:48] + bytes(range(256)) * 4 + content[1072:]
    if how == "says that it is open":
        return content[:11] + b"\x05" + content[12:]
    return b"no HDF5 at all" * 9000


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("how", ["cut", "head", "text"])
def test_the_other_runs_come_back_under_their_own_numbers(recording: Path, number: int, how: str) -> None:
    part = recording_folder(recording) / f"{number:03d}{PART_SUFFIX}"
    bad = damaged(part.read_bytes(), how)
    part.write_bytes(bad)
    session = open_session(recording)
    assert [run.name for run in session.runs] == [f"{n:03d}" for n in (1, 2, 3) if n != number]
    for run in session.runs:
        measured = run.channel("motor_position")
        assert measured == pytest.approx(np.sin(int(run.name) * np.arange(SAMPLES) / 1000), abs=1e-6)
    assert session.attributes["ended"] == "truncated"
    assert f"Run {number:03d} cannot be read" in session.attributes["ended_note"]
    kept = recording.with_name(f"s.h5.{number:03d}{PART_SUFFIX}.damaged")
    assert kept.read_bytes() == bad
    assert not recording_folder(recording).exists()


def test_a_run_that_is_gone_is_told(recording: Path) -> None:
    (recording_folder(recording) / f"002{PART_SUFFIX}").unlink()
    session = open_session(recording)
    assert [run.name for run in session.runs] == ["001", "003"]
    assert "Run 002 is missing" in session.attributes["ended_note"]


@pytest.mark.parametrize(("closed", "ended"), [(False, "truncated"), (True, "clean")])
def test_killed_in_the_rest_is_not_a_clean_end(recording: Path, closed: bool, ended: str) -> None:
    if closed:
        (recording_folder(recording) / CLOSED).write_text("", encoding="utf-8")
    assert open_session(recording).attributes["ended"] == ended


def test_a_part_that_says_it_is_open_is_read_where_it_ends(recording: Path) -> None:
    part = recording_folder(recording) / f"003{PART_SUFFIX}"
    content = bytearray(damaged(part.read_bytes(), "says that it is open"))
    content[28:36] = (4096).to_bytes(8, "little")  # as its writer had last written it down
    part.write_bytes(bytes(content) + os.urandom(100))
    assert [run.length for run in open_session(recording).runs] == [SAMPLES] * 3
