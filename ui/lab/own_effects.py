"""Effects of the user's own: the folder in which they are, and which of its files may be run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QLabel,
    QLayout,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from fingerlab.core.errors import UserError

from ..app.dialogs import ask_to_run
from ..widgets.labels import remark
from ..widgets.layout import Spacer, described, hbox

if TYPE_CHECKING:
    from fingerlab.effects.own import OwnFile

ABOUT = (
    "An effect of your own is a Python file. Once you have let it run, the next comparison ranks it with the "
    "rest. After a change it is asked about again."
)
NO_FOLDER = "No folder was chosen yet."
EMPTY_FOLDER = "There is no Python file in this folder."
WIDTH, HEIGHT = 620, 400


class OwnEffects(QDialog):
    """Shows the files of the folder; lets one in, or takes that back."""

    def __init__(self, parent: QWidget | None, folder: str) -> None:
        super().__init__(parent)
        self._start = folder
        self.setWindowTitle("Own effects")
        self.setObjectName("ownEffects")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.place = remark("")
        self.place.setObjectName("ownFolder")
        self.files = described(QListWidget(), "ownFiles", accessible="Files of own effects")
        self.files.setWordWrap(True)
        self.files.currentRowChanged.connect(lambda _row: self._refresh_buttons())
        self.problem = QLabel()
        self.problem.setTextFormat(Qt.TextFormat.PlainText)
        self.problem.setObjectName("ownProblem")
        self.problem.setWordWrap(True)
        self.choose = self._button("Choose the &folder…", "ownFolderChoose", self._choose)
        self.trust = self._button("&Let it run…", "ownTrust", self._trust)
        self.untrust = self._button("&Do not run it", "ownUntrust", self._untrust)
        self.untrust.setToolTip("Take back that this file may be run; it is asked about again.")
        self.forget = self._button("For&get folder and files", "ownForget", self._forget)
        self._build()
        self._show("")

    def _button(self, text: str, name: str, call: Callable[[], None]) -> QPushButton:
        button = QPushButton(text)
        button.setObjectName(name)
        button.setAutoDefault(False)
        button.clicked.connect(lambda _checked=False: call())
        return button

    def _build(self) -> None:
        layout = QVBoxLayout(self)
        layout.setSizeConstraint(QLayout.SizeConstraint.SetNoConstraint)  # words may grow, the window stays
        top = hbox(None, (self.place, 1), self.choose)
        beside = hbox(None, self.trust, self.untrust, Spacer(1), self.forget)
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        layout.addWidget(remark(ABOUT))
        layout.addLayout(top)
        layout.addWidget(self.files, 1)
        layout.addLayout(beside)
        layout.addWidget(self.problem)
        layout.addWidget(close)
        self.resize(WIDTH, HEIGHT)

    # what is shown

    def _show(self, problem: str) -> None:
        """What is known now, and ``problem``: a sentence on what went wrong, or nothing."""
        from fingerlab.core.trust import read_settings
        from fingerlab.effects import CATALOGUE, own

        row = max(self.files.currentRow(), 0)
        self.files.clear()
        folder: Path | None = None
        found: tuple[OwnFile, ...] = ()
        try:
            folder, found = read_settings().folder, own.own_files(CATALOGUE)
        except UserError as error:
            problem = problem or str(error)
        for file in found:
            item = QListWidgetItem(f"{Path(file.source.file).name}: {state_words(file)}")
            item.setData(Qt.ItemDataRole.UserRole, file)
            self.files.addItem(item)
        self.files.setCurrentRow(min(row, self.files.count() - 1))
        place = NO_FOLDER if folder is None else f"Folder: {folder}"
        self.place.setText(place if folder is None or found else f"{place}\n{EMPTY_FOLDER}")
        self.problem.setText(problem)
        self.problem.setVisible(bool(problem))
        self.forget.setEnabled(folder is not None)
        self._refresh_buttons()

    def _refresh_buttons(self) -> None:
        file = self._chosen()
        self.trust.setEnabled(file is not None and file.state != "trusted")
        self.untrust.setEnabled(file is not None and file.state != "waiting")

    def _chosen(self) -> OwnFile | None:
        item = self.files.currentItem()
        return None if item is None else item.data(Qt.ItemDataRole.UserRole)

    # hand

    def _choose(self) -> None:
        from fingerlab.effects import own

        name = QFileDialog.getExistingDirectory(self, "Folder of own effects", self._start)
        if name:
            self._try(lambda: own.set_folder(Path(name)))

    def _trust(self) -> None:
        from fingerlab.effects import CATALOGUE, own

        file = self._chosen()
        if file is None:
            return
        source = file.source
        if ask_to_run(self, Path(source.file), source.content, file.state == "changed", "it"):
            self._try(lambda: own.trust(source, CATALOGUE))

    def _untrust(self) -> None:
        from fingerlab.effects import own

        file = self._chosen()
        if file is not None:
            self._try(lambda: own.distrust(Path(file.source.file)))

    def _forget(self) -> None:
        from fingerlab.effects import own

        self._try(own.forget)

    def _try(self, change: Callable[[], object]) -> None:
        try:
            change()
        except UserError as error:
            self._show(str(error))
        else:
            self._show("")


def state_words(file: OwnFile) -> str:
    """What became of a file, in a few words."""
    if file.problem:
        return f"does not work. {file.problem}"
    if file.state == "trusted":
        return f"takes part, as {', '.join(effect.title for effect in file.effects)}"
    return "changed since you let it run; not run" if file.state == "changed" else "new; not run"
