"""What the operator says of the session to come: folder, title, name, notes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)



@dataclass
class Details:
    """What the operator says of the session to come."""

    folder: Path
    title: str = ""
    operator: str = ""
    notes: str = ""

    def attributes(self) -> dict[str, str]:
        """For the session file; without what was left empty."""
        return {name: text for name in ("operator", "notes") if (text := getattr(self, name).strip())}


class DetailsDialog(QDialog):
    """Fills :class:`Details` when it is accepted."""

    def __init__(self, details: Details, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Session to record – FingerLab")
        self.resize(520, 320)
        self._details = details
        self.folder = QLineEdit(str(details.folder))
        self.folder.setObjectName("recordFolder")
        choose = QPushButton("Choose…")
        choose.clicked.connect(self._choose)
        across = QHBoxLayout()
        across.addWidget(self.folder, 1)
        across.addWidget(choose)
        self.title_field = QLineEdit(details.title)
        self.operator_field = QLineEdit(details.operator)
        self.notes = QPlainTextEdit(details.notes)
        self.notes.setTabChangesFocus(True)
        form = QFormLayout(self)
        form.setSpacing(8)
        label = QLabel("&Folder")
        label.setBuddy(self.folder)
        form.addRow(label, across)
        for words, name, field in (
            ("&Title", "Title", self.title_field),
            ("&Operator", "Operator", self.operator_field),
            ("&Notes", "Notes", self.notes),
        ):
            field.setAccessibleName(name)
            form.addRow(words, field)
        self.folder.setAccessibleName("Folder")
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel
        )
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        form.addRow(buttons)

    def accept(self) -> None:
        details = self._details
        details.folder = Path(self.folder.text()).expanduser()
        details.title = self.title_field.text()
        details.operator = self.operator_field.text()
        details.notes = self.notes.toPlainText()
        super().accept()

    def _choose(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Folder for recordings", self.folder.text())
        if name:
            self.folder.setText(name)
