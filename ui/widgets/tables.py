"""Labels and tables: text that is shortened instead of cut off, numbers to read, boxes to tick."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import (
    QEvent,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QPointF,
    QSize,
    Qt,
    SignalInstance,
)
from PySide6.QtGui import (
    QAction,
    QFontMetrics,
    QGuiApplication,
    QKeyEvent,
    QKeySequence,
    QPainter,
    QPaintEvent,
    QPalette,
    QResizeEvent,
    QTextLayout,
    QTextOption,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QGridLayout,
    QHeaderView,
    QLabel,
    QPushButton,
    QSizePolicy,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from fingerlab.core.text import held_together

from .layout import Spacer, as_written, described, vbox
from .theme import large_font, small_font

if TYPE_CHECKING:
    from ..app.context import Settings


class ElidedLabel(QLabel):
    """One line that says less where room is short, and at last ends in …; all of it is in the tooltip."""

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(text, parent)
        self._shorter: tuple[str, ...] = ()
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setToolTip(as_written(text))

    def setText(self, text: str) -> None:
        self._shorter = ()
        super().setText(text)
        self.setToolTip(as_written(text))

    def set_texts(self, texts: Sequence[str]) -> None:
        """Wordings, the longest first: the first that has room is drawn."""
        self.setText(texts[0])
        self._shorter = tuple(texts[1:])

    @property
    def seen(self) -> str:
        """What is drawn."""
        mode = Qt.TextElideMode.ElideRight
        return self.fontMetrics().elidedText(self.fitting, mode, self.contentsRect().width())

    @property
    def fitting(self) -> str:
        """The longest wording that has room, else the shortest."""
        room = self.contentsRect().width()
        return next((text for text in self.wordings if self._width(text) <= room), self.wordings[-1])

    @property
    def wordings(self) -> tuple[str, ...]:
        """The longest first."""
        return self.text(), *self._shorter

    def _width(self, text: str) -> int:
        return self.fontMetrics().horizontalAdvance(text)

    def minimumSizeHint(self) -> QSize:
        return QSize(0, super().minimumSizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self.palette().color(self.foregroundRole()))
        painter.drawText(self.contentsRect(), self.alignment() | Qt.TextFlag.TextSingleLine, self.seen)


class FittingLabel(ElidedLabel):
    """One line in the longest of several wordings that has room: never a half of one.

    Its text is the longest, for whoever reads it aloud.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent=parent)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)

    @property
    def seen(self) -> str:
        """The wording that is drawn."""
        return self.fitting

    def minimumSizeHint(self) -> QSize:
        return QSize(min(map(self._width, self.wordings)), super().minimumSizeHint().height())


LINE_BREAK = "\u2028"
"""What Qt's text layout takes for one."""


