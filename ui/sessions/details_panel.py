"""Beside the table: what the chosen session is, its tags and notes, and what can be done with it."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QLabel,
    QLineEdit,
    QMenu,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from fingerlab.library.index import SessionFacts, text_list
from fingerlab.library.notes import FILE_NAME, Note, Verdict

from ..widgets.labels import ElidedLabel, heading, remark
from ..widgets.layout import described, hbox, vbox
from .session_words import clock_time, duration, verdict_text

WIDTH = 272


class DetailsPanel(QWidget):
    """Signals: review_asked, lab_asked, merge_asked; noted(facts, Note): tags or notes are to be kept.

    What was typed is also kept when another session is chosen: nothing that was written is lost.
    """

    review_asked = Signal()
    lab_asked = Signal()
    merge_asked = Signal()
    noted = Signal(object, object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFixedWidth(WIDTH)
        self.title = heading("No session chosen")
        self.title.setWordWrap(True)
        self.file = ElidedLabel()
        self.about = remark()
        self.about.setObjectName("aboutSession")
        self.review = QPushButton("&Review runs")
        self.review.setObjectName("review")
        self.review.setProperty("primary", "true")
        self.review.setToolTip(
            "The runs against time: zoom, cursors (Return). Of several sessions, runs can be laid over one "
            "another."
        )
        self.lab = QPushButton("Open in &Model lab")
        self.lab.setObjectName("openInLab")
        self.lab.setToolTip("Open the chosen sessions together in the Model lab (double click).")
        self.export = QPushButton("E&xport")
        self.export.setObjectName("export")
        self.export.setToolTip("For other tools, or as a copy that has tags and notes in it.")
        self.exports = QMenu(self.export)
        self.export.setMenu(self.exports)
        self.merge = QPushButton("Mer&ge…")
        self.merge.setObjectName("merge")
        self.merge.setToolTip("The runs of the chosen sessions as one session; mark two or more rows.")
        self.tags = QLineEdit()
        self.tags.setObjectName("tags")
        self.tags.setPlaceholderText("good, new cable")
        self.tags.setAccessibleName("Tags, separated by commas")
        self.notes = described(QPlainTextEdit(), "notes", accessible="Notes")
        self.notes.setTabChangesFocus(True)
        self.notes.setPlaceholderText("What to know of this session")
        for field in (self.tags, self.notes):
            field.setToolTip(f"Kept in {FILE_NAME} in the folder; the recording stays as it is.")
        self.keep = QPushButton("&Keep tags and notes")
        self.keep.setObjectName("keepNotes")
        self._kept = Note()
        self._facts: SessionFacts | None = None
        self._build()
        self.review.clicked.connect(self.review_asked)
        self.lab.clicked.connect(self.lab_asked)
        self.merge.clicked.connect(self.merge_asked)
        self.keep.clicked.connect(self.flush)
        self.tags.returnPressed.connect(self.flush)
        self.tags.textChanged.connect(self._refresh)
        self.notes.textChanged.connect(self._refresh)
        self.show_session(None, Note(), None, 0)

    def _build(self) -> None:
        layout = vbox(
            self, self.title, self.file, self.about, self.review, self.lab, margins=(16, 8, 16, 8), spacing=8
        )
        row = hbox(None, self.export, self.merge, spacing=8)
        layout.addLayout(row)
        layout.addSpacing(8)
        for text, field in (("&Tags", self.tags), ("&Notes", self.notes)):
            label = QLabel(text)
            label.setBuddy(field)
            layout.addWidget(label)
            layout.addWidget(field)
        layout.addWidget(self.keep)
        layout.addStretch(1)
        self.notes.setMinimumHeight(80)

    @property
    def note(self) -> Note:
        """Tags and notes as they stand in the fields."""
        return Note(
            text_list(self.tags.text()) if self.tags.text().strip() else (), self.notes.toPlainText().strip()
        )

    @property
    def changed(self) -> bool:
        """Whether something stands in the fields that was not kept."""
        return self.note != self._kept

    def show_session(
        self, facts: SessionFacts | None, note: Note, verdict: Verdict | None, chosen: int
    ) -> None:
        """Show one session; ``chosen`` counts the rows that are marked."""
        self.flush()
        self._facts = facts if chosen == 1 else None
        good = facts is not None and not facts.problem
        if chosen > 1:
            self.title.setText(f"{chosen} sessions chosen")
        else:
            self.title.setText((facts.title or facts.path.name) if facts is not None else "No session chosen")
        self.file.setText(facts.name if facts is not None and chosen <= 1 else "")
        self.about.setText(about(facts, verdict) if facts is not None and chosen <= 1 else "")
        self._kept = note
        self.tags.setText(", ".join(note.tags))
        self.notes.setPlainText(note.notes)
        one = facts is not None and chosen == 1
        for field in (self.tags, self.notes):
            field.setEnabled(one and good)
        self.review.setEnabled(chosen > 0)
        self.lab.setEnabled(chosen > 0)
        self.export.setEnabled(one and good)
        self.merge.setEnabled(chosen > 1)
        self._refresh()

    def kept(self, note: Note) -> None:
        """The note is in the side file."""
        self._kept = note
        self._refresh()

    def _refresh(self) -> None:
        self.keep.setEnabled(self.changed and self.tags.isEnabled())

    def flush(self) -> None:
        """Have kept what was typed."""
        if self.changed and self._facts is not None:
            self.noted.emit(self._facts, self.note)


def about(facts: SessionFacts, verdict: Verdict | None) -> str:
    """A session in a few lines."""
    if facts.problem:
        return facts.problem
    date, time = clock_time(facts.when, facts.created)
    runs = "1 run" if facts.runs == 1 else f"{facts.runs} runs"
    lines = [f"Recorded {date} {time}".rstrip(), f"{runs}, {duration(facts.seconds)}", f"Rig: {facts.rig}"]
    if facts.operator:
        lines.append(f"Operator: {facts.operator}")
    lines.append("Quality: " + (", ".join(facts.flags) or "clean"))
    if verdict is not None:
        lines.append("Verdict: " + ", ".join(verdict_text(verdict).split("\n")).rstrip(", "))
    if facts.tags:
        lines.append(f"Tags in the file: {', '.join(facts.tags)}")
    if facts.notes:
        lines.append(f"Notes in the file: {facts.notes}")
    return "\n".join(lines)
