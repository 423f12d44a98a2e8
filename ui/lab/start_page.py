"""The first page: what the program is for, and where to begin: with recordings, with a rig, with neither."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QPushButton, QVBoxLayout, QWidget

from fingerlab.models.file import project_path

from ..widgets.fields import centred_column, set_usable
from ..widgets.labels import WholeLabel, heading, remark
from ..widgets.layout import Item, Spacer, described, hbox, vbox
from .practice import EXAMPLES

WIDTH = 1000
MOST_RECENT = 5
PURPOSE = "Which physical effect is your model missing?"
WHAT_FOR = (
    "FingerLab drives a cable-driven finger, records it, lays the model beside what was measured, says where "
    "the model fails, names the effect that it lacks, and foretells the force of the fingertip with what was "
    "found."
)


class LabStartPage(QWidget):
    """Three cards. Signals: a button was pressed; ``example_asked(name)``, ``recent_asked(path)``."""

    open_asked = Signal()
    connect_asked = Signal()
    practise_asked = Signal()
    example_asked = Signal(str)
    recent_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.open = described(QPushButton("&Open a session…"), "emptyOpen", primary="true")
        self.open.clicked.connect(self.open_asked)
        self.connect_rig = described(QPushButton("&Connect a rig"), "emptyConnect")
        self.connect_rig.setToolTip("The Acquire tab: a data acquisition card, or the simulated rig.")
        self.connect_rig.clicked.connect(self.connect_asked)
        self.practise = described(QPushButton("&Practise on a hidden effect"), "practise")
        self.practise.setToolTip(
            "Records a session from the simulated rig with an effect that is not told: find it, reveal it."
        )
        self.practise.clicked.connect(self.practise_asked)
        self.examples = [self._example(name, title) for name, (title, _) in EXAMPLES.items()]
        self.doing = described(remark(), "emptyDoing")
        self.doing.hide()
        self._recent_title = remark("Recent")
        self._recent = QVBoxLayout()
        self._recent.setSpacing(0)
        page = centred_column(self, WIDTH)
        page.addWidget(heading(PURPOSE, large=True))
        page.addWidget(WholeLabel(WHAT_FOR))
        cards = (
            _card("With recordings", RECORDINGS, self.open, self._recent_title, self._recent),
            _card("With a rig", RIG, self.connect_rig),
            _card("With neither", NEITHER, self.practise, *self.examples),
        )
        page.addLayout(hbox(None, *((card, 1) for card in cards), spacing=16))
        page.addWidget(self.doing)

    def _example(self, name: str, title: str) -> QPushButton:
        button = described(QPushButton(f"Example: {title}"), f"example_{name}", link="true")
        button.setToolTip("Recorded from the simulated rig when it is asked for the first time, then kept.")
        button.clicked.connect(lambda: self.example_asked.emit(name))
        return button

    def show_recording(self, title: str) -> None:
        """While a session is recorded for this page say so here, too; an empty title: none is."""
        self.doing.setText(title)
        self.doing.setVisible(bool(title))
        for button in (self.practise, *self.examples):
            set_usable(button, not title)

    def tell_recording(self, title: str, what: str) -> None:
        """How far that is."""
        if not self.doing.isHidden():
            self.doing.setText(f"{title}: {what}")

    def show_recent(self, paths: Sequence[Path]) -> None:
        """Offer recently opened files."""
        while (item := self._recent.takeAt(0)) is not None:
            widget = item.widget()
            if widget is not None:
                widget.deleteLater()
        for path in paths[:MOST_RECENT]:
            kept = " – with your models and notes" if project_path([path]).is_file() else ""
            button = described(QPushButton(path.name.replace("&", "&&") + kept), link="true", tip=str(path))
            button.setAccessibleName(f"Open {path.name} again")
            button.clicked.connect(lambda _checked=False, p=str(path): self.recent_asked.emit(p))
            self._recent.addWidget(button, 0, Qt.AlignmentFlag.AlignLeft)
        self._recent_title.setVisible(bool(paths))


RECORDINGS = (
    "Open a session file, or drop one anywhere. A text or CSV file that is dropped is imported, with a look "
    "at its columns first."
)
RIG = "See it live, drive it within its limits, and record it; then compare."
NEITHER = (
    "A session of the simulated rig, as it would be recorded: one whose effect is hidden, or an example "
    "whose effect is known."
)


def _card(title: str, words: str, *items: Item) -> QFrame:
    card = QFrame()
    card.setProperty("card", "true")
    vbox(card, heading(title), described(WholeLabel(words), role="muted"), *items, Spacer(1), spacing=8)
    return card