class LinesLabel(ElidedLabel):
    """As many lines as it is made for, always as high; what has no room there ends in …"""

    def __init__(self, lines: int, parent: QWidget | None = None) -> None:
        super().__init__(parent=parent)
        self._lines = lines

    @property
    def seen(self) -> str:
        text = self.text()
        if self._height(text) <= self.contentsRect().height():
            return text
        short, long = 0, len(text)
        while long - short > 1:  # so many characters have room, so many have not
            middle = (short + long) // 2
            fits = self._height(f"{text[:middle]}…") <= self.contentsRect().height()
            short, long = (middle, long) if fits else (short, middle)
        return f"{text[:short].rstrip()}…"

    @property
    def lines(self) -> list[str]:
        """What is drawn, line by line."""
        text, laid = self.seen, self._laid(self.seen)
        every = [laid.lineAt(number) for number in range(laid.lineCount())]
        return [text[line.textStart() : line.textStart() + line.textLength()] for line in every]

    def _height(self, text: str) -> int:
        return math.ceil(self._laid(text).boundingRect().height())

    def _laid(self, text: str) -> QTextLayout:
        """The lines at this width: broken between words, within one only where it is wider than a line."""
        layout = QTextLayout(text.replace("\n", LINE_BREAK), self.font())
        option = QTextOption(Qt.AlignmentFlag.AlignLeft)
        option.setWrapMode(QTextOption.WrapMode.WrapAtWordBoundaryOrAnywhere)
        layout.setTextOption(option)
        layout.beginLayout()
        top = 0.0
        while (line := layout.createLine()).isValid():
            line.setLineWidth(self.contentsRect().width())
            line.setPosition(QPointF(0.0, top))
            top += line.height()
        layout.endLayout()
        return layout

    def sizeHint(self) -> QSize:
        return QSize(super().sizeHint().width(), self._lines * self.fontMetrics().lineSpacing())

    def minimumSizeHint(self) -> QSize:
        return QSize(0, self.sizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self.palette().color(self.foregroundRole()))
        room, laid = self.contentsRect(), self._laid(self.seen)
        middle = self.alignment() & Qt.AlignmentFlag.AlignVCenter
        spare = room.height() - laid.boundingRect().height() if middle else 0.0
        laid.draw(painter, QPointF(room.left(), room.top() + max(0.0, spare) / 2.0))


class WordsLabel(QLabel):
    """Words whose lines never end between a number and its unit."""

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setText(text)

    def setText(self, text: str) -> None:
        self._text = text
        super().setText(held_together(text))

    def text(self) -> str:
        """The words as they were given."""
        return self._text

    def clear(self) -> None:
        self.setText("")


class WholeLabel(WordsLabel):
    """Wrapped words that keep the height that they need at their width: a layout cuts none of them."""

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(text, parent)
        self.setWordWrap(True)

    def minimumSizeHint(self) -> QSize:
        return QSize(super().minimumSizeHint().width(), max(self.heightForWidth(self.width()), 0))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if event.oldSize().width() != event.size().width():
            self.updateGeometry()


def header_name(name: str, accessible: str, alone: bool = True) -> ElidedLabel:
    """What a tab shows in the window's header, such as a file: bold, short where room is short.

    Args:
        alone: nothing stands beside it, so that it keeps its own distance from the edges.
    """
    label = described(ElidedLabel(), name, accessible=accessible)
    font = label.font()
    font.setBold(True)
    label.setFont(font)
    if alone:
        label.setContentsMargins(16, 0, 8, 0)
    return label


def heading(text: str = "", large: bool = False) -> QLabel:
    """A bold label."""
    label = QLabel(text, textFormat=Qt.TextFormat.PlainText)
    label.setProperty("role", "heading")
    if large:
        label.setFont(large_font())
    return label


def remark(text: str = "", wrap: bool = True) -> QLabel:
    """A quiet label for side remarks."""
    label = described(WordsLabel(text), font=small_font(), role="muted")
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(wrap)
    return label


def whole_remark(text: str = "") -> WholeLabel:
    """A quiet side remark that no layout cuts, whatever stands beside it, and however large letters are."""
    label = described(WholeLabel(text), font=small_font(), role="muted")
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label


EMPTY_MARGINS = (80, 0, 80, 0)
"""Of a page without anything to show, px."""


class EmptyPage(QWidget):
    """The page of a tab that has nothing to show yet: what is missing, and a way to open a session."""

    def __init__(self, name: str, open_asked: SignalInstance) -> None:
        super().__init__()
        self._title, self._text = described(heading(large=True), name), remark()
        self._open = described(QPushButton("&Open a session…"), primary="true")
        self._open.clicked.connect(open_asked)
        column = vbox(self, Spacer(2), self._title, self._text, margins=EMPTY_MARGINS, spacing=16)
        column.addWidget(self._open, 0, Qt.AlignmentFlag.AlignLeft)
        column.addStretch(3)

    def say(self, title: str, text: str, opened: bool) -> None:
        """The two texts; the button stands there while no session is open."""
        self._title.setText(title if opened else "No session open")
        self._text.setText(text)
        self._open.setVisible(not opened)


