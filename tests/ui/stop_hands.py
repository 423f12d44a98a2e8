"""Hands that stop: by a press that is held, by Escape, by a foot switch's key; and what it took, in samples.

On the off-screen platform events enter Qt where those of the system do, at the window that lies under the
mouse. Under X they are the X server's own (XTEST), as from a mouse or a keyboard.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
from PySide6.QtCore import QEventLoop, QPoint, Qt, QTimer
from PySide6.QtGui import QGuiApplication, QWindow
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QWhatsThis, QWidget
from shiboken6 import isValid

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.control.machine import Enable, Initialise, Mode, Release, Reset, SetUp, Start
from fingerlab.acquisition.ring import COLUMN, RowFlag
from fingerlab.core.errors import UserError
from fingerlab.ui.acquire.acquire_tab import AcquireTab
from fingerlab.ui.acquire.bench_controller import has_virtual_clock
from fingerlab.ui.app.stop_key import STOP_KEYS

from .standing_open import WAYS, Stage, Surface, shut_all, standing

SINE = {"kind": "sine", "amplitude_deg": 10.0, "frequency_hz": 1.0, "offset_deg": 22.0, "ramp_s": 0.2}
LEFT, NONE = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
STEP_MS = 4
OPEN_S, REACTION_S = 0.08, 0.3
"""Until a hand is at STOP after something was opened, s: the guard looks every 50 ms; as fast as a person is
in real time, assumed."""
PATIENCE_S = 10.0
STOOD, TRIES = "stood already", 3
"""A window that takes more than 0.5 s to make a dialog has its motor stopped by the loop: tried again."""

Wait = float | Callable[[], bool]
"""A script waits for so many seconds of the bench, or until something holds."""


Seen = list[tuple[QWidget, str]]
"""What stands open, with its title: of two dialogs in turn, the second may have the first's memory."""


class Hand(Protocol):
    """A mouse and a keyboard."""

    def down(self, place: QPoint) -> None:
        """Press the left button at a place of the screen, and hold it."""

    def up(self, place: QPoint) -> None:
        """Let it go."""

    def key(self, name: str) -> None:
        """Press and release Escape or a key of ``STOP_KEYS``."""


class QtHand:
    """Events of the window system, made by Qt itself."""

    def down(self, place: QPoint) -> None:
        window = window_at(place)
        QTest.mousePress(window, LEFT, NONE, window.mapFromGlobal(place))

    def up(self, place: QPoint) -> None:
        window = window_at(place)
        QTest.mouseRelease(window, LEFT, NONE, window.mapFromGlobal(place))

    def key(self, name: str) -> None:
        code = Qt.Key.Key_Escape if name == "Escape" else STOP_KEYS[name].qt
        shown = [w for w in QGuiApplication.topLevelWindows() if w.isVisible()]
        QTest.keyClick(QGuiApplication.focusWindow() or QGuiApplication.modalWindow() or shown[0], code)


def window_at(place: QPoint) -> QWindow:
    """The window that was shown last among those at a place; this display is larger than its screen says."""
    return [w for w in QGuiApplication.topLevelWindows() if w.isVisible() and w.geometry().contains(place)][
        -1
    ]


class XHand:
    """Events of the X server, over a connection of its own. KEYSYMS: X11/keysymdef.h."""

    def __init__(self) -> None:
        self._x, self._test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._x.XKeysymToKeycode.argtypes = (ctypes.c_void_p, ctypes.c_ulong)
        self._display = ctypes.c_void_p(self._x.XOpenDisplay(None))

    def down(self, place: QPoint) -> None:
        self._test.XTestFakeMotionEvent(self._display, -1, place.x(), place.y(), ctypes.c_ulong(0))
        self._test.XTestFakeButtonEvent(self._display, 1, 1, ctypes.c_ulong(0))
        self._x.XFlush(self._display)

    def up(self, place: QPoint) -> None:
        self._test.XTestFakeButtonEvent(self._display, 1, 0, ctypes.c_ulong(0))
        self._x.XFlush(self._display)

    def key(self, name: str) -> None:
        keysym = 0xFF1B if name == "Escape" else STOP_KEYS[name].keysym
        code = self._x.XKeysymToKeycode(self._display, keysym)
        for down in (1, 0):
            self._test.XTestFakeKeyEvent(self._display, code, down, ctypes.c_ulong(0))
        self._x.XFlush(self._display)


def hand_here() -> Hand:
    """The hand for the platform on which the tests run."""
    return XHand() if QGuiApplication.platformName() == "xcb" else QtHand()


@dataclass
class Outcome:
    """What a stop took.

    Attributes:
        plant_ms: samples from before the event to the first with zero set value and enable low, in ms of the
            bench; None where it did not stop. wrong: what should not have happened, empty for nothing.
    """

    surface: str
    way: str
    plant_ms: float | None = None
    wrong: str = ""


