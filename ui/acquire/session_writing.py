"""From the recording to its file: what the operator says of it, how far the writing is, and putting it off.

Nothing is lost by putting it off: the runs are closed by then, and whoever opens the session finishes it.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.core.errors import Cancelled

from ..app.bars import time_left
from ..widgets.fields import PROGRESS_STEPS
from ..widgets.layout import hbox


@dataclass
class SessionDetails:
    """What the operator says of the session to come."""

    folder: Path
    title: str = ""
    operator: str = ""
    notes: str = ""

    def attributes(self) -> dict[str, str]:
        """For the session file; without what was left empty."""
        return {name: text for name in ("operator", "notes") if (text := getattr(self, name).strip())}


class DetailsDialog(QDialog):
    """Fills :class:`SessionDetails` when it is accepted."""

    def __init__(self, details: SessionDetails, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Session to record – FingerLab")
        self.resize(520, 320)
        self._details = details
        self.folder = QLineEdit(str(details.folder))
        self.folder.setObjectName("recordFolder")
        choose = QPushButton("Choose…")
        choose.clicked.connect(self._choose)
        across = hbox(None, (self.folder, 1), choose)
        self.title_field = QLineEdit(details.title)
        self.operator_field = QLineEdit(details.operator)
        self.notes = QPlainTextEdit(details.notes)
        self.notes.setTabChangesFocus(True)
        form = QFormLayout(self)
        form.setSpacing(8)
        label = QLabel("&Folder")
        label.setBuddy(self.folder)
        form.addRow(label, across)
        for words, name, field in (
            ("&Title", "Title", self.title_field),
            ("&Operator", "Operator", self.operator_field),
            ("&Notes", "Notes", self.notes),
        ):
            field.setAccessibleName(name)
            form.addRow(words, field)
        self.folder.setAccessibleName("Folder")
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel
        )
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        form.addRow(buttons)

    def accept(self) -> None:
        details = self._details
        details.folder = Path(self.folder.text()).expanduser()
        details.title = self.title_field.text()
        details.operator = self.operator_field.text()
        details.notes = self.notes.toPlainText()
        super().accept()

    def _choose(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Folder for recordings", self.folder.text())
        if name:
            self.folder.setText(name)


CLOSING_S = 10.0
"""A window that closes waits so long for a session (an hour's is written meanwhile); then it is put off."""


@dataclass(frozen=True)
class SessionEnding:
    """What became of a session: its path, and whether it is written and verified or was put off."""

    path: Path
    whole: bool


class SessionWriting(QObject):
    """Closes one session at a time.

    Attributes:
        share: done, 0 to 1. words: what is being done and the time left; empty when nothing is.

    Signal ``changed``.
    """

    changed = Signal()
    _went_on = Signal(float, str)

    def __init__(self, parent: QObject | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(parent)
        self.share, self.words = 0.0, ""
        self._clock, self._began, self._until = clock, 0.0, math.inf
        self._later = threading.Event()
        self._told = (-1, "")
        self._went_on.connect(self._on_went_on)

    @property
    def under_way(self) -> bool:
        """Whether a session is being written."""
        return bool(self.words)

    @property
    def asked_to_wait(self) -> bool:
        """Whether it is about to be put off."""
        return self.under_way and self._later.is_set()

    def put_off(self) -> None:
        """Stop here; the recording stays as it is and is finished when it is opened."""
        if self.under_way:
            self._later.set()
            self._show("Putting it off …")

    def hurry(self) -> None:
        """The window closes, or the bench: what is written now, or next, is put off where it takes long."""
        self._until = self._clock() + CLOSING_S

    def over(self) -> None:
        """The session is written, put off, or could not be written."""
        self.share, self._until = 0.0, math.inf
        self._show("")

    # in the worker

    def close(self, bench: Bench, path: Path) -> SessionEnding:
        """Write and verify the session that the bench's recorder has open under this name.

        Raises:
            UserError: it could not be written.
        """
        self._later.clear()
        self._told, self._began = (-1, ""), self._clock()
        try:
            return SessionEnding(bench.recorder.close(self._report), True)
        except Cancelled:
            return SessionEnding(path, False)

    def _report(self, share: float, what: str) -> None:
        """Asked a hundred times a second; told when something of it changes on the screen."""
        if self._later.is_set() or self._clock() > self._until:
            raise Cancelled
        now = round(PROGRESS_STEPS * share), what
        if now != self._told:
            self._told = now
            self._went_on.emit(share, what)

    # in the window

    def _on_went_on(self, share: float, what: str) -> None:
        if self._later.is_set():
            return
        self.share = share
        left = time_left(share, self._clock() - self._began)
        self._show(f"{what.capitalize()}, {left}" if left else f"{what.capitalize()} …")

    def _show(self, words: str) -> None:
        self.words = words
        self.changed.emit()
