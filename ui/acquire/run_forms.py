"""Forms of the side panel: values after initialising, and which protocol is run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFormLayout,
    QGridLayout,
    QLabel,
    QMenu,
    QSizePolicy,
    QSpinBox,
    QToolButton,
    QWidget,
    QWidgetAction,
)

from fingerlab.acquisition.control.commands import LARGEST_DEG, Initialise
from fingerlab.acquisition.protocols.steps import PlannedRun, Record, Step, own_runs, plan_seconds, plan_steps
from fingerlab.report.diagnosis_words import PHASE_WORDS
from fingerlab.sessions.trajectory import trajectory_words

from ..widgets.fields import choice, number
from ..widgets.labels import heading, remark

JOINTS = {"mcp": "MCP", "pip": "PIP"}


class InitialButton(QToolButton):
    """Says the values and opens a small form to change them. Signal ``edited``."""

    edited = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("initialValues")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Values after initialising")
        self.setToolTip(
            "What encoder and angle sensors read once they are initialised: as the rig file says, or as set "
            "here for the posture in which the finger is held."
        )
        self.angles: dict[str, QDoubleSpinBox] = {}
        self.sets: dict[str, QCheckBox] = {}
        self.position = self._angle("initialPosition", "Pulley: its angle after initialising.")
        form = QWidget()
        layout = QGridLayout(form)
        layout.setContentsMargins(16, 8, 16, 8)
        layout.addWidget(heading("After initialising (°)"), 0, 0, 1, 2)
        label = QLabel("&Pulley")
        label.setBuddy(self.position)
        layout.addWidget(label, 1, 0)
        layout.addWidget(self.position, 1, 1)
        for row, (name, title) in enumerate(JOINTS.items(), start=2):
            box = QCheckBox(f"&{title} set to")
            box.setObjectName(f"initialSet_{name}")
            box.setToolTip("Without it the sensor keeps its calibrated zero.")
            field = self._angle(f"initial_{name}", f"{title}: joint angle after initialising.")
            field.setEnabled(False)
            box.toggled.connect(field.setEnabled)
            box.toggled.connect(self._on_edited)
            self.sets[name], self.angles[name] = box, field
            layout.addWidget(box, row, 0)
            layout.addWidget(field, row, 1)
        menu = QMenu(self)
        action = QWidgetAction(menu)
        action.setDefaultWidget(form)
        menu.addAction(action)
        self.setMenu(menu)
        self._say()

    @property
    def fields(self) -> tuple[QWidget, ...]:
        """All that can be typed into."""
        return self.position, *self.angles.values()

    def command(self) -> Initialise:
        """What is asked of the loop."""
        joints = {
            name: math.radians(self.angles[name].value()) if box.isChecked() else None
            for name, box in self.sets.items()
        }
        return Initialise(math.radians(self.position.value()), **joints)

    def show_command(self, values: Initialise) -> None:
        """Fill the form, such as from the rig file."""
        state: dict[str, Any] = {"position": math.degrees(values.position)}
        for name in JOINTS:
            angle = getattr(values, name)
            state[name] = math.degrees(angle) if angle is not None else self.angles[name].value()
            state[f"set_{name}"] = angle is not None
        self.restore(state)

    def state(self) -> dict[str, Any]:
        """Every field."""
        joints = {name: field.value() for name, field in self.angles.items()}
        sets = {f"set_{name}": box.isChecked() for name, box in self.sets.items()}
        return {"position": self.position.value(), **joints, **sets}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Every field as it was."""
        self.position.setValue(state["position"])
        for name, box in self.sets.items():
            self.angles[name].setValue(state[name])
            box.setChecked(state[f"set_{name}"])

    def _angle(self, name: str, help_text: str) -> QDoubleSpinBox:
        field = number(name, 0.0, -LARGEST_DEG, LARGEST_DEG, 1, 1.0, help_text)
        field.valueChanged.connect(self._on_edited)
        return field

    def _on_edited(self) -> None:
        self._say()
        self.edited.emit()

    def _say(self) -> None:
        parts = [f"{self.position.value():g}°"]
        set_here = [name for name, box in self.sets.items() if box.isChecked()]
        parts += [f"{JOINTS[name]} {self.angles[name].value():g}°" for name in set_here]
        if not set_here:
            parts.append("joints as calibrated")
        self.setText(f"To {', '.join(parts)}".replace("-", "−"))


OWN_RUNS = {
    "own_on_air": "n runs on air",
    "own_contact": "n runs in contact",
    "own_both": "n on air, then n in contact",
}
NAMED = {
    "thesis": "As in the thesis",
    "rich": "Rich: air and contact",
    "on-air": "Many motions on air",
    "contact": "Contact",
    "motor-bench": "Motor bench",
}
HANDED = "handed"


