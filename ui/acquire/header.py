"""What stands in the header while Acquire is shown: which device, and the way to what was just recorded."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QWidget

from ..widgets.labels import ElidedLabel, header_name


class AcquireHeader(QWidget):
    """Signals: disconnect_asked; open_asked(path)."""

    disconnect_asked = Signal()
    open_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name = header_name("deviceName", "Device", alone=False)
        self.lines = ElidedLabel()
        self.lines.setObjectName("safetyLines")
        self.lines.setAccessibleName("Emergency stop, amplifier and dead-man")
        self.disconnect_button = QPushButton("Disconnect")
        self.disconnect_button.setObjectName("disconnect")
        self.disconnect_button.setToolTip("Stop the motor and let the device go, to choose another.")
        self.open = QPushButton("Look at the recording")
        self.open.setObjectName("openRecording")
        self._path = ""
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 0, 8, 0)
        layout.setSpacing(8)
        layout.addWidget(self.name, 1)
        layout.addWidget(self.lines, 1)
        layout.addWidget(self.open)
        layout.addWidget(self.disconnect_button)
        self.open.hide()
        self.open.clicked.connect(lambda: self.open_asked.emit(self._path))
        self.disconnect_button.clicked.connect(self.disconnect_asked)

    def show_device(self, name: str, in_protocol: bool) -> None:
        """Which device is connected."""
        self.name.setText(name[:1].upper() + name[1:] if name else "")
        self.disconnect_button.setVisible(bool(name))
        self.disconnect_button.setEnabled(not in_protocol)

    def show_lines(self, words: Mapping[str, str]) -> None:
        """State of the bench's digital lines, each in words; nothing where no bench is connected."""
        told = [f"{name[:1].upper()}{name[1:]} {word}" for name, word in words.items()]
        wired = [line for line in told if not line.endswith("not wired")]
        short = " · ".join(wired) or ("No emergency stop input" if told else "")
        if self.lines.text() != " · ".join(told):
            self.lines.set_texts([" · ".join(told), short])

    def show_written(self, path: Path) -> None:
        """Offer what was just recorded."""
        self._offer(path, "Look at the recording", f"Open {path.name} in the Model lab.")

    def show_put_off(self, path: Path) -> None:
        """Offer to finish what was put off."""
        self._offer(
            path, "Finish the recording", f"Write and verify {path.name}, and open it in the Model lab."
        )

    def _offer(self, path: Path, text: str, help_text: str) -> None:
        self._path = str(path)
        self.open.setText(text)
        self.open.setToolTip(help_text)
        self.open.show()
