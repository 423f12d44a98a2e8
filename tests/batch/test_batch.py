"""``fingerlab batch``: every session once, in a table that grows and is never lost."""

from __future__ import annotations

import json
import multiprocessing
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result

from fingerlab.batch import table
from fingerlab.batch.run import locally, run_batch
from fingerlab.batch.table import Options, Parts, SessionRow, Task, diagnose_file
from fingerlab.cli.main import cli
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.trust import OwnSource
from fingerlab.sessions import file_hash

from .conftest import aged

EXAMPLE = Path(__file__).parents[2] / "docs" / "own_effect_example.py"
BROKEN = ("2026-1/hole.h5", "not hdf5.h5", "other.hdf5")


def call(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["batch", *map(str, arguments)])


class Finished:
    """One batch over the whole tree, in two processes, through the command."""

    def __init__(self, bench: Path, place: Path) -> None:
        self.table = place / "T.parquet"
        self.called = call(bench, "--out", self.table, "--jobs", 2, "--json", place / "T.json")
        assert self.called.exit_code == 0, self.called.output
        self.data: dict[str, Any] = json.loads((place / "T.json").read_text(encoding="utf-8"))
        self.rows = {row["session"]: row for row in self.data["rows"]}


@pytest.fixture(scope="module")
def finished(bench: Path, tmp_path_factory: pytest.TempPathFactory) -> Finished:
    return Finished(bench, tmp_path_factory.mktemp("table"))


def test_one_row_a_session_below_the_folder(finished: Finished, bench: Path) -> None:
    files = {p.relative_to(bench).as_posix() for p in bench.rglob("*.h*5")}
    assert set(finished.rows) == files
    assert len(files) == 7
    row = finished.rows["2026-1/m1.h5"]
    assert row["sha256"] == file_hash(bench / "2026-1" / "m1.h5")
    assert (row["title"], row["operator"], row["runs"]) == ("month 1", "Łucja", 3)
    assert row["recorded_seconds"] == pytest.approx(30.0, abs=0.1)
    assert row["verdict"] in ("nothing_missing", "missing_effect", "not_in_catalogue")
    assert row["final_score"] == row["error_path"][-1]["score"]
    assert row["final_model"] == [step["added"] for step in row["error_path"][1:]]
    assert 0.5 < row["score"] < 3
    for family, unit in (("joint_torque", "N m"), ("cable_kinematics", "m"), ("motor_torque", "N m")):
        assert row[f"rmse.{family}"] > 0
        assert finished.data["units"][f"floor.{family}"] == unit
    for name in ("param.arm_mcp@extension", "alone.coulomb_friction.coulomb_pip"):
        assert row[f"{name}.low"] <= row[name] <= row[f"{name}.high"]


def test_the_table_is_parquet_with_units_and_times(finished: Finished) -> None:
    table = pq.read_table(finished.table)
    assert table.num_rows == 7
    assert table.schema.field("param.offset@extension").metadata[b"unit"] == b"m"
    assert table.schema.field("recorded").type == pa.timestamp("ms", tz="UTC")
    times = [t for t in table["recorded"].to_pylist() if t is not None]
    assert times == sorted(times)
    assert times[0].isoformat() == "2026-01-01T09:00:00+00:00"
    assert not list(finished.table.parent.glob("*.part*"))


def test_sessions_that_cannot_be_diagnosed_are_rows_with_a_sentence(finished: Finished) -> None:
    assert finished.data["failed"] == 3
    assert {name for name, row in finished.rows.items() if row["error"]} == set(BROKEN)
    assert "mcp_angle" in finished.rows["2026-1/hole.h5"]["error"]
    assert finished.rows["2026-1/hole.h5"]["title"]  # what could be read is there
    assert all("mistake of the program" not in str(row["error"]) for row in finished.rows.values())
    assert "3 sessions could not be diagnosed" in finished.called.stderr
    assert finished.rows["not hdf5.h5"]["verdict"] is None


