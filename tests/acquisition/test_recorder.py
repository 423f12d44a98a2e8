"""The recorder on a ring that tests fill: what was published is in the session, to the last sample."""

from __future__ import annotations

import errno
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fingerlab.acquisition.control.machine import Mode
from fingerlab.acquisition.recorder import Recorder
from fingerlab.acquisition.recording import WHOLE_S, RunInfo, SessionInfo
from fingerlab.acquisition.ring import COLUMN, COLUMNS, Array, Ring, RowFlag
from fingerlab.acquisition.status import Number, SharedStatus, Slot, Text
from fingerlab.core.errors import UserError
from fingerlab.diagnosis.signals.scales import LEAST_SECONDS
from fingerlab.rig.file import default_rig
from fingerlab.sessions import check_session, open_session
from fingerlab.sessions.exporting import export_session
from fingerlab.sessions.recording_files import PartWriter, cut_recordings

SINE = {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0}


class Bench:
    """A ring that is filled row by row, and its recorder."""

    def __init__(self, folder: Path, rows: int = 4096) -> None:
        self.ring, self.board = Ring.make(rows, len(COLUMNS), False), SharedStatus.make(False)
        self.now = 0.0
        self.recorder = Recorder(self.ring, self.board, folder / "rescued", lambda: self.now)
        self.path = folder / "place" / "session.h5"
        self.path.parent.mkdir(exist_ok=True)
        self.index = -1

    def open(self) -> None:
        info = SessionInfo(self.path, default_rig().to_json(), "Łódź", "2026-11-01T09:00:00+01:00")
        self.recorder.open(info)

    def begin(self, start: int = 0, stop: int | None = None, phase: str = "contact") -> None:
        cable = {"contact": "flexion", "on_air": "extension"}.get(phase, "none")
        self.recorder.begin(RunInfo(phase, cable, 1000.0, SINE, start, stop))

    def publish(self, count: int, skip: int = 0, **columns: float) -> None:
        self.index += skip
        self.write(count, **columns)
        self.now += 1.0
        self.recorder.poll()

    def write(self, count: int, **columns: float) -> None:
        for _ in range(count):
            self.index += 1
            row = {name: 0.001 * self.index + k for k, name in enumerate(COLUMNS)}
            row |= {"index": float(self.index), "flags": 0.0, "raw/encoder_counts": 2.0**25 + self.index}
            row |= columns
            self.ring.write(tuple(row.values()))
            self.board[Slot.INDEX] = self.index


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    made = Bench(tmp_path)
    made.open()
    return made


def test_every_sample_is_in_the_session_and_nothing_else(bench: Bench) -> None:
    bench.publish(300)
    bench.begin(100, 1100)
    for _ in range(12):
        bench.publish(90)
    session = open_session(bench.recorder.close())
    assert not check_session(session).errors
    run = session.runs[0]
    np.testing.assert_allclose(run.channel("time"), np.arange(1000) / 1000.0)
    index = np.arange(100, 1100)
    for name in ("motor_command", "endpoint_force", "raw/mcp_volts", "cycle_time"):
        np.testing.assert_allclose(run.channel(name), 0.001 * index + COLUMN[name], rtol=1e-6)
    np.testing.assert_array_equal(run.channel("raw/encoder_counts"), 2**25 + index)
    assert session.attributes["ended"] == "clean"
    assert run.attributes["complete"] == 1
    assert session.title == "Łódź"
    assert not bench.path.with_name("session.h5.recording").exists()


