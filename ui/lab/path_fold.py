"""Where the error path stands: below all, or, in a window too low for that, in place of the candidates."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QPushButton, QStackedWidget, QWidget

from ..widgets.layout import FLUSH, described, vbox
from ..widgets.theme import small_font
from .error_path import PathPanel

THERE, BACK = "Error path", "Candidates"
HELP = {
    THERE: "The error from model to model, with undo and redo; the window is too low to show it below.",
    BACK: "The candidates again.",
}


class PathFold(QWidget):
    """A strip with the error path. Signal ``asked``: the path in place of the candidates, or these again.

    Attributes:
        page: of ``below``; holds the path while it is folded. link: leads there and back, seen only then.
    """

    asked = Signal()

    def __init__(self, path: PathPanel, below: QStackedWidget) -> None:
        super().__init__()
        self._path = path
        self._strip = vbox(self, path, margins=FLUSH)
        self.page = QWidget()
        self._room = vbox(self.page, margins=FLUSH)
        below.addWidget(self.page)
        below.currentChanged.connect(lambda _: self._say(below.currentWidget() is self.page))
        self.link = described(QPushButton(), "showErrorPath", font=small_font(), link="true")
        self.link.clicked.connect(self.asked)
        self.link.hide()
        self._say(False)

    @property
    def folded(self) -> bool:
        """Whether the path has no room of its own."""
        return self.isHidden()

    @property
    def needed(self) -> int:
        """What the path needs as a strip of its own, px, wherever it is now."""
        return self._path.height_of_strip

    def fold(self, on: bool) -> None:
        """Take the path out of its strip, or put it there again."""
        if on == self.folded:
            return
        if on:
            self._room.addWidget(self._path)
        else:
            self._strip.addWidget(self._path)
        self._path.stack(on)
        self.setHidden(on)
        self.link.setVisible(on)

    def _say(self, shown: bool) -> None:
        words = BACK if shown else THERE
        self.link.setText(words)
        self.link.setToolTip(HELP[words])
