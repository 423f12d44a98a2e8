"""The line at the top: what is open and what can be done with it."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QWidget

from .widgets.labels import header_name


class Header(QWidget):
    """Signals ``open_asked``, ``report_asked``, ``reveal_asked``."""

    open_asked = Signal()
    report_asked = Signal()
    reveal_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name = header_name("sessionName", "Open sessions", alone=False)
        self.reveal = QPushButton("Reveal the hidden effect")
        self.reveal.setObjectName("reveal")
        self.reveal.setToolTip(
            "Say which effect was put into this practice session. Your guess is what you have added by then."
        )
        self.report = QPushButton("Save report page…")
        self.report.setObjectName("report")
        self.open = QPushButton("Open…")
        self.open.setObjectName("open")
        self.open.setToolTip("Open a session file (Ctrl+O), or drop one here.")
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 4, 8, 4)
        layout.setSpacing(8)
        layout.addWidget(self.name, 1)
        for button, signal in (
            (self.reveal, self.reveal_asked),
            (self.report, self.report_asked),
            (self.open, self.open_asked),
        ):
            button.clicked.connect(signal)
            layout.addWidget(button)
        self.show_session("", False, False)

    def show_session(self, text: str, practice: bool, ready: bool) -> None:
        """Say what is open; ``ready`` when there is a diagnosis to report on."""
        # Of the runs as much as there is room for.
        self.name.set_texts((text, text.rpartition(": ")[0] or text, text.rpartition(" · ")[0] or text))
        self.reveal.setVisible(practice)
        self.report.setVisible(ready)
        self.report.setToolTip("The whole comparison as one self-contained page (Ctrl+S).")
