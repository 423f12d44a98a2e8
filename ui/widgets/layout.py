"""Where widgets stand: in columns and rows, rooms that scroll, panes with grips, dialogs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, TypeVar

from PySide6.QtCore import QEvent, QObject, QSize
from PySide6.QtGui import QFont, QResizeEvent, Qt
from PySide6.QtWidgets import (
    QApplication,
    QBoxLayout,
    QDialog,
    QDialogButtonBox,
    QFrame,
    QHBoxLayout,
    QLayout,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QSplitter,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

if TYPE_CHECKING:
    from ..app.context import Settings


def as_written(text: str) -> str:
    """A text for a tooltip: markup in what others wrote is shown, not obeyed."""
    return f"<qt>{escape(text)}</qt>".replace("\n", "<br>") if Qt.mightBeRichText(text) else text


GAP = 8
FLUSH = (0, 0, 0, 0)
"""Margins of a layout that has none of its own."""

SomeWidget = TypeVar("SomeWidget", bound=QWidget)


def described(
    widget: SomeWidget,
    name: str = "",
    accessible: str = "",
    tip: str = "",
    font: QFont | None = None,
    **properties: str,
) -> SomeWidget:
    """The widget with its object name, its accessible name, its tooltip, and properties of the style."""
    if name:
        widget.setObjectName(name)
    if accessible:
        widget.setAccessibleName(accessible)
    if tip:
        widget.setToolTip(tip)
    if font is not None:
        widget.setFont(font)
    for key, value in properties.items():
        widget.setProperty(key, value)
    return widget


@dataclass(frozen=True)
class Spacer:
    """Room of a layout that takes a share of what is left."""

    share: int = 0


Item = QWidget | QLayout | Spacer | int | tuple[Any, ...]
"""Of a layout: what stands there, px that stay free, or what stands there with its share and alignment."""
SomeLayout = TypeVar("SomeLayout", bound=QBoxLayout)


def vbox(
    owner: QWidget | None,
    *items: Item,
    margins: tuple[int, int, int, int] | None = None,
    spacing: int | None = None,
) -> QVBoxLayout:
    """Items above one another; the style's own margins and spacing where none are given."""
    return _filled(QVBoxLayout() if owner is None else QVBoxLayout(owner), items, margins, spacing)


def hbox(
    owner: QWidget | None,
    *items: Item,
    margins: tuple[int, int, int, int] | None = None,
    spacing: int | None = None,
) -> QHBoxLayout:
    """Items beside one another."""
    return _filled(QHBoxLayout() if owner is None else QHBoxLayout(owner), items, margins, spacing)


def _filled(
    layout: SomeLayout, items: Sequence[Item], margins: tuple[int, int, int, int] | None, spacing: int | None
) -> SomeLayout:
    if margins is not None:
        layout.setContentsMargins(*margins)
    if spacing is not None:
        layout.setSpacing(spacing)
    for item in items:
        if isinstance(item, Spacer):
            layout.addStretch(item.share)
        elif isinstance(item, int):
            layout.addSpacing(item)
        else:
            what, *how = item if isinstance(item, tuple) else (item,)
            (layout.addLayout if isinstance(what, QLayout) else layout.addWidget)(what, *how)
    return layout


