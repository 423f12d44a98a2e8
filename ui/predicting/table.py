"""How well each model tells the force of the run shown: peaks, delay, R², error by phase."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHeaderView, QTableWidgetItem, QWidget

from fingerlab.core.text import fixed, r2_text
from fingerlab.prediction.beside import RunForce
from fingerlab.thesis.prediction import FORCE_PHASES

from ..theme import colours_of
from ..widgets.number_table import NumberTable
from .plots import Shown, sample

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


class NumbersTable(NumberTable):
    """One row a ticked model."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "predictionNumbers", "Numbers of each model on the run shown", COLUMNS, parent=parent
        )
        self.horizontalHeader().setMinimumSectionSize(40)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)

    def show_forces(self, shown: Shown) -> None:
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
