"""Which models and which run the Predict tab shows, how well each tells the force; saved ones compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import (
    QComboBox,
    QHeaderView,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from fingerlab.core.text import fixed, r2_text, score_text
from fingerlab.prediction.comparing import RunForce
from fingerlab.report.diagnosis_words import effect_title
from fingerlab.report.page_tables import (
    COMPARED_COLUMNS,
    compared_rows,
    force_got_worse,
    judged_as_they_stand,
)
from fingerlab.thesis.prediction import FORCE_PHASES

from ..widgets.layout import ResultDialog, described
from ..widgets.tables import FramedTicks, NumberTable, WholeLabel, heading, remark
from ..widgets.theme import colours_of, small_font
from .force_plots import ModelLine, ShownForces, model_line, sample

if TYPE_CHECKING:
    from fingerlab.prediction.comparing import ModelComparison

WIDTH, HEIGHT = 900, 360


IN_THE_WINDOW = tuple((title.replace("R2", "R²"), help_text) for title, help_text in COMPARED_COLUMNS)


class ModelsDialog(ResultDialog):
    """What ``fingerlab compare`` prints."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, "comparedModels", "Models compared", WIDTH, HEIGHT)
        self.words = described(WholeLabel(), "comparedWords", font=small_font())
        self.table = NumberTable("comparedTable", "Models on runs left out", IN_THE_WINDOW, words=2)
        hint = remark(
            "Every run is judged by values that have not seen it, in floors of the best model; Ctrl+C copies "
            "the table."
        )
        self.lay_out(self.words, (self.table, 1), hint)

    def show_comparison(self, found: ModelComparison) -> None:
        """Show models that were compared."""
        best = min(found.models, key=lambda one: one.score)
        said = f"{found.session.name}: {best.name} leaves least, {score_text(best.score)} times its floor."
        self.words.setText(
            " ".join(filter(None, (said, force_got_worse(found), judged_as_they_stand(found))))
        )
        self.table.show_rows(
            [
                (name, ", ".join(map(effect_title, one.effects)) or "–", *rest)
                for one, (name, _ids, *rest) in zip(found.models, compared_rows(found), strict=True)
            ],
            stretched=1,
        )


PANEL_WIDTH = 280
NAME_ROLE = Qt.ItemDataRole.UserRole


