"""Page over two benches: which effects they share, each with its probability and strengths."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QWidget

from fingerlab.batch.benches import folders_of, shared_effects, two_groups
from fingerlab.batch.table import Contents
from fingerlab.core.errors import UserError
from fingerlab.report.time_words import SHARED_HEADINGS, shared_cells, shared_sentence

from ..widgets.layout import Spacer, described, hbox, vbox
from ..widgets.tables import NumberTable, WholeLabel, remark
from ..widgets.theme import small_font

MEANINGS = (
    "Found in any session of either bench.",
    "Which bench has it: both alike, both of another strength, or one.",
    "Of that.",
    "The number that tells how strong it is.",
    "On the first bench, with its 90 % interval.",
    "On the second bench, with its 90 % interval.",
    "Zero inside the interval: no difference is seen.",
)
NAME_HELP = "A folder below this one, or a pattern of session names such as left-*; then Compare, or Enter."


def _name(name: str, words: str) -> QComboBox:
    field = described(QComboBox(), name, accessible=words, tip=f"{words}. {NAME_HELP}")
    field.setEditable(True)
    field.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
    field.setMinimumContentsLength(16)
    return field


class BenchesPage(QWidget):
    """Two lists of names, a table with a row for each strength, and a sentence for each effect."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.first = _name("firstBench", "Sessions of the first bench")
        self.second = _name("secondBench", "Sessions of the second bench")
        for field in (self.first, self.second):
            field.activated.connect(self.compare)
            line = field.lineEdit()
            assert line is not None
            line.returnPressed.connect(self.compare)
        columns = tuple(zip(SHARED_HEADINGS, MEANINGS, strict=True))
        self.table = NumberTable("sharedTable", "Effects on two benches", columns, words=4)
        self.words = described(WholeLabel(), "sharedWords", font=small_font())
        self.hint = remark(
            "Both alike, both of another strength, one alone and neither are weighed against one another by "
            "their evidence. Ctrl+C copies the table."
        )
        self.button = described(QPushButton("Co&mpare"), "compareBenches", tip="Of the two that are named.")
        self.button.clicked.connect(self.compare)
        self._contents: Contents | None = None
        first, second = QLabel("&First"), QLabel("&Second")
        first.setBuddy(self.first)
        second.setBuddy(self.second)
        chosen = hbox(None, first, self.first, second, self.second, self.button, Spacer(1), spacing=8)
        vbox(self, chosen, self.words, (self.table, 1), self.hint, Spacer(), spacing=8)

    def show_contents(self, contents: Contents) -> None:
        """Offer the folders of a batch's table, and compare the first two."""
        self._contents = contents
        names = folders_of(contents.rows)
        for field, at in ((self.first, 0), (self.second, 1)):
            before = field.currentText()
            field.clear()
            field.addItems(names)
            field.setCurrentText(before or (names[at] if at < len(names) else ""))
        self.compare()

    def compare(self) -> None:
        """Compare the two that are named."""
        names = self.first.currentText().strip(), self.second.currentText().strip()
        cells: list[tuple[str, ...]] = []
        if self._contents is None or not all(names):
            said = (
                "Name two benches, each a folder below this one or a pattern of session names such as "
                "left-*, and press Compare: which effects they share, and how strong they are on each, will "
                "stand here."
            )
        else:
            try:
                groups = two_groups(self._contents.rows, *names)
                found = shared_effects(*groups, self._contents.units)
                cells = [row for one in found for row in shared_cells(one)]
                told = [shared_sentence(one, *groups) for one in found]
                said = "\n".join(told) or "No effect was found in any session of either."
            except UserError as error:
                said = str(error)
        self.words.setText(said)
        self.table.show_rows(cells)
        for part in (self.table, self.hint):
            part.setVisible(bool(cells))