def test_digital_inputs_are_recorded_where_the_rig_has_them(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    rig = json.loads(default_rig().to_json())
    rig["daq"]["emergency_stop"] = {"terminal": "port0/line2"}
    bench.recorder.open(SessionInfo(bench.path, json.dumps(rig), "lines", "2026-11-01T09:00:00+01:00"))
    bench.begin(0, 300)
    bench.publish(200, **{"raw/emergency_stop": 0.0})
    bench.publish(100, **{"raw/emergency_stop": 1.0})
    session = open_session(bench.recorder.close())
    assert not check_session(session).errors
    run = session.runs[0]
    np.testing.assert_array_equal(run.channel("raw/emergency_stop"), np.r_[np.zeros(200), np.ones(100)])
    assert run.units["raw/emergency_stop"] == ""
    assert not run.has("raw/amplifier_ready")  # this rig has none
    exported = export_session(session, "csv", tmp_path / "out")
    with next(one for one in exported if one.suffix == ".csv").open(encoding="utf-8") as table:
        assert "raw/emergency_stop" in table.readline()


def test_pre_trigger_takes_what_the_ring_still_has(bench: Bench) -> None:
    bench.publish(3000)
    bench.begin(bench.index - 1999)
    bench.publish(50)
    run = open_session(bench.recorder.close()).runs[0]
    assert run.length == 2050
    assert run.attributes["dropped_samples"] == 0


def test_a_loop_that_goes_on_while_a_run_begins_costs_no_sample(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The recorder is set aside while it looks for the run's first row, and 40 rows come meanwhile."""
    bench.publish(300)
    start, copy = bench.index - 9, bench.ring.copy

    def set_aside(first: int, stop: int) -> tuple[int, Array]:
        found = copy(first, stop)
        bench.write(40)
        return found

    monkeypatch.setattr(bench.ring, "copy", set_aside)
    bench.begin(start)
    monkeypatch.undo()
    bench.publish(50)
    run = open_session(bench.recorder.close()).runs[0]
    assert run.length == 10 + 40 + 50
    assert run.attributes["ended"] == "clean"


LOADED = RunInfo("motor_bench", "none", 1000.0, SINE, 0, None, 0.05)


def test_a_run_against_a_known_load_ends_when_the_load_is_set_down(bench: Bench) -> None:
    bench.recorder.begin(LOADED)
    bench.publish(150, mode=Mode.RUNNING)
    assert bench.board[Slot.RECORDING] == 1
    bench.publish(50, mode=Mode.STOPPING)
    assert bench.board[Slot.RECORDING] == 0
    bench.recorder.begin(replace(LOADED, start=bench.index + 1, stop=bench.index + 101))
    bench.publish(99, mode=Mode.RUNNING)
    bench.publish(60, mode=Mode.STOPPING)
    session = open_session(bench.recorder.close())
    # The first row of the soft stop still holds the motion's last sample.
    assert [run.length for run in session.runs] == [151, 100]


@pytest.mark.parametrize(
    ("mode", "flags", "words"),
    [
        (Mode.FAULT, 0, "The finger hit its stop."),
        (Mode.IDLE, int(RowFlag.LATCHED), "stopped by the operator"),
        (Mode.INITIALISED, 0, ""),
    ],
)
def test_a_load_that_falls_is_not_recorded_as_carried(
    bench: Bench, mode: Mode, flags: int, words: str
) -> None:
    bench.publish(1)
    bench.recorder.begin(replace(LOADED, start=1))
    bench.publish(150, mode=Mode.RUNNING)
    bench.board.set_text(Text.FAULT, "The finger hit its stop.")
    bench.publish(50, mode=mode, flags=flags)
    (run,) = open_session(bench.recorder.close()).runs
    assert run.length == 150
    assert run.attributes["ended"] == ("truncated" if words else "clean")
    note = str(run.attributes.get("ended_note", ""))
    assert words in note
    assert bool(words) == bool(note)


def test_gaps_are_gaps_and_are_told(bench: Bench) -> None:
    bench.begin(0, 1000)
    bench.publish(400)
    bench.publish(100, skip=37)
    bench.publish(300, mcp_angle=float("nan"))
    bench.publish(200)
    path = bench.recorder.close()
    session = open_session(path)
    run = session.runs[0]
    assert run.length == 400 + 100 + (1000 - 400 - 37 - 100 - 300)
    assert run.attributes["dropped_samples"] == 337
    steps = np.rint(np.diff(run.channel("time")) * 1000).astype(int)
    assert sorted(steps[steps > 1]) == [38, 301]
    assert session.attributes["ended"] == "lossy"
    assert "337 samples" in session.attributes["ended_note"]
    assert [r.lost_samples for r in check_session(session).runs] == [337]


def test_a_ring_that_came_round_is_a_gap(bench: Bench) -> None:
    bench.begin(0)
    bench.publish(100)
    for _ in range(9000):  # nobody polls meanwhile
        bench.index += 1
        bench.ring.write((float(bench.index), *(0.5 for _ in COLUMNS[1:])))
    bench.publish(10)
    assert bench.board[Slot.UNREAD] == 9000 + 10 - (4096 - 256)
    run = open_session(bench.recorder.close()).runs[0]
    assert run.attributes["dropped_samples"] == bench.board[Slot.UNREAD]
    assert run.length + run.attributes["dropped_samples"] == 9110


def test_pause_markers_late_cycles_and_what_the_loop_learned(bench: Bench) -> None:
    bench.recorder.begin(RunInfo("contact", "flexion", 1000.0, SINE, 0, attributes={"feed_forward": 0.0}))
    bench.board.set_number(Number.FEED_FORWARD, 0.81)
    bench.publish(500)
    bench.recorder.mark("cable slipped, später")
    bench.recorder.pause(True)
    assert bench.board[Slot.RECORDING] == 2
    bench.publish(250)
    bench.recorder.pause(False)
    bench.publish(250, flags=float(RowFlag.LATE))
    run = open_session(bench.recorder.close()).runs[0]
    assert run.length == 750
    assert run.channel("time")[[499, 500]] == pytest.approx([0.499, 0.75])
    assert run.attributes["dropped_samples"] == 0
    assert run.attributes["late_cycles"] == 250
    assert run.attributes["feed_forward"] == 0.81
    assert json.loads(run.attributes["markers"]) == [{"time": 0.499, "note": "cable slipped, später"}]


def test_several_runs_one_session_in_their_order(bench: Bench) -> None:
    for phase in ("on_air", "contact", "motor_bench"):
        bench.begin(bench.index + 1, bench.index + 201, phase)
        bench.publish(250)
    session = open_session(bench.recorder.close())
    assert [(r.name, r.phase, r.length) for r in session.runs] == [
        ("001", "on_air", 200),
        ("002", "contact", 200),
        ("003", "motor_bench", 200),
    ]
    assert session.runs[2].has("load_torque")
    assert not session.runs[2].has("mcp_angle")


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.path.write_bytes(b"somebody's")
    with pytest.raises(UserError, match="not overwritten"):
        bench.open()
    bench.path.unlink()
    bench.open()
    other = Bench(tmp_path)
    with pytest.raises(UserError, match="under way or was cut"):
        other.open()
    with pytest.raises(UserError, match="being recorded at this moment"):
        open_session(bench.path)
    bench.begin(0)
    bench.publish(100)
    bench.path.write_bytes(b"somebody's")  # while we recorded
    assert bench.recorder.close().name == "session (2).h5"
    assert bench.path.read_bytes() == b"somebody's"


def test_a_session_without_a_sample_is_not_written(bench: Bench) -> None:
    with pytest.raises(UserError, match="no runs"):
        bench.recorder.close()
    assert list(bench.path.parent.iterdir()) == []


def test_a_cut_recording_is_repaired_when_it_is_opened(bench: Bench, tmp_path: Path) -> None:
    bench.begin(0)
    bench.publish(730)
    copy = tmp_path / "copy" / "session.h5.recording"  # what a killed writer leaves is what is on the disk
    shutil.copytree(bench.path.with_name("session.h5.recording"), copy)
    session = copy.with_name("session.h5")
    assert cut_recordings(copy.parent) == [session]
    found = open_session(session)
    assert found.attributes["ended"] == "truncated"
    assert found.runs[0].attributes["complete"] == 0
    assert 730 - 100 <= found.runs[0].length <= 730
    assert session.exists()
    assert not copy.exists()


def test_a_cut_part_taken_out_of_its_folder_is_repaired_too(bench: Bench, tmp_path: Path) -> None:
    bench.begin(0)
    bench.publish(500)
    alone = tmp_path / "alone.h5"
    shutil.copyfile(bench.path.with_name("session.h5.recording") / "001.h5part", alone)
    assert open_session(alone).runs[0].length == 500
    assert (tmp_path / "alone.h5.cut").exists()


def test_announced_samples_that_never_came_are_not_believed(bench: Bench, tmp_path: Path) -> None:
    bench.begin(0)
    bench.publish(500)
    part = tmp_path / "part.h5"
    shutil.copyfile(bench.path.with_name("session.h5.recording") / "001.h5part", part)
    with h5py.File(part, "r", swmr=True) as cut:
        data = {name: cut[f"runs/001/{name}"][:] for name in ("time", "motor_position")}
    assert len(data["time"]) == len(data["motor_position"]) == 500
    bench.recorder._run.writer._datasets["motor_position"].resize((600,))  # type: ignore[union-attr]
    bench.recorder._run.writer._datasets["time"].resize((600,))  # type: ignore[union-attr]
    bench.recorder._run.writer._file.flush()  # type: ignore[union-attr]
    again = tmp_path / "again.h5"
    shutil.copyfile(bench.path.with_name("session.h5.recording") / "001.h5part", again)
    assert open_session(again).runs[0].length == 500


def test_a_full_disk_is_told_in_one_sentence_and_what_was_written_is_kept(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.begin(0)
    bench.publish(600)

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(PartWriter, "append", full)
    bench.publish(100)
    assert bench.board[Slot.RECORDER_ERRORS] == 1
    sentence = bench.board.text(Text.RECORDER)
    assert "No space left" in sentence
    assert sentence.count(". ") == 0
    monkeypatch.undo()
    session = open_session(bench.path)
    assert session.runs[0].length == 600
    assert session.attributes["ended"] == "truncated"


@pytest.mark.skipif(sys.platform != "linux", reason="needs a small file system that can be mounted")
def test_a_disk_that_is_really_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small = tmp_path / "small"
    small.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(small)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("mounting a small file system is not allowed here")
    try:
        monkeypatch.setattr("fingerlab.acquisition.recorder.LEAST_FREE_BYTES", 0)
        bench = Bench(small)
        bench.open()
        bench.begin(0)
        while not bench.board[Slot.RECORDER_ERRORS] and bench.index < 100_000:
            bench.publish(100)
        assert "No space left on device" in bench.board.text(Text.RECORDER)
        elsewhere = tmp_path / "elsewhere"
        shutil.copytree(bench.path.parent, elsewhere)
        run = open_session(elsewhere / bench.path.name).runs[0]
        assert bench.index - 250 <= run.length <= bench.index + 1
    finally:
        subprocess.run(["umount", str(small)], check=False)


def test_little_room_ends_the_recording_while_it_can_be_ended(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.begin(0)
    bench.publish(600)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9, 10**6))
    bench.publish(100)
    assert "1 MB left" in bench.board.text(Text.RECORDER)
    assert bench.board[Slot.RECORDING] == 0
    session = open_session(bench.recorder.close())
    assert session.runs[0].length == 700
    assert "MB left" in session.attributes["ended_note"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows removes no folder with open files in it")
def test_a_vanished_folder_costs_no_sample(bench: Bench, tmp_path: Path) -> None:
    bench.begin(0, 400)
    bench.publish(400)
    bench.begin(400)
    bench.publish(300)
    shutil.rmtree(bench.path.parent)
    bench.publish(100)
    sentence = bench.board.text(Text.RECORDER)
    assert "vanished" in sentence
    assert "saved as" in sentence
    assert bench.board[Slot.RECORDER_ERRORS] >= 1
    runs = open_session(tmp_path / "rescued" / "session.h5").runs
    assert [run.length for run in runs] == [400, 400]


def test_a_disk_that_lies_is_found_out(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.begin(0)
    bench.publish(500)
    bench.recorder.end()
    from fingerlab.sessions.writing import RunWriter

    honest = RunWriter.append

    def lying(self: RunWriter, channels: dict[str, Any]) -> None:
        spoilt = np.array(channels["motor_torque"])
        spoilt[-1] += 1.0
        honest(self, {**channels, "motor_torque": spoilt})

    monkeypatch.setattr(RunWriter, "append", lying)
    with pytest.raises(UserError, match=r"differs.*motor_torque"):
        bench.recorder.close()
    monkeypatch.undo()
    assert open_session(bench.path).runs[0].length == 500  # the recording was kept


def test_what_a_run_is_worth_is_told_when_it_ends(bench: Bench) -> None:
    bench.begin(0, 3000)
    bench.publish(3001)
    assert bench.board.text(Text.RUN) == "Run 1: 3.0 s, nothing missing; usable."
    bench.begin(bench.index + 1, bench.index + 5024)
    for skip in (20, 3, 0, 0, 0):
        bench.publish(1000, skip)
    assert (bench.board[Slot.GAPS], bench.board[Slot.DROPPED]) == (2, 23)
    assert bench.board.text(Text.RUN) == (
        "Run 2: 5.0 s, 2 gaps with 23 samples missing; "
        "usable, piece by piece between them (the longest 4.0 s)."
    )
    bench.begin(bench.index + 1, bench.index + 6005)
    for _ in range(4):
        bench.publish(1500, 1)
    assert bench.board.text(Text.RUN).startswith("Run 3: 6.0 s, 4 gaps with 4 samples missing; not usable")
    bench.begin(bench.index + 1, bench.index + 1002)
    bench.publish(500, 1)
    bench.publish(501)
    assert bench.board.text(Text.RUN).startswith("Run 4: 1.0 s, 1 gap with 1 sample missing; not usable")
    bench.begin(bench.index + 1, bench.index + 901)
    bench.publish(902)
    assert bench.board.text(Text.RUN) == (
        "Run 5: 0.9 s, nothing missing; not usable: too short, a run takes 3 s."
    )
    assert pytest.approx(LEAST_SECONDS) == WHOLE_S  # what the diagnosis takes
