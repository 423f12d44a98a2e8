"""The folder's sessions as a table with a search box, and the chosen one beside it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QItemSelectionModel, QModelIndex, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QPushButton,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.library.notes import HELP, Note, matches
from fingerlab.library.pyramid import Thumbnail

from ..widgets.labels import ElidedLabel, remark
from ..widgets.tables import ColumnKeeper
from .details_panel import DetailsPanel
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
)

if TYPE_CHECKING:
    from ..app.settings import Settings

WIDTHS = {MOTOR: 12, RECORDED: 13, LENGTH: 13, PHASES: 13, RIG: 10, QUALITY: 14, VERDICT: 20, TAGS: 10}
"""Widths in characters; the name takes the rest, and gives the verdict a share of what it does not need."""
NAME_NEEDS, VERDICT_MOST = 32, 44
"""Characters: what a name gets first, and the most that a verdict gets."""


AGAIN_HELP = "Look for new and changed files (F5)."


class LibraryPage(QWidget):
    """Signals: folder_asked, texts_asked, again_asked; review_asked(paths), lab_asked(paths); chosen().

    The last one: other rows are marked.
    """

    folder_asked = Signal()
    texts_asked = Signal()
    again_asked = Signal()
    review_asked = Signal(object)
    lab_asked = Signal(object)
    chosen = Signal()

    def __init__(self, thumbnails: Thumbnails, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._thumbnails = thumbnails
        self._columns: ColumnKeeper | None = None
        self.model = SessionTable()
        self.table = QTableView()
        self.details = DetailsPanel()
        self.folder = ElidedLabel()
        self.folder.setObjectName("libraryFolder")
        self.choose = QPushButton("Choose &folder…")
        self.choose.setObjectName("chooseFolder")
        self.texts = QPushButton("&Import text…")
        self.texts.setObjectName("importText")
        self.texts.setToolTip(
            "Text files of the bench's earlier program become a session; or drop them here."
        )
        self.again = QPushButton("Read a&gain")
        self.again.setObjectName("readAgain")
        self.again.setToolTip(AGAIN_HELP)
        self.search = QLineEdit()
        self.search.setObjectName("search")
        self.search.setPlaceholderText("Search: words, phase:contact, tag:good, is:clean, after:2026-05 …")
        self.search.setAccessibleName("Search and filter")
        self.search.setToolTip(HELP)
        self.search.setClearButtonEnabled(True)
        self.count = remark(wrap=False)
        self.count.setObjectName("sessionCount")
        self.empty = remark()
        self.empty.setObjectName("libraryEmpty")
        self._build()
        self._set_up_table()
        self._connect()

    def _build(self) -> None:
        top = QHBoxLayout()
        top.setSpacing(8)
        top.addWidget(self.folder, 1)
        top.addWidget(self.choose)
        top.addWidget(self.texts)
        top.addWidget(self.again)
        find = QHBoxLayout()
        find.setSpacing(8)
        find.addWidget(self.search, 1)
        find.addWidget(self.count)
        left = QVBoxLayout()
        left.setContentsMargins(16, 8, 0, 8)
        left.setSpacing(8)
        left.addLayout(top)
        left.addLayout(find)
        left.addWidget(self.empty)
        left.addWidget(self.table, 1)
        across = QHBoxLayout(self)
        across.setContentsMargins(0, 0, 0, 0)
        across.setSpacing(0)
        across.addLayout(left, 1)
        across.addWidget(self.details)

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
        self.again.setText("&Stop reading" if on else "Read a&gain")
        self.again.setToolTip("Leave the list as it is." if on else AGAIN_HELP)
        self.show_count("Reading …" if on else "")

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
                "No session file below this folder. Choose the folder that holds the sessions, import text "
                "files, or record one in Acquire."
            )
        elif not reading and shown == 0:
            text = "No session fits the search. Take words away, or clear it."
        self.empty.setText(text)
        self.empty.setVisible(bool(text))

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
        if self._columns is not None and self._columns.by_hand:
            return
        character = self.fontMetrics().averageCharWidth()
        others = sum(self.table.columnWidth(column) for column in WIDTHS if column != VERDICT)
        room = self.table.viewport().width() - others - NAME_NEEDS * character
        least, most = ((count * character + 8) for count in (WIDTHS[VERDICT], VERDICT_MOST))
        self.table.setColumnWidth(VERDICT, min(max(room, least), most))

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
