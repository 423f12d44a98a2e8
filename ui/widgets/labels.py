"""Labels: one that shortens its text instead of cutting it off, and makers for the usual roles."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from .layout import as_written, described
from .theme import large_font, small_font


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

    def _height(self, text: str) -> int:
        room = self.contentsRect()
        wraps = Qt.TextFlag.TextWordWrap | Qt.TextFlag.TextWrapAnywhere
        return self.fontMetrics().boundingRect(0, 0, room.width(), 1 << 16, wraps, text).height()

    def sizeHint(self) -> QSize:
        return QSize(super().sizeHint().width(), self._lines * self.fontMetrics().lineSpacing())

    def minimumSizeHint(self) -> QSize:
        return QSize(0, self.sizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self.palette().color(self.foregroundRole()))
        wraps = Qt.TextFlag.TextWordWrap | Qt.TextFlag.TextWrapAnywhere
        painter.drawText(self.contentsRect(), self.alignment() | wraps, self.seen)


class WholeLabel(QLabel):
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
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setProperty("role", "heading")
    if large:
        label.setFont(large_font())
    return label


def remark(text: str = "", wrap: bool = True) -> QLabel:
    """A quiet label for side remarks."""
    label = described(QLabel(text), font=small_font(), role="muted")
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(wrap)
    return label
