"""The key that a foot switch sends: which it may be, and how it is heard while another program is in front.

A foot switch is a keyboard of one key. The system is asked for that key while a rig is connected: on X11 by a
grab, on Windows by a hot key. Wayland and macOS offer no such thing to a program of this kind; there the key
is heard while FingerLab is in front, as any other is.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QAbstractNativeEventFilter, QByteArray, QCoreApplication, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QWidget


@dataclass(frozen=True)
class KeyCodes:
    """One key as each system names it.

    Attributes:
        qt: Qt's. keysym: X11's (X11/keysymdef.h). evdev: X11's key code for a keyboard whose layout has no
            such name, 0 for none: the kernel's code (linux/input-event-codes.h) and 8.
        virtual: Windows' (winuser.h).
    """

    qt: Qt.Key
    keysym: int
    evdev: int
    virtual: int


STOP_KEYS = {
    "Pause": KeyCodes(Qt.Key.Key_Pause, 0xFF13, 0, 0x13),
    "Scroll Lock": KeyCodes(Qt.Key.Key_ScrollLock, 0xFF14, 0, 0x91),
    **{
        f"F{n}": KeyCodes(Qt.Key(Qt.Key.Key_F13.value + n - 13), 0xFFCA + n - 13, 191 + n - 13, 0x7C + n - 13)
        for n in range(13, 25)
    },
}
"""Keys that no program needs for anything else; every foot switch that can be set at all can send one."""

DEFAULT_STOP_KEY = "Pause"
"""On every full keyboard, so that it can be tried without a foot switch, too."""

GENERIC_EVENT, KEY_PRESS, ANY_MODIFIER, ASYNCHRONOUS = 0x7F, 2, 0x8000, 1  # xproto.h
HOT_KEY_MESSAGE, NO_REPEAT, HOT_KEY_NUMBER = 0x0312, 0x4000, 1  # winuser.h; the number is this program's own


class SystemKey(QAbstractNativeEventFilter):
    """A key that reaches this program wherever the keyboard is.

    Attributes:
        scan_code: the key's code on this keyboard, 0 where it is not known. Under it Qt reports the key where
            the layout gives it no name.
    """

    def __init__(self, pressed: Callable[[], None]) -> None:
        super().__init__()
        self._pressed = pressed
        self._give_back: Callable[[], None] | None = None
        self._is_mine: Callable[[int], bool] = lambda _: False
        self.scan_code = 0

    def take(self, name: str, window: QWidget) -> str:
        """Ask the system for a key of :data:`STOP_KEYS`; why it cannot be had, empty where it is."""
        self.release()
        platform = QGuiApplication.platformName()
        if platform == "windows":
            reason = self._take_on_windows(STOP_KEYS[name], window)
        elif platform == "xcb":
            reason = self._take_on_x11(STOP_KEYS[name])
        else:
            reason = f"{PLATFORMS.get(platform, platform)} offers no key for the whole system"
        if not reason:
            app = QCoreApplication.instance()
            assert app is not None
            app.installNativeEventFilter(self)
        return reason

    def release(self) -> None:
        """Let the key go."""
        give_back, self._give_back = self._give_back, None
        self.scan_code = 0
        app = QCoreApplication.instance()
        if give_back is not None and app is not None:
            app.removeNativeEventFilter(self)
            give_back()

    def nativeEventFilter(
        self, kind: QByteArray | bytes | bytearray | memoryview, message: int
    ) -> tuple[bool, int]:
        if self._give_back is not None and self._is_mine(int(message)):
            self._pressed()
            return True, 0
        return False, 0

    def _take_on_x11(self, codes: KeyCodes) -> str:
        # Through Qt's own connection: another would need a thread, and Xlib ends a program whose grab fails.
        native = QGuiApplication.instance().nativeInterface()  # type: ignore[union-attr]
        xcb, xlib = _library("libxcb.so.1"), _library("libX11.so.6")
        if native is None or xcb is None or xlib is None:
            return "libxcb and libX11 are needed for a key of the whole system"
        connection = ctypes.c_void_p(native.connection())
        xlib.XKeysymToKeycode.argtypes = (ctypes.c_void_p, ctypes.c_ulong)
        xlib.XKeysymToKeycode.restype = ctypes.c_ubyte
        code = int(xlib.XKeysymToKeycode(native.display(), codes.keysym)) or codes.evdev
        if not code:
            return "this keyboard's layout does not have it"
        xlib.XDefaultRootWindow.argtypes = (ctypes.c_void_p,)
        xlib.XDefaultRootWindow.restype = ctypes.c_ulong
        root = int(xlib.XDefaultRootWindow(native.display()))
        xcb.xcb_grab_key_checked.restype = xcb.xcb_ungrab_key_checked.restype = _Cookie
        xcb.xcb_request_check.argtypes = (ctypes.c_void_p, _Cookie)
        xcb.xcb_request_check.restype = ctypes.c_void_p
        grabbed = xcb.xcb_grab_key_checked(
            connection, 0, ctypes.c_uint32(root), ctypes.c_uint16(ANY_MODIFIER), ctypes.c_uint8(code),
            ctypes.c_uint8(ASYNCHRONOUS), ctypes.c_uint8(ASYNCHRONOUS),
        )  # fmt: skip
        if xcb.xcb_request_check(connection, grabbed):  # an error of a few bytes, not worth freeing by hand
            return "another program has taken it"

        def is_mine(address: int) -> bool:
            event = _XKeyEvent.from_address(address)
            return event.kind & GENERIC_EVENT == KEY_PRESS and event.code == code and event.window == root

        def give_back() -> None:
            arguments = connection, ctypes.c_uint8(code), ctypes.c_uint32(root), ctypes.c_uint16(ANY_MODIFIER)
            xcb.xcb_request_check(connection, xcb.xcb_ungrab_key_checked(*arguments))

        self.scan_code, self._is_mine, self._give_back = code, is_mine, give_back
        return ""

    def _take_on_windows(self, codes: KeyCodes, window: QWidget) -> str:
        user: Any = getattr(ctypes, "windll").user32  # noqa: B009 -- there on Windows only
        handle = ctypes.c_void_p(int(window.winId()))  # of a window: then it comes while one is dragged, too
        if not user.RegisterHotKey(handle, HOT_KEY_NUMBER, NO_REPEAT, codes.virtual):
            return "another program has taken it"

        def is_mine(address: int) -> bool:
            message = _Message.from_address(address)
            return message.message == HOT_KEY_MESSAGE and message.first == HOT_KEY_NUMBER

        self._is_mine = is_mine
        self._give_back = lambda: user.UnregisterHotKey(handle, HOT_KEY_NUMBER)
        return ""


PLATFORMS = {"wayland": "Wayland", "cocoa": "macOS", "offscreen": "This display"}


class _Cookie(ctypes.Structure):
    """xcb_void_cookie_t."""

    _fields_ = (("sequence", ctypes.c_uint),)


class _XKeyEvent(ctypes.Structure):
    """Head of xcb_key_press_event_t: type, key code, sequence, time, root window, window of the event."""

    _fields_ = (
        ("kind", ctypes.c_uint8),
        ("code", ctypes.c_uint8),
        ("sequence", ctypes.c_uint16),
        ("time", ctypes.c_uint32),
        ("root", ctypes.c_uint32),
        ("window", ctypes.c_uint32),
    )


class _Message(ctypes.Structure):
    """Head of Windows' MSG: window, message, wParam."""

    _fields_ = (("window", ctypes.c_void_p), ("message", ctypes.c_uint), ("first", ctypes.c_size_t))


def _library(name: str) -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(name)
    except OSError:
        return None