def test_the_offset_that_grows_a_millimetre_a_month_is_seen(finished: Finished) -> None:
    trends = {trend["column"]: trend for trend in finished.data["trends"]}
    offset = trends["param.offset@extension"]
    assert offset["unit"] == "m"
    # Months of 31, 28 and 31 days: one millimetre is 0.98 to 1.09 mm in a month of 30.44 days.
    assert 0.97e-3 < offset["per_month"] < 1.1e-3
    assert offset["low"] > 0.9e-3
    assert offset["changes"]
    assert offset["sessions"] == 4
    assert abs(trends["param.arm_mcp@extension"]["per_month"]) < 1e-5


def test_the_summary_tells_a_person_how_the_bench_ages(finished: Finished) -> None:
    told = finished.called.stdout
    lines = told.splitlines()
    dates = [line[:10] for line in lines if line.startswith("2026-")]
    assert dates == ["2026-01-01", "2026-02-01", "2026-03-01", "2026-04-01"]
    offset, story = [line for line in lines if line.startswith("Cable offset, extension")]
    assert story.startswith("Cable offset, extension grows steadily, from ")
    assert offset.split()[-2:] == ["*", "4"]
    end = max(number for number, line in enumerate(lines) if not line.strip())
    counted = [line for line in lines[end + 1 :] if line[:1].isdigit()]  # names of effects may wrap
    assert sum(int(line.split()[0]) for line in counted) == 4


def test_what_became_of_each_number_is_in_the_json(finished: Finished) -> None:
    courses = {one["column"]: one for one in finished.data["over_time"]}
    offset = courses["param.offset@extension"]
    assert (offset["told"], offset["unit"]) == ("wear", "m")
    assert offset["size"]["value"] == pytest.approx(3e-3, rel=0.02)  # a millimetre a month, three months
    assert offset["sessions"] == ["2026-0/m0.h5", "2026-1/m1.h5", "2026-0/m2.h5", "2026-1/m3.h5"]
    assert sum(offset["chances"].values()) == pytest.approx(1.0)
    assert courses["param.arm_mcp@extension"]["told"] in ("steady", "open")
    assert offset["sentence"] in " ".join(finished.called.stdout.split())


def test_two_benches_are_told_apart_and_beside_one_another(
    finished: Finished, bench: Path, tmp_path: Path
) -> None:
    """No session is diagnosed again: the tables are made of those that are there."""
    tables = "--over-time", tmp_path / "C.csv", "--shared", tmp_path / "S.csv"
    done = call(bench, "--out", finished.table, "--between", "2026-0", "2026-1", *tables, "--json", "-")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["done"] == 0
    between = told["between"]
    assert [group["sessions"] for group in between["groups"]] == [
        ["2026-0/m0.h5", "2026-0/m2.h5"], ["2026-1/m1.h5", "2026-1/m3.h5"],
    ]  # fmt: skip
    assert [one["effect"] for one in between["effects"]] == sorted(
        {name for row in told["rows"] for name in row["final_model"] or ()}
    )
    assert (tmp_path / "C.csv").read_text(encoding="utf-8").startswith("bench,column,unit,sessions,told,")
    assert (tmp_path / "S.csv").read_text(encoding="utf-8").startswith("effect,told,same,differs,first,")
    again = call(bench, "--out", finished.table, "--between", "2026-0", "2026-1")
    assert "2026-0\n" in again.stdout
    assert "\nBoth\n" in again.stdout
    refused = call(bench, "--out", finished.table, "--between", "2026-0", "nowhere").exception
    assert isinstance(refused, UserError)
    assert "No session with a verdict and a time is in 'nowhere'" in str(refused)
    alone = call(bench, "--out", finished.table, "--shared", tmp_path / "other.csv").exception
    assert isinstance(alone, UserError)
    assert "name them with --between A B" in str(alone)
    taken = call(bench, "--out", finished.table, "--over-time", tmp_path / "C.csv").exception
    assert isinstance(taken, UserError)


