"""What a project holds beside the model shown: notes, and the models that were tried."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QListWidget,
    QListWidgetItem,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from fingerlab.core.text import score_text
from fingerlab.models.file import Held, ModelKey, TriedModel
from fingerlab.report.diagnosis_words import effect_title, in_sentence, listed
from fingerlab.report.parameter_words import held_words

from ..widgets.labels import remark
from ..widgets.layout import described, vbox

WIDTH, HEIGHT = 560, 380


class NotesDialog(QDialog):
    """Notes on the open sessions. Signal ``noted(text)`` at every change: nothing waits to be saved."""

    noted = Signal(str)

    def __init__(self, parent: QWidget | None, notes: str, place: str) -> None:
        super().__init__(parent)
        _prepare(self, "Notes", "projectNotes")
        self.text = described(QPlainTextEdit(notes), "notesText", accessible="Notes")
        self.text.setPlaceholderText("What you see, think and plan.")
        self.text.textChanged.connect(lambda: self.noted.emit(self.text.toPlainText()))
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        vbox(self, (self.text, 1), remark(f"Kept at every letter in {place}."), close, spacing=8)


class TriedDialog(QDialog):
    """Models that were tried, least error first. Signal ``chosen(key)``: one is to be shown again."""

    chosen = Signal(object)

    def __init__(self, parent: QWidget | None, tried: Sequence[TriedModel], now: ModelKey) -> None:
        super().__init__(parent)
        _prepare(self, "Models tried", "triedModels")
        self.models = described(QListWidget(), "triedList", accessible="Models tried, least error first")
        self._tried = sorted(tried, key=lambda one: one.score)
        for model in self._tried:
            here = " (shown now)" if model.key == now else ""
            item = QListWidgetItem(f"{score_text(model.score)}  {model_words(*model.key)}{here}")
            item.setToolTip(model.evidence)
            self.models.addItem(item)
        self.models.itemActivated.connect(self._show_chosen)
        self.models.setCurrentRow(0)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        self.show_button = QPushButton("&Show it again")
        buttons.addButton(self.show_button, QDialogButtonBox.ButtonRole.ActionRole)
        self.show_button.clicked.connect(self._show_chosen)
        buttons.rejected.connect(self.reject)
        help_text = remark("Error on runs left out of the fit (in floors), and what was added.")
        vbox(self, help_text, (self.models, 1), buttons, spacing=8)

    def _show_chosen(self) -> None:
        row = self.models.currentRow()
        if row >= 0:
            self.chosen.emit(self._tried[row].key)
            self.accept()


def model_words(added: Sequence[str], held: Held = ()) -> str:
    """A model in words."""
    names = [in_sentence(effect_title(effect)) for effect in added]
    model = f"nominal model with {listed(names)}" if names else "nominal model"
    return ", ".join(filter(None, (model, held_words(dict(held)))))


def _prepare(dialog: QDialog, title: str, name: str) -> None:
    dialog.setWindowTitle(f"{title} – FingerLab")
    dialog.setObjectName(name)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.resize(WIDTH, HEIGHT)
