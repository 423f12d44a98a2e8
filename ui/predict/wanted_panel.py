"""Side panel of "Wanted force": which force, by which model, in which pose; what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFileDialog,
    QFormLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from ..widgets.fields import NumberField, number
from ..widgets.labels import heading, remark
from ..widgets.layout import as_written, described

KINDS = {"sine": "Sine", "ramp_hold": "Ramp and hold", "steps": "Steps", "file": "From a file"}
TABLES = "Text tables of time and force (*.csv *.txt *.tsv);;All files (*)"
SHAPED = ("sine", "ramp_hold", "steps")
FIELDS = {
    "mean_n": ("&Mean (N)", SHAPED, (1.0, 0.0, 40.0, 2, 0.1), "F, N: middle of the wanted force's range."),
    "amplitude_n": ("&Amplitude (N)", SHAPED, (0.4, 0.0, 20.0, 2, 0.1), "Half of the range of F, N."),
    "frequency_hz": ("Fre&quency (Hz)", SHAPED, (0.5, 0.01, 10.0, 2, 0.1), "Periods, or steps, a second."),
    "rise_s": ("R&ise (s)", ("steps",), (0.3, 0.05, 5.0, 2, 0.05), "From one step to the next."),
    "duration_s": ("D&uration (s)", SHAPED, (20.0, 1.0, 300.0, 1, 5.0), "Length of the profile."),
}
"""Label, kinds that have it, (value, least, most, decimals, step), meaning."""


class WantedPanel(QWidget):
    """Signals ``changed``: another force, model or pose; ``save_asked``; ``hand_asked``."""

    changed = Signal()
    save_asked = Signal()
    hand_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.model = _choice("wantedModel", "Model that gives the torque")
        # A long name must not widen the panel.
        self.model.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.model_name = remark()  # what the list has no room for
        self.model_name.setObjectName("wantedModelName")
        self.pose = _choice("wantedPose", "Contact run that says how the finger stands")
        self.kind = _choice("wantedKind", "Kind of the wanted force")
        for key, words in KINDS.items():
            self.kind.addItem(words, key)
        self.numbers = {name: _number(name, *spec) for name, spec in FIELDS.items()}
        self.file = QPushButton("Choose…")
        self.file.setObjectName("wantedFile")
        self.file.setToolTip("Text table of time (s) and force (N).")
        self._path: Path | None = None
        self.result, self.limits = QLabel(), QLabel()
        self.result.setObjectName("wantedResult")
        self.limits.setObjectName("wantedLimits")
        for label in (self.result, self.limits):
            label.setWordWrap(True)
            label.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Minimum)
        self.save = QPushButton("&Save trajectory…")
        self.save.setObjectName("saveTorque")
        self.hand = described(QPushButton("Hand &to Acquire"), "handTorque", primary="true")
        self._lay_out()
        self._connect()
        self._show_kind()
        self.show_outcome("", "", False)

    def _lay_out(self) -> None:
        form = self._form = QFormLayout()
        form.setContentsMargins(0, 0, 0, 0)
        form.setSpacing(4)
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        form.addRow("Mo&del", self.model)
        form.addRow(self.model_name)
        form.addRow("P&ose of run", self.pose)
        form.addRow("Fo&rce", self.kind)
        for name, field in self.numbers.items():
            form.addRow(FIELDS[name][0], field)
        form.addRow("File", self.file)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        layout.addLayout(form)
        layout.addWidget(heading("Torque"))
        layout.addWidget(self.result)
        layout.addWidget(self.limits)
        layout.addStretch(1)
        layout.addWidget(self.save)
        layout.addWidget(self.hand)

    def _connect(self) -> None:
        for box in (self.model, self.pose):
            box.currentIndexChanged.connect(self._on_choice)
        self.kind.currentIndexChanged.connect(self._on_kind)
        for field in self.numbers.values():
            field.valueChanged.connect(lambda _value: self.changed.emit())
        self.file.clicked.connect(self._choose_file)
        self.save.clicked.connect(self.save_asked)
        self.hand.clicked.connect(self.hand_asked)

    # what is chosen

    def settings(self) -> dict[str, Any]:
        """The wanted force, as :func:`fingerlab.prediction.target.wanted_force` takes it."""
        kind = str(self.kind.currentData())
        if kind == "file":
            return {"kind": kind, "file": str(self._path) if self._path is not None else ""}
        return {"kind": kind} | {n: f.value() for n, f in self.numbers.items() if kind in FIELDS[n][1]}

    @property
    def waits_for_file(self) -> bool:
        """Whether a file is to be chosen first."""
        return self.kind.currentData() == "file" and self._path is None

    def show_choices(self, models: Sequence[str], runs: Sequence[str]) -> None:
        """Fill in predictors and contact runs; what was chosen stays where it is still there."""
        for box, names in ((self.model, models), (self.pose, runs)):
            before = box.currentText()
            box.blockSignals(True)
            box.clear()
            box.addItems(list(names))
            for row, name in enumerate(names):
                box.setItemData(
                    row, as_written(name), Qt.ItemDataRole.ToolTipRole
                )  # the list may be too narrow
            box.setCurrentIndex(max(box.findText(before), 0))
            box.blockSignals(False)
        self.model_name.setText(self.model.currentText())

    def show_file(self, path: Path) -> None:
        """Take the force from a file."""
        self._path = path
        self.file.setText(path.name.replace("&", "&&"))
        self.file.setToolTip(str(path))
        if self.kind.currentData() == "file":
            self.changed.emit()
        else:
            self.kind.setCurrentIndex(self.kind.findData("file"))

    def show_outcome(self, result: str, limits: str, usable: bool) -> None:
        """What the torque is, in words; what the limits say to it; whether it can be used."""
        self.result.setText(result)
        self.limits.setText(limits)
        self.limits.setVisible(bool(limits))
        why = "" if usable else limits or "No torque yet."
        for button, words in (
            (self.save, "As a file for 'fingerlab record --trajectory' and 'simulate'."),
            (self.hand, "A contact run with this torque, as a protocol in the Acquire tab."),
        ):
            button.setEnabled(usable)
            button.setToolTip(words if usable else why)

    def _choose_file(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Wanted force", str(Path.home()), TABLES)
        if name:
            self.show_file(Path(name))

    def _on_choice(self) -> None:
        self.model_name.setText(self.model.currentText())
        self.changed.emit()

    def _on_kind(self) -> None:
        self._show_kind()
        self.changed.emit()

    def _show_kind(self) -> None:
        kind = str(self.kind.currentData())
        for name, field in self.numbers.items():
            self._form.setRowVisible(field, kind in FIELDS[name][1])
        self._form.setRowVisible(self.file, kind == "file")


def _choice(name: str, accessible: str) -> QComboBox:
    box = described(QComboBox(), name, accessible=accessible, tip=accessible)
    return box


def _number(
    name: str, label: str, kinds: Sequence[str], spec: tuple[float, float, float, int, float], words: str
) -> NumberField:
    value, least, most, decimals, step = spec
    field = number(f"wanted_{name}", value, least, most, decimals, step, words)
    return described(field, accessible=label.replace("&", ""))
