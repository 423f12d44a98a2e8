"""The ranked effects with the verdict above and "Add to model" below."""

from __future__ import annotations

from PySide6.QtCore import QModelIndex, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QListView, QPushButton, QVBoxLayout, QWidget

from fingerlab.diagnosis.answer.results import Diagnosis

from ..theme import large_font, small_font
from ..widgets.focus import set_usable
from ..widgets.labels import WholeLabel
from .candidate_delegate import CandidateDelegate
from .candidate_list import CandidateList, Row
from .wording import OUTCOME_TITLES, best_choice, set_help, set_words, verdict_headline

LEAST_ROWS = 2
"""Of the list, that are always seen; with the words above it more would not fit at 1280 x 800."""


class CandidateView(QListView):
    """A list whose Enter key asks to add the chosen effect."""

    accepted = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.accepted.emit()
            return
        super().keyPressEvent(event)


class CandidatesPanel(QWidget):
    """Signals: ``chosen(key)`` when another row is chosen, ``add_asked(effect)``."""

    chosen = Signal(str)
    add_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.verdict = WholeLabel()
        self.verdict.setProperty("role", "heading")
        self.verdict.setFont(large_font())
        self.verdict.setObjectName("verdict")
        self.set_text = WholeLabel()
        self.set_text.setProperty("role", "muted")
        self.set_text.setFont(small_font())
        self.set_text.setObjectName("setText")
        self.list = CandidateList(self)
        self.view = CandidateView()
        self.view.setObjectName("candidates")
        self.view.setAccessibleName("Candidates, best first")
        self.view.setModel(self.list)
        self.view.setItemDelegate(CandidateDelegate(self.view))
        self.view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.view.setVerticalScrollMode(QListView.ScrollMode.ScrollPerPixel)
        self.view.setUniformItemSizes(True)
        # Where room is short the list gives way and scrolls, not the words above it.
        self.view.setMinimumHeight(LEAST_ROWS * 2 * self.fontMetrics().height())
        self.add_button = QPushButton("Add &to model")
        self.add_button.setObjectName("addToModel")
        self.add_button.setProperty("primary", "true")
        self._layout()
        self._busy = False
        self.view.selectionModel().currentChanged.connect(self._on_current)
        self.view.accepted.connect(self._ask)
        self.view.doubleClicked.connect(self._ask)
        self.add_button.clicked.connect(self._ask)
        self._update_button()

    def _layout(self) -> None:
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        layout.addWidget(self.verdict)
        layout.addWidget(self.set_text)
        layout.addWidget(self.view, 1)
        row = QHBoxLayout()
        row.addWidget(self.add_button)
        row.addStretch(1)
        layout.addLayout(row)

    def show_diagnosis(self, diagnosis: Diagnosis | None) -> None:
        """Show the rows of a diagnosis and choose the one that its verdict names."""
        self.list.show(diagnosis)
        self.verdict.setText(verdict_headline(diagnosis) if diagnosis is not None else "")
        self.set_text.setText(set_words(diagnosis) if diagnosis is not None else "")
        self.set_text.setToolTip(set_help(diagnosis) if diagnosis is not None else "")
        if diagnosis is not None:
            self.choose(best_choice(diagnosis))
        self._update_button()

    def choose(self, key: str) -> None:
        """Choose a row by effect id or outcome."""
        index = self.list.index_of(key)
        if index.isValid():
            self.view.setCurrentIndex(index)

    def chosen_row(self) -> Row | None:
        index = self.view.currentIndex()
        return self.list.rows[index.row()] if index.isValid() else None

    def set_busy(self, busy: bool) -> None:
        """While the model is being refitted nothing more can be added."""
        self._busy = busy
        self._update_button()

    def _on_current(self, current: QModelIndex, _previous: QModelIndex) -> None:
        self._update_button()
        row = self.chosen_row()
        if current.isValid() and row is not None:
            self.chosen.emit(row.key)

    def _ask(self) -> None:
        row = self.chosen_row()
        if row is not None and self.add_button.isEnabled():
            self.add_asked.emit(row.key)

    def _update_button(self) -> None:
        row = self.chosen_row()
        if row is None:
            why = "Choose an effect first."
        elif row.key in OUTCOME_TITLES:
            why = f"“{row.title}” is a result, not an effect: there is nothing to add."
        elif self._busy:
            why = "Work is running; wait for it or cancel it below."
        else:
            why = ""
        set_usable(self.add_button, not why)
        help_text = f"Refit with {row.title} in the model (Enter)." if row is not None else ""
        self.add_button.setToolTip(why or help_text)
        self.add_button.setAccessibleDescription(why or help_text)
