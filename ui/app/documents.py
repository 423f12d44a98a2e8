"""The documents inside the window, without a network; what a word of the window means, where it stands."""

from __future__ import annotations

import re
from html import escape
from itertools import groupby
from typing import Any

import numpy as np
from PySide6.QtCore import QByteArray, QEvent, QPoint, QRectF, QSignalBlocker, Qt, QUrl
from PySide6.QtGui import (
    QColor,
    QDesktopServices,
    QHelpEvent,
    QImage,
    QPainter,
    QTextCharFormat,
    QTextCursor,
    QTextDocument,
    QTextFrameFormat,
    QTextLength,
    QTextTable,
    QWhatsThisClickedEvent,
)
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QComboBox,
    QDialog,
    QHeaderView,
    QLabel,
    QLineEdit,
    QPushButton,
    QSplitter,
    QTableView,
    QTextBrowser,
    QTreeWidget,
    QTreeWidgetItem,
    QWhatsThis,
    QWidget,
)

from fingerlab.report import documents

from ..widgets.layout import FLUSH, Spacer, described, hbox, resize_on_screen, vbox
from ..widgets.theme import colours_of

WIDTH, HEIGHT, CONTENTS_WIDTH = 1080, 720, 260
PICTURE_WIDTH = 700
"""Of a page's pictures, px at most, so that they fit beside the contents."""
FORMULA_POINTS = 9.5
HEADING_ROOM = 18
GROUPS = {"catalogue": "Catalogue of effects", "tutorials": "Tutorials"}
ROLES = (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole)
ACROSS = Qt.Orientation.Horizontal
MOST_WORDS = 5
"""Words of the glossary that are told at one place."""


