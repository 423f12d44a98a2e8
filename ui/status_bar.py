"""The line at the bottom: device, samples, cycles, disk; what is running; the last log line."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from .desk import RigLine
from .task_bar import TaskBar
from .tasks import TaskRunner

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
        self.device = QLabel()
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
        self.device.setText(device_text(line))
        self.device.setVisible(bool(line.device))
        self.device.setToolTip("\n".join(filter(None, (line.warning, CYCLE_HELP if line.cycle_s else ""))))


def device_text(line: RigLine) -> str:
    """Device, samples, late cycles, cycle time, disk, in words."""
    if not line.device:
        return ""
    parts = [line.device, f"{line.samples:,} samples".replace(",", "\u202f"), f"{line.late} late"]
    if line.cycle_s:
        parts.append(f"cycle {1e3 * line.cycle_s:.2f} ms, longest {1e3 * line.longest_cycle_s:.2f} ms")
    if line.free_bytes:
        room = f"{line.free_bytes / 1e9:.0f} GB free" if line.free_bytes >= 1e10 else _little(line.free_bytes)
        parts.append(f"⚠ only {room}" if line.free_bytes < LOW_DISK_BYTES else room)
    if line.warning:
        parts.append(f"⚠ {line.warning}")
    return " · ".join(parts)


def _little(size: int) -> str:
    return f"{size / 1e9:.1f} GB free"
