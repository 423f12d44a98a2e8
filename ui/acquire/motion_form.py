"""What the motor is to do, by hand: kind of trajectory and its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QDoubleSpinBox, QFileDialog, QFormLayout, QPushButton, QWidget

from fingerlab.acquisition.trajectories import DEFAULT_RAMP_S, MULTISINE_RATIOS, read_trajectory

from ..widgets.fields import choice, number

KINDS = {
    "sine": "Sine",
    "chirp": "Chirp",
    "multisine": "Multisine",
    "steps": "Steps",
    "ramp_hold": "Ramp and hold",
    "blocked": "Blocked",
    "file": "From a file",
    "torque": "Torque from a file",
}
LISTS = ("time_s", "angle_deg", "torque_n_m", "amplitude_n_m", "offset_n_m", "sha256")
"""What follows from a file; kept only where the points themselves were handed over."""
HANDED = "Handed over"
BY_POINTS = ("file", "torque")
"""Kinds that are given point by point: of the angle, or of the torque itself."""
MOVES = ("sine", "chirp", "multisine", "steps", "ramp_hold")
FIELDS = {
    "amplitude_deg": MOVES,
    "frequency_hz": MOVES,
    "end_frequency_hz": ("chirp",),
    "rise_s": ("steps",),
    "seed": ("steps",),
    "lines": ("multisine",),
    "offset_deg": (*MOVES, "blocked"),
    "ramp_s": tuple(KINDS),
}
"""Which numbers each kind has."""
DEFAULTS = {"seed": 0.0, "ramp_s": DEFAULT_RAMP_S}
"""What a trajectory means that does not name them; so they are not named."""
LABELS = {
    "amplitude_deg": "&Amplitude (°)",
    "frequency_hz": "F&requency (Hz)",
    "end_frequency_hz": "&To (Hz)",
    "rise_s": "R&ise (s)",
    "seed": "Se&quence",
    "lines": "Li&nes",
    "offset_deg": "&Offset (°)",
    "ramp_s": "Ramp (s)",
}
ALL_LINES = len(MULTISINE_RATIOS)
RATIOS = ", ".join(f"{ratio:g}" for ratio in MULTISINE_RATIOS)

FILE_HELP = "Text table of time (s) and angle (degrees), or of time (s) and torque (N m)."
ENDLESS_S = 60.0
"""Length that a trajectory without end is given: that of its pattern before it comes again."""


class MotionForm(QWidget):
    """Signal ``edited``."""

    edited = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.kind = choice("kind", KINDS, "Mode: what the motor does.")
        self.numbers = _make_numbers()
        self.duration = number(
            "duration", 0.0, 0.0, 36_000.0, 1, 5.0, "Duration: 0 goes on until it is brought to rest."
        )
        self.duration.setSpecialValueText("until stopped")
        self.file = QPushButton("Choose…")
        self.file.setObjectName("trajectoryFile")
        self.file.setToolTip(FILE_HELP)
        self._path: Path | None = None
        self._further: dict[str, Any] = {}
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._form.setSpacing(3)
        self._form.addRow("&Mode", self.kind)
        for name, field in self.numbers.items():
            self._form.addRow(LABELS[name], field)
            field.valueChanged.connect(self._on_edited)
        self._form.addRow("File", self.file)
        self._form.addRow("&Duration (s)", self.duration)
        self.duration.valueChanged.connect(self._on_edited)
        for name in ("lines", "frequency_hz"):
            self.numbers[name].valueChanged.connect(self._forget_lines)
        self.kind.currentIndexChanged.connect(self._on_kind)
        self.file.clicked.connect(self._choose_file)
        self._on_kind()

    @property
    def endless(self) -> bool:
        """Whether the motion goes on until it is brought to rest."""
        return self.duration.value() == 0.0

    def settings(self) -> dict[str, Any]:
        """The trajectory as in the session format."""
        kind = str(self.kind.currentData())
        settings: dict[str, Any] = {"kind": kind, **self._further}
        for name, kinds in FIELDS.items():
            value = self.numbers[name].value()
            if kind in kinds and name != "lines" and value != DEFAULTS.get(name):
                settings[name] = round(value) if name == "seed" else value
        lines = round(self.numbers["lines"].value())
        if kind == "multisine" and lines < ALL_LINES and "frequencies_hz" not in settings:
            base = settings["frequency_hz"]
            settings["frequencies_hz"] = [round(ratio * base, 6) for ratio in MULTISINE_RATIOS[:lines]]
        if kind in BY_POINTS and self._path is not None:
            settings["file"] = str(self._path)
        if not self.endless:
            settings["duration_s"] = self.duration.value()
        elif kind not in BY_POINTS:
            settings["duration_s"] = ENDLESS_S
        return settings

    def show_settings(self, settings: Mapping[str, Any]) -> None:
        """Fill the fields from a trajectory, such as one that was proposed.

        Raises:
            UserError: it is no trajectory.
        """
        given = read_trajectory(settings).settings
        known = {"kind", "duration_s", "file", *FIELDS}
        row = self.kind.findData(given["kind"])
        self.kind.setCurrentIndex(row)
        for name, field in self.numbers.items():
            if name in given or name in DEFAULTS:
                field.setValue(float(given.get(name, DEFAULTS.get(name))))
        self._show_lines(len(given.get("frequencies_hz", MULTISINE_RATIOS)))
        self.duration.setValue(float(given.get("duration_s", 20.0)))
        listed = given["kind"] in BY_POINTS and "time_s" in settings
        path = Path(str(settings["file"])) if "file" in given and not listed else None
        self._further = {
            name: value
            for name, value in given.items()
            if name not in known and (listed or name not in LISTS)
        }
        self._name_file(path)
        self.edited.emit()

    @property
    def fields(self) -> tuple[QWidget, ...]:
        """All that can be typed into or chosen."""
        return self.kind, *self.numbers.values(), self.duration

    def state(self) -> dict[str, Any]:
        """Every field, and what came with a trajectory that was handed over."""
        numbers = {name: field.value() for name, field in self.numbers.items()}
        further = {"further": dict(self._further), "path": self._path}
        return {"kind": self.kind.currentData(), **numbers, "duration": self.duration.value(), **further}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Every field as it was."""
        self.kind.setCurrentIndex(self.kind.findData(state["kind"]))
        self._show_lines(state["lines"])
        for name, field in self.numbers.items():
            field.setValue(state[name])
        self.duration.setValue(state["duration"])
        self._further = dict(state["further"])
        self._name_file(state["path"])
        self.edited.emit()

    def show_file(self, path: Path) -> None:
        """Take the trajectory from a file."""
        self._further = {}
        self._name_file(path)
        if self.kind.currentData() not in BY_POINTS:
            self.kind.setCurrentIndex(self.kind.findData("file"))
        self._on_edited()

    @property
    def kind_by_points(self) -> str:
        """What a table is taken for: torque where that is chosen, else angles."""
        kind = str(self.kind.currentData())
        return kind if kind in BY_POINTS else BY_POINTS[0]

    def _name_file(self, path: Path | None) -> None:
        self._path = path
        nothing = HANDED if "time_s" in self._further else "Choose…"
        self.file.setText(path.name.replace("&", "&&") if path is not None else nothing)
        self.file.setToolTip(str(path) if path is not None else FILE_HELP)

    def words(self) -> str:
        """A few words for the header."""
        settings = self.settings()
        parts = [KINDS[settings["kind"]].lower()]
        if "amplitude_deg" in settings:
            parts.append(f"{settings['amplitude_deg']:g}°")
        if "frequency_hz" in settings:
            parts.append(f"{settings['frequency_hz']:g} Hz")
        return ", ".join(parts)

    def _choose_file(self) -> None:
        name, _ = QFileDialog.getOpenFileName(
            self, "Trajectory", str(Path.home()), "Text tables (*.csv *.txt *.tsv);;All files (*)"
        )
        if name:
            self.show_file(Path(name))

    def _on_kind(self) -> None:
        kind = str(self.kind.currentData())
        self._further = {}
        for name, field in self.numbers.items():
            self._form.setRowVisible(field, kind in FIELDS[name])
        self._form.setRowVisible(self.file, kind in BY_POINTS)
        self.edited.emit()

    def _on_edited(self) -> None:
        self.edited.emit()

    def _show_lines(self, count: float) -> None:
        """So many lines, which may be more than this form makes where they were handed over."""
        self.numbers["lines"].setMaximum(max(count, ALL_LINES))
        self.numbers["lines"].setValue(count)

    def _forget_lines(self) -> None:
        """Lines that were handed over hold until their number or their base is changed by hand."""
        if self._further.pop("frequencies_hz", None) is not None:
            self.numbers["lines"].setMaximum(ALL_LINES)