class WrappedRow(QWidget):
    """Widgets side by side, in as many rows as the width asks for, each as full as it can be.

    Args:
        items: widgets as wide as they like to be; with a share beside it, one that takes that share of what
            its row has left, and less than it likes where room is short.
    """

    def __init__(
        self,
        items: Sequence[QWidget | tuple[QWidget, int]],
        parent: QWidget | None = None,
        spacing: int = GAP,
    ) -> None:
        super().__init__(parent)
        self._items = [item if isinstance(item, tuple) else (item, 0) for item in items]
        self._gap = spacing
        for widget, _ in self._items:
            widget.setParent(self)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)

    def _rows(self, room: int) -> list[list[tuple[QWidget, int, int]]]:
        """Row by row what stands there in so much room: widget, least width, share."""
        rows: list[list[tuple[QWidget, int, int]]] = [[]]
        x = 0
        for widget, share in self._items:
            if widget.isHidden():
                continue
            least = widget.minimumSizeHint() if share else widget.sizeHint()
            width = max(least.width(), widget.minimumWidth())
            if rows[-1] and x + width > room:
                rows.append([])
                x = 0
            rows[-1].append((widget, width, share))
            x += width + self._gap
        return rows

    @property
    def rows(self) -> int:
        """How many there are now."""
        return len(self._rows(self.width()))

    def _height(self, room: int) -> int:
        tall = [max((_tall(w) for w, *_ in row), default=0) for row in self._rows(room)]
        return sum(tall) + self._gap * (len(tall) - 1)

    def sizeHint(self) -> QSize:
        across = [w.sizeHint().width() + self._gap for w, _ in self._items if not w.isHidden()]
        return QSize(max(sum(across) - self._gap, 0), self._height(self.width()))

    def minimumSizeHint(self) -> QSize:
        widest = max((width for row in self._rows(0) for _, width, _ in row), default=0)
        return QSize(widest, self._height(self.width()))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._put()
        if event.oldSize().width() != event.size().width():
            self.updateGeometry()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:  # one of them says more or less, comes or goes
            self._put()
            self.updateGeometry()
        return super().event(event)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() in (QEvent.Type.FontChange, QEvent.Type.StyleChange):
            self._put()
            self.updateGeometry()

    def _put(self) -> None:
        y = 0
        for row in self._rows(self.width()):
            tall = max((_tall(widget) for widget, *_ in row), default=0)
            spare = self.width() - sum(width for _, width, _ in row) - self._gap * (len(row) - 1)
            shares, x = sum(share for *_, share in row), 0
            for widget, least, share in row:
                width = least + (max(spare, 0) * share // shares if share else 0)
                high = _tall(widget)
                widget.setGeometry(x, y + (tall - high) // 2, width, high)
                x += width + self._gap
            y += tall + self._gap


def _tall(widget: QWidget) -> int:
    """What it gets in a row; the style may ask for more than the widget."""
    return max(widget.sizeHint().height(), widget.minimumHeight())


class _Fitted(QScrollArea):
    """A scroll area without a look of its own, which fits what is in it anew whenever either changes."""

    def __init__(self, inner: QWidget, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.viewport().setAutoFillBackground(False)
        self.setWidget(inner)
        inner.setAutoFillBackground(False)  # a scroll area turns it on, over the window's own colour

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        # A tab whose page changes may need more or less than before.
        if watched is self.widget() and event.type() == QEvent.Type.LayoutRequest:
            self._fit()
        return super().eventFilter(watched, event)

    def _fit(self) -> None:
        raise NotImplementedError


class Room(_Fitted):
    """Gives one widget the whole room, and more where that is less than it needs at least.

    Qt's own resizing goes by the height that wrapped words would like, not by what they need.
    """

    def minimumSizeHint(self) -> QSize:
        return QSize(0, 0)

    def _fit(self) -> None:
        inner = self.widget()
        if inner is not None:
            needed = inner.minimumSizeHint().expandedTo(inner.minimumSize())
            room = self.maximumViewportSize()
            bar = self.verticalScrollBar().sizeHint().width()
            across = room.width() - (bar if needed.height() > room.height() else 0)
            down = room.height() - (bar if needed.width() > across else 0)
            inner.resize(QSize(across, down).expandedTo(needed))


class SideRoom(_Fitted):
    """Room for a side panel of fixed width, which scrolls by itself where the window is too low for it.

    What stands beside it, such as plots, stays in view meanwhile.
    """

    def __init__(self, inner: QWidget, parent: QWidget | None = None) -> None:
        super().__init__(inner, parent)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._fit()

    def minimumSizeHint(self) -> QSize:
        return QSize(self.minimumWidth(), 0)

    def _fit(self) -> None:
        inner = self.widget()
        if inner is not None:
            across, needed = inner.minimumWidth(), inner.minimumSizeHint().height()
            layout = inner.layout()
            if layout is not None and layout.hasHeightForWidth():  # words that are wrapped at this width
                needed = max(needed, layout.totalMinimumHeightForWidth(across))
            bar = self.verticalScrollBar().sizeHint().width() if needed > self.height() else 0
            self.setFixedWidth(across + bar)
            inner.resize(across, max(needed, self.height()))


class Pages(QWidget):
    """Pages of which one is shown, and which take no more room than that one; a stack takes the tallest's."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pages: list[QWidget] = []
        self._column = vbox(self, margins=FLUSH)

    def add(self, page: QWidget) -> None:
        """One more page; the first is shown."""
        self._column.addWidget(page)
        if self._pages:
            page.hide()
        self._pages.append(page)

    def show_page(self, number: int) -> None:
        """The page of this number, in the place of the one that was shown."""
        for one, page in enumerate(self._pages):
            page.setVisible(one == number)


class OnePage(QStackedWidget):
    """Pages of which one is shown, and which need no more room than that one."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.currentChanged.connect(lambda _: QApplication.postEvent(self, QEvent(QEvent.Type.LayoutRequest)))

    def minimumSizeHint(self) -> QSize:
        shown = self.currentWidget()
        return shown.minimumSizeHint() if shown is not None else QSize(0, 0)


class Panes(QSplitter):
    """A splitter, vertical if nothing else is said, of which no part can be dragged away.

    Args:
        parts: each widget with its share of the room that a larger window gives.
        heights: px at first, widths where it is horizontal; None leaves them to the widgets.
    """

    def __init__(
        self,
        name: str,
        parts: Sequence[tuple[QWidget, int]],
        heights: Sequence[int] | None = None,
        orientation: Qt.Orientation = Qt.Orientation.Vertical,
    ) -> None:
        super().__init__(orientation)
        self.setObjectName(name)
        self.setChildrenCollapsible(False)
        for widget, share in parts:
            self.addWidget(widget)
            self.setStretchFactor(self.count() - 1, share)
        if heights is not None:
            self.setSizes(list(heights))

    def remember(self, settings: Settings) -> None:
        """Take the heights that the user left here last time, and keep those to come.

        They are kept at once, not when the window closes: a program that is killed loses nothing.
        """
        kept = settings.heights(self.objectName())
        if len(kept) == self.count():
            self.setSizes(list(kept))
        self.splitterMoved.connect(lambda *_: settings.set_heights(self.objectName(), self.sizes()))


USUAL_LETTER = 6.0
"""Mean width of a letter for which widths in px were measured, px."""
TITLE_BAR_HEIGHT = 40
"""px that a desktop puts above a window (assumed)."""


def resize_on_screen(window: QWidget, width: int, height: int) -> None:
    """Give a window this size, px, more width where letters are larger, or less height on a low screen."""
    screen = window.screen().availableGeometry()
    wider = round(width * max(window.fontMetrics().averageCharWidth() / USUAL_LETTER, 1.0))
    window.resize(max(width, min(wider, screen.width())), min(height, screen.height() - TITLE_BAR_HEIGHT))


class ResultDialog(QDialog):
    """A window beside the main one that shows something, until its button or Escape shuts it.

    Args:
        title: in front of the program's name. width, height: px.
    """

    def __init__(self, parent: QWidget | None, name: str, title: str, width: int, height: int) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setWindowTitle(f"{title} – FingerLab")
        resize_on_screen(self, width, height)

    def lay_out(self, *items: Item) -> QPushButton:
        """Items above one another, and below them the button that shuts it."""
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        vbox(self, *items, buttons, spacing=8)
        return buttons.button(QDialogButtonBox.StandardButton.Close)


def fix_width(panel: QWidget, usual: int) -> None:
    """Give a panel at the side its width: the usual one, px, or what its words need where letters are larger.

    To be called when all is in it.
    """
    panel.setFixedWidth(max(usual, panel.minimumSizeHint().width()))
