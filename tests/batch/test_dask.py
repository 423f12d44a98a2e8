"""The same batch on a Dask cluster that is there already; here a local one."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from distributed import LocalCluster

from fingerlab.batch import run
from fingerlab.batch.table import Options, Task, diagnose_file
from fingerlab.cli.main import cli
from fingerlab.core.errors import UserError

from .conftest import aged


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0", protocol="tcp"
    ) as made:
        yield made


def call(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["batch", *map(str, arguments)])


def test_the_cluster_gives_what_this_machine_gives(
    cluster: LocalCluster, recorded: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "sessions"
    folder.mkdir()
    for month in (1, 2):
        aged(recorded, folder / f"{month}.h5", f"2026-0{month}-01T10:00:00+01:00", 1e-4 * month)
    (folder / "broken.h5").write_text("broken", encoding="utf-8")
    out = tmp_path / "T.parquet"
    told = call(folder, "--out", out, "--dask", cluster.scheduler_address, "--json", "-")
    assert told.exit_code == 0, told.output
    data = json.loads(told.stdout)
    assert (data["done"], data["failed"]) == (3, 1)
    for row in data["rows"]:
        here = diagnose_file(Task(str(folder / row["session"]), row["session"]), Options()).row
        assert {**here, "seconds": 0.0} == {
            **{name: value for name, value in row.items() if name in here}, "seconds": 0.0
        }  # fmt: skip
    again = json.loads(call(folder, "--out", out, "--dask", cluster.scheduler_address, "--json", "-").stdout)
    assert (again["done"], again["kept"]) == (0, 3)


def test_nobody_at_the_address_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "CONNECT_SECONDS", 0.5)
    with pytest.raises(UserError, match=r"No Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run.on_dask("tcp://127.0.0.1:9", tmp_path)
    with pytest.raises(UserError, match=r"No Dask scheduler answers at nonsense://x"):
        run.on_dask("nonsense://x", tmp_path)


def test_a_worker_that_does_not_see_the_sessions_is_named(cluster: LocalCluster, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"The worker tcp://.* does not see .*nowhere"):
        run.on_dask(cluster.scheduler_address, tmp_path / "nowhere")


def test_a_worker_of_another_version_is_named(
    cluster: LocalCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "worker_facts", _old_worker)
    with pytest.raises(UserError, match=r"has fingerlab 0\.0\.1; install"):
        run.on_dask(cluster.scheduler_address, tmp_path)


def _old_worker(folder: str) -> tuple[str, bool]:
    return "0.0.1", True


def test_a_cluster_without_workers_is_told(tmp_path: Path) -> None:
    with (
        LocalCluster(n_workers=0, processes=False, dashboard_address=":0", protocol="tcp") as empty,
        pytest.raises(UserError, match="has no worker"),
    ):
        run.on_dask(empty.scheduler_address, tmp_path)


def test_without_the_package_a_sentence_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UserError, match=r"'fingerlab\[cluster\]'"):
        run.on_dask("tcp://127.0.0.1:8786", tmp_path)
