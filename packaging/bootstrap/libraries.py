"""The system libraries that Qt loads on Linux, and the Debian and Ubuntu packages that hold them.

The list is what ``readelf -d`` names as needed by the Qt libraries and plugins that PySide6-Essentials
6.11 brings, less what it brings itself; it was checked by starting from a bare Debian 12.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterable

ALWAYS = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libdbus-1.so.3": "libdbus-1-3",
    "libfontconfig.so.1": "libfontconfig1",
    "libfreetype.so.6": "libfreetype6",
    "libbrotlidec.so.1": "libbrotli1",
    "libglib-2.0.so.0": "libglib2.0-0",
    "libgthread-2.0.so.0": "libglib2.0-0",
    "libzstd.so.1": "libzstd1",
    "libz.so.1": "zlib1g",
}
"""Needed to import Qt at all, off screen too."""

X11 = {
    "libX11-xcb.so.1": "libx11-xcb1",
    "libxcb.so.1": "libxcb1",
    "libxcb-cursor.so.0": "libxcb-cursor0",
    "libxcb-glx.so.0": "libxcb-glx0",
    "libxcb-icccm.so.4": "libxcb-icccm4",
    "libxcb-image.so.0": "libxcb-image0",
    "libxcb-keysyms.so.1": "libxcb-keysyms1",
    "libxcb-randr.so.0": "libxcb-randr0",
    "libxcb-render.so.0": "libxcb-render0",
    "libxcb-render-util.so.0": "libxcb-render-util0",
    "libxcb-shape.so.0": "libxcb-shape0",
    "libxcb-shm.so.0": "libxcb-shm0",
    "libxcb-sync.so.1": "libxcb-sync1",
    "libxcb-util.so.1": "libxcb-util1",
    "libxcb-xfixes.so.0": "libxcb-xfixes0",
    "libxcb-xkb.so.1": "libxcb-xkb1",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
}
"""Needed besides for a window on an X server (which most Wayland desktops serve as well)."""

WAYLAND = {
    "libwayland-client.so.0": "libwayland-client0",
    "libwayland-cursor.so.0": "libwayland-cursor0",
    "libwayland-egl.so.1": "libwayland-egl1",
}
"""Needed instead of the X list for a window on Wayland where no X server answers."""


def needed(platform: str) -> dict[str, str]:
    """The libraries that a Qt ``platform`` needs, with the Debian package of each; empty off Linux.

    Args:
        platform: ``offscreen``, ``xcb`` or ``wayland``; any other counts as ``offscreen``.
    """
    if not sys.platform.startswith("linux"):
        return {}
    return ALWAYS | {"xcb": X11, "wayland": WAYLAND}.get(platform, {})


def _load(name: str) -> None:
    # Lazy binding and no shared symbols: the question is only whether the loader finds the library.
    ctypes.CDLL(name, mode=os.RTLD_LAZY)


def missing(libraries: Iterable[str], load: Callable[[str], None] = _load) -> list[str]:
    """Those of ``libraries`` that the system's loader does not find."""
    absent = []
    for name in libraries:
        try:
            load(name)
        except OSError:
            absent.append(name)
    return absent