LINE_ROOM = 6
"""About the words of a row, px."""


class NumberTable(QTableWidget):
    """A table with fixed columns, each a title and what it means."""

    def __init__(
        self,
        name: str,
        accessible: str,
        columns: Sequence[tuple[str, str]],
        words: int = 1,
        parent: QWidget | None = None,
    ) -> None:
        """Args:
        columns: title and meaning of each. words: so many columns at the left hold words, the rest numbers.
        """
        super().__init__(0, 0, parent)
        self.setObjectName(name)
        self.setAccessibleName(accessible)
        self.set_columns(columns, words)
        self.setFont(small_font())
        self.horizontalHeader().setFont(small_font())
        self.horizontalHeader().setHighlightSections(False)  # bold words had been cut where a row is chosen
        self.verticalHeader().hide()
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setTabKeyNavigation(False)  # Tab leaves the table; the arrows move in it
        self.setShowGrid(False)
        copies(self)

    def set_columns(self, columns: Sequence[tuple[str, str]], words: int = 1) -> None:
        """Other columns, and no rows; as for the table itself."""
        self._words = words
        self.setRowCount(0)
        self.setColumnCount(len(columns))
        self.setHorizontalHeaderLabels([title for title, _ in columns])
        for column, (_, meaning) in enumerate(columns):
            item = self.horizontalHeaderItem(column)
            assert item is not None
            item.setToolTip(meaning)
            side = Qt.AlignmentFlag.AlignLeft if column < words else Qt.AlignmentFlag.AlignRight
            item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)

    def show_rows(self, rows: Sequence[Sequence[str]], stretched: int = 0) -> None:
        """Texts of all cells, a line each; one column takes the room that is left."""
        self.setWordWrap(False)  # what is cut is whole in its tooltip
        self.verticalHeader().setDefaultSectionSize(QFontMetrics(self.font()).height() + LINE_ROOM)
        self.setRowCount(len(rows))
        for row, cells in enumerate(rows):
            for column, text in enumerate(cells):
                item = QTableWidgetItem(text)
                words = column < self._words
                side = Qt.AlignmentFlag.AlignLeft if words else Qt.AlignmentFlag.AlignRight
                item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
                item.setToolTip(as_written(text) if words else "")
                self.setItem(row, column, item)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(stretched, QHeaderView.ResizeMode.Stretch)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.matches(QKeySequence.StandardKey.Copy):
            QGuiApplication.clipboard().setText(cells_of(self))
            return
        super().keyPressEvent(event)


def copies(view: QWidget, text: Callable[[], str] | None = None) -> None:
    """Let Ctrl+C and the context menu copy a view as text with tabs.

    Args:
        text: what is copied; None: the cells of a table (:func:`cells_of`).
    """
    copy = QAction("&Copy as a table", view)
    copy.setShortcut(QKeySequence.StandardKey.Copy)
    copy.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)

    def put() -> None:
        made = text() if text is not None else cells_of(view) if isinstance(view, QTableView) else ""
        QGuiApplication.clipboard().setText(made)

    copy.triggered.connect(put)
    view.addAction(copy)
    view.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)


def cells_of(table: QTableView) -> str:
    """A table with its titles as text with tabs: the chosen cells if more than one row is, else all."""
    model, header = table.model(), table.horizontalHeader()
    chosen = table.selectionModel().selectedIndexes() if table.selectionModel() is not None else []
    rows = sorted({index.row() for index in chosen})
    columns = sorted({index.column() for index in chosen}, key=header.visualIndex)
    if len(rows) < 2:
        rows = list(range(model.rowCount()))
        columns = sorted(range(model.columnCount()), key=header.visualIndex)
    columns = [column for column in columns if not table.isColumnHidden(column)]
    across = Qt.Orientation.Horizontal
    lines = [[model.headerData(column, across) for column in columns]]
    return with_tabs([*lines, *([model.index(row, column).data() for column in columns] for row in rows)])


