"""A batch: which sessions are still to do, their diagnoses as they come, and the table at the end.

The diagnoses run in processes of this machine, or on a Dask cluster that is there already.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import count
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import fingerlab
from fingerlab.batch.table import (
    SOFTWARE,
    Contents,
    Options,
    Parts,
    Row,
    SessionRow,
    Task,
    complete,
    diagnose_file,
    in_order_of_time,
    read_table,
    units_of,
    write_table,
)
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.progress import Progress, own_code_only
from fingerlab.sessions import file_hash
from fingerlab.sessions.recording_files import ENDINGS, session_files

Runner = Callable[[Sequence[Task], Options], Iterator[SessionRow]]
"""Gives the outcome of every task, each as soon as it is there, in any order."""

CONNECT_SECONDS = 10.0


def locally(processes: int | None = None, cancelled: Callable[[], bool] | None = None) -> Runner:
    """A runner on this machine, one diagnosis a process; all processors for None.

    A session whose process is ended from outside, for want of memory or by itself, is tried once more when
    all others are done, alone; if that ends its process, too, it gets a row that says so.

    Args:
        cancelled: asked several times a second; True ends the processes at once. With it, not even a single
            diagnosis is made in this process, and all give way to whatever else runs.
    """
    wanted = processes or os.cpu_count() or 1

    def run(tasks: Sequence[Task], options: Options) -> Iterator[SessionRow]:
        if min(wanted, len(tasks)) <= 1 and cancelled is None:
            yield from (diagnose_file(task, options) for task in tasks)
            return
        lost: list[Task] = []
        for outcome in _apart(tasks, options, min(wanted, len(tasks)), cancelled):
            if isinstance(outcome, Task):
                lost.append(outcome)
            else:
                yield outcome
        for outcome in _apart(lost, options, 1, cancelled):
            if isinstance(outcome, Task):
                why = "it was ended from outside, for want of memory or by this file"
                outcome = _lost(outcome, options, why)
            yield outcome

    return run


LISTENING_S = 0.2
"""How long one waits for a diagnosis before it is asked whether to stop."""
NICENESS = 10
"""Of a process that gives way to others, as ``nice`` counts."""


@dataclass
class _Process:
    """A process that diagnoses one session after the other, and the one that it has in work."""

    process: BaseProcess
    pipe: Connection
    task: Task | None = None


def _serve(pipe: Connection, options: Options, gives_way: bool) -> None:
    """What such a process does, until its pipe is shut."""
    if gives_way and hasattr(os, "nice"):
        os.nice(NICENESS)
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        pipe.send(diagnose_file(task, options))


def _started(options: Options, gives_way: bool) -> _Process:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, options, gives_way), daemon=True)
    with own_code_only():
        process.start()
    there.close()  # its end alone, so that it is heard when it goes
    return _Process(process, here)


def _apart(
    tasks: Sequence[Task], options: Options, most: int, cancelled: Callable[[], bool] | None
) -> Iterator[SessionRow | Task]:
    """The outcome of every task as it comes; the task itself where its process was lost.

    Raises:
        Cancelled: so it was asked.
    """
    waiting, processes = deque(tasks), list[_Process]()
    try:
        while waiting or any(one.task for one in processes):
            while waiting and len(processes) < most:
                processes.append(_started(options, cancelled is not None))
            for one in processes:
                if one.task is None and waiting:
                    one.task = waiting.popleft()
                    with contextlib.suppress(OSError):  # it is gone, which is heard below
                        one.pipe.send(one.task)
            ready = wait([one.pipe for one in processes if one.task is not None], LISTENING_S)
            if cancelled is not None and cancelled():
                raise Cancelled
            for one in [one for one in processes if one.pipe in ready]:
                assert one.task is not None
                try:
                    outcome: SessionRow | Task = one.pipe.recv()
                except (EOFError, OSError):
                    outcome = one.task
                    processes.remove(one)
                    _end(one)
                one.task = None
                yield outcome
    finally:
        for one in processes:
            _end(one)


def _end(one: _Process) -> None:
    one.pipe.close()
    one.process.kill()
    one.process.join()
    one.process.close()


def on_dask(address: str, folder: Path) -> Runner:
    """A runner on the cluster at ``address``, whose workers see ``folder`` under the same path.

    Raises:
        UserError: ``distributed`` is not installed, nobody answers there, or a worker lacks
            program or folder.
    """
    client = _connected(address)
    try:
        _check_workers(client, address, folder)
    except BaseException:
        client.close()
        raise

    def run(tasks: Sequence[Task], options: Options) -> Iterator[SessionRow]:
        from distributed import as_completed

        waiting = {client.submit(diagnose_file, task, options, pure=False): task for task in tasks}
        try:
            for future in as_completed(list(waiting), loop=client.loop):
                task = waiting.pop(future)
                if future.status == "finished":
                    yield future.result()
                else:
                    yield _lost(task, options, str(future.exception() or future.status))
        finally:
            client.cancel(list(waiting))
            client.close()

    return run


def _connected(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise UserError(
            "--dask needs the package 'distributed', which is not installed; install 'fingerlab[cluster]', "
            "or leave out --dask to use this machine alone."
        ) from None
    try:
        return Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise UserError(
            f"No Dask scheduler answers at {address} ({why}); give an address such as tcp://HOST:8786."
        ) from None


def _check_workers(client: Any, address: str, folder: Path) -> None:
    try:
        answers: dict[str, tuple[str, bool]] = client.run(worker_facts, str(folder))
    except Exception as error:
        why = " ".join(f"{type(error).__name__}: {error}".split())
        raise UserError(
            f"The workers at {address} cannot run FingerLab ({why}); install fingerlab "
            f"{fingerlab.__version__} where they run."
        ) from None
    if not answers:
        raise UserError(f"The Dask scheduler at {address} has no worker; start one, or leave out --dask.")
    for worker, (version, sees) in answers.items():
        if version != fingerlab.__version__:
            raise UserError(
                f"The worker {worker} has fingerlab {version}; install {fingerlab.__version__} there, too."
            )
        if not sees:
            raise UserError(
                f"The worker {worker} does not see {folder}; put the sessions on a disk that all of them "
                "share under the same path."
            )


def worker_facts(folder: str) -> tuple[str, bool]:
    """What a worker says of itself: its version of the program, and whether it sees the folder."""
    return fingerlab.__version__, Path(folder).is_dir()


def _lost(task: Task, options: Options, why: str) -> SessionRow:
    """A session whose worker went away; without a hash, so that it is tried anew next time."""
    words = " ".join(why.split())
    row = {
        "session": task.name,
        "software": SOFTWARE,
        "options": options.key,
        "error": f"{task.path} could not be diagnosed, because its worker failed ({words}); start again.",
        "seconds": 0.0,
    }
    return SessionRow(row, {})


HASHING_THREADS = 4
TABLE_NAME = "verdicts"
"""Of the table that is made beside the sessions where nobody gives a name."""


def table_beside(folder: Path) -> Path:
    """The table that a batch of this folder goes on with: the newest one of it there, or a new name."""
    for path in sorted(folder.glob("*.parquet"), key=lambda one: one.stat().st_mtime, reverse=True):
        try:
            table = read_table(path)
        except UserError:
            continue
        if table is not None and not table.added and Path(table.folder) == folder.resolve():
            return path
    names = (f"{TABLE_NAME}{'' if number == 1 else f'-{number}'}.parquet" for number in count(1))
    return next(folder / name for name in names if not (folder / name).exists())


def contents_beside(folder: Path) -> Contents:
    """What the batches of this folder found so far, those that were stopped included.

    Raises:
        UserError: the table cannot be read.
    """
    path = table_beside(folder)
    table = read_table(path) or Contents(str(folder.resolve()), ())
    parts = Parts.of(path).read()
    fresh = {part.row["session"] for part in parts}
    rows = [row for row in table.rows if row["session"] not in fresh] + [complete(p.row) for p in parts]
    return replace(table, rows=tuple(in_order_of_time(rows)), units=units_of(parts, table.units))


@dataclass(frozen=True)
class BatchResult:
    """The table as it is now.

    Attributes:
        contents: all rows, in order of time.
        done: sessions diagnosed by this call. kept: those that were in the table already.
        outdated: of the sessions done, those that an older version or other own effects had done before.
        gone: rows of sessions that are no longer below the folder.
    """

    contents: Contents
    done: int
    kept: int
    outdated: int
    gone: int

    @property
    def failed(self) -> tuple[Row, ...]:
        """Rows of sessions that could not be diagnosed."""
        return tuple(row for row in self.contents.rows if row.get("error"))


def find_sessions(folder: Path) -> list[Task]:
    """Every session file below the folder, by name, as the browser finds them.

    Raises:
        UserError: there is no such folder, or no session in it.
    """
    found = session_files(folder)
    if not found:
        raise UserError(f"There is no session below {folder}; session files end in {' or '.join(ENDINGS)}.")
    return [Task(str(path.resolve()), name) for path, name in found]


def run_batch(
    folder: Path,
    out: Path,
    options: Options,
    runner: Runner,
    retry: bool = False,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
    found: Callable[[Row], None] | None = None,
) -> BatchResult:
    """Diagnose every session below ``folder`` that the table ``out`` does not hold yet, and write the table.

    Args:
        retry: whether sessions that could not be diagnosed are tried again.
        progress: called with the share done (0 to 1) and what was done last.
        cancelled: asked after every session; True stops, and what is done stays kept.
        found: called with every row as it comes.

    Raises:
        UserError: nothing to do, the table is not ours or of another batch, a place cannot be written to.
        Cancelled: ``cancelled`` answered True.
    """
    tasks = find_sessions(folder)
    if not out.parent.is_dir():
        raise UserError(f"The folder {out.parent} does not exist; make it first or choose another place.")
    report: Progress = progress or (lambda share, what: None)
    table = read_table(out)
    report(0.0, f"reading {len(tasks)} sessions")
    hashes = _hashes(tasks)
    if table is not None:
        _refuse_other(out, table, folder, options, hashes)
    before = table or Contents(str(folder.resolve()), options.added)
    parts = Parts.of(out)
    plan = _plan(tasks, hashes, [*before.rows, *(p.row for p in parts.read())], options, retry)
    report(0.0, f"{len(plan.todo)} of {len(tasks)} sessions to do")
    outcomes: list[SessionRow] = []
    for outcome in runner(plan.todo, options) if plan.todo else ():
        parts.keep(outcome)
        outcomes.append(outcome)
        if found is not None:
            found(outcome.row)
        report(
            len(outcomes) / len(plan.todo), f"{len(outcomes)} of {len(plan.todo)}, {outcome.row['session']}"
        )
        if cancelled is not None and cancelled():
            raise Cancelled
    gone = _gone(before.rows, tasks, hashes)
    rows = in_order_of_time([*plan.kept, *(o.row for o in outcomes), *gone])
    units = units_of(parts.read(), before.units)
    after = Contents(str(folder.resolve()), options.added, tuple(complete(row) for row in rows), units)
    if table is None or after != before:
        write_table(out, after)
    parts.clear()
    return BatchResult(after, len(outcomes), len(plan.kept), plan.outdated, len(gone))


@dataclass(frozen=True)
class _Plan:
    todo: tuple[Task, ...]
    kept: tuple[Row, ...]
    outdated: int


def _plan(
    tasks: Sequence[Task], hashes: dict[str, str], known: Sequence[Row], options: Options, retry: bool
) -> _Plan:
    """What is left to do. A session is known by its content: a moved or renamed one is not done again."""
    answers = {
        (row["sha256"], row["software"], row["options"]): row
        for row in known
        if row.get("sha256") and not (retry and row.get("error"))
    }
    seen = {row["sha256"] for row in known if row.get("sha256") and not row.get("error")}
    todo, kept = [], []
    for task in tasks:
        content = hashes.get(task.name, "")
        answer = answers.get((content, SOFTWARE, options.key))
        if answer is None:
            todo.append(task)
        else:
            kept.append({**answer, "session": task.name})
    return _Plan(tuple(todo), tuple(kept), sum(hashes.get(task.name) in seen for task in todo))


def _gone(rows: Iterable[Row], tasks: Sequence[Task], hashes: dict[str, str]) -> list[Row]:
    """Rows of the table whose session is no longer below the folder, under no name at all."""
    names, contents = {task.name for task in tasks}, set(hashes.values())
    return [row for row in rows if row["session"] not in names and row.get("sha256") not in contents]


def _refuse_other(out: Path, table: Contents, folder: Path, options: Options, hashes: dict[str, str]) -> None:
    """A table goes on only with the same question, about the same sessions."""
    if set(table.added) != set(options.added):
        flags = " ".join(f"--add {name}" for name in table.added) or "no --add"
        raise UserError(
            f"{out} was made with {flags}, and its answers are to another question; choose another name for "
            "--out, or ask the same."
        )
    common = {row.get("sha256") for row in table.rows} & set(hashes.values())
    if table.rows and not common and Path(table.folder) != folder.resolve():
        raise UserError(
            f"{out} is the table of {table.folder}, and none of its sessions is below {folder}; choose "
            "another name for --out."
        )


def _hashes(tasks: Sequence[Task]) -> dict[str, str]:
    """Content hash of each session by its name; without those that cannot be read."""

    def one(task: Task) -> str:
        try:
            return file_hash(Path(task.path))
        except UserError:
            return ""

    with ThreadPoolExecutor(HASHING_THREADS) as pool:
        found = pool.map(one, tasks)
        return {task.name: content for task, content in zip(tasks, found, strict=True) if content}
