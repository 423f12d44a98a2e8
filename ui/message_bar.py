"""One sentence across the window: an error or a piece of news, with its details to copy."""

from __future__ import annotations

from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QSizePolicy, QWidget


class MessageBar(QFrame):
    """Hidden until there is something to say; stays until it is dismissed or replaced."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("messageBar")
        self.setAccessibleName("Message")
        self.sentence = QLabel()
        self.sentence.setObjectName("message")
        self.sentence.setWordWrap(True)
        self.sentence.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.copy = QPushButton("&Copy details")
        self.copy.setObjectName("copyDetails")
        self.copy.clicked.connect(self._copy)
        self.dismiss = QPushButton("&Dismiss")
        self.dismiss.clicked.connect(self.hide)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 8, 8, 8)
        layout.setSpacing(8)
        for widget in (self.sentence, self.copy, self.dismiss):
            layout.addWidget(widget)
        self._details = ""
        self.hide()

    def tell(self, sentence: str, details: str = "") -> None:
        """Show a sentence; with details it can be copied whole for a report. An empty one hides the bar."""
        if not sentence:
            self.hide()
            return
        self._details = details
        self.sentence.setText(sentence)
        self.setAccessibleDescription(sentence)
        self.copy.setVisible(bool(details))
        self.show()

    def _copy(self) -> None:
        QGuiApplication.clipboard().setText(f"{self.sentence.text()}\n\n{self._details}")