class PageView(QTextBrowser):
    """One page; links between pages stay in it, others go to the browser of the computer."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        described(self, "documentPage", accessible="Page of the documents")
        self.setOpenLinks(False)
        self.page = ""
        self._formulas: list[str] = []
        self._drawings: list[str] = []

    def show_page(self, page: str, anchor: str = "") -> None:
        """Show a page, from the heading that ``anchor`` names."""
        text = documents.pages()[page]
        self.page, self._drawings = page, re.findall(r"<svg.*?</svg>", text, re.DOTALL)
        for number, drawing in enumerate(self._drawings):
            text = text.replace(drawing, f"\n\n![drawing](drawing:{number})\n\n")
        text, self._formulas = documents.with_formulas(re.sub(r"</?div[^>]*>", "", text))
        self.document().clear()
        self.document().setMarkdown(text, QTextDocument.MarkdownFeature.MarkdownDialectGitHub)
        self._dress()
        self.moveCursor(QTextCursor.MoveOperation.Start)
        block = self.document().begin()
        while anchor and block.isValid():
            if block.blockFormat().headingLevel() and documents.slug(block.text()) == anchor:
                break
            block = block.next()
        if anchor and block.isValid():
            self._bring_up(QTextCursor(block))

    def _dress(self) -> None:
        """Lines about the cells of tables, formulas on the line, and code in its own letters."""
        for frame in self.document().rootFrame().childFrames():
            if isinstance(frame, QTextTable):
                form = frame.format()
                form.setCellPadding(5)
                form.setCellSpacing(0)
                form.setBorder(1)
                form.setBorderCollapse(True)
                form.setBorderStyle(QTextFrameFormat.BorderStyle.BorderStyle_Solid)
                form.setBorderBrush(QColor(colours_of(self).line))
                form.setWidth(QTextLength(QTextLength.Type.PercentageLength, 100))
                frame.setFormat(form)
        on_the_line = QTextCharFormat()
        on_the_line.setVerticalAlignment(QTextCharFormat.VerticalAlignment.AlignMiddle)
        cursor = QTextCursor(self.document())
        block = self.document().begin()
        while block.isValid():
            if block.blockFormat().headingLevel() > 1:
                roomy = block.blockFormat()
                roomy.setTopMargin(HEADING_ROOM)
                QTextCursor(block).setBlockFormat(roomy)
            parts: Any = block  # a block is the sequence of its fragments
            for place in [part.fragment() for part in parts]:
                if place.charFormat().toImageFormat().name().startswith("formula:"):
                    cursor.setPosition(place.position())
                    cursor.setPosition(place.position() + place.length(), QTextCursor.MoveMode.KeepAnchor)
                    cursor.mergeCharFormat(on_the_line)
            block = block.next()

    def find_row(self, word: str) -> None:
        """Bring up the row of a table whose first words hold ``word``, and choose it."""
        for frame in self.document().rootFrame().childFrames():
            if not isinstance(frame, QTextTable):
                continue
            for row in range(frame.rows()):
                cursor = frame.cellAt(row, 0).firstCursorPosition()
                if re.search(rf"\b{re.escape(word)}\b", cursor.block().text()):
                    cursor.movePosition(QTextCursor.MoveOperation.EndOfBlock, QTextCursor.MoveMode.KeepAnchor)
                    self._bring_up(cursor)
                    return

    def _bring_up(self, cursor: QTextCursor) -> None:
        end = self.textCursor()
        end.movePosition(QTextCursor.MoveOperation.End)
        self.setTextCursor(end)  # so that it comes to the top, not to the bottom
        self.setTextCursor(cursor)
        self.ensureCursorVisible()

    def loadResource(self, kind: int, name: QUrl | str) -> Any:
        """Pictures of the folder, formulas and drawings of this page."""
        url = QUrl(name) if isinstance(name, str) else name
        if url.scheme() in ("formula", "drawing"):
            number, formula = int(url.path()), url.scheme() == "formula"
            return self._formula(self._formulas[number]) if formula else self._drawing(self._drawings[number])
        place = documents.folder() / documents.resolved(self.page, url.path())
        return self._fitted(QImage(str(place))) if place.suffix == ".png" else None

    def _fitted(self, image: QImage) -> QImage:
        width = round(PICTURE_WIDTH * self.devicePixelRatioF())
        if image.width() > width:
            image = image.scaledToWidth(width, Qt.TransformationMode.SmoothTransformation)
            image.setDevicePixelRatio(self.devicePixelRatioF())
        return image

    def _formula(self, latex: str) -> QImage:
        """A line of LaTeX, with as much room above the middle of its letters as below: it stands level."""
        from matplotlib.font_manager import FontProperties
        from matplotlib.mathtext import MathTextParser

        ratio = self.devicePixelRatioF()
        letters = FontProperties(size=FORMULA_POINTS, math_fontfamily="dejavusans")
        drawn = MathTextParser("agg").parse(f"${latex}$", 72.0 * 4 / 3 * ratio, letters)
        ink = np.asarray(drawn.image, dtype=np.uint8)
        above = round(ink.shape[0] - drawn.depth - 3.0 * ratio)  # the middle of a small letter is 3 px up
        below = ink.shape[0] - above
        room = max(above, below)
        alpha = np.zeros((2 * room, ink.shape[1]), dtype=np.uint8)
        alpha[room - above : room + below] = ink
        colour = self.palette().text().color()
        pixels = np.empty((*alpha.shape, 4), dtype=np.uint8)
        pixels[..., :3] = colour.blue(), colour.green(), colour.red()
        pixels[..., 3] = alpha
        height, width = alpha.shape
        image = QImage(pixels.tobytes(), width, height, 4 * width, QImage.Format.Format_ARGB32).copy()
        image.setDevicePixelRatio(ratio)
        return image

    def _drawing(self, svg: str) -> QImage:
        from PySide6.QtSvg import QSvgRenderer

        ink = self.palette().text().color().name()
        words = f"text{{fill:{ink};text-anchor:middle;font-size:12px}}"
        style = f"<style>rect{{fill:none;stroke:{ink}}}{words}</style>"
        drawn = svg.replace("currentColor", ink)
        if 'class="arrows"' in drawn:  # its colours come from the style of the pages
            drawn = drawn.replace("<defs>", f"{style}<defs>", 1)
        renderer = QSvgRenderer(QByteArray(drawn.encode()))
        size = renderer.viewBoxF().size() * min(1.0, PICTURE_WIDTH / max(renderer.viewBoxF().width(), 1.0))
        ratio = self.devicePixelRatioF()
        image = QImage((size * ratio).toSize(), QImage.Format.Format_ARGB32_Premultiplied)
        image.setDevicePixelRatio(ratio)
        image.fill(Qt.GlobalColor.transparent)
        painter = QPainter(image)
        renderer.render(painter, QRectF(0, 0, size.width(), size.height()))
        painter.end()
        return image

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and self.page:
            bar, chosen = self.verticalScrollBar(), self.textCursor()
            read, places = bar.value(), (chosen.anchor(), chosen.position())
            self.show_page(self.page)  # formulas and lines in the new colours, at the place that was read
            chosen = self.textCursor()
            chosen.setPosition(places[0])
            chosen.setPosition(places[1], QTextCursor.MoveMode.KeepAnchor)
            self.setTextCursor(chosen)
            bar.setValue(read)


def _folder(page: str) -> str:
    return page.rpartition("/")[0]


class Documents(QDialog):
    """Contents and search at the left, the page beside; stays open beside the window."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("documents")
        self.setWindowTitle("Documents – FingerLab")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.wanted = described(
            QLineEdit(), "documentSearch", accessible="Search", tip="Pages that hold all these words."
        )
        self.wanted.setPlaceholderText("Search all pages")
        self.wanted.setClearButtonEnabled(True)
        self.contents = described(QTreeWidget(), "documentContents", accessible="Contents")
        self.contents.setHeaderHidden(True)
        self.none = described(QLabel("No page holds all these words.", wordWrap=True), role="remark")
        self.view = PageView()
        self.back = described(QPushButton("&Back"), "documentBack", tip="The page before.")
        self._been: list[str] = []
        left, right, panes = QWidget(), QWidget(), QSplitter()
        vbox(left, self.wanted, self.none, (self.contents, 1), margins=FLUSH, spacing=8)
        vbox(right, hbox(None, self.back, Spacer(1)), (self.view, 1), margins=FLUSH, spacing=8)
        panes.addWidget(left)
        panes.addWidget(right)
        panes.setSizes([CONTENTS_WIDTH, WIDTH - CONTENTS_WIDTH])
        panes.setStretchFactor(1, 1)
        vbox(self, panes, margins=(8, 8, 8, 8))
        resize_on_screen(self, WIDTH, HEIGHT)
        self._fill()
        self.wanted.textChanged.connect(self._search)
        self.contents.currentItemChanged.connect(self._on_chosen)
        self.back.clicked.connect(self.go_back)
        self.view.anchorClicked.connect(self._on_link)

    def _fill(self) -> None:
        pages = documents.pages()
        for folder, members in groupby(sorted(pages, key=_folder), key=_folder):
            top: QTreeWidget | QTreeWidgetItem = self.contents
            if folder:
                top = QTreeWidgetItem(self.contents, [GROUPS.get(folder, folder)])
            for page in members:
                item = QTreeWidgetItem(top, [documents.title_of(pages[page])])
                item.setData(0, Qt.ItemDataRole.UserRole, page)
        self._search("")

    def _items(self) -> list[QTreeWidgetItem]:
        exactly = Qt.MatchFlag.MatchRecursive | Qt.MatchFlag.MatchContains
        return self.contents.findItems("", exactly)

    def _search(self, text: str) -> None:
        """Only pages that hold all words; their groups open where something is looked for."""
        words, pages, hits = text.lower().split(), documents.pages(), 0
        for item in self._items():
            page = item.data(0, Qt.ItemDataRole.UserRole)
            if page is not None:
                found = all(word in pages[page].lower() for word in words)
                hits += found
                item.setHidden(not found)
        for group in self._items():
            inside = [item for item in map(group.child, range(group.childCount())) if item is not None]
            if inside:
                group.setHidden(all(item.isHidden() for item in inside))
                group.setExpanded(bool(words))
        self.none.setVisible(not hits)

    def open_page(self, page: str, anchor: str = "", word: str = "") -> None:
        """Show a page, a heading of it, or the row of a word; the page before can be gone back to."""
        if self.view.page and self.view.page != page:
            self._been.append(self.view.page)
        if self.view.page != page or not word:
            self.view.show_page(page, anchor)
        if word:
            self.view.find_row(word)
        self.back.setEnabled(bool(self._been))
        with QSignalBlocker(self.contents):
            for item in self._items():
                if item.data(0, Qt.ItemDataRole.UserRole) == page:
                    self.contents.setCurrentItem(item)

    def go_back(self) -> None:
        """The page before."""
        if self._been:
            page = self._been.pop()
            self.view.page = ""
            self.open_page(page)

    def _on_chosen(self, item: QTreeWidgetItem | None, _before: object) -> None:
        page = item.data(0, Qt.ItemDataRole.UserRole) if item is not None else None
        if page is not None and page != self.view.page:
            self.open_page(page)
            words = self.wanted.text().split()
            if words:
                self.view.find(words[0])

    def _on_link(self, url: QUrl) -> None:
        page = documents.resolved(self.view.page, url.path()) if url.path() else self.view.page
        if url.scheme():
            QDesktopServices.openUrl(url)
        elif page in documents.pages():
            self.open_page(page, url.fragment())
        else:  # such as a figure, or a file of the checkout
            place = documents.folder() / page
            if place.exists():
                QDesktopServices.openUrl(QUrl.fromLocalFile(str(place)))


