"""The folder's sessions as a table with a search box; beside it the chosen one with its tags and notes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QItemSelectionModel, QModelIndex, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QLineEdit,
    QMenu,
    QPlainTextEdit,
    QPushButton,
    QTableView,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.library.index import SessionFacts, text_list
from fingerlab.library.notes import FILE_NAME, HELP, Note, StoredVerdict, matches
from fingerlab.library.reviewing import Thumbnail

from ..widgets.fields import set_usable
from ..widgets.layout import FLUSH, WrappedRow, described, fix_width, hbox, vbox
from ..widgets.tables import ColumnKeeper, ElidedLabel, WholeLabel, copies, heading, remark
from ..widgets.theme import small_font
from .session_table import (
    LENGTH,
    MOTOR,
    NAME,
    PHASES,
    QUALITY,
    RECORDED,
    RIG,
    TAGS,
    VERDICT,
    SessionTable,
    ThumbnailDelegate,
    Thumbnails,
    VerdictDelegate,
    clock_time,
    duration,
    verdict_text,
)

if TYPE_CHECKING:
    from ..app.context import Settings

DETAILS_WIDTH = 272


class DetailsPanel(QWidget):
    """Signals: review_asked, lab_asked, merge_asked, compare_asked; noted(facts, Note): keep tags and notes.

    What was typed is also kept when another session is chosen: nothing that was written is lost.
    """

    review_asked = Signal()
    lab_asked = Signal()
    merge_asked = Signal()
    compare_asked = Signal()
    noted = Signal(object, object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.title = heading("No session chosen")
        self.title.setWordWrap(True)
        self.file = ElidedLabel()
        self.about = described(WholeLabel(), "aboutSession", font=small_font(), role="muted")
        self.about.setTextFormat(Qt.TextFormat.PlainText)
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
        self.compare = QPushButton("&Compare…")
        self.compare.setObjectName("compareRuns")
        self.compare.setToolTip("Two days or two benches, the same motions in phase; mark two rows.")
        self.tags = described(QLineEdit(), "tags", accessible="Tags, separated by commas")
        self.tags.setPlaceholderText("good, new cable")
        self.notes = described(QPlainTextEdit(), "notes", accessible="Notes")
        self.notes.setTabChangesFocus(True)
        self.notes.setPlaceholderText("What to know of this session")
        for field in (self.tags, self.notes):
            field.setToolTip(f"Kept in {FILE_NAME} in the folder; the recording stays as it is.")
        self.keep = described(QPushButton("&Keep tags and notes"), "keepNotes")
        self._kept = Note()
        self._facts: SessionFacts | None = None
        self._build()
        self.review.clicked.connect(self.review_asked)
        self.lab.clicked.connect(self.lab_asked)
        self.merge.clicked.connect(self.merge_asked)
        self.compare.clicked.connect(self.compare_asked)
        self.keep.clicked.connect(self.flush)
        self.tags.returnPressed.connect(self.flush)
        self.tags.textChanged.connect(self._refresh)
        self.notes.textChanged.connect(self._refresh)
        self.show_session(None, Note(), None, 0)

    def _build(self) -> None:
        layout = vbox(self, self.title, self.file, self.about, self.review, margins=(16, 8, 16, 8), spacing=8)
        for pair in ((self.lab, self.export), (self.merge, self.compare)):
            layout.addLayout(hbox(None, *pair, spacing=8))
        layout.addSpacing(8)
        for text, field in (("&Tags", self.tags), ("&Notes", self.notes)):
            label = QLabel(text)
            label.setBuddy(field)
            layout.addWidget(label)
            layout.addWidget(field)
        layout.addWidget(self.keep)
        layout.addStretch(1)
        self.notes.setMinimumHeight(80)
        fix_width(self, DETAILS_WIDTH)

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
        self, facts: SessionFacts | None, note: Note, verdict: StoredVerdict | None, chosen: int
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
        self.compare.setEnabled(chosen == 2)
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


def about(facts: SessionFacts, verdict: StoredVerdict | None) -> str:
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


WIDTHS = {MOTOR: 12, RECORDED: 12, LENGTH: 12, PHASES: 13, RIG: 10, QUALITY: 11, VERDICT: 20, TAGS: 10}
"""Widths in characters; the name takes the rest, and gives the verdict a share of what it does not need."""
NAME_NEEDS, NAME_LEAST, VERDICT_MOST = 27, 14, 44
"""Characters: what a name gets first, what it gets in any case, and the most that a verdict gets."""
BESIDE = (TAGS, RIG, QUALITY, PHASES, MOTOR)
"""Columns that go, one after the other, where a name has no room: what they say stands at the right, too."""


AGAIN_HELP = "Look for new and changed files (F5)."
DIAGNOSE_HELP = (
    "Say of every session below this folder what its model lacks, in the background; what a table beside "
    "them holds already is not done again."
)
TREND_HELP = "How the bench aged over the sessions of this folder, and when it changed."
NO_SESSION = "No session file below this folder."


class LibraryPage(QWidget):
    """Signals: folder_asked, texts_asked, again_asked, diagnose_asked, trend_asked; review_asked(paths),
    lab_asked(paths); chosen().

    The last one: other rows are marked.
    """

    folder_asked = Signal()
    texts_asked = Signal()
    again_asked = Signal()
    diagnose_asked = Signal()
    trend_asked = Signal()
    review_asked = Signal(object)
    lab_asked = Signal(object)
    chosen = Signal()

    def __init__(self, thumbnails: Thumbnails, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._thumbnails = thumbnails
        self._columns: ColumnKeeper | None = None
        self.model = SessionTable()
        self.table = QTableView()
        copies(self.table)
        self.details = DetailsPanel()
        self.folder = described(ElidedLabel(), "libraryFolder")
        self.choose = described(QPushButton("Ch&oose folder…"), "chooseFolder")
        self.texts = QPushButton("&Import table…")
        self.texts.setObjectName("importText")
        self.texts.setToolTip("Tables of text or MATLAB files become a session; or drop them on the window.")
        self.again = described(QPushButton("Read a&gain"), "readAgain", tip=AGAIN_HELP)
        self.diagnose = described(QPushButton("&Diagnose all"), "diagnoseAll", tip=DIAGNOSE_HELP)
        self.trend = described(QPushButton("Tre&nd…"), "showTrend", tip=TREND_HELP)
        self.search = described(QLineEdit(), "search", accessible="Search and filter", tip=HELP)
        self.search.setPlaceholderText("Search: words, phase:contact, tag:good, is:clean, after:2026-05 …")
        self.search.setClearButtonEnabled(True)
        self.count = described(remark(wrap=False), "sessionCount")
        self.empty = described(remark(), "libraryEmpty")
        self._build()
        self._set_up_table()
        self._connect()

    def _build(self) -> None:
        top = WrappedRow(((self.folder, 1), self.choose, self.texts, self.again, self.diagnose, self.trend))
        find = hbox(None, (self.search, 1), self.count, spacing=8)
        left = vbox(None, top, find, self.empty, (self.table, 1), margins=(16, 8, 0, 8), spacing=8)
        hbox(self, (left, 1), self.details, margins=FLUSH, spacing=0)

    def _set_up_table(self) -> None:
        table, metrics = self.table, self.fontMetrics()
        table.setModel(self.model)
        table.setObjectName("sessionTable")
        table.setAccessibleName("Sessions")
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.setShowGrid(False)
        table.setWordWrap(False)
        table.setTabKeyNavigation(False)
        table.setAlternatingRowColors(True)
        table.setItemDelegateForColumn(MOTOR, ThumbnailDelegate(self._thumbnail, table))
        table.setItemDelegateForColumn(VERDICT, VerdictDelegate(table))
        table.verticalHeader().hide()
        table.verticalHeader().setDefaultSectionSize(round(2.7 * metrics.height()))
        header = table.horizontalHeader()
        header.setHighlightSections(False)
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setMinimumSectionSize(4 * metrics.averageCharWidth())
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        for column, characters in WIDTHS.items():
            table.setColumnWidth(column, characters * metrics.averageCharWidth() + 8)
        header.setSortIndicator(RECORDED, Qt.SortOrder.DescendingOrder)
        table.setSortingEnabled(True)
        for watched in (table, table.viewport()):
            watched.installEventFilter(self)

    def _connect(self) -> None:
        self.choose.clicked.connect(self.folder_asked)
        self.texts.clicked.connect(self.texts_asked)
        self.again.clicked.connect(self.again_asked)
        self.diagnose.clicked.connect(self.diagnose_asked)
        self.trend.clicked.connect(self.trend_asked)
        self.search.textChanged.connect(self._on_search)
        self.table.doubleClicked.connect(self._on_double_click)
        self.table.selectionModel().selectionChanged.connect(lambda *_: self._on_chosen())
        self._thumbnails.ready.connect(lambda _path: self.table.viewport().update())
        self.details.review_asked.connect(self.ask_review)
        self.details.lab_asked.connect(lambda: self.lab_asked.emit(self.paths()))

    def remember(self, settings: Settings) -> None:
        """Take the columns as the user left them last time, and keep those to come."""
        self._columns = ColumnKeeper(self.table, settings)

    def show_reading(self, on: bool) -> None:
        """Whether the folder is being read, which the button then stops."""
        self.again.setText("Stop readin&g" if on else "Read a&gain")
        self.again.setToolTip("Leave the list as it is." if on else AGAIN_HELP)
        self.show_count("Reading …" if on else "")

    def show_diagnosing(self, words: str) -> None:
        """How far a batch is, which the button then stops; empty: none runs."""
        self.diagnose.setText("Stop &diagnosing" if words else "&Diagnose all")
        self.diagnose.setToolTip("What is done so far is kept." if words else DIAGNOSE_HELP)
        self.show_count(words)

    # what is shown

    def show_folder(self, text: str) -> None:
        """The folder that is browsed."""
        self.folder.setText(text)

    def show_count(self, reading: str = "") -> None:
        """How many sessions there are and how many of them are shown."""
        shown, total = self.model.rowCount(), self.model.total
        many = "1 session" if total == 1 else f"{total} sessions"
        words = many if shown == total else f"{shown} of {many}"
        self.count.setText(reading or words)
        text = ""
        if not reading and total == 0:
            text = (
                f"{NO_SESSION} Choose the folder that holds the sessions, import tables, "
                "or record one in Acquire."
            )
        elif not reading and shown == 0:
            text = "No session fits the search. Take words away, or clear it."
        self.empty.setText(text)
        self.empty.setVisible(bool(text))
        for button, usual in ((self.diagnose, DIAGNOSE_HELP), (self.trend, TREND_HELP)):
            set_usable(button, bool(reading) or total > 0)
            if not reading:
                button.setToolTip(usual if total else NO_SESSION)

    def paths(self) -> list[Path]:
        """The sessions chosen, in the order shown."""
        rows = sorted(index.row() for index in self.table.selectionModel().selectedRows())
        return [self.model.path(row) for row in rows]

    def choose_path(self, path: Path) -> None:
        """Mark a session, if it is shown."""
        row = self.model.row(path)
        if row >= 0:
            index, flags = self.model.index(row, NAME), QItemSelectionModel.SelectionFlag
            # Not selectRow, which looks at the keys that happen to be held down.
            self.table.selectionModel().setCurrentIndex(index, flags.ClearAndSelect | flags.Rows)
            self.table.scrollTo(index)

    def refresh_details(self) -> None:
        """Show the chosen session beside the table."""
        paths = self.paths()
        path = paths[0] if paths else None
        facts = self.model.facts(path) if path is not None else None
        if path is None or facts is None or len(paths) > 1:
            self.details.show_session(facts, Note(), None, len(paths))
        else:
            self.details.show_session(facts, self.model.note(path), self.model.verdict(path), 1)

    def _thumbnail(self, path: Path) -> Thumbnail | None:
        facts = self.model.facts(path)
        return None if facts is None or facts.problem else self._thumbnails.get(path, facts.modified)

    # hand

    def _share_room(self) -> None:
        self._leave_room_for_names()
        if self._columns is not None and self._columns.by_hand:
            return
        character = self.fontMetrics().averageCharWidth()
        others = sum(self.table.columnWidth(column) for column in WIDTHS if column != VERDICT)
        room = self.table.viewport().width() - others - NAME_NEEDS * character
        least, most = ((count * character + 8) for count in (WIDTHS[VERDICT], VERDICT_MOST))
        self.table.setColumnWidth(VERDICT, min(max(room, least), most))

    def _leave_room_for_names(self) -> None:
        for column in BESIDE:
            self.table.setColumnHidden(column, False)
        least = NAME_LEAST * self.fontMetrics().averageCharWidth()
        for column in BESIDE:
            others = sum(self.table.columnWidth(other) for other in WIDTHS)
            if self.table.viewport().width() - others >= least:
                return
            self.table.setColumnHidden(column, True)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self.table.viewport() and event.type() == QEvent.Type.Resize:
            self._share_room()
        pressed = isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress
        if pressed and event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):  # type: ignore[attr-defined]
            self.ask_review()
            return True
        return super().eventFilter(watched, event)

    def _on_search(self, text: str) -> None:
        try:
            self.model.filter(matches(text))
        except UserError as error:
            self.count.setText("")
            self.empty.setText(str(error))
            self.empty.show()
            return
        self.show_count()
        self._on_chosen()  # of rows that are gone the selection says nothing

    def _on_double_click(self, index: QModelIndex) -> None:
        self.lab_asked.emit([self.model.path(index.row())])

    def _on_chosen(self) -> None:
        self.refresh_details()
        self.chosen.emit()

    def ask_review(self) -> None:
        """Ask for the review of the sessions that are marked, the first of them in front."""
        paths = self.paths()
        if paths:
            self.review_asked.emit(paths)
