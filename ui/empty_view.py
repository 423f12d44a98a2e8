"""Shown while no session is open, or before its first result: what will be here, and the way to it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from .widgets.focus import set_usable
from .widgets.labels import heading, remark

COLUMN_WIDTH = 520


class EmptyView(QWidget):
    """Signals ``open_asked``, ``practise_asked``, ``recent_asked(path)``."""

    open_asked = Signal()
    practise_asked = Signal()
    recent_asked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        title = heading("No session open", large=True)
        text = remark(
            "Open a session file, or drop one here. Measured and modelled will then stand side by side, with "
            "where the model fails and which physical effect is missing."
        )
        self.open = QPushButton("&Open a session…")
        self.open.setProperty("primary", "true")
        self.open.setObjectName("emptyOpen")
        self.practise = QPushButton("&Practise on a hidden effect")
        self.practise.setObjectName("practise")
        self.practise.setToolTip(
            "Records a session from the simulated rig with an effect that is not told: find it, reveal it."
        )
        self.open.clicked.connect(self.open_asked)
        self.practise.clicked.connect(self.practise_asked)
        buttons = QHBoxLayout()
        buttons.setSpacing(8)
        buttons.addWidget(self.open)
        buttons.addWidget(self.practise)
        buttons.addStretch(1)
        self.doing = remark()
        self.doing.setObjectName("emptyDoing")
        self.doing.hide()
        self._recent_title = remark("Recent")
        self._recent = QVBoxLayout()
        self._recent.setSpacing(0)
        column = QWidget()
        column.setMaximumWidth(COLUMN_WIDTH)
        inner = QVBoxLayout(column)
        inner.setSpacing(16)
        inner.addWidget(title)
        inner.addWidget(text)
        inner.addLayout(buttons)
        inner.addWidget(self.doing)
        inner.addWidget(self._recent_title)
        inner.addLayout(self._recent)
        across = QHBoxLayout()
        across.addStretch(1)
        across.addWidget(column, 100)  # takes all up to its widest, so that its text gets the height it needs
        across.addStretch(1)
        layout = QVBoxLayout(self)
        layout.addStretch(2)
        layout.addLayout(across)
        layout.addStretch(3)

    def show_practice(self, on: bool) -> None:
        """While a practice session is recorded say so where it was asked for, too."""
        self.doing.setText("Recording a practice session")
        self.doing.setVisible(on)
        set_usable(self.practise, not on)

    def tell_practice(self, what: str) -> None:
        """How far that is."""
        if not self.doing.isHidden():
            self.doing.setText(f"Recording a practice session: {what}")

    def show_recent(self, paths: Sequence[Path]) -> None:
        """Offer recently opened files."""
        while (item := self._recent.takeAt(0)) is not None:
            widget = item.widget()
            if widget is not None:
                widget.deleteLater()
        for path in paths[:5]:
            button = QPushButton(path.name.replace("&", "&&"))
            button.setProperty("step", "true")
            button.setToolTip(str(path))
            button.setAccessibleName(f"Open {path.name} again")
            button.clicked.connect(lambda _checked=False, p=str(path): self.recent_asked.emit(p))
            self._recent.addWidget(button)
        self._recent_title.setVisible(bool(paths))


class WaitingView(QWidget):
    """A session is open and its first comparison is not there (yet). Signal ``compare_asked``."""

    compare_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.title = heading(large=True)
        self.title.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        self.what = remark()
        self.what.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        self.compare = QPushButton("Compare &model and measurement")
        self.compare.setObjectName("compareAgain")
        self.compare.setProperty("primary", "true")
        self.compare.clicked.connect(self.compare_asked)
        layout = QVBoxLayout(self)
        layout.setSpacing(16)
        layout.addStretch(2)
        layout.addWidget(self.title)
        layout.addWidget(self.what)
        layout.addWidget(self.compare, 0, Qt.AlignmentFlag.AlignHCenter)
        layout.addStretch(3)
        self.show_state(False, "")

    def show_state(self, running: bool, what: str) -> None:
        """While the comparison runs, say how far it is; else offer to run it."""
        self.title.setText("Comparing model and measurement" if running else "Not compared yet")
        self.what.setText(what if running else "The comparison was stopped or failed before it had a result.")
        self.compare.setVisible(not running)
