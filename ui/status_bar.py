"""The line at the bottom: device, samples, cycles, disk; what is running; the last log line."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QWidget

from .desk import RigLine
from .task_bar import TaskBar
from .tasks import TaskRunner
from .widgets.labels import FittingLabel

LOW_DISK_BYTES = 1 << 30
"""With less room than this the status bar warns (assumed): about two hours of recording at 1 kHz."""

CYCLE_HELP = (
    "Late: cycles of the control loop that came too late or were lost, since the device was connected.\n"
    "Cycle: measured over the last ten seconds, mean and longest."
)


class StatusBar(QWidget):
    """Follows the rig and a task runner."""

    def __init__(self, tasks: TaskRunner, parent: QWidget | None = None) -> None:
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
