"""Effects of the user's own: laws drafted for one, their folder, which files may be run, and their text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFontDatabase
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QLabel,
    QLayout,
    QListWidget,
    QListWidgetItem,
    QMessageBox,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.report.diagnosis_words import effect_title, in_sentence
from fingerlab.report.line_units import LineUnits

from ..app.window import ask_to_run
from ..widgets.layout import WrappedRow, described, hbox, resize_on_screen, vbox
from ..widgets.tables import remark
from .evidence import FingerprintPlot

if TYPE_CHECKING:
    from fingerlab.diagnosis.draft.laws import DraftLaw
    from fingerlab.diagnosis.score.fitted_model import FittedModel
    from fingerlab.effects.own import OwnFile

ABOUT = (
    "An effect of your own is a Python file. Once you have let it run, the next comparison ranks it with the "
    "rest. After a change it is asked about again."
)
EDITING = (
    "What stands in capitals is to be replaced. After saving, “Let it run…” lets it take part; what is wrong "
    "with it is said there. Help > Documents > Your own effect explains every line."
)
PYTHON = "Python files (*.py)"
EDITOR_WIDTH, EDITOR_HEIGHT = 860, 640
NO_FOLDER = "No folder was chosen yet."
EMPTY_FOLDER = "There is no Python file in this folder."
WIDTH, HEIGHT = 680, 400
DRAFT_WIDTH, DRAFT_HEIGHT = 900, 640
ROOM = 4
"""Below the last law of the list, px."""
ABOUT_DRAFTS = (
    "Points: what the model misses, with 90 % intervals; line: what the whole law tells of it. A law is a "
    "description until it holds on runs that it was not drafted from."
)


class OwnEffects(QDialog):
    """Shows the files of the folder; lets one in, or takes that back."""

    def __init__(self, parent: QWidget | None, folder: str) -> None:
        super().__init__(parent)
        self._start = folder
        self._text: Callable[[Path], str] | None = None
        self.setWindowTitle("Own effects")
        self.setObjectName("ownEffects")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.place = described(remark(""), "ownFolder")
        self.files = described(QListWidget(), "ownFiles", accessible="Files of own effects")
        self.files.setWordWrap(True)
        self.files.currentRowChanged.connect(lambda _row: self._refresh_buttons())
        self.problem = described(QLabel(textFormat=Qt.TextFormat.PlainText, wordWrap=True), "ownProblem")
        self._equation = self._found = ""
        self.new = self._button("&New…", "ownNew", self.write_new)
        self.new.setToolTip("A file with law, parameters and explanation to edit.")
        self.edit = self._button("&Edit…", "ownEdit", self._edit)
        self.choose = self._button("Choose the &folder…", "ownFolderChoose", self._choose)
        self.trust = self._button("&Let it run…", "ownTrust", self._trust)
        self.untrust = self._button("&Do not run it", "ownUntrust", self._untrust)
        self.untrust.setToolTip("Take back that this file may be run; it is asked about again.")
        self.forget = self._button("For&get folder and files", "ownForget", self._forget)
        self._build()
        self._show("")

    def _button(self, text: str, name: str, call: Callable[[], None]) -> QPushButton:
        button = described(QPushButton(text, autoDefault=False), name)
        button.clicked.connect(lambda _checked=False: call())
        return button

    def _build(self) -> None:
        layout = QVBoxLayout(self)
        layout.setSizeConstraint(QLayout.SizeConstraint.SetNoConstraint)  # words may grow, the window stays
        top = hbox(None, (self.place, 1), self.choose)
        beside = WrappedRow((self.new, self.edit, self.trust, self.untrust, self.forget))
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        layout.addWidget(remark(ABOUT))
        layout.addLayout(top)
        layout.addWidget(self.files, 1)
        layout.addWidget(beside)
        layout.addWidget(self.problem)
        layout.addWidget(close)
        resize_on_screen(self, WIDTH, HEIGHT)

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
        self.edit.setEnabled(file is not None)
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

    def start_from(self, equation: str, found: str) -> None:
        """What a new file is to begin with: the equation in which the model fails, and where."""
        self._equation, self._found = equation, found

    def start_from_law(self, text: Callable[[Path], str]) -> None:
        """What a new file holds: the text of a drafted law, by the file's path."""
        self._text = text

    def write_new(self) -> None:
        """A new file from the template, opened for editing; nothing is written before it is saved."""
        from fingerlab.core.trust import read_settings
        from fingerlab.effects import own

        def ask() -> None:
            folder = read_settings().folder
            start = (folder or Path(self._start)) / "my_effect.py"
            name, _ = QFileDialog.getSaveFileName(self, "Name of the new effect", str(start), PYTHON)
            if name:
                path = Path(name)
                make = self._text
                text = make(path) if make else own.template(path, self._equation, self._found)
                own.save_own(path, text)
                self._open(path, text)

        self._try(ask)

    def _edit(self) -> None:
        file = self._chosen()
        if file is not None:
            self._open(Path(file.source.file), file.source.content.decode("utf-8", errors="replace"))

    def _open(self, path: Path, text: str) -> None:
        editor = EffectEditor(self, path, text)
        editor.saved.connect(lambda: self._choose_file(path))
        editor.open()
        self._choose_file(path)

    def _choose_file(self, path: Path) -> None:
        self._show("")
        for row in range(self.files.count()):
            file = self.files.item(row).data(Qt.ItemDataRole.UserRole)
            if Path(file.source.file).name == path.name:
                self.files.setCurrentRow(row)

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