def show_documents(parent: QWidget, page: str = documents.FIRST, word: str = "") -> Documents:
    """The documents at a page, or at a word of the glossary; the dialog that is open already, if one is.

    Raises:
        UserError: this installation holds none.
    """
    documents.pages()
    dialog = parent.findChild(Documents) or Documents(parent)
    dialog.open_page(page, word=word)
    dialog.show()
    dialog.raise_()
    dialog.activateWindow()
    return dialog


def explains(window: QWidget, event: QEvent) -> bool:
    """Whether this event asked what something in the window is; it is then answered.

    What's This (Shift+F1 and a click) tells what the thing under the mouse says of itself, and what the
    glossary says of the words in it.
    """
    if isinstance(event, QWhatsThisClickedEvent):
        show_documents(window, documents.GLOSSARY, word=event.href())
        return True
    if not isinstance(event, QHelpEvent) or event.type() == QEvent.Type.ToolTip:
        return False
    if event.type() == QEvent.Type.WhatsThis:
        said = _said_at(window, event.pos())
        QWhatsThis.showText(event.globalPos(), explanation(said), window)
    event.accept()
    return True


def explanation(said: list[str]) -> str:
    """What a thing says of itself, and the words of the glossary in it, as rich text."""
    found = list(documents.words_in(" ".join(said)).items())[:MOST_WORDS]
    lines = [escape(said[-1]).replace("\n", "<br>")] if said else []
    lines += [
        f'<a href="{escape(word, quote=True)}"><b>{escape(entry)}</b></a>: {escape(text)}.'
        for word, (entry, text) in found
    ]
    if not found:
        lines.append('No word of the <a href="floor">glossary</a> stands here.')
    return "<qt>" + "<br><br>".join(lines) + "</qt>"


