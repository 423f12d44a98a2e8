"""What the operator has to do now, large, across the plots, with the key that says it is done."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QWidget

from ..widgets.theme import large_font


class PromptBar(QFrame):
    """Hidden until something is asked. Signal ``done``."""

    done = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("promptBar")
        self.setAccessibleName("What to do now")
        self.sentence = QLabel()
        self.sentence.setObjectName("prompt")
        self.sentence.setFont(large_font())
        self.sentence.setWordWrap(True)
        self.button = QPushButton("&Done")
        self.button.setObjectName("promptDone")
        self.button.setProperty("primary", "true")
        self.button.setToolTip("It is done: go on with the protocol (Ctrl+D).")
        self.button.clicked.connect(self._on_done)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 8, 8, 8)
        layout.setSpacing(16)
        layout.addWidget(self.sentence, 1)
        layout.addWidget(self.button)
        self.hide()

    def ask(self, sentence: str) -> None:
        """Show what to do."""
        self.sentence.setText(sentence)
        self.setAccessibleDescription(sentence)
        self.show()
        self.button.setFocus()

    def _on_done(self) -> None:
        self.hide()
        self.done.emit()
