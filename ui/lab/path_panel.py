"""Bottom row of the lab: the error path with undo and redo, and the error of each equation."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from fingerlab.report.diagnosis_words import effect_title, in_sentence

from ..widgets.focus import set_usable
from .error_path import ErrorPath
from .error_table import ErrorTable
from .history import History


class PathPanel(QWidget):
    """Signals ``undo_asked`` and ``redo_asked``."""

    undo_asked = Signal()
    redo_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.path = ErrorPath()
        self.table = ErrorTable()
        self.undo = QPushButton("Undo")
        self.redo = QPushButton("Redo")
        self.undo.setObjectName("undo")
        self.redo.setObjectName("redo")
        self.undo.clicked.connect(self.undo_asked)
        self.redo.clicked.connect(self.redo_asked)
        buttons = QVBoxLayout()
        buttons.setSpacing(8)
        buttons.addStretch(1)
        buttons.addWidget(self.undo)
        buttons.addWidget(self.redo)
        buttons.addStretch(1)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(16)
        layout.addWidget(self.path, 1)
        layout.addLayout(buttons)
        layout.addWidget(self.table)

    def show_history(self, history: History | None) -> None:
        """Show the path, the errors, and what undo and redo would do."""
        self.path.show_history(history)
        self.table.show_history(history)
        can_undo = history is not None and history.can_undo
        can_redo = history is not None and history.can_redo
        set_usable(self.undo, can_undo)
        set_usable(self.redo, can_redo)
        added = history.now.last_added if history is not None else None
        undone = history.undone() if history is not None else None
        self.undo.setToolTip(
            f"Take {_named(added)} out again (Ctrl+Z)." if added else "Nothing was added yet."
        )
        self.redo.setToolTip(
            f"Add {_named(undone)} again (Ctrl+Shift+Z)." if undone else "Nothing was undone."
        )


def _named(effect: str) -> str:
    return in_sentence(effect_title(effect))