class Driving:
    """Drives the rig of a window again and again, and stops it with something standing open."""

    def __init__(self, stage: Stage, hand: Hand) -> None:
        self.stage, self._hand = stage, hand
        tab = stage.window.tab("acquire")
        assert isinstance(tab, AcquireTab)
        self.controller = tab.controller
        assert self.controller.bench is not None
        self.bench: Bench = self.controller.bench
        self.outcomes: list[Outcome] = []

    def stop_each(self, surfaces: list[Surface], ways: tuple[str, ...] = WAYS) -> list[Outcome]:
        """Open each, stop, shut it again; in every way."""
        loop, failed = QEventLoop(), []
        script = self._all(surfaces, ways)
        waiting: list[Any] = [lambda: True, 0.0]
        timer = QTimer()
        timer.setInterval(STEP_MS)

        def step() -> None:
            try:
                waiting[1] += STEP_MS * 1e-3
                if waiting[0]() or waiting[1] > PATIENCE_S:
                    waiting[:] = [self._wait(next(script)), 0.0]
            except StopIteration:
                timer.stop()
                loop.quit()
            except Exception as error:
                failed.append(error)
                timer.stop()
                while standing(self.stage.window):  # or the loops of open dialogs would go on for ever
                    shut_all(self.stage.window)
                loop.quit()

        timer.timeout.connect(step)
        timer.start()
        loop.exec()
        if failed:
            raise failed[0]
        return self.outcomes

    def _wait(self, wait: Wait) -> Callable[[], bool]:
        if callable(wait):
            return wait
        if has_virtual_clock(self.bench):
            for _ in range(max(round(wait / 0.033), 1)):
                self.controller.tick()
            return lambda: True
        until = self.bench.status().index + wait * self.bench.rate_hz
        return lambda: self.bench.status().index >= until

    def _all(self, surfaces: list[Surface], ways: tuple[str, ...]) -> Iterator[Wait]:
        for surface in surfaces:
            for way in [way for way in ways if way in surface.ways]:
                self.stage.window.show_tab(surface.page)
                outcome = Outcome(surface.name, way)
                self.outcomes.append(outcome)
                for _ in range(TRIES):
                    yield from self._drive()
                    outcome.wrong = ""
                    yield from self._once(surface, outcome)
                    if outcome.wrong != STOOD:
                        break

    def _time(self, virtual: float, real: float) -> float:
        """Seconds of a script: as few as do on a virtual clock, which is slower than it says."""
        return virtual if has_virtual_clock(self.bench) else real

    def _drive(self) -> Iterator[Wait]:
        """The finger at rest, then a sine."""
        for _ in range(3):
            try:
                if self.bench.status().mode is Mode.FAULT:
                    self.bench.ask(Reset())
                if self.bench.status().latched:
                    self.bench.ask(Release())
                self.bench.ask(SetUp("on_air", "extension"))
                yield self._time(0.1, 0.3)
                for command in (Initialise(), Enable(), Start(SINE, True)):
                    self.bench.ask(command)
            except UserError:
                continue
            yield self._time(0.1, 0.4)
            if self.bench.status().mode is Mode.RUNNING:
                return
        raise AssertionError(f"the rig does not run: {self.bench.status().fault}")

    def _once(self, surface: Surface, outcome: Outcome) -> Iterator[Wait]:
        window = self.stage.window
        seen: Seen = []
        for open_it in surface.steps:
            QTimer.singleShot(0, lambda call=open_it: call(self.stage))
            ready = surface.ready or partial(self._opened, seen)
            yield ready
            if not ready():
                outcome.wrong = "did not open"
            seen += self._new(seen)
        yield from self._settle()
        yield from self._settle(self._time(0.0, REACTION_S))
        fields = {field: field.currentIndex() for field in window.findChildren(QComboBox)}
        modal = QApplication.activeModalWidget()
        place = window.header.stop.mapToGlobal(window.header.stop.rect().center())
        before = self.bench.status()
        if not before.enabled:
            outcome.wrong = STOOD
            yield from self._shut()
            return
        reader = self.bench.ring.reader()
        if outcome.way == "press":
            self._hand.down(place)
        else:
            self._hand.key(outcome.way if outcome.way == "Escape" else window.stop_guard.key)
        yield lambda: self.bench.status().latched
        yield self._time(0.03, 0.1)
        rows = reader.read().rows
        outcome.plant_ms = self._zero_after(rows, before.index)
        shut = modal is not None and not (isValid(modal) and modal.isVisible())
        if shut and outcome.way != "Escape":
            outcome.wrong = outcome.wrong or "shut the dialog"
        if outcome.way == "press":
            self._hand.up(place)
            yield from self._settle()
        if any(isValid(field) and field.currentIndex() != index for field, index in fields.items()):
            outcome.wrong = outcome.wrong or "picked an entry"
        yield from self._shut()

    def _shut(self) -> Iterator[Wait]:
        while standing(self.stage.window):
            shut_all(self.stage.window)
            yield from self._settle(0.01)
        QWhatsThis.leaveWhatsThisMode()
        self.stage.tab("calibrate").leave()
        while self.stage.others:
            other = self.stage.others.pop()
            other.terminate()
            other.wait()

    def _opened(self, seen: Seen) -> bool:
        return bool(self._new(seen))

    def _new(self, seen: Seen) -> Seen:
        """What stands open and was not seen yet."""
        here = [(widget, widget.windowTitle()) for widget in standing(self.stage.window)]
        return [one for one in here if one not in seen]

    def _settle(self, seconds: float = OPEN_S) -> Iterator[Wait]:
        """Let the window come to rest; no time passes on a virtual clock."""
        for _ in range(round(seconds * 1e3 / STEP_MS)):
            yield lambda: True

    def _zero_after(self, rows: np.ndarray[Any, Any], index: int) -> float | None:
        """ms of the bench from sample ``index`` to zero for good."""
        low = rows[:, COLUMN["flags"]].astype(int) & RowFlag.ENABLED == 0
        zero = low & (rows[:, COLUMN["current_command"]] == 0.0)
        if not len(zero) or not zero[-1]:
            return None
        driven = np.flatnonzero(~zero)
        first = int(driven[-1]) + 1 if len(driven) else 0
        return float((rows[first, COLUMN["index"]] - index) * 1e3 / self.bench.rate_hz)