class PredictPanel(QWidget):
    """Signals ``add_asked``, ``remove_asked(file)``, ``changed``: other models ticked, or another run."""

    add_asked = Signal()
    remove_asked = Signal(str)
    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.add = QPushButton("&Add model files…")
        self.add.setObjectName("addModels")
        self.add.setToolTip(
            "Model files that Fit, the Model lab or the command line saved; or drop them here."
        )
        self.list = described(
            QListWidget(), "models", accessible="Models; the ticked ones are shown", font=small_font()
        )
        self.list.setWordWrap(True)
        self.list.setSpacing(1)
        self.list.setItemDelegate(FramedTicks(self.list))
        # The sample of the line stays readable in the chosen row.
        self.list.setStyleSheet(
            "QListView::item:selected { background: palette(midlight); color: palette(text); }"
        )
        self.remove = described(QPushButton("&Remove this file"), "removeModel")
        self.run = QComboBox()
        self.run.setObjectName("predictRun")
        self.run.setToolTip("Contact run that is shown (Alt+Up, Alt+Down for the next).")
        self.run.setAccessibleName("Run shown")
        run_label = QLabel("R&un shown")
        run_label.setBuddy(self.run)
        self.remarks = remark("— measured; shaded: 90 % interval, where the model has one.")
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        layout.addWidget(heading("Models"))
        layout.addWidget(self.add)
        layout.addWidget(self.list, 1)
        layout.addWidget(self.remove)
        layout.addWidget(run_label)
        layout.addWidget(self.run)
        layout.addWidget(self.remarks)
        self.add.clicked.connect(self.add_asked)
        self.remove.clicked.connect(self._on_remove)
        self.list.itemChanged.connect(lambda _item: self.changed.emit())
        self.list.currentRowChanged.connect(lambda _row: self._enable())
        self.run.currentTextChanged.connect(lambda _text: self.changed.emit())
        self._looks: dict[str, int] = {}
        self._enable()

    def show_models(self, names: Sequence[str], preferred: Sequence[str], runs: Sequence[str]) -> None:
        """Fill in predictors and runs; ticks and the run that was shown stay where they are still there."""
        known = {
            self._item(row).data(NAME_ROLE): self._item(row).checkState() for row in range(self.list.count())
        }
        run = self.run.currentText()
        for widget in (self.list, self.run):
            widget.blockSignals(True)
        self.list.clear()
        for name in names:
            item = QListWidgetItem(name)
            item.setData(NAME_ROLE, name)
            item.setToolTip(name)
            first = Qt.CheckState.Checked if name in preferred else Qt.CheckState.Unchecked
            item.setCheckState(known.get(name, first))
            self.list.addItem(item)
        self.run.clear()
        self.run.addItems(list(runs))
        self.run.setCurrentIndex(max(self.run.findText(run), 0))
        for widget in (self.list, self.run):
            widget.blockSignals(False)
        self.list.setCurrentRow(0 if names else -1)
        self._enable()

    def set_next(self, on: bool) -> None:
        """Whether adding a model is the next thing to do; its button then stands out."""
        self.add.setProperty("primary", "true" if on else None)
        self.add.style().unpolish(self.add)
        self.add.style().polish(self.add)

    def ticked(self) -> dict[str, ModelLine]:
        """The models to show, with their looks; each keeps its own as long as it is ticked."""
        items = [self._item(row) for row in range(self.list.count())]
        names = [str(i.data(NAME_ROLE)) for i in items if i.checkState() == Qt.CheckState.Checked]
        self._looks = {name: number for name, number in self._looks.items() if name in names}
        for name in names:
            if name not in self._looks:
                taken = set(self._looks.values())
                self._looks[name] = next(n for n in range(len(names) + 1) if n not in taken)
        with QSignalBlocker(self.list):
            for item in items:
                number = self._looks.get(str(item.data(NAME_ROLE)))
                item.setIcon(QIcon() if number is None else sample(model_line(number), colours_of(self)))
        return {name: model_line(self._looks[name]) for name in names}

    def _item(self, row: int) -> QListWidgetItem:
        item = self.list.item(row)
        assert item is not None
        return item

    def _on_remove(self) -> None:
        item = self.list.currentItem()
        if item is not None:
            self.remove_asked.emit(str(item.data(NAME_ROLE)).partition(": ")[0])

    def _enable(self) -> None:
        chosen = self.list.currentItem() is not None
        self.remove.setEnabled(chosen)
        self.remove.setToolTip("The file itself stays." if chosen else "No model is chosen in the list.")


COLUMNS = (
    ("Model", "File and parameters."),
    ("R²", "Of modelled against measured force over the run, thesis (4.1)."),
    ("R²\nnormalised", "Over the average period, each force scaled to run from 0 to 1."),
    ("Peak (N)\nmeasured", "Mean of the largest force of each period."),
    ("Peak (N)\nmodelled", "Mean of the largest force of each period."),
    ("Delay\n(ms)", "Positive where the measured force comes later than the modelled one."),
    ("RMS error\n(N)", "Root mean square of modelled less measured force."),
    *((f"Error (N)\n{phase}", f"Mean of modelled less measured force, {phase}.") for phase in FORCE_PHASES),
)
SEEN = {
    True: "This run was left out of the fit that predicts it.",
    False: "This run was no part of the fit.",
    None: "",
}


class ForceTable(NumberTable):
    """One row a ticked model."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "predictionNumbers", "Numbers of each model on the run shown", COLUMNS, parent=parent
        )
        self.horizontalHeader().setMinimumSectionSize(40)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)

    def show_forces(self, shown: ShownForces) -> None:
        """Other models or another run."""
        self.setRowCount(len(shown))
        for row, (name, (one, force)) in enumerate(shown.items()):
            for column, text in enumerate((name, *_cells(force))):
                item = QTableWidgetItem(text)
                if column > 0:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                else:
                    item.setIcon(sample(one, colours_of(self)))
                    item.setToolTip(f"{name}: {one.words} line. {SEEN[force.held_out]}".strip())
                self.setItem(row, column, item)


def _cells(force: RunForce) -> tuple[str, ...]:
    numbers = force.numbers.prediction
    return (
        r2_text(numbers.r2),
        r2_text(numbers.normalised_r2),
        fixed(numbers.peak_measured, 3),
        fixed(numbers.peak_modelled, 3),
        fixed(1e3 * force.numbers.delay_s, 0),
        fixed(numbers.rmse, 3),
        *(fixed(numbers.error_by_phase[phase], 3) for phase in FORCE_PHASES),
    )
