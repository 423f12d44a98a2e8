"""A second process that takes a share of the reading, ready by the time the first has imported its libraries.

Threads do not help there: thousands of short array operations wait for one interpreter lock. Nothing heavy is
imported here, so that the second process can start first of all. Processes are spawned, as Windows does.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

WORTH_BYTES = 3_000_000
"""Below this size of all files one process is done before a second has started."""


@contextmanager
def own_code_only() -> Iterator[None]:
    """Processes that are started meanwhile import nothing from the current folder.

    Sessions come from strangers, and Python would run a ``signal.py`` that lies beside them.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


SAFE_PATH = "PYTHONSAFEPATH"


def _prepare(module: str) -> None:
    limits = importlib.import_module("threadpoolctl")
    importlib.import_module(module)
    # Kept for the life of the process: small matrices, and the other core is busy already.
    limits.threadpool_limits(limits=1, user_api="blas")


@contextmanager
def second_process(paths: Sequence[Path], module: str) -> Iterator[Executor | None]:
    """An executor with one process that imports ``module`` at once; None where it would not pay.

    Args:
        paths: files to be read. module: what the tasks will need.
    """
    size = sum(path.stat().st_size for path in paths if path.is_file())
    if size < WORTH_BYTES or (os.cpu_count() or 1) < 2:
        yield None
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(1, mp_context=context, initializer=_prepare, initargs=(module,))
    with own_code_only():
        number = pool.submit(os.getpid)  # a task, so that the process starts now
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        _end(number)


def _end(number: Future[int]) -> None:
    """End the process of that number at once: giving back what it holds takes a while, for nothing."""
    if not number.done() or number.cancelled() or number.exception() is not None:
        return  # it has hardly begun, or is gone already
    for child in multiprocessing.active_children():
        if child.pid == number.result():
            child.terminate()