class EffectEditor(QDialog):
    """The text of one file; ``saved`` when it was written. It is not run by that."""

    saved = Signal()

    def __init__(self, parent: QWidget, path: Path, text: str) -> None:
        super().__init__(parent)
        self._path = path
        self.setWindowTitle(f"{path.name} – own effect")
        self.setObjectName("effectEditor")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.text = described(QPlainTextEdit(text), "effectText", accessible="Text of the effect")
        self.text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.text.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.problem = described(QLabel(textFormat=Qt.TextFormat.PlainText, wordWrap=True), "effectProblem")
        self.problem.hide()
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Save | QDialogButtonBox.StandardButton.Close
        )
        described(buttons.button(QDialogButtonBox.StandardButton.Save), "effectSave")
        buttons.accepted.connect(self._save)
        buttons.rejected.connect(self.reject)
        vbox(self, remark(EDITING), (self.text, 1), self.problem, buttons, spacing=8)
        resize_on_screen(self, EDITOR_WIDTH, EDITOR_HEIGHT)

    def _save(self) -> None:
        from fingerlab.effects import own

        try:
            own.save_own(self._path, self.text.toPlainText())
        except UserError as error:
            self.problem.setText(str(error))
            self.problem.show()
            return
        self.text.document().setModified(False)
        self.saved.emit()
        self.accept()

    def reject(self) -> None:
        """Ask where something would be lost."""
        if not self.text.document().isModified() or ask_to_leave(self, self._path):
            super().reject()


def ask_to_leave(parent: QWidget, path: Path) -> bool:
    """Whether what was typed may be lost."""
    box = QMessageBox(parent)
    box.setWindowTitle("FingerLab")
    box.setText(f"{path.name} was changed and is not saved. Leave it as it was?")
    lose = box.addButton("&Leave it as it was", QMessageBox.ButtonRole.DestructiveRole)
    box.setDefaultButton(box.addButton("&Go on editing", QMessageBox.ButtonRole.RejectRole))
    box.exec()
    return box.clickedButton() is lose


def state_words(file: OwnFile) -> str:
    """What became of a file, in a few words."""
    if file.problem:
        return f"does not work. {file.problem}"
    if file.state == "trusted":
        return f"takes part, as {', '.join(effect.title for effect in file.effects)}"
    return "changed since you let it run; not run" if file.state == "changed" else "new; not run"


class DraftDialog(QDialog):
    """The drafted laws, best first, each with a plot and its words; ``own_asked`` with one to go on with."""

    own_asked = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("draftedLaws")
        self.setWindowTitle("Drafted laws – FingerLab")
        resize_on_screen(self, DRAFT_WIDTH, DRAFT_HEIGHT)
        self._laws: tuple[DraftLaw, ...] = ()
        self._line = LineUnits()
        self.list = described(QListWidget(), "draftList", accessible="Drafted laws, best first")
        self.list.currentRowChanged.connect(self._show)
        self.plot = FingerprintPlot()
        self.words = described(QLabel(), "draftWords")
        self.words.setTextFormat(Qt.TextFormat.PlainText)
        self.words.setWordWrap(True)
        self.words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.own = described(QPushButton("&Make it an own effect…"), "draftOwn")
        self.own.setToolTip("Write a file with the law, its parameters and an explanation to edit.")
        self.own.clicked.connect(self._ask)
        self.hint = remark(ABOUT_DRAFTS)
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        vbox(
            self,
            self.list,
            (self.plot, 1),
            self.words,
            self.hint,
            hbox(None, self.own, 1, close, spacing=8),
            spacing=8,
        )

    def show_laws(
        self, laws: Sequence[DraftLaw], last: FittedModel | None, line: LineUnits | None = None
    ) -> None:
        """Other laws, or none; ``last``: the model that they stand beside; ``line``: units of the plot.

        A law itself is one of angles and torques, as its file is.
        """
        from fingerlab.diagnosis.draft.laws import nothing_drafted

        self._laws, self._line = tuple(laws), line or LineUnits()
        self.hint.setText(" ".join(filter(None, (ABOUT_DRAFTS, self._line.arc))))
        self.list.clear()
        for number, law in enumerate(self._laws, 1):
            self.list.addItem(f"{number}. {law.title} ({law.score_before:.2f} to {law.score:.2f} floors)")
        for part in (self.list, self.plot, self.hint, self.own):
            part.setVisible(bool(self._laws))
        self.words.setText("" if self._laws else nothing_drafted(last))
        self.list.setCurrentRow(0)
        rows = sum(self.list.sizeHintForRow(row) for row in range(self.list.count()))
        self.list.setFixedHeight(rows + 2 * self.list.frameWidth() + ROOM)
        # A sentence alone needs no more than its lines.
        resize_on_screen(self, DRAFT_WIDTH, DRAFT_HEIGHT if self._laws else 0)

    @property
    def chosen(self) -> DraftLaw | None:
        """The law that is shown."""
        row = self.list.currentRow()
        return self._laws[row] if 0 <= row < len(self._laws) else None

    def _show(self, _row: int) -> None:
        law = self.chosen
        if law is not None:
            self.plot.show_fingerprint(law.fingerprint and self._line.fingerprint(law.fingerprint))
            story = law.told(lambda effect: in_sentence(effect_title(effect)))
            self.words.setText("\n".join(line.strip() for line in story.splitlines()))

    def _ask(self) -> None:
        if self.chosen is not None:
            self.own_asked.emit(self.chosen)
