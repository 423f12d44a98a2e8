"""Saved models compared on the runs of a session, none of which their values have seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QWidget

from fingerlab.core.text import score_text
from fingerlab.report.page_tables import COMPARED_COLUMNS, compared_rows, judged_as_they_stand

from ..widgets.labels import WholeLabel, remark
from ..widgets.layout import described, vbox
from ..widgets.tables import NumberTable
from ..widgets.theme import small_font

if TYPE_CHECKING:
    from fingerlab.prediction.comparing import ModelComparison

WIDTH, HEIGHT = 900, 360


class ModelsDialog(QDialog):
    """What ``fingerlab compare`` prints."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("comparedModels")
        self.setWindowTitle("Models compared – FingerLab")
        self.resize(WIDTH, HEIGHT)
        self.words = described(WholeLabel(), "comparedWords", font=small_font())
        self.table = NumberTable("comparedTable", "Models on runs left out", COMPARED_COLUMNS, words=2)
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        hint = remark(
            "Every run is judged by values that have not seen it, in floors of the best model; Ctrl+C copies "
            "the table."
        )
        vbox(self, self.words, (self.table, 1), hint, close, spacing=8)

    def show_comparison(self, found: ModelComparison) -> None:
        """Show models that were compared."""
        best = min(found.models, key=lambda one: one.score)
        said = f"{found.session.name}: {best.name} leaves least, {score_text(best.score)} times its floor."
        self.words.setText(f"{said} {judged_as_they_stand(found)}")
        self.table.show_rows(compared_rows(found), stretched=1)
