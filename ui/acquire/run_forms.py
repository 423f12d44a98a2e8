"""Forms of the side panel: values after initialising, and which protocol is run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QGridLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QWidget,
)

from fingerlab.acquisition.control.machine import LARGEST_DEG, Initialise
from fingerlab.acquisition.protocols.steps import (
    PlannedRun,
    Record,
    Step,
    own_runs,
    plan_seconds,
    plan_steps,
    scan_runs,
    steps_from,
)
from fingerlab.core.errors import UserError
from fingerlab.report.diagnosis_words import PHASE_WORDS
from fingerlab.rig.file import Rig, changed_words
from fingerlab.sessions.trajectory import trajectory_words

from ..widgets.fields import WholeField, choice, form_menu, number, refuse_entries
from ..widgets.layout import described
from ..widgets.tables import heading, remark
from .force_trial_form import ForceTrialFields

if TYPE_CHECKING:
    from fingerlab.acquisition.protocols.force_trial import ForceTrial

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
        form_menu(self, form)
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
    "own_scan": "Scan on air",
}
SCANNED = {"frequency_hz": "Frequency (Hz)", "amplitude_deg": "Amplitude (°)", "offset_deg": "Offset (°)"}
SCAN_HELP = (
    "{}: several values such as '5 10 15', or '0.5 to 3 in 6' (with 'log' behind it: each by as many times "
    "more). Every one is taken with every one of the other two; left empty, it is as set under By hand."
)
TABLE, FORCE_TRIAL = "table", "force_trial"
NO_TABLE = "No table of runs is chosen; choose one, or another protocol."
TABLE_FILTER = "Text tables (*.csv *.txt *.tsv);;All files (*)"
TABLE_HELP = (
    "A row for each kind of run: phase, kind, amplitude_deg, frequency_hz, ...; a number may be a scan."
)
NAMED = {
    "thesis": "As in the thesis",
    "rich": "Rich: air and contact",
    "on-air": "Many motions on air",
    "contact": "Contact",
    "motor-bench": "Motor bench",
}
HANDED = "handed"
TRIAL_NAME = "Force trial"
WITHOUT_CONTACT = ("own_on_air", "own_scan", "on-air", "motor-bench")
MOST_RUNS = 1000


class ProtocolForm(QWidget):
    """Signal ``edited``."""

    edited = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._handed: tuple[Step, ...] = ()
        self._table: Path | None = None
        entries = {**OWN_RUNS, **NAMED, FORCE_TRIAL: TRIAL_NAME, TABLE: "A table of runs"}
        self.which = choice("protocol", entries, "Protocol: which runs are taken.")
        self.which.setCurrentIndex(2)
        self.runs = described(WholeField(), "runCount", accessible="Runs of each kind")
        self.runs.setRange(1, 100)
        self.runs.setValue(10)
        self.runs.setToolTip("Runs of each kind; motion as set under By hand.")
        self.seconds = number("runSeconds", 30.0, 1.0, 3600.0, 1, 5.0, "Seconds of each run.")
        self.rest = number("rest", 2.0, 0.0, 600.0, 1, 1.0, "Rest between runs.")
        self.force = number(
            "contactForce", 0.8, 0.05, 20.0, 2, 0.1, "Contact force: mean of contact runs, found by winding."
        )
        self.amplitude = number(
            "contactAmplitude", 5.0, 0.0, 90.0, 1, 0.5, "Contact amplitude: at the pulley, in contact runs."
        )
        self.scans = {name: self._scan(name, title) for name, title in SCANNED.items()}
        self.scans["frequency_hz"].setText("0.5 to 3 in 6")
        self.table = described(QPushButton("Choose…"), "runTable", tip=TABLE_HELP)
        self.first = described(WholeField(), "firstRun", accessible="First run that is taken")
        self.first.setRange(1, MOST_RUNS)
        self.first.setToolTip("From run: the first that is taken, such as the one in which it was stopped.")
        self.total = described(remark(), "protocolTotal")
        form = self._form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.setSpacing(3)
        self.trial = ForceTrialFields(self)
        self.planned: ForceTrial | None = None
        form.addRow("&Protocol", self.which)
        form.addRow("File", self.table)
        self.trial.add_to(form)
        for name, title in SCANNED.items():
            form.addRow(title, self.scans[name])
        form.addRow("R&uns (n)", self.runs)
        form.addRow("Each (s)", self.seconds)
        form.addRow("Re&st (s)", self.rest)
        form.addRow("Force (N)", self.force)
        form.addRow("Press (&°)", self.amplitude)
        form.addRow("From run", self.first)
        form.addRow(self.total)
        self.which.currentIndexChanged.connect(self._on_which)
        self.table.clicked.connect(self._choose_table)
        self.trial.changed.connect(self.edited)
        for field in (self.runs, self.first, *self._numbers.values()):
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
        numbers = self._numbers.values()
        return self.which, *self.scans.values(), *self.trial.fields, self.runs, *numbers, self.first

    @property
    def _numbers(self) -> dict[str, QDoubleSpinBox]:
        times = {"seconds": self.seconds, "rest": self.rest}
        return {**times, "force": self.force, "amplitude": self.amplitude}

    def state(self) -> dict[str, Any]:
        """Every field, and the protocol that was handed over."""
        numbers = {name: field.value() for name, field in self._numbers.items()}
        row = self.which.findData(HANDED)
        handed = (self._handed, self.which.itemText(row) if row >= 0 else "")
        chosen = {
            "which": self.which.currentData(),
            "scans": {name: field.text() for name, field in self.scans.items()},
            "table": self._table,
            "trial": self.trial.state(),
        }
        return {**chosen, "runs": self.runs.value(), "first": self.first.value(), **numbers, "handed": handed}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Every field as it was."""
        self._handed, title = state["handed"]
        row = self.which.findData(HANDED)
        if row >= 0 and title:
            self.which.setItemText(row, title)
        self._name_table(state["table"])
        self.trial.restore(state["trial"])
        self.which.setCurrentIndex(self.which.findData(state["which"]))
        for name, scan in self.scans.items():
            scan.setText(state["scans"][name])
        self.runs.setValue(state["runs"])
        self.first.setValue(state["first"])
        for name, field in self._numbers.items():
            field.setValue(state[name])
        self.edited.emit()

    @property
    def own(self) -> bool:
        """Whether its motion is the one that is set by hand."""
        return str(self.which.currentData()) in OWN_RUNS

    def refuse_fingers(self, why: str) -> None:
        """Protocols with a finger cannot be chosen now; empty: they can."""
        with_finger = (*OWN_RUNS, *NAMED, FORCE_TRIAL)
        refuse_entries(self.which, {key: why for key in with_finger if key != "motor-bench"})

    def show_rig(self, rig: Rig) -> None:
        """The rig that is connected, whose limits a force trial keeps."""
        self.trial.show_rig(rig)
        self.edited.emit()

    @property
    def missing(self) -> str:
        """What has to be chosen before the protocol can run, a sentence; empty where nothing has."""
        key = self.which.currentData()
        if key == FORCE_TRIAL:
            return self.trial.missing
        return NO_TABLE if key == TABLE and self._table is None else ""

    def title(self) -> str:
        """Name of the protocol, for the session file."""
        key = str(self.which.currentData())
        title = key if key in NAMED else "feed-forward" if key == FORCE_TRIAL else self.which.currentText()
        if key == TABLE and self._table is not None:
            title = self._table.stem
        return title if self._first_run == 1 else f"{title}, from run {self._first_run}"

    def steps(self, motion: Mapping[str, Any]) -> tuple[Step, ...]:
        """The steps, with the motion set by hand for the user's own protocols; ``planned`` is their trial.

        Raises:
            UserError: the motion is impossible.
        """
        self.planned = None
        return steps_from(self._all_steps(motion), self._first_run)

    @property
    def _first_run(self) -> int:
        """Of a force trial always the first: what it sends it learns from its own runs before."""
        return 1 if self.which.currentData() == FORCE_TRIAL else self.first.value()

    def _all_steps(self, motion: Mapping[str, Any]) -> tuple[Step, ...]:
        from fingerlab.twin.protocols import PROTOCOLS, read_run_table

        plans: Sequence[PlannedRun]
        key = str(self.which.currentData())
        if key == HANDED:
            return self._handed
        if key == FORCE_TRIAL:
            self.planned = self.trial.trial(self.force.value(), self.rest.value())
            return self.planned.steps()
        if key == TABLE:
            if self._table is None:
                raise UserError(NO_TABLE)
            plans = read_run_table(self._table)
        elif key in PROTOCOLS:
            plans = PROTOCOLS[key](self.amplitude.value())
        else:
            wave = {
                name: value for name, value in motion.items() if name not in ("until_stopped", "pattern_s")
            }
            wave["duration_s"] = self.seconds.value()
            press = None if key in ("own_on_air", "own_scan") else self.amplitude.value()
            if key == "own_scan":
                plans = scan_runs(wave, self._scanned())
            else:
                plans = own_runs(wave, self.runs.value(), key != "own_contact", press)
        return plan_steps(plans, self.force.value(), self.rest.value())

    def _scan(self, name: str, title: str) -> QLineEdit:
        """The field of a number that may be scanned: several values, as in a cell of a table of runs."""
        words = title.split(" (")[0]
        field = described(QLineEdit(), f"scan_{name}", accessible=words, tip=SCAN_HELP.format(words))
        field.setPlaceholderText("as by hand")
        field.textChanged.connect(self.edited)
        return field

    def _scanned(self) -> dict[str, list[float]]:
        """The values of each number that is scanned.

        Raises:
            UserError: what was typed is none, none is scanned, or they make too many runs.
        """
        from fingerlab.twin.protocols import scan_values

        typed = {name: field.text().strip() for name, field in self.scans.items()}
        scans = {
            name: scan_values(text, SCANNED[name].split(" (")[0]) for name, text in typed.items() if text
        }
        count = math.prod(map(len, scans.values()))
        if not scans:
            raise UserError("Nothing is scanned; give several values of a number, such as 0.5 to 3 in 6.")
        if count > MOST_RUNS:
            raise UserError(f"The scans make {count} runs, more than {MOST_RUNS}; take fewer values.")
        return scans

    def tell_total(self, steps: Sequence[Step]) -> None:
        """How many runs, how long; of one that was handed over also what it is."""
        runs = [step for step in steps if isinstance(step, Record)]
        self.first.setMaximum(max((step.count for step in runs), default=MOST_RUNS))
        many = "1 run" if len(runs) == 1 else f"{len(runs)} runs"
        words = f"{many}, about {clock(plan_seconds(steps))}, and the changes of cable."
        if len(runs) == 1 and self.which.currentData() == HANDED:
            words += f" {run_words(runs[0])}"
        self.total.setText(words)

    def _on_which(self) -> None:
        key = str(self.which.currentData())
        for field, shown in (
            (self.table, key == TABLE),
            *((field, key == "own_scan") for field in self.scans.values()),
            (self.runs, key in OWN_RUNS and key != "own_scan"),
            (self.seconds, key in OWN_RUNS),
            (self.rest, key not in (HANDED, FORCE_TRIAL)),
            (self.force, key not in (HANDED, FORCE_TRIAL, *WITHOUT_CONTACT)),
            (self.amplitude, key not in (HANDED, TABLE, FORCE_TRIAL, *WITHOUT_CONTACT)),
            (self.first, key != FORCE_TRIAL),
        ):
            self._form.setRowVisible(field, shown)
        self.trial.set_shown(key == FORCE_TRIAL)
        self.first.setValue(1)
        self.edited.emit()

    def go_on_from(self, number_: int) -> None:
        """The next start goes on with this run."""
        self.first.setMaximum(max(number_, self.first.maximum()))
        self.first.setValue(number_)

    def _choose_table(self) -> None:
        folder = str(self._table.parent if self._table is not None else Path.home())
        name, _ = QFileDialog.getOpenFileName(self, "Table of runs", folder, TABLE_FILTER)
        if name:
            self._name_table(Path(name))
            self.edited.emit()

    def _name_table(self, path: Path | None) -> None:
        self._table = path
        self.table.setText(path.name.replace("&", "&&") if path is not None else "Choose…")
        self.table.setToolTip(TABLE_HELP if path is None else str(path))


def run_words(run: Record) -> str:
    """``In contact, flexion cable: sine, 1.6°, 2.5 Hz.``; how long it takes is told anyway."""
    phase = PHASE_WORDS.get(run.phase, run.phase)
    cable = f", {run.cable} cable" if run.cable != "none" else ""
    motion = {
        key: value for key, value in run.trajectory.items() if key not in ("duration_s", "sha256", "file")
    }
    words = ", ".join(filter(None, (trajectory_words(motion), changed_words(run.attributes))))
    return f"{phase[:1].upper()}{phase[1:]}{cable}: {words}."


def clock(seconds: float) -> str:
    """Minutes and seconds."""
    whole = round(seconds)
    return f"{whole // 60} min {whole % 60:02d} s" if whole >= 60 else f"{whole} s"