def _of_column(view: QAbstractItemView, place: QPoint) -> list[str]:
    """Title and help of the column of a table at a place of its cells or of its head."""
    if isinstance(view, QHeaderView):
        column = view.logicalIndexAt(place) if view.orientation() == ACROSS else -1
    else:
        column = view.indexAt(place).column() if isinstance(view, QTableView) else -1
    if column < 0:
        return []
    texts = [view.model().headerData(column, ACROSS, role) for role in ROLES]
    return [str(text).replace("\n", " ") for text in texts if text]


def _said_at(window: QWidget, place: QPoint) -> list[str]:
    """What the thing at a place shows, its name, and at last its tooltip; of a cell its column's, too."""
    widget: QWidget | None = window.childAt(place)
    said: list[str] = []
    while widget is not None and widget is not window:
        view = widget.parentWidget()
        if isinstance(view, QAbstractItemView) and widget is view.viewport():
            of_column = _of_column(view, widget.mapFrom(window, place))
            index = view.indexAt(widget.mapFrom(window, place))
            said += [str(index.data(role)) for role in ROLES if index.isValid() and index.data(role)]
            if of_column:  # what a column is tells more than what the table is
                said += of_column
                break
        if isinstance(widget, QAbstractButton | QLabel):
            said.append(widget.text())
        if isinstance(widget, QComboBox):
            said.append(widget.currentText())
        said += [text for text in (widget.accessibleName(), widget.toolTip()) if text]
        if widget.toolTip():  # those of what is around it tell of something else
            break
        widget = view
    return [re.sub(r"<[^>]+>", " ", text).replace("&", "").strip() for text in said if text.strip()]
