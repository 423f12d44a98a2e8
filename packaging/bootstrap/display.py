"""Is there a display that a window can be opened on?"""

from __future__ import annotations

import os
import re
import socket
import sys
from collections.abc import Mapping
from pathlib import Path


def qt_platform(environ: Mapping[str, str] = os.environ) -> str:
    """The Qt platform that a window would use: ``native``, ``xcb``, ``wayland``, ``offscreen`` or empty.

    Empty means that there is no display. Windows and macOS have their own (``native``). On Linux a display
    counts where something answers at it: a ``DISPLAY`` left over from a closed connection does not.
    A ``QT_QPA_PLATFORM`` set by the user is taken at its word.
    """
    chosen = environ.get("QT_QPA_PLATFORM", "").split(":")[0].split(";")[0]
    if not sys.platform.startswith("linux"):
        return "native"
    if chosen:
        return chosen
    if _x_server_answers(environ.get("DISPLAY", "")):
        return "xcb"
    if _wayland_answers(environ):
        return "wayland"
    return ""


def why_none(environ: Mapping[str, str] = os.environ) -> str:
    """What to tell the user where `qt_platform` found none."""
    named = environ.get("DISPLAY") or environ.get("WAYLAND_DISPLAY")
    return f"the display {named} does not answer" if named else "there is no display"


def _x_server_answers(display: str) -> bool:
    """Whether an X server listens at ``display`` (``host:number.screen``; X(7), "Display names")."""
    parts = re.fullmatch(r"(?:(?P<host>[^:]*):)(?P<number>\d+)(?:\.\d+)?", display)
    if parts is None:
        return False
    number = int(parts["number"])
    if parts["host"] in ("", "unix"):
        path = f"/tmp/.X11-unix/X{number}"
        return _connects(socket.AF_UNIX, path) or _connects(socket.AF_UNIX, "\0" + path)
    return _connects(socket.AF_INET, (parts["host"], 6000 + number))


def _wayland_answers(environ: Mapping[str, str]) -> bool:
    name = environ.get("WAYLAND_DISPLAY", "")
    if not name:
        return False
    return _connects(socket.AF_UNIX, str(Path(environ.get("XDG_RUNTIME_DIR", "/")) / name))


def _connects(family: int, address: str | tuple[str, int]) -> bool:
    try:
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.settimeout(2.0)
            probe.connect(address)
    except OSError:
        return False
    return True