class ProtocolForm(QWidget):
    """Signal ``edited``."""

    edited = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._handed: tuple[Step, ...] = ()
        self.which = choice("protocol", {**OWN_RUNS, **NAMED}, "Protocol: which runs are taken.")
        self.which.setCurrentIndex(2)
        self.runs = QSpinBox()
        self.runs.setObjectName("runCount")
        self.runs.setRange(1, 100)
        self.runs.setValue(10)
        self.runs.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.runs.setAccessibleName("Runs of each kind")
        self.runs.setToolTip("Runs of each kind; motion as set under By hand.")
        self.seconds = number("runSeconds", 30.0, 1.0, 3600.0, 1, 5.0, "Seconds of each run.")
        self.rest = number("rest", 2.0, 0.0, 600.0, 1, 1.0, "Rest between runs.")
        self.force = number(
            "contactForce", 0.8, 0.05, 20.0, 2, 0.1, "Contact force: mean of contact runs, found by winding."
        )
        self.amplitude = number(
            "contactAmplitude", 5.0, 0.0, 90.0, 1, 0.5, "Contact amplitude: at the pulley, in contact runs."
        )
        self.total = remark()
        self.total.setObjectName("protocolTotal")
        form = self._form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.setSpacing(3)
        form.addRow("&Protocol", self.which)
        form.addRow("R&uns (n)", self.runs)
        form.addRow("&Each (s)", self.seconds)
        form.addRow("Re&st (s)", self.rest)
        form.addRow("&Force (N)", self.force)
        form.addRow("Press (&°)", self.amplitude)
        form.addRow(self.total)
        self.which.currentIndexChanged.connect(self._on_which)
        self.runs.valueChanged.connect(self.edited)
        for field in (self.seconds, self.rest, self.force, self.amplitude):
            field.valueChanged.connect(self.edited)
        self._on_which()

    def hand(self, steps: Sequence[Step], title: str) -> None:
        """Take the steps of another tab."""
        self._handed = tuple(steps)
        row = self.which.findData(HANDED)
        if row < 0:
            self.which.addItem("", HANDED)
            row = self.which.count() - 1
        self.which.setItemText(row, title or "Handed over")
        self.which.setCurrentIndex(row)
        self.edited.emit()

    @property
    def fields(self) -> tuple[QWidget, ...]:
        """All that can be typed into or chosen."""
        return self.which, self.runs, *self._numbers.values()

    @property
    def _numbers(self) -> dict[str, QDoubleSpinBox]:
        return {"seconds": self.seconds, "rest": self.rest, "force": self.force, "amplitude": self.amplitude}

    def state(self) -> dict[str, Any]:
        """Every field, and the protocol that was handed over."""
        numbers = {name: field.value() for name, field in self._numbers.items()}
        row = self.which.findData(HANDED)
        handed = (self._handed, self.which.itemText(row) if row >= 0 else "")
        return {"which": self.which.currentData(), "runs": self.runs.value(), **numbers, "handed": handed}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Every field as it was."""
        self._handed, title = state["handed"]
        row = self.which.findData(HANDED)
        if row >= 0 and title:
            self.which.setItemText(row, title)
        self.which.setCurrentIndex(self.which.findData(state["which"]))
        self.runs.setValue(state["runs"])
        for name, field in self._numbers.items():
            field.setValue(state[name])
        self.edited.emit()

    def title(self) -> str:
        """Name of the protocol, for the session file."""
        key = str(self.which.currentData())
        return key if key in NAMED else self.which.currentText()

    def steps(self, motion: Mapping[str, Any]) -> tuple[Step, ...]:
        """The steps, with the motion set by hand for the user's own protocols.

        Raises:
            UserError: the motion is impossible.
        """
        from fingerlab.twin.protocols import PROTOCOLS

        plans: Sequence[PlannedRun]
        key = str(self.which.currentData())
        if key == HANDED:
            return self._handed
        if key in PROTOCOLS:
            plans = PROTOCOLS[key](self.amplitude.value())
        else:
            wave = {**motion, "duration_s": self.seconds.value()}
            press = None if key == "own_on_air" else self.amplitude.value()
            plans = own_runs(wave, self.runs.value(), key != "own_contact", press)
        return plan_steps(plans, self.force.value(), self.rest.value())

    def tell_total(self, steps: Sequence[Step]) -> None:
        """How many runs, how long; of one that was handed over also what it is."""
        runs = [step for step in steps if isinstance(step, Record)]
        many = "1 run" if len(runs) == 1 else f"{len(runs)} runs"
        words = f"{many}, about {clock(plan_seconds(steps))}, and the changes of cable."
        if len(runs) == 1 and self.which.currentData() == HANDED:
            words += f" {run_words(runs[0])}"
        self.total.setText(words)

    def _on_which(self) -> None:
        key = str(self.which.currentData())
        for field, shown in (
            (self.runs, key in OWN_RUNS),
            (self.seconds, key in OWN_RUNS),
            (self.rest, key != HANDED),
            (self.force, key not in (HANDED, "own_on_air", "on-air", "motor-bench")),
            (self.amplitude, key not in (HANDED, "own_on_air", "on-air", "motor-bench")),
        ):
            self._form.setRowVisible(field, shown)
        self.edited.emit()


def run_words(run: Record) -> str:
    """``In contact, flexion cable: sine, 1.6°, 2.5 Hz.``; how long it takes is told anyway."""
    phase = PHASE_WORDS.get(run.phase, run.phase)
    cable = f", {run.cable} cable" if run.cable != "none" else ""
    told = {
        key: value for key, value in run.trajectory.items() if key not in ("duration_s", "sha256", "file")
    }
    return f"{phase[:1].upper()}{phase[1:]}{cable}: {trajectory_words(told)}."


def clock(seconds: float) -> str:
    """Minutes and seconds."""
    whole = round(seconds)
    return f"{whole // 60} min {whole % 60:02d} s" if whole >= 60 else f"{whole} s"