def _make_numbers() -> dict[str, QDoubleSpinBox]:
    """The number fields in the order in which they stand."""
    return {
        "amplitude_deg": number(
            "amplitude", 15.0, 0.0, 120.0, 1, 1.0, "Amplitude: half of the range, at the pulley."
        ),
        "frequency_hz": number("frequency", 1.0, 0.01, 10.0, 2, 0.1, "Frequency: of the motion."),
        "end_frequency_hz": number("endFrequency", 3.0, 0.01, 10.0, 2, 0.1, "End frequency of the chirp."),
        "rise_s": number("rise", 0.15, 0.01, 2.0, 2, 0.05, "Rise: time from one step to the next."),
        "seed": number(
            "seed",
            0.0,
            0.0,
            99_999.0,
            0,
            1.0,
            "Sequence: seed of the steps' heights; the same gives the same.",
        ),
        "lines": number(
            "lines", ALL_LINES, 1.0, ALL_LINES, 0, 1.0, f"Lines: the first of {RATIOS} times the frequency."
        ),
        "offset_deg": number(
            "offset", 22.0, -180.0, 180.0, 1, 1.0, "Offset: middle of the range, at the pulley."
        ),
        "ramp_s": number(
            "ramp", DEFAULT_RAMP_S, 0.0, 60.0, 2, 0.5, "Ramp: time from rest to the whole motion."
        ),
    }
