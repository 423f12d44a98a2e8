"""What the motor is to do, by hand: kind of trajectory and its numbers.

The fields are made from the table of the trajectories' parameters. They are Qt's own and not those of
``pyqtgraph.parametertree``: its fields have neither accessible names, nor object names, nor letters to reach
them by, and it would have pyqtgraph imported before the first tab is seen.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QInputDialog,
    QMenu,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QWidget,
)

from fingerlab.acquisition.control.machine import SetGains
from fingerlab.acquisition.control.motion import GAIN_RANGES, Gains
from fingerlab.acquisition.control.trajectories import (
    BY_POINTS,
    DEFAULT_PATTERN_S,
    KIND_TITLES,
    MULTISINE_RATIOS,
    PARAMETERS,
    REPEATED,
    TrajectoryParameter,
    read_trajectory,
)
from fingerlab.core.errors import UserError
from fingerlab.core.files import own_data, read_text
from fingerlab.core.plain_data import read_object

from ..widgets.fields import NumberField, choice, form_menu, number, take_typed
from ..widgets.layout import as_written, described

LISTS = ("time_s", "angle_deg", "torque_n_m", "amplitude_n_m", "offset_n_m", "sha256")
"""What follows from a file; kept only where the points themselves were handed over."""
HANDED = "Handed over"
FILE_HELP = "Text table of time (s) and angle (degrees), or of time (s) and torque (N m)."


class GainsButton(QToolButton):
    """Says the position loop's gains and opens a small form to change them. Signal ``asked(SetGains)``."""

    asked = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        described(self, "gains", accessible="Gains of the position loop")
        self.setToolTip(
            "Gains of the position loop, also while it runs: the current makes no jump. A run says in its "
            "attributes with which it began, and a marker where they were changed."
        )
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        form = QWidget()
        layout = QFormLayout(form)
        layout.setContentsMargins(16, 8, 16, 8)
        self.numbers: dict[str, NumberField] = {}
        for name, (low, high, unit) in GAIN_RANGES.items():
            title = name.capitalize()
            field = number(
                f"gain_{name}", getattr(Gains(), name), low, high, 3, 0.1 * low or 5.0, f"{title}."
            )
            field.valueChanged.connect(self._on_edited)
            self.numbers[name] = field
            layout.addRow(f"&{title} ({unit})", field)
        self.usual = described(QPushButton("&Usual gains"), "usualGains")
        self.usual.clicked.connect(lambda: self.show_gains(Gains()))
        layout.addRow(self.usual)
        form_menu(self, form)
        self._asked = SetGains(*(getattr(Gains(), name) for name in GAIN_RANGES))
        self._say()

    def command(self) -> SetGains:
        """What is asked of the loop."""
        return SetGains(**{name: field.value() for name, field in self.numbers.items()})

    def show_gains(self, gains: Gains | SetGains) -> None:
        """Fill the form."""
        for name, field in self.numbers.items():
            field.setValue(getattr(gains, name))

    def words(self) -> str:
        """The three numbers."""
        return ", ".join(f"{field.value():g}" for field in self.numbers.values())

    def _on_edited(self) -> None:
        self._say()
        if self.command() != self._asked:
            self._asked = self.command()
            self.asked.emit(self._asked)

    def _say(self) -> None:
        usual = all(field.value() == getattr(Gains(), name) for name, field in self.numbers.items())
        self.setText(f"Gains: {'usual' if usual else self.words()}")


def motions_folder() -> Path:
    """Where kept motions are: each a file that ``record --trajectory`` takes."""
    return own_data("motions")


class MotionsButton(QToolButton):
    """Motions that were kept, by name, for a form. Signals, a sentence each: done(str); refused(str)."""

    done = Signal(str)
    refused = Signal(str)

    def __init__(self, form: MotionForm, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._form = form
        described(self, "motions", accessible="Kept motions", tip="Motions that were kept, to be set again.")
        self.setText("Motions")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._menu = QMenu(self)
        self._menu.aboutToShow.connect(self.fill)
        self.setMenu(self._menu)
        self.fill()

    def fill(self) -> None:
        """Every motion that is kept now, by name."""
        self._menu.clear()
        kept = sorted(motions_folder().glob("*.json"))
        for path in kept:
            self._menu.addAction(_menu_words(path)).triggered.connect(partial(self._set, path))
        if kept:
            self._menu.addSeparator()
        self._menu.addAction("&Keep this motion…").triggered.connect(self._ask_name)
        if kept:
            forget = self._menu.addMenu("&Forget")
            for path in kept:
                forget.addAction(_menu_words(path)).triggered.connect(partial(self._forget, path))

    def _ask_name(self) -> None:
        name, sure = QInputDialog.getText(self, "Keep this motion", "Name")
        if not (sure and name.strip()) or take_typed(self._form.fields):
            return
        try:
            path = keep_motion(self._form.settings(), name.strip())
        except UserError as error:
            self.refused.emit(str(error))
            return
        self.done.emit(f"Motion kept: {path}")

    def _set(self, path: Path) -> None:
        try:
            self._form.show_settings(read_object(read_text(path, "a kept motion"), str(path), "forget it"))
        except UserError as error:
            self.refused.emit(str(error))
            return
        self.done.emit(f"Motion set: {path.stem}")

    def _forget(self, path: Path) -> None:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            self.refused.emit(f"{path} cannot be removed ({error.strerror}).")
            return
        self.done.emit(f"Motion forgotten: {path.stem}")


def _menu_words(path: Path) -> str:
    return path.stem.replace("&", "&&")


def keep_motion(settings: Mapping[str, Any], name: str) -> Path:
    """Write a motion under a name that is not taken.

    Raises:
        UserError: the name is taken or no name of a file, or it cannot be written.
    """
    if not re.fullmatch(r"[\w .,()+°-]{1,60}", name) or name.startswith("."):
        raise UserError(f"{name!r} is no name for a motion; give letters, figures and spaces, 60 at most.")
    path = motions_folder() / f"{name}.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            json.dump(settings, file, ensure_ascii=False, indent=1)
    except FileExistsError:
        raise UserError(
            f"A motion {name!r} is kept already; forget it first, or give another name."
        ) from None
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}).") from None
    return path


