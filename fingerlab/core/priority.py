"""How soon the system gives a thread a core, against other programs: asked for, and not always granted."""

from __future__ import annotations

import ctypes
import os
import sys

NORMAL_CLASS, ABOVE_NORMAL_CLASS, HIGH_CLASS = 0x20, 0x8000, 0x80
"""Of a process, as the Windows API's SetPriorityClass counts them."""


def own_niceness() -> int:
    """Of this thread (Linux) or process; 0 where the system has none."""
    return 0 if sys.platform == "win32" else os.getpriority(os.PRIO_PROCESS, 0)


def ask_for(niceness: int, windows_class: int) -> bool:
    """Ask for a priority; whether it was granted.

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
