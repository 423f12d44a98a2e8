"""Widgets above one another with grips between them, that come back as they were left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter, QWidget

if TYPE_CHECKING:
    from ..settings import Settings


class Panes(QSplitter):
    """A vertical splitter of which no part can be dragged away.

    Args:
        parts: each widget with its share of the room that a larger window gives.
        heights: px at first; None leaves them to the widgets.
    """

    def __init__(
        self, name: str, parts: Sequence[tuple[QWidget, int]], heights: Sequence[int] | None = None
    ) -> None:
        super().__init__(Qt.Orientation.Vertical)
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
