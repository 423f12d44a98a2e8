"""The line at the bottom: device, samples, cycles, disk; what is running, how far it is, a way to stop it."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QPushButton, QWidget

from ..widgets.fields import PROGRESS_STEPS
from ..widgets.labels import ElidedLabel, FittingLabel
from .context import RigLine
from .worker import Worker

TELLS_FROM_S = 2.0
TELLS_FROM_SHARE = 0.05
"""Time left is told after so long and so much: before, it would be a guess."""


class TaskBar(QWidget):
    """Follows a task runner. Ctrl+. cancels."""

    def __init__(
        self, tasks: Worker, parent: QWidget | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(parent)
        self._clock, self._began = clock, 0.0
        self.text = ElidedLabel()
        self.text.setObjectName("status")
        self.text.setAccessibleName("Status")
        self.progress = QProgressBar()
        self.progress.setObjectName("progress")
        self.progress.setAccessibleName("Progress")
        self.progress.setRange(0, PROGRESS_STEPS)
        self.progress.setFixedWidth(200)
        self.cancel = QPushButton("Cancel")
        self.cancel.setObjectName("cancel")
        self.cancel.setShortcut("Ctrl+.")
        self.cancel.setToolTip("Stop what is running (Ctrl+.).")
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 4, 8, 4)
        layout.setSpacing(8)
        layout.addWidget(self.text, 1)
        layout.addWidget(self.progress)
        layout.addWidget(self.cancel)
        self.cancel.clicked.connect(self._on_cancel)
        tasks.started.connect(self._on_started)
        tasks.progressed.connect(self._on_progress)
        tasks.ended.connect(self._on_ended)
        self._tasks = tasks
        self._title = ""
        self._show_work(False)

    def say(self, text: str) -> None:
        """The last thing that happened."""
        self.text.setText(text)

    def _show_work(self, running: bool) -> None:
        if not running:
            self.cancel.clearFocus()  # Qt would hand it to the next widget, whatever that is
        # Space is kept, so that nothing jumps when work starts or ends.
        for widget in (self.progress, self.cancel):
            policy = widget.sizePolicy()
            policy.setRetainSizeWhenHidden(True)
            widget.setSizePolicy(policy)
            widget.setVisible(running)

    def _on_started(self, title: str) -> None:
        self._title, self._began = title, self._clock()
        self.say(title)
        self.progress.setValue(0)
        self.cancel.setEnabled(True)
        self._show_work(True)

    def _on_progress(self, share: float, what: str) -> None:
        self.progress.setValue(round(share * PROGRESS_STEPS))
        words = f"{self._title}: {what}" if what else self._title
        left = time_left(share, self._clock() - self._began)
        self.say(f"{words}, {left}" if left else words)

    def _on_cancel(self) -> None:
        self.cancel.clearFocus()
        self.cancel.setEnabled(False)
        self.say(f"{self._title}: stopping")
        self._tasks.cancel()

    def _on_ended(self, how: str) -> None:
        self._show_work(False)
        words = {"done": "done", "stopped": "stopped", "failed": "failed"}
        self.say(f"{self._title}: {words.get(how, how)}")


def time_left(share: float, seconds: float) -> str:
    """How long it will still take, in words; empty as long as that is a guess.

    Args:
        share: done, 0 to 1. seconds: since the start.
    """
    if not TELLS_FROM_SHARE <= share < 1.0 or seconds < TELLS_FROM_S:
        return ""
    left = seconds * (1.0 - share) / share
    return f"about {max(round(left), 1)} s left" if left < 90 else f"about {round(left / 60)} min left"


LOW_DISK_BYTES = 1 << 30
"""With less room than this the status bar warns (assumed): about two hours of recording at 1 kHz."""

CYCLE_HELP = (
    "Late: cycles of the control loop that came too late or were lost, since the device was connected.\n"
    "Cycle: measured over the last ten seconds, mean and longest."
)


class StatusBar(QWidget):
    """Follows the rig and a task runner."""

    def __init__(self, tasks: Worker, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.device = FittingLabel()
        self.device.setObjectName("statusDevice")
        self.device.setAccessibleName("Device")
        self.tasks = TaskBar(tasks)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 0, 0, 0)
        layout.setSpacing(8)
        layout.addWidget(self.device)
        layout.addWidget(self.tasks, 1)
        self.show_rig(RigLine())

    def show_rig(self, line: RigLine) -> None:
        """How the rig does."""
        texts = device_texts(line)
        self.device.set_texts(texts)
        self.device.setVisible(bool(line.device))
        self.device.setToolTip("\n".join(filter(None, (texts[0], CYCLE_HELP if line.cycle_s else ""))))


def device_texts(line: RigLine) -> tuple[str, ...]:
    """Device, samples, late cycles, cycle time, disk, in words: all of it, then less and less.

    What endangers the recording is in each.
    """
    if not line.device:
        return ("",)
    samples, late = f"{line.samples:,} samples".replace(",", "\u202f"), f"{line.late} late"
    mean, longest = f"cycle {1e3 * line.cycle_s:.2f} ms", f"longest {1e3 * line.longest_cycle_s:.2f} ms"
    cycle = f"{mean}, {longest}" if line.cycle_s else ""
    warning = f"⚠ {line.warning}" if line.warning else ""
    room, low = _room(line.free_bytes), 0 < line.free_bytes < LOW_DISK_BYTES
    choices = (
        (line.device, samples, late, cycle, room, warning),
        (line.device, samples, late, longest if line.cycle_s else "", room, warning),
        (line.device, late, room, warning),
        (line.device, room if low else "", warning),
    )
    return tuple(dict.fromkeys(" · ".join(filter(None, parts)) for parts in choices))


def _room(free_bytes: int) -> str:
    """Empty before it is known."""
    if not free_bytes:
        return ""
    room = f"{free_bytes / 1e9:.{0 if free_bytes >= 1e10 else 1}f} GB free"
    return f"⚠ only {room}" if free_bytes < LOW_DISK_BYTES else room
