"""A session that is being written may be put off: nothing is lost, and whoever opens it finishes it."""

from __future__ import annotations

import multiprocessing
import shutil
import threading
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest

from fingerlab.acquisition.bench.process_bench import RemoteRecorder
from fingerlab.acquisition.bench.processes import _serve
from fingerlab.acquisition.ring import COLUMN
from fingerlab.acquisition.status import Number, Slot
from fingerlab.core.errors import Cancelled
from fingerlab.sessions import open_session
from fingerlab.sessions.recording_files import recording_folder
from fingerlab.sessions.repair import repaired

from .test_recorder import Bench


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    made = Bench(tmp_path)
    made.open()
    made.begin(0, 1000)
    made.publish(1100)
    return made


def far_from(bench: Bench) -> tuple[RemoteRecorder, threading.Thread]:
    """The caller's side of the recorder, which answers one request from a thread."""
    near, there = multiprocessing.Pipe()

    def answer() -> None:
        name, arguments = there.recv()
        _serve(bench.recorder, there, name, arguments)

    thread = threading.Thread(target=answer)
    thread.start()
    return RemoteRecorder(SimpleNamespace(board=bench.board, beat=lambda: None), near), thread  # type: ignore[arg-type]


@pytest.mark.parametrize("until", ["writing", "verifying"])
def test_what_was_put_off_is_whole_when_it_is_opened(bench: Bench, until: str) -> None:
    def progress(share: float, what: str) -> None:
        if what == until and share > 0.0:
            raise Cancelled

    with pytest.raises(Cancelled):
        bench.recorder.close(progress)
    folder = recording_folder(bench.path)
    assert not bench.path.exists()
    kept = ["written.h5part"] if until == "verifying" else []
    assert sorted(file.name for file in folder.iterdir()) == ["001.h5part", "closed", "lock", *kept]
    session = open_session(bench.path)
    assert session.attributes["ended"] == "clean"
    assert session.runs[0].length == 1000
    assert not folder.exists()


@pytest.mark.parametrize("damage", ["none", "a sample", "a run", "the file"])
def test_what_was_written_to_its_end_is_only_read_back(bench: Bench, damage: str) -> None:
    def progress(share: float, what: str) -> None:
        if what == "verifying":
            raise Cancelled

    with pytest.raises(Cancelled):
        bench.recorder.close(progress)
    written = recording_folder(bench.path) / "written.h5part"
    if damage == "the file":
        written.write_bytes(written.read_bytes()[:1000])
    elif damage != "none":
        with h5py.File(written, "r+") as file:
            if damage == "a run":
                file.copy("runs/001", "runs/002")
            else:
                file["runs/001/motor_position"][-1] += 1e-3
    told: list[tuple[float, str]] = []
    repaired(bench.path, lambda share, what: told.append((share, what)))
    assert ("writing" in [what for _, what in told]) == (damage != "none")
    assert told[0] == (0.0, "verifying")
    assert told[-1] == (1.0, "verifying")
    run = open_session(bench.path).runs[0]
    assert run.length == 1000
    recorded = 0.001 * 999 + COLUMN["motor_position"]
    assert run.channel("motor_position")[-1] == pytest.approx(recorded, rel=1e-6)
    assert not recording_folder(bench.path).exists()


def test_finishing_later_may_be_put_off_again(bench: Bench) -> None:
    def stop(share: float, what: str) -> None:
        raise Cancelled

    for again in (bench.recorder.close, lambda progress: repaired(bench.path, progress)):
        with pytest.raises(Cancelled):
            again(stop)
    shares: list[float] = []
    assert repaired(bench.path, lambda share, _: shares.append(share)) == bench.path
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert open_session(bench.path).runs[0].length == 1000


def test_a_runs_file_alone_is_repaired_whole_or_not_at_all(bench: Bench, tmp_path: Path) -> None:
    """Somebody copied it out of its folder while it grew."""
    bench.begin(2000)
    bench.publish(2500)
    alone = tmp_path / "alone.h5"
    shutil.copyfile(recording_folder(bench.path) / "002.h5part", alone)

    def stop(share: float, what: str) -> None:
        if what == "verifying":
            raise Cancelled

    with pytest.raises(Cancelled):
        repaired(alone, stop)
    assert [file.name for file in tmp_path.iterdir() if file.is_file()] == ["alone.h5"]
    assert repaired(alone) == alone
    assert open_session(alone).attributes["ended"] == "truncated"


def test_the_recorder_is_free_for_the_next_session_at_once(bench: Bench) -> None:
    bench.board[Slot.PUT_OFF] = 1
    with pytest.raises(Cancelled):
        bench.recorder.close()
    bench.board[Slot.PUT_OFF] = 0
    first, bench.path = bench.path, bench.path.with_name("next.h5")
    bench.open()
    assert open_session(first).runs[0].length == 1000


def test_another_process_tells_how_far_it_is_and_lives(bench: Bench) -> None:
    far, thread = far_from(bench)
    beats, told = bench.board[Slot.RECORDER_BEAT], []
    assert far.close(lambda share, what: told.append((share, what))) == bench.path
    thread.join()
    assert all(0.0 <= share <= 1.0 and what in ("writing", "verifying") for share, what in told)
    assert bench.board.number(Number.WRITTEN) == 1.0
    assert bench.board[Slot.VERIFYING] == 1
    assert bench.board[Slot.RECORDER_BEAT] > beats + 2


def test_another_process_is_asked_to_put_it_off(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = threading.Event()
    close = bench.recorder.close
    monkeypatch.setattr(bench.recorder, "close", lambda: asked.wait(60.0) and close())
    far, thread = far_from(bench)

    def progress(share: float, what: str) -> None:
        threading.Timer(0.05, asked.set).start()
        raise Cancelled

    with pytest.raises(Cancelled):
        far.close(progress)
    thread.join()
    assert bench.board[Slot.PUT_OFF] == 0
    assert open_session(bench.path).runs[0].length == 1000