class MotionForm(QWidget):
    """Signal ``edited``."""

    edited = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.kind = choice("kind", KIND_TITLES, "Mode: what the motor does.")
        self.numbers = {name: _field(one) for name, one in PARAMETERS.items()}
        self.duration = number(
            "duration", 0.0, 0.0, 36_000.0, 1, 5.0, "Duration: 0 goes on until it is brought to rest."
        )
        self.duration.setSpecialValueText("until stopped")
        self.file = described(QPushButton("Choose…"), "trajectoryFile", tip=FILE_HELP)
        self._path: Path | None = None
        self._further: dict[str, Any] = {}
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._form.setSpacing(2)
        self._form.addRow("&Mode", self.kind)
        for name, field in self.numbers.items():
            self._form.addRow(_label(PARAMETERS[name]), field)
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
        for name, one in PARAMETERS.items():
            value = self.numbers[name].value()
            if kind in one.kinds and name != "lines" and not (one.unsaid and value == one.start):
                settings[name] = value if one.decimals else round(value)
        lines = round(self.numbers["lines"].value())
        if kind == "multisine" and lines < PARAMETERS["lines"].high and "frequencies_hz" not in settings:
            base = settings["frequency_hz"]
            settings["frequencies_hz"] = [round(ratio * base, 6) for ratio in MULTISINE_RATIOS[:lines]]
        if kind in BY_POINTS and self._path is not None:
            settings["file"] = str(self._path)
        if not self.endless:
            settings["duration_s"] = self.duration.value()
            return settings
        settings["until_stopped"] = True
        if kind in REPEATED:
            settings["pattern_s"] = DEFAULT_PATTERN_S
        return settings

    def show_settings(self, settings: Mapping[str, Any]) -> None:
        """Fill the fields from a trajectory, such as one that was proposed.

        Raises:
            UserError: it is no trajectory.
        """
        given = read_trajectory(settings).settings
        known = {"kind", "duration_s", "until_stopped", "pattern_s", "file", *PARAMETERS}
        row = self.kind.findData(given["kind"])
        self.kind.setCurrentIndex(row)
        for name, field in self.numbers.items():
            if name in given or PARAMETERS[name].unsaid:
                field.setValue(float(given.get(name, PARAMETERS[name].start)))
        self._show_lines(len(given.get("frequencies_hz", MULTISINE_RATIOS)))
        lasts = 0.0 if given.get("until_stopped") else float(given.get("duration_s", 20.0))
        self.duration.setValue(lasts)
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
        self.file.setToolTip(as_written(str(path)) if path is not None else FILE_HELP)

    def words(self) -> str:
        """A few words for the header."""
        settings = self.settings()
        parts = [KIND_TITLES[settings["kind"]].lower()]
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
            self._form.setRowVisible(field, kind in PARAMETERS[name].kinds)
        self._form.setRowVisible(self.file, kind in BY_POINTS)
        self.edited.emit()

    def _on_edited(self) -> None:
        self.edited.emit()

    def _show_lines(self, count: float) -> None:
        """So many lines, which may be more than this form makes where they were handed over."""
        self.numbers["lines"].setMaximum(max(count, PARAMETERS["lines"].high))
        self.numbers["lines"].setValue(count)

    def _forget_lines(self) -> None:
        """Lines that were handed over hold until their number or their base is changed by hand."""
        if self._further.pop("frequencies_hz", None) is not None:
            self.numbers["lines"].setMaximum(PARAMETERS["lines"].high)


def _label(parameter: TrajectoryParameter) -> str:
    words, letter = parameter.title, parameter.letter
    if letter:
        words = words.replace(letter, f"&{letter}", 1)
    return f"{words} ({parameter.unit})" if parameter.unit else words


def _field(parameter: TrajectoryParameter) -> QDoubleSpinBox:
    """The field of a parameter; its object name is the parameter's without the unit, as ``endFrequency``."""
    first, *others = re.sub("_(deg|hz|s)$", "", parameter.name).split("_")
    name = first + "".join(word.capitalize() for word in others)
    one = parameter
    return number(name, one.start, one.low, one.high, one.decimals, one.step, one.help)
