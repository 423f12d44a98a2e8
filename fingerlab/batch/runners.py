"""Where the diagnoses run: in processes of this machine, or on a Dask cluster that is there already."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import fingerlab
from fingerlab.batch.rows import SOFTWARE, Options, Outcome, Task, diagnose_file
from fingerlab.core.errors import UserError

Runner = Callable[[Sequence[Task], Options], Iterator[Outcome]]
"""Gives the outcome of every task, each as soon as it is there, in any order."""

CONNECT_SECONDS = 10.0


def locally(processes: int | None = None) -> Runner:
    """A runner on this machine, one diagnosis a process; all processors for None."""
    wanted = processes or os.cpu_count() or 1

    def run(tasks: Sequence[Task], options: Options) -> Iterator[Outcome]:
        from joblib import Parallel, delayed
        from joblib.externals.loky import get_reusable_executor

        count = min(wanted, len(tasks))
        if count <= 1:
            yield from (diagnose_file(task, options) for task in tasks)
            return
        work = Parallel(n_jobs=count, backend="loky", return_as="generator_unordered", batch_size=1)
        try:
            yield from work(delayed(diagnose_file)(task, options) for task in tasks)
        except BrokenProcessPool:
            raise UserError(
                "A process that diagnosed was ended from outside, mostly for want of memory; what is done is "
                "kept, so start the same batch again with fewer at a time, such as --jobs 1."
            ) from None
        finally:
            get_reusable_executor().shutdown(wait=True, kill_workers=True)

    return run


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

    def run(tasks: Sequence[Task], options: Options) -> Iterator[Outcome]:
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
        answers: dict[str, tuple[str, bool]] = client.run(_worker_facts, str(folder))
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


def _worker_facts(folder: str) -> tuple[str, bool]:
    """What a worker says of itself: its version of the program, and whether it sees the folder."""
    return fingerlab.__version__, Path(folder).is_dir()


def _lost(task: Task, options: Options, why: str) -> Outcome:
    """A session whose worker went away; without a hash, so that it is tried anew next time."""
    words = " ".join(why.split())
    row = {
        "session": task.name,
        "software": SOFTWARE,
        "options": options.key,
        "error": f"{task.path} could not be diagnosed, because its worker failed ({words}); start again.",
        "seconds": 0.0,
    }
    return Outcome(row, {})