def test_the_summary_fits_a_terminal(
    finished: Finished, monkeypatch: pytest.MonkeyPatch, bench: Path
) -> None:
    monkeypatch.setattr("fingerlab.cli.common.TABLE_WIDTH", 80)
    again = call(bench, "--out", finished.table)
    assert again.exit_code == 0
    assert max(len(line) for line in again.stdout.splitlines()) <= 80


@pytest.fixture
def tree(recorded: Path, tmp_path: Path) -> Path:
    """Three sessions of this test's own, one of them broken."""
    folder = tmp_path / "tree"
    (folder / "deep" / "er").mkdir(parents=True)
    aged(recorded, folder / "a.h5", "2026-01-01T10:00:00+01:00")
    aged(recorded, folder / "deep" / "er" / "b.h5", "2026-02-01T10:00:00+01:00")
    (folder / "broken.h5").write_text("broken", encoding="utf-8")
    return folder


def quickly(task: Task, options: Options) -> SessionRow:
    """A row as of a diagnosis, for what does not depend on one."""
    content = file_hash(Path(task.path))
    error = "broken" if task.name.startswith("broken") else None
    return SessionRow(
        {"session": task.name, "sha256": content, "software": table.SOFTWARE, "options": options.key,
         "error": error, "seconds": 0.0, "score": 1.0}, {},
    )  # fmt: skip


class Counted:
    """A runner in this process that remembers what it was given, and may be killed on the way."""

    def __init__(
        self, killed_after: int = 99, answer: Callable[[Task, Options], SessionRow] = quickly
    ) -> None:
        self.names: list[str] = []
        self.killed_after = killed_after
        self.answer = answer

    def __call__(self, tasks: Sequence[Task], options: Options) -> Iterator[SessionRow]:
        for task in tasks:
            if len(self.names) == self.killed_after:
                raise KeyboardInterrupt
            self.names.append(task.name)
            yield self.answer(task, options)


def test_nothing_is_done_twice_and_a_changed_session_once_more(tree: Path, tmp_path: Path) -> None:
    out, first, second, third = (
        tmp_path / "T.parquet",
        Counted(answer=diagnose_file),
        Counted(),
        Counted(answer=diagnose_file),
    )
    run_batch(tree, out, Options(), first)
    assert sorted(first.names) == ["a.h5", "broken.h5", "deep/er/b.h5"]
    before = out.stat().st_mtime_ns
    result = run_batch(tree, out, Options(), second)
    assert (second.names, result.done, result.kept) == ([], 0, 3)
    assert out.stat().st_mtime_ns == before
    with h5py.File(tree / "a.h5", "r+") as file:
        file.attrs["title"] = "changed"
    result = run_batch(tree, out, Options(), third)
    assert (third.names, result.done, result.kept) == (["a.h5"], 1, 2)
    assert {row["session"]: row["title"] for row in result.contents.rows}["a.h5"] == "changed"
    assert len(result.contents.rows) == 3


def test_a_moved_session_keeps_its_answer_and_a_removed_one_its_row(tree: Path, tmp_path: Path) -> None:
    out, again = tmp_path / "T.parquet", Counted()
    run_batch(tree, out, Options(), Counted())
    (tree / "a.h5").rename(tree / "deep" / "renamed.h5")
    (tree / "deep" / "er" / "b.h5").unlink()
    result = run_batch(tree, out, Options(), again)
    assert again.names == []
    assert result.gone == 1
    assert {r["session"] for r in result.contents.rows} == {"deep/renamed.h5", "deep/er/b.h5", "broken.h5"}


