"""Two starts at once must not both install: the second waits for the first.

The operating system drops the lock with the last process that holds it, so a killed start leaves nothing
to clear away. On Linux and macOS its installers inherit the lock: pip that outlives a killed start is waited
for as well.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from .messages import SetupError, say

if sys.platform == "win32":
    import msvcrt

    def _try_lock(stream: IO[bytes]) -> bool:
        try:
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
else:
    import fcntl

    def _try_lock(stream: IO[bytes]) -> bool:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


@contextlib.contextmanager
def only_one(path: Path) -> Iterator[None]:
    """Hold the lock file ``path`` for the length of a ``with`` block.

    Raises:
        SetupError: the folder cannot be written to.
    """
    try:
        stream = path.open("ab")
    except OSError as error:
        raise SetupError(
            f"{path.parent} cannot be written to ({error.strerror}); "
            "copy FingerLab to a folder that you may write to and start it there."
        ) from None
    with stream:
        os.set_inheritable(stream.fileno(), True)
        waiting = False
        while not _try_lock(stream):
            if not waiting:
                say("another start is installing here; waiting for it to finish.")
                waiting = True
            time.sleep(0.2)
        yield
