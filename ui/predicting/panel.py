"""Side panel of the Predict tab: which models, which run."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import (
    QComboBox,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from ..theme import colours_of, small_font
from ..widgets.framed_ticks import FramedTicks
from ..widgets.labels import heading, remark
from .plots import Look, look, sample

PANEL_WIDTH = 280
NAME = Qt.ItemDataRole.UserRole


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
        self.list = QListWidget()
        self.list.setObjectName("models")
        self.list.setAccessibleName("Models; the ticked ones are shown")
        self.list.setFont(small_font())
        self.list.setWordWrap(True)
        self.list.setSpacing(1)
        self.list.setItemDelegate(FramedTicks(self.list))
        # The sample of the line stays readable in the chosen row.
        self.list.setStyleSheet(
            "QListView::item:selected { background: palette(midlight); color: palette(text); }"
        )
        self.remove = QPushButton("&Remove this file")
        self.remove.setObjectName("removeModel")
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
        known = {self._item(row).data(NAME): self._item(row).checkState() for row in range(self.list.count())}
        run = self.run.currentText()
        for widget in (self.list, self.run):
            widget.blockSignals(True)
        self.list.clear()
        for name in names:
            item = QListWidgetItem(name)
            item.setData(NAME, name)
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

    def ticked(self) -> dict[str, Look]:
        """The models to show, with their looks; each keeps its own as long as it is ticked."""
        items = [self._item(row) for row in range(self.list.count())]
        names = [str(i.data(NAME)) for i in items if i.checkState() == Qt.CheckState.Checked]
        self._looks = {name: number for name, number in self._looks.items() if name in names}
        for name in names:
            if name not in self._looks:
                taken = set(self._looks.values())
                self._looks[name] = next(n for n in range(len(names) + 1) if n not in taken)
        self.list.blockSignals(True)
        for item in items:
            number = self._looks.get(str(item.data(NAME)))
            item.setIcon(QIcon() if number is None else sample(look(number), colours_of(self)))
        self.list.blockSignals(False)
        return {name: look(self._looks[name]) for name in names}

    def _item(self, row: int) -> QListWidgetItem:
        item = self.list.item(row)
        assert item is not None
        return item

    def _on_remove(self) -> None:
        item = self.list.currentItem()
        if item is not None:
            self.remove_asked.emit(str(item.data(NAME)).partition(": ")[0])

    def _enable(self) -> None:
        chosen = self.list.currentItem() is not None
        self.remove.setEnabled(chosen)
        self.remove.setToolTip("The file itself stays." if chosen else "No model is chosen in the list.")
