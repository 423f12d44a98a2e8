"""The fields of a wanted endpoint force, which stand as rows in a form of Predict and of Acquire."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QSignalBlocker, Signal
from PySide6.QtWidgets import QComboBox, QFileDialog, QFormLayout, QPushButton, QWidget

from .fields import NumberField, number
from .layout import described

KINDS = {"sine": "Sine", "ramp_hold": "Ramp and hold", "steps": "Steps", "file": "From a file"}
TABLES = "Text tables of time and force (*.csv *.txt *.tsv);;All files (*)"
SHAPED = ("sine", "ramp_hold", "steps")
FIELDS = {
    "mean_n": ("&Mean (N)", SHAPED, (1.0, 0.0, 40.0, 2, 0.1), "F, N: middle of the wanted force's range."),
    "amplitude_n": ("Amp&litude (N)", SHAPED, (0.4, 0.0, 20.0, 2, 0.1), "Half of the range of F, N."),
    "frequency_hz": ("Fre&quency (Hz)", SHAPED, (0.5, 0.01, 10.0, 2, 0.1), "Periods, or steps, a second."),
    "rise_s": ("R&ise (s)", ("steps",), (0.3, 0.05, 5.0, 2, 0.05), "From one step to the next."),
    "duration_s": ("D&uration (s)", SHAPED, (20.0, 1.0, 300.0, 1, 5.0), "Length of the profile."),
}
"""Label, kinds that have it, (value, least, most, decimals, step), meaning."""
Spec = tuple[float, float, float, int, float]


class WantedFields(QObject):
    """Kind, numbers and file. Signal ``changed``.

    Args:
        owner: of the file dialog. prefix: of the fields' object names.
        specs: value, least, most, decimals and step of numbers that differ from those of ``FIELDS``.
    """

    changed = Signal()

    def __init__(
        self, owner: QWidget, prefix: str = "wanted", specs: Mapping[str, Spec] | None = None
    ) -> None:
        super().__init__(owner)
        self._owner = owner
        self._form: QFormLayout | None = None
        self._shown = True
        self._path: Path | None = None
        tip = "Kind of the wanted force"
        self.kind = described(QComboBox(), f"{prefix}Kind", accessible=tip, tip=tip)
        for key, words in KINDS.items():
            self.kind.addItem(words, key)
        self.numbers = {
            name: _number(f"{prefix}_{name}", label, (specs or {}).get(name, spec), words)
            for name, (label, _, spec, words) in FIELDS.items()
        }
        self._begun = {name: field.value() for name, field in self.numbers.items()}
        self.file = described(
            QPushButton("Choose…"), f"{prefix}File", tip="Text table of time (s) and force (N)."
        )

    def add_to(self, form: QFormLayout, title: str = "Fo&rce") -> None:
        """Stand in a form, below what is there; :meth:`set_shown` once the form has its place."""
        self._form = form
        form.addRow(title, self.kind)
        for name, field in self.numbers.items():
            form.addRow(FIELDS[name][0], field)
        form.addRow("File", self.file)
        self.kind.currentIndexChanged.connect(self._on_kind)
        for field in self.numbers.values():
            field.valueChanged.connect(lambda _value: self.changed.emit())
        self.file.clicked.connect(self._choose_file)

    def start_at(self, mean_n: float, amplitude_n: float) -> None:
        """Another mean and amplitude to begin with, N, where nobody has asked for any yet; tells nobody."""
        for name, value in {"mean_n": mean_n, "amplitude_n": amplitude_n}.items():
            field = self.numbers[name]
            if field.value() == self._begun[name]:
                with QSignalBlocker(field):
                    field.setValue(value)
                self._begun[name] = field.value()

    def set_shown(self, on: bool) -> None:
        """All rows, as far as the kind has them, or none."""
        self._shown = on
        self._show_kind()

    @property
    def fields(self) -> tuple[QWidget, ...]:
        """All that can be typed into or chosen."""
        return self.kind, *self.numbers.values()

    def settings(self) -> dict[str, Any]:
        """The wanted force, as :func:`fingerlab.prediction.target.wanted_force` takes it."""
        kind = str(self.kind.currentData())
        if kind == "file":
            return {"kind": kind, "file": str(self._path) if self._path is not None else ""}
        return {"kind": kind} | {n: f.value() for n, f in self.numbers.items() if kind in FIELDS[n][1]}

    def state(self) -> dict[str, Any]:
        """Every field."""
        numbers = {name: field.value() for name, field in self.numbers.items()}
        return {"kind": self.kind.currentData(), "path": self._path, "numbers": numbers}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Every field as it was."""
        self._name_file(state["path"])
        for name, value in state["numbers"].items():
            self.numbers[name].setValue(value)
        self.kind.setCurrentIndex(self.kind.findData(state["kind"]))

    @property
    def waits_for_file(self) -> bool:
        """Whether a file is to be chosen first."""
        return self.kind.currentData() == "file" and self._path is None

    def show_file(self, path: Path) -> None:
        """Take the force from a file."""
        self._name_file(path)
        if self.kind.currentData() == "file":
            self.changed.emit()
        else:
            self.kind.setCurrentIndex(self.kind.findData("file"))

    def _name_file(self, path: Path | None) -> None:
        self._path = path
        self.file.setText(path.name.replace("&", "&&") if path is not None else "Choose…")
        self.file.setToolTip(str(path) if path is not None else "Text table of time (s) and force (N).")

    def _choose_file(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self._owner, "Wanted force", str(Path.home()), TABLES)
        if name:
            self.show_file(Path(name))

    def _on_kind(self) -> None:
        self._show_kind()
        self.changed.emit()

    def _show_kind(self) -> None:
        if self._form is None:
            return
        kind = str(self.kind.currentData())
        self._form.setRowVisible(self.kind, self._shown)
        for name, field in self.numbers.items():
            self._form.setRowVisible(field, self._shown and kind in FIELDS[name][1])
        self._form.setRowVisible(self.file, self._shown and kind == "file")


def _number(name: str, label: str, spec: Spec, words: str) -> NumberField:
    value, least, most, decimals, step = spec
    field = number(name, value, least, most, decimals, step, words)
    return described(field, accessible=label.replace("&", ""))