def test_another_version_or_another_own_effect_is_done_anew(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "T.parquet"
    for name in ("broken.h5", "a.h5"):
        (tree / name).unlink()
    run_batch(tree, out, Options(), Counted())
    options = Options(own=(OwnSource(str(EXAMPLE), EXAMPLE.read_bytes()),))
    result = run_batch(tree, out, options, Counted())
    assert (result.done, result.outdated) == (1, 1)
    for module in ("table", "run"):
        monkeypatch.setattr(f"fingerlab.batch.{module}.SOFTWARE", "fingerlab 99")
    result = run_batch(tree, out, options, Counted())
    assert (result.done, result.outdated, result.contents.rows[0]["software"]) == (1, 1, "fingerlab 99")


def test_a_kill_loses_only_what_was_in_work(tree: Path, tmp_path: Path) -> None:
    out, killed, resumed = tmp_path / "T.parquet", Counted(killed_after=2), Counted()
    with pytest.raises(KeyboardInterrupt):
        run_batch(tree, out, Options(), killed)
    kept = list(Parts.of(out).folder.glob("*.json"))
    assert len(kept) == 2
    assert not out.exists()
    kept[0].write_text('{"format": "fingerlab-ba', encoding="utf-8")  # the power failed in that moment
    result = run_batch(tree, out, Options(), resumed)
    assert len(resumed.names) == 2
    assert set(resumed.names) | set(killed.names) == {"a.h5", "broken.h5", "deep/er/b.h5"}
    assert len(result.contents.rows) == 3
    assert not Parts.of(out).folder.exists()


def test_a_batch_that_is_cancelled_goes_on_later(tree: Path, tmp_path: Path) -> None:
    out, resumed = tmp_path / "T.parquet", Counted()
    with pytest.raises(Cancelled):
        run_batch(tree, out, Options(), Counted(), cancelled=lambda: True)
    run_batch(tree, out, Options(), resumed)
    assert len(resumed.names) == 2


def test_failed_sessions_are_tried_again_when_asked(tree: Path, tmp_path: Path) -> None:
    out, again = tmp_path / "T.parquet", Counted()
    (tree / "a.h5").unlink()
    run_batch(tree, out, Options(), Counted())
    run_batch(tree, out, Options(), again, retry=True)
    assert again.names == ["broken.h5"]


def test_own_effects_travel_to_other_processes(tree: Path, tmp_path: Path) -> None:
    """The settings of the tests know no own effects, so the workers can have it from the batch alone."""
    options = Options(("motor_root_friction",), (OwnSource(str(EXAMPLE), EXAMPLE.read_bytes()),))
    (tree / "deep" / "er" / "b.h5").unlink()
    found = run_batch(tree, tmp_path / "T.parquet", options, locally(2)).contents.rows
    errors = {row["session"]: row["error"] for row in found}
    assert errors["a.h5"] is None
    assert all("param.motor_root_friction.root" in row for row in found if not row["error"])
    alone = diagnose_file(Task(str(tree / "a.h5"), "a.h5"), Options(("motor_root_friction",)))
    assert "no effect 'motor_root_friction'" in alone.row["error"]


def test_a_file_that_ends_its_process_and_one_of_odd_texts_cost_the_others_nothing(
    recorded: Path, tree: Path, tmp_path: Path
) -> None:
    """An own effect stands for whatever crashes in a library at one session: a cable that is wound up."""
    text = EXAMPLE.read_text(encoding="utf-8")
    crash = '    if motion.position.mean() > 3.0:\n        __import__("os").abort()\n'
    changed = text.replace("    torque = np.sign", crash + "    torque = np.sign")
    options = Options(("motor_root_friction",), (OwnSource(str(EXAMPLE), changed.encode()),))
    aged(recorded, tree / "crash.h5", "2026-03-01T10:00:00+01:00", 0.06)
    with h5py.File(tree / "deep" / "er" / "b.h5", "r+") as file:
        odd = {"created": "[/bold]=1+1", "title": "\x1b[2J$x_{$", "notes": np.zeros(0)}
        for name, value in odd.items():
            file.attrs[name] = value
    found = run_batch(tree, tmp_path / "T.parquet", options, locally(2)).contents.rows
    table = {row["session"]: row for row in found}
    assert "ended from outside, for want of memory or by this file" in table["crash.h5"]["error"]
    assert "is not an HDF5 file" in table["broken.h5"]["error"]
    for name in ("a.h5", "deep/er/b.h5"):
        assert table[name]["error"] is None
        assert table[name]["score"] > 0
    assert table["deep/er/b.h5"]["created"] == "[/bold]=1+1"
    assert pq.read_table(tmp_path / "T.parquet").num_rows == 4


def refused(*arguments: object) -> str:
    result = call(*arguments)
    assert isinstance(result.exception, (UserError, SystemExit)), result.output
    return str(result.exception) if isinstance(result.exception, UserError) else result.stderr


def test_tables_that_are_not_ours_are_refused_and_stay(tree: Path, tmp_path: Path) -> None:
    text, foreign = tmp_path / "text.parquet", tmp_path / "foreign.parquet"
    text.write_text("mine", encoding="utf-8")
    pq.write_table(pa.table({"x": [1, 2]}), foreign)
    for path in (text, foreign):
        before = path.read_bytes()
        assert "is not a table of 'fingerlab batch'" in refused(tree, "--out", path, "--jobs", 1)
        assert path.read_bytes() == before
        assert not Parts.of(path).folder.exists()


def test_a_table_of_another_question_or_other_sessions_is_refused(
    finished: Finished, bench: Path, tree: Path
) -> None:
    before = finished.table.read_bytes()
    added = refused(bench, "--out", finished.table, "--add", "coulomb_friction")
    assert "answers are to another question" in added
    assert "none of its sessions is below" in refused(tree, "--out", finished.table)
    assert finished.table.read_bytes() == before


def test_bad_calls_are_one_sentence(tree: Path, tmp_path: Path, finished: Finished) -> None:
    out = tmp_path / "T.parquet"
    (tmp_path / "empty" / ".hidden").mkdir(parents=True)
    (tmp_path / "empty" / ".hidden" / "old.h5").write_bytes(b"passed by, as the browser does")
    assert "no session below" in refused(tmp_path / "empty", "--out", out)
    assert "is not a folder" in refused(tmp_path / "nowhere", "--out", out)
    assert "does not exist" in refused(tree, "--out", tmp_path / "nowhere" / "T.parquet")
    assert "should end in .parquet" in refused(tree, "--out", tmp_path / "T.csv")
    assert "no effect 'gremlins'" in refused(tree, "--out", out, "--add", "gremlins")
    assert "--jobs" in refused(tree, "--out", out, "--dask", "tcp://127.0.0.1:1", "--jobs", 2)
    written = finished.table.with_name("T.json")
    assert "not overwritten" in refused(tree, "--out", out, "--json", written)
    assert not out.exists()


def test_a_recording_that_is_there_twice_is_told(finished: Finished, bench: Path, tmp_path: Path) -> None:
    """A copy is not diagnosed again; that it counts twice is said once."""
    folder, table = tmp_path / "sessions", tmp_path / "T.parquet"
    shutil.copytree(bench, folder)
    shutil.copy(folder / "2026-1" / "m1.h5", folder / "2026-1" / "once-more.h5")
    shutil.copy(finished.table, table)
    told = call(folder, "--out", table).stderr
    assert told.count("hold the same recording and count twice") == 1
    assert "2026-1/m1.h5" in told
    assert "2026-1/once-more.h5" in told


def test_json_alone_goes_to_standard_output(finished: Finished, bench: Path, tmp_path: Path) -> None:
    table = tmp_path / "T.parquet"
    shutil.copy(finished.table, table)
    told = call(bench, "--out", table, "--json", "-")
    data = json.loads(told.stdout)
    assert (data["done"], data["kept"], data["failed"]) == (0, 7, 3)
    assert data["rows"] == finished.data["rows"]
    assert data["trends"] == finished.data["trends"]
    assert sum(data["verdicts"].values()) == 4


def test_a_stop_is_heard_while_a_session_is_in_work(tree: Path, tmp_path: Path) -> None:
    """With a stop to ask for, not even one session is diagnosed in this process; none goes on after it."""
    asked: list[int] = []

    def cancelled() -> bool:
        asked.append(len(multiprocessing.active_children()))
        return len(asked) > 2

    with pytest.raises(Cancelled):
        run_batch(tree, tmp_path / "T.parquet", Options(), locally(1, cancelled), cancelled=cancelled)
    assert max(asked) == 1
    assert not multiprocessing.active_children()
