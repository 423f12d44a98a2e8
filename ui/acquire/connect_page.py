"""Shown while no rig is connected: what was found, in a plain sentence, and what can be used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from ..widgets.labels import heading, remark
from .fields import choice
from .opening import Wanted

if TYPE_CHECKING:
    from fingerlab.devices.protocol import Found

COLUMN_WIDTH = 560
RIG_FILTER = "Rig files (*.toml);;All files (*)"
SESSION_FILTER = "Session files (*.h5 *.hdf5);;All files (*)"


class ConnectPage(QWidget):
    """Signals: chosen(Wanted); rig_file_changed."""

    chosen = Signal(object)
    rig_file_changed = Signal()

    def __init__(self, folder: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.rig_file: Path | None = None
        self._folder = folder
        self._card = ""
        self.title = heading("No rig connected", large=True)
        self.text = remark(
            "Connect one to see it live, drive it and record it. The simulated rig works in the same way as "
            "the real one."
        )
        self.found = QLabel("Looking for a data acquisition card …")
        self.found.setObjectName("foundSentence")
        self.found.setWordWrap(True)
        self.card = QPushButton("Connect to the &card")
        self.card.setObjectName("connectCard")
        self.card.setEnabled(False)
        self.simulated = QPushButton("&Simulated rig")
        self.simulated.setObjectName("connectSimulated")
        self.simulated.setProperty("primary", "true")
        self.effect: QComboBox = choice(
            "simulatedEffect",
            {"": "without a missing effect", "hidden": "with a hidden effect"},
            "Effect: what the simulated rig has that the nominal model lacks.",
        )
        self.effect.setMinimumContentsLength(24)
        self.seed = QSpinBox()
        self.seed.setObjectName("simulatedSeed")
        self.seed.setRange(0, 99_999)
        self.seed.setPrefix("bench ")
        self.seed.setAccessibleName("Number of the simulated bench")
        self.seed.setToolTip(
            "Each number is another bench: other tolerances, other noise, another hidden effect."
        )
        self.replay = QPushButton("&Replay a recording…")
        self.replay.setObjectName("connectReplay")
        self.rig = QPushButton("Rig &file…")
        self.rig.setObjectName("rigFile")
        self.rig_text = remark("Default rig: wiring and limits as in the thesis.")
        self._build()
        self.card.clicked.connect(lambda: self.chosen.emit(Wanted(self._card, self.rig_file)))
        self.simulated.clicked.connect(self._on_simulated)
        self.replay.clicked.connect(self._on_replay)
        self.rig.clicked.connect(self._on_rig)

    def _build(self) -> None:
        column = QWidget()
        column.setMaximumWidth(COLUMN_WIDTH)
        inner = QVBoxLayout(column)
        inner.setSpacing(16)
        inner.addWidget(self.title)
        inner.addWidget(self.text)
        for entries in (
            (self.simulated, self.effect, self.seed),
            (self.card, self.found),
            (self.replay, remark("A recorded run as if it were measured now; nothing moves it.")),
            (self.rig, self.rig_text),
        ):
            line = QHBoxLayout()
            line.setSpacing(8)
            for number, entry in enumerate(entries):
                line.addWidget(entry, 0 if number == 0 or isinstance(entry, QSpinBox) else 1)
            entries[0].setMinimumWidth(168)
            inner.addLayout(line)
        across = QHBoxLayout()
        across.addStretch(1)
        across.addWidget(column, 100)
        across.addStretch(1)
        layout = QVBoxLayout(self)
        layout.addStretch(2)
        layout.addLayout(across)
        layout.addStretch(3)

    # what is shown

    def show_found(self, found: Sequence[Found]) -> None:
        """The card, and whether it can be used."""
        card = found[0]
        self._card = card.name
        self.found.setText(card.sentence[:1].upper() + card.sentence[1:] + ".")
        self.card.setEnabled(card.available)
        self.card.setToolTip("" if card.available else self.found.text())
        simulated = next((one for one in found if one.name == "simulated"), None)
        if simulated is not None and not simulated.available:
            self.simulated.setEnabled(False)
            self.simulated.setToolTip(simulated.sentence)

    def show_effects(self, effects: Sequence[tuple[str, str]]) -> None:
        """Offer effects of the simulated rig."""
        for key, title in effects:
            self.effect.addItem(f"with {title[:1].lower()}{title[1:]}", key)

    def show_busy(self, what: str) -> None:
        """While something is being connected, say so."""
        self.title.setText(f"{what} …" if what else "No rig connected")
        for button in (self.simulated, self.replay, self.rig):
            button.setEnabled(not what)
        self.card.setEnabled(not what and bool(self._card) and not self.card.toolTip())

    # hand

    def _on_simulated(self) -> None:
        self.chosen.emit(
            Wanted("simulated", self.rig_file, str(self.effect.currentData()), self.seed.value())
        )

    def _on_replay(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Replay a recording", self._folder, SESSION_FILTER)
        if name:
            self.chosen.emit(Wanted(f"replay:{name}"))

    def _on_rig(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Rig file", self._folder, RIG_FILTER)
        if name:
            self.rig_file = Path(name)
            self.rig_text.setText(name)
            self.rig_file_changed.emit()
