"""Laws drafted for what the catalogue does not explain: what is seen, and what each law tells of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QLabel, QListWidget, QPushButton, QWidget

from ..widgets.layout import described, hbox, resize_on_screen, vbox
from ..widgets.tables import remark
from .evidence import FingerprintPlot

if TYPE_CHECKING:
    from fingerlab.diagnosis.draft.laws import DraftLaw
    from fingerlab.diagnosis.score.fitted_model import FittedModel

WIDTH, HEIGHT = 900, 640
ROOM = 4
"""Below the last law of the list, px."""
ABOUT = (
    "Points: what the model misses, with 90 % intervals; line: what the whole law tells of it. A law is a "
    "description until it holds on runs that it was not drafted from."
)


class DraftDialog(QDialog):
    """The drafted laws, best first, each with a plot and its words; ``own_asked`` with one to go on with."""

    own_asked = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("draftedLaws")
        self.setWindowTitle("Drafted laws – FingerLab")
        resize_on_screen(self, WIDTH, HEIGHT)
        self._laws: tuple[DraftLaw, ...] = ()
        self.list = described(QListWidget(), "draftList", accessible="Drafted laws, best first")
        self.list.currentRowChanged.connect(self._show)
        self.plot = FingerprintPlot()
        self.words = described(QLabel(), "draftWords")
        self.words.setTextFormat(Qt.TextFormat.PlainText)
        self.words.setWordWrap(True)
        self.words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.own = described(QPushButton("&Make it an own effect…"), "draftOwn")
        self.own.setToolTip("Write a file with the law, its parameters and an explanation to edit.")
        self.own.clicked.connect(self._ask)
        self.hint = remark(ABOUT)
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        vbox(
            self,
            self.list,
            (self.plot, 1),
            self.words,
            self.hint,
            hbox(None, self.own, 1, close, spacing=8),
            spacing=8,
        )

    def show_laws(self, laws: Sequence[DraftLaw], last: FittedModel | None) -> None:
        """Other laws, or none; ``last``: the model that they stand beside."""
        from fingerlab.diagnosis.draft.laws import nothing_drafted

        self._laws = tuple(laws)
        self.list.clear()
        for number, law in enumerate(self._laws, 1):
            self.list.addItem(f"{number}. {law.title} ({law.score_before:.2f} to {law.score:.2f} floors)")
        for part in (self.list, self.plot, self.hint, self.own):
            part.setVisible(bool(self._laws))
        self.words.setText("" if self._laws else nothing_drafted(last))
        self.list.setCurrentRow(0)
        rows = sum(self.list.sizeHintForRow(row) for row in range(self.list.count()))
        self.list.setFixedHeight(rows + 2 * self.list.frameWidth() + ROOM)
        # A sentence alone needs no more than its lines.
        resize_on_screen(self, WIDTH, HEIGHT if self._laws else 0)

    @property
    def chosen(self) -> DraftLaw | None:
        """The law that is shown."""
        row = self.list.currentRow()
        return self._laws[row] if 0 <= row < len(self._laws) else None

    def _show(self, _row: int) -> None:
        law = self.chosen
        if law is not None:
            self.plot.show_fingerprint(law.fingerprint)
            self.words.setText("\n".join(line.strip() for line in law.story.splitlines()))

    def _ask(self) -> None:
        if self.chosen is not None:
            self.own_asked.emit(self.chosen)
