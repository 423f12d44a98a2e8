"""No good run is lost: where one run's part is damaged, the others come back under their numbers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.sessions import open_session
from fingerlab.sessions.disk_files import ReadFile
from fingerlab.sessions.model import CHANNEL_UNITS
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


def no_texts(path: Path) -> bytes:
    """The file with zeros where its heap of texts lists them, as after a bad block of a disk."""
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 16 : heap + 256] = bytes(240)
    path.write_bytes(content)
    return bytes(content)


def test_zeroed_texts_hold_nobody_up(recording: Path, make_session: Callable[..., Path]) -> None:
    """HDF5 itself goes round for ever at such a heap, and cannot be interrupted: hence another process."""
    bad = no_texts(recording_folder(recording) / f"002{PART_SUFFIX}")
    other = make_session("other.h5", samples=300)
    no_texts(other)
    for path, status, said in (
        (recording, 0, "Run 002 cannot be read (the texts at byte 2048 are damaged)"),
        (other, 2, "is damaged (HDF5 says: the texts at byte 2048 are damaged)"),
    ):
        command = [sys.executable, "-m", "fingerlab", "info", str(path)]
        done = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=60)
        assert done.returncode == status
        assert said in " ".join((done.stdout + done.stderr).split())
    assert [run.name for run in open_session(recording).runs] == ["001", "003"]
    assert recording.with_name(f"s.h5.002{PART_SUFFIX}.damaged").read_bytes() == bad


def heap(*objects: tuple[int, int], size: int = 4096) -> bytes:
    """A heap of texts as HDF5's file format has it: number and length of each object."""
    content = b"GCOL\1\0\0\0" + size.to_bytes(8, "little")
    for number, length in objects:
        content += number.to_bytes(2, "little") + bytes(6) + length.to_bytes(8, "little")
        content += bytes(-(-length // 8) * 8 if number else max(length - 16, 0)) if length < 5000 else b""
    return content.ljust(4096, b"\0")


@pytest.mark.parametrize(
    ("content", "good"),
    [
        (heap((1, 3), (2, 40), (0, 4096 - 16 - 24 - 56)), True),
        (heap((1, 4096 - 16 - 16 - 8)), True),  # eight bytes are left: too few for another
        (heap((1, 3)), False),  # a free object of no size
        (heap((0, 8)), False),
        (heap((1, 4096)), False),
        (heap((1, 2**64 - 16)), False),
        (heap((0, 4080), size=4095), False),
        (heap((0, 4080), size=4097), False),  # more than the file has
    ],
)
def test_a_heap_of_texts_is_read_where_its_sizes_add_up(content: bytes, good: bool, tmp_path: Path) -> None:
    (tmp_path / "heap").write_bytes(content)
    with ReadFile(tmp_path / "heap") as file:
        if good:
            assert file.readinto(bytearray(4096)) == 4096
        else:
            with pytest.raises(OSError, match="the texts at byte 0 are damaged"):
                file.readinto(bytearray(4096))


def test_other_sizes_of_addresses_are_no_session(tmp_path: Path) -> None:
    """The heaps of such a file could not be looked through; no program of laboratories writes them."""
    plan = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    plan.set_sizes(4, 4)
    h5py.h5f.create(bytes(tmp_path / "s.h5"), h5py.h5f.ACC_TRUNC, plan).close()
    with pytest.raises(UserError, match="counts its bytes as no program does"):
        open_session(tmp_path / "s.h5")
