"""Starts the application, and clears Python's cyclic garbage away in the GUI thread alone.

A plot and its menu refer to one another, so that not their last name but the garbage collector ends them, and
Python runs that in whichever thread happens to ask for memory. A widget that a worker's thread destroys
leaves Qt with a pointer to nothing: the next change of style walks over it and the program is gone.
"""

from __future__ import annotations

import gc
import sys
import time
import traceback
from importlib.resources import files
from pathlib import Path
from types import TracebackType

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, QTimer
from PySide6.QtGui import QGuiApplication, QIcon
from PySide6.QtWidgets import QApplication, QWidget

import fingerlab

from ..widgets.theme import apply_appearance
from .context import Settings
from .window import MainWindow

TICK_MS = 500
WHOLE_S = 30.0
"""Everything is looked through so often at the most: it takes a tenth of a second."""


class Tidier(QObject):
    """Takes the collector's place until :meth:`end`; made in the GUI thread."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._before = gc.isenabled()
        gc.disable()
        self._whole = time.monotonic()
        self._timer = QTimer(self, interval=TICK_MS)
        self._timer.timeout.connect(self.tidy)
        self._timer.start()

    def tidy(self) -> None:
        """Collect what Python would have collected by now."""
        counts, limits = gc.get_count(), gc.get_threshold()
        now = time.monotonic()
        if counts[2] > limits[2] and now - self._whole > WHOLE_S:
            self._whole = now
            gc.collect()
        elif counts[1] > limits[1]:
            gc.collect(1)
        elif counts[0] > limits[0]:
            gc.collect(0)

    def end(self) -> None:
        """The window is gone: collect once more, and let Python collect by itself again."""
        self._timer.stop()
        gc.collect()
        if self._before:
            gc.enable()


def run(arguments: list[str], settings: Settings | None = None) -> int:
    """Open the window, and the session files that ``arguments`` name; returns the exit code."""
    app = QApplication.instance() or QApplication([sys.argv[0]])
    assert isinstance(app, QApplication)
    settings = settings if settings is not None else Settings()
    prepare(app, settings)
    tidier = Tidier(app)
    window = MainWindow(settings)

    QGuiApplication.styleHints().colorSchemeChanged.connect(window.follow_desktop)
    previous = sys.excepthook
    sys.excepthook = _show_in(window)
    window.show()
    paths = [Path(argument) for argument in arguments]
    if paths:
        QTimer.singleShot(0, lambda: window.open_paths(paths))
    try:
        return app.exec()
    finally:
        sys.excepthook = previous
        let_go(window)
        tidier.end()


def let_go(window: QWidget) -> None:
    """Delete a closed window with all that it owns, now.

    References in a circle, such as a plot and what it calls when it changes, keep its parts alive after its
    last name is gone. When Python ends, the application takes its style back from every plot that is still
    there, and a plot that has a method of its own for that calls into an interpreter that is half gone.
    """
    window.close()
    window.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    gc.collect()  # what Qt does not own, such as the menus of plots, here and not in some worker's thread


def prepare(app: QApplication, settings: Settings) -> None:
    """Name, style and colours of the application."""
    app.setApplicationName("FingerLab")
    app.setOrganizationName("FingerLab")
    app.setApplicationVersion(fingerlab.__version__)
    app.setDesktopFileName("fingerlab")  # so that a Linux desktop finds the menu entry's icon
    app.setWindowIcon(QIcon(str(files("fingerlab.resources").joinpath("icon", "fingerlab.svg"))))
    app.setStyle("Fusion")
    # A menu bar of the desktop's own keeps presses and keys from the program while a menu of it is open.
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeMenuBar)
    apply_appearance(app, settings.appearance())


def _show_in(window: MainWindow):  # type: ignore[no-untyped-def]
    """An exception hook that shows the mistake in the window instead of losing it."""

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        details = "".join(traceback.format_exception(kind, error, trace))
        sys.stderr.write(details)
        window.show_mistake(
            f"FingerLab made a mistake ({kind.__name__}: {error}); your session file is unchanged.", details
        )

    return hook
