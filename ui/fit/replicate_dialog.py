"""The thesis' experiment, simulated and analysed again, beside what the thesis prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QLabel, QPushButton, QWidget

from fingerlab.core.text import with_minus

from ..app.worker import IsCancelled, Progress, Worker
from ..widgets.fields import WholeField, progress_bar, set_usable
from ..widgets.labels import WholeLabel, remark
from ..widgets.layout import Spacer, described, hbox, vbox
from ..widgets.tables import NumberTable
from ..widgets.theme import small_font

if TYPE_CHECKING:
    from fingerlab.report.comparison_words import ComparedQuantity

WIDTH, HEIGHT = 760, 620
MOST_BENCHES = 100
COLUMNS = (
    ("Quantity", "As the thesis names it."),
    ("Published", "In the thesis, with its deviation over runs; in brackets a tolerance of ours."),
    ("Ours", "Mean and deviation over the runs of the simulated benches."),
    ("", "*: further off than the published deviation."),
    ("Unit", ""),
)
PUBLISHED = 1
PRESET = "as-built"


class ReplicateDialog(QDialog):
    """What ``fingerlab replicate`` does. A seed draws the bench within its tolerances, and its noise."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("replicate")
        self.setWindowTitle("The thesis' experiment again – FingerLab")
        self.resize(WIDTH, HEIGHT)
        self._worker = Worker(self)
        self.seed = self._field("replicateSeed", "Seed of the first bench", 0, 10**6, 1)
        self.benches = self._field("replicateBenches", "How many benches", 1, MOST_BENCHES, 1)
        self.run = described(QPushButton("&Run"), "replicateRun", primary="true")
        self.progress = progress_bar("replicateProgress", "How far it is")
        self.words = described(WholeLabel(), "replicateWords", font=small_font())
        self.table = NumberTable("replicateTable", "Published numbers and ours", COLUMNS)
        self._build()
        self.run.clicked.connect(self._run_or_stop)
        self._worker.progressed.connect(lambda share, _what: self.progress.setValue(round(1000 * share)))
        self._worker.failed.connect(lambda failed: self.words.setText(failed.sentence))
        self._worker.busy_changed.connect(self._refresh)
        self._worker.ended.connect(lambda _how: self._refresh())
        self._refresh()

    def _field(self, name: str, help_text: str, low: int, high: int, value: int) -> WholeField:
        field = described(WholeField(), name, accessible=help_text, tip=help_text)
        field.setRange(low, high)
        field.setValue(value)
        return field

    def _build(self) -> None:
        seed, benches = QLabel("&Seed"), QLabel("&Benches")
        seed.setBuddy(self.seed)
        benches.setBuddy(self.benches)
        fields = (seed, self.seed, 8, benches, self.benches, 8, self.run)
        row = hbox(None, *fields, (self.progress, 1), Spacer(0), spacing=8)
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        hint = remark("Some ten seconds a bench; the bench as it was built. Ctrl+C copies the table.")
        vbox(self, row, self.words, (self.table, 1), hint, close, spacing=8)

    def _run_or_stop(self) -> None:
        if self._worker.busy:
            self._worker.cancel()
            return
        seeds = [self.seed.value() + number for number in range(self.benches.value())]

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[ComparedQuantity, ...]:
            from fingerlab.core.progress import Watch
            from fingerlab.report.comparison_words import replicated

            return replicated(PRESET, seeds, Watch(progress, cancelled))

        self.words.setText("")
        self._worker.start("Replicating", work, self._show)

    def _show(self, lines: Sequence[ComparedQuantity]) -> None:
        from fingerlab.report.comparison_words import cells, outcome_sentences

        self.table.show_rows([[with_minus(text) for text in cells(line)] for line in lines])
        for row, line in enumerate(lines):
            item = self.table.item(row, PUBLISHED)
            if item is not None and line.tolerance is not None:
                item.setToolTip(line.tolerance.reason)
        self.words.setText(f"{outcome_sentences(lines)[0]} Spreads in brackets are ours; the mouse says why.")

    def _refresh(self) -> None:
        busy = self._worker.busy
        self.run.setText("&Stop" if busy else "&Run")
        self.progress.setVisible(busy)
        for field in (self.seed, self.benches):
            set_usable(field, not busy)

    def shut_down(self) -> None:
        """Wait until what runs has ended."""
        self._worker.shut_down()
