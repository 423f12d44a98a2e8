"""Text files of the bench to one session: what each is, and what becomes of its columns, seen beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.report.diagnosis_words import PHASE_WORDS
from fingerlab.sessions.format import CABLES, PHASES

from ..acquire.fields import choice
from ..widgets.labels import remark

if TYPE_CHECKING:
    from fingerlab.sessions.importing import ImportPlan

SETTLE_MS = 300
"""After a key, before the files are looked at anew."""

RIGS = "Rig files (*.toml);;All files (*)"
NO_RIG = "The thesis' rig; masses, lengths and springs of the finger are assumed."
COLUMNS_HELP = (
    "Empty: by the header's words, or without a header in the bench's own order (time, command, position, "
    "torque, MCP, PIP, force). Else such as time=1, motor_command=2:deg, motor_torque=4:mNm, "
    "pip_angle=6:deg:-1 (channel = column or header : unit : factor)."
)
FIELDS = {"--map": "'Columns'", "--rate": "'Samples a second'", "--phase": "phase", "--out": "name"}
"""What the sentences of the command call an option, and what it is called here."""


class ImportDialog(QDialog):
    """Asks until the plan is possible; :attr:`plans` and :attr:`rig_file` are read once it is accepted."""

    def __init__(self, files: Sequence[Path], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Import text files – FingerLab")
        self.resize(720, 520)
        self.plans: tuple[ImportPlan, ...] = ()
        self.rig_file: Path | None = None
        self._files = tuple(files)
        self._each = [
            (
                choice(
                    f"importPhase{n}",
                    {key: PHASE_WORDS.get(key, key) for key in PHASES},
                    "Phase: what it was.",
                ),
                choice(f"importCable{n}", {key: key for key in CABLES}, "Cable: the one that was hung in."),
            )
            for n in range(len(self._files))
        ]
        self.mapping = QLineEdit()
        self.mapping.setObjectName("importColumns")
        self.mapping.setPlaceholderText("by the header, or in the bench's own order")
        self.mapping.setAccessibleName("Columns")
        self.mapping.setToolTip(COLUMNS_HELP)
        self.rate = QDoubleSpinBox()
        self.rate.setObjectName("importRate")
        self.rate.setRange(0.0, 1e6)
        self.rate.setSpecialValueText("by the time column")
        self.rate.setAccessibleName("Samples a second")
        self.rate.setToolTip("Needed only where no column holds the time.")
        self.rig = QPushButton("&Rig file…")
        self.rig.setObjectName("importRig")
        self.rig_words = remark(NO_RIG)
        self.seen = QPlainTextEdit()
        self.seen.setObjectName("importSeen")
        self.seen.setReadOnly(True)
        self.seen.setAccessibleName("What becomes of the columns")
        self._build()
        self._connect()
        self.look()

    def _build(self) -> None:
        grid = QGridLayout()
        grid.setColumnStretch(0, 1)
        for row, (path, fields) in enumerate(zip(self._files, self._each, strict=True)):
            name = QLabel(path.name)
            name.setToolTip(str(path))
            grid.addWidget(name, row, 0)
            for column, field in enumerate(fields, start=1):
                grid.addWidget(field, row, column)
        inner = QWidget()
        inner.setLayout(grid)
        room = QScrollArea()
        room.setWidgetResizable(True)
        room.setWidget(inner)
        room.setMaximumHeight(min(inner.sizeHint().height() + 8, 200))
        across = QHBoxLayout()
        across.addWidget(self.rig)
        across.addWidget(self.rig_words, 1)
        form = QFormLayout()
        form.setSpacing(8)
        form.addRow("&Columns", self.mapping)
        form.addRow("&Samples a second", self.rate)
        form.addRow("Bench", across)
        self.buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        self.write = self.buttons.addButton("&Write session…", QDialogButtonBox.ButtonRole.AcceptRole)
        self.write.setObjectName("importWrite")
        layout = QVBoxLayout(self)
        layout.setSpacing(8)
        layout.addWidget(remark("One run a file, in this order. Nothing is written before you have seen it."))
        layout.addWidget(room)
        layout.addLayout(form)
        layout.addWidget(self.seen, 1)
        layout.addWidget(self.buttons)

    def _connect(self) -> None:
        for phase, cable in self._each:
            phase.currentIndexChanged.connect(self.look)
            cable.currentIndexChanged.connect(self.look)
        self._settled = QTimer(self)
        self._settled.setSingleShot(True)
        self._settled.setInterval(SETTLE_MS)
        self._settled.timeout.connect(self.look)
        self.mapping.textChanged.connect(lambda _: self._settled.start())
        self.rate.valueChanged.connect(self.look)
        self.rig.clicked.connect(self._choose_rig)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)

    def look(self) -> None:
        """Plan with the fields as they are, and say what would be written, or why that cannot be."""
        from fingerlab.sessions.importing import TextRun, describe, plan_import

        sources = [
            TextRun(path, str(phase.currentData()), str(cable.currentData()))
            for path, (phase, cable) in zip(self._files, self._each, strict=True)
        ]
        try:
            self.plans = plan_import(sources, self.mapping.text().strip() or None, self.rate.value() or None)
            words = "\n".join(line for plan in self.plans for line in describe(plan))
        except UserError as error:
            self.plans, words = (), in_the_window(str(error))
        self.seen.setPlainText(words)
        self.write.setEnabled(bool(self.plans))
        self.write.setToolTip("" if self.plans else words)

    def accept(self) -> None:
        if self._settled.isActive():  # what stands there now counts
            self._settled.stop()
            self.look()
        if self.plans:
            super().accept()

    def _choose_rig(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Rig file", str(self._files[0].parent), RIGS)
        if name:
            self.rig_file = Path(name)
            self.rig_words.setText(name)


def in_the_window(sentence: str) -> str:
    """A sentence of the command, with the names that its options have here."""
    for option, name in FIELDS.items():
        sentence = sentence.replace(option, name)
    return sentence
