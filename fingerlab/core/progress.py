"""Long calculations: where they report, how they are stopped, a second process, and how soon they get a core.

Threads would not help: thousands of short array operations wait for one interpreter lock. Nothing heavy is
imported here, so that the second process can start first of all. Processes are spawned, as Windows does.
"""

from __future__ import annotations

import ctypes
import importlib
import multiprocessing
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fingerlab.core.errors import Cancelled

Progress = Callable[[float, str], None]
"""Is told the share done (0 to 1) and what is being done."""


@dataclass(frozen=True)
class Watch:
    """Where a long calculation reports, and where it hears that it should stop."""

    progress: Progress | None = None
    cancelled: Callable[[], bool] | None = None

    def tell(self, share: float, what: str) -> None:
        """Report, and stop where asked to.

        Raises:
            Cancelled: the user asked for it.
        """
        if self.cancelled is not None and self.cancelled():
            raise Cancelled
        if self.progress is not None:
            self.progress(share, what)


SILENT = Watch()
"""Nobody looks."""


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
    others, threads = set(multiprocessing.active_children()), set(threading.enumerate())
    with own_code_only():
        pool.submit(os.getpid)  # a task, so that the process starts now
    own, watching = set(multiprocessing.active_children()) - others, set(threading.enumerate()) - threads
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in own:  # at once, begun or not: giving back what it holds takes a while, for nothing
            process.terminate()
        for thread in watching:  # one that is still closing its pipe when Python ends says so on the terminal
            if thread.ident is not None:  # an error came before it began
                thread.join(ENDING_S)


ENDING_S = 2.0
"""In which the thread that watches a process has seen that it is gone; assumed."""


NORMAL_CLASS, ABOVE_NORMAL_CLASS, HIGH_CLASS = 0x20, 0x8000, 0x80
"""Of a process, as the Windows API's SetPriorityClass counts them."""


def own_niceness() -> int:
    """Of this thread (Linux) or process; 0 where the system has none."""
    return 0 if sys.platform == "win32" else os.getpriority(os.PRIO_PROCESS, 0)


def ask_for(niceness: int, windows_class: int) -> bool:
    """Ask for a priority against other programs; whether it was granted.

    Args:
        niceness: of this thread and those that it starts from now on (Linux), or of the process.
        windows_class: of the whole process, on Windows.
    """
    if sys.platform == "win32":
        kernel = ctypes.WinDLL("kernel32")
        kernel.GetCurrentProcess.restype = ctypes.c_void_p
        return bool(kernel.SetPriorityClass(ctypes.c_void_p(kernel.GetCurrentProcess()), windows_class))
    try:
        os.setpriority(os.PRIO_PROCESS, 0, niceness)
    except OSError:
        return False
    return True