def cells_of_grid(grid: QGridLayout) -> str:
    """The labels of a grid as text with tabs, a line a row."""
    found = [
        [grid.itemAtPosition(row, column) for column in range(grid.columnCount())]
        for row in range(grid.rowCount())
    ]
    labels = [[item.widget() if item is not None else None for item in line] for line in found]
    texts = [[label.text() if isinstance(label, QLabel) else "" for label in line] for line in labels]
    width = max((k + 1 for line in texts for k, text in enumerate(line) if text), default=0)
    return with_tabs([line[:width] for line in texts if any(line)])


def with_tabs(lines: Sequence[Sequence[object]]) -> str:
    """Cells as text with tabs, each in one line."""
    cells = [["" if cell is None else " ".join(str(cell).split()) for cell in line] for line in lines]
    return "\n".join("\t".join(line) for line in cells)


class ColumnKeeper(QObject):
    """Watches the header of one table, which owns it; what was kept last time holds from the start.

    Attributes:
        by_hand: whether the widths are the user's own, so that nobody else shall change them.
    """

    def __init__(self, table: QTableView, settings: Settings) -> None:
        super().__init__(table)
        self._table, self._settings, self._name = table, settings, table.objectName()
        self._pressed: tuple[int, ...] | None = None
        self.by_hand = False
        header = table.horizontalHeader()
        widths = self._settings.widths(self._name)
        if len(widths) == header.count():
            self.by_hand = True
            for column, width in enumerate(widths):
                # A column that was out of sight for want of room has a width of nothing.
                if width and header.sectionResizeMode(column) == QHeaderView.ResizeMode.Interactive:
                    header.resizeSection(column, max(width, header.minimumSectionSize()))
        column, descending = self._settings.sorting(self._name)
        if 0 <= column < header.count():
            order = Qt.SortOrder.DescendingOrder if descending else Qt.SortOrder.AscendingOrder
            self._table.sortByColumn(column, order)
        header.viewport().installEventFilter(self)
        header.sortIndicatorChanged.connect(self._on_sorted)

    def _widths(self) -> tuple[int, ...]:
        header = self._table.horizontalHeader()
        return tuple(header.sectionSize(column) for column in range(header.count()))

    def _on_sorted(self, column: int, order: Qt.SortOrder) -> None:
        self._settings.set_sorting(self._name, column, order == Qt.SortOrder.DescendingOrder)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        # Only what happens between press and release is the user's: the window changes widths as well.
        if event.type() in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick):
            self._pressed = self._widths()
        elif event.type() == QEvent.Type.MouseButtonRelease and self._pressed is not None:
            if self._widths() != self._pressed:
                self.by_hand = True
                self._settings.set_widths(self._name, self._widths())
            self._pressed = None
        return False


Index = QModelIndex | QPersistentModelIndex


class FramedTicks(QStyledItemDelegate):
    """Draws each box, ticked or not, with a frame in the palette's dark colour.

    The style darkens the window's colour for it, and in a list that is the row's own background, so that on
    black there was none; a style sheet can frame the empty box alone, without a picture for the ticked one.
    """

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        """As the base, and a frame around the box."""
        super().paint(painter, option, index)
        if index.data(Qt.ItemDataRole.CheckStateRole) is None:
            return
        own = QStyleOptionViewItem(option)
        self.initStyleOption(own, index)
        style = own.widget.style() if own.widget is not None else QApplication.style()
        box = style.subElementRect(QStyle.SubElement.SE_ItemViewItemCheckIndicator, own, own.widget)
        painter.save()
        painter.setPen(own.palette.color(QPalette.ColorRole.Dark))
        painter.drawRect(box.adjusted(0, 0, -1, -1))
        painter.restore()
