"""Python's cyclic garbage is cleared away in the GUI thread alone.

A plot and its menu refer to one another, so that not their last name but the garbage collector ends them, and
Python runs that in whichever thread happens to ask for memory. A widget that a worker's thread destroys
leaves Qt with a pointer to nothing: the next change of style walks over it and the program is gone.
"""

from __future__ import annotations

import gc
import time

from PySide6.QtCore import QObject, QTimer

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
        self._timer = QTimer(self)
        self._timer.setInterval(TICK_MS)
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
