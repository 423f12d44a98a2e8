"""New files from sessions and from text: cut, merged, exported, copied with tags, imported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QGridLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.library.cutting import RunStretch, cut_session, merge_sessions
from fingerlab.library.index import SessionFacts
from fingerlab.library.notes import Note
from fingerlab.report.diagnosis_words import PHASE_WORDS
from fingerlab.sessions.copying import copy_session
from fingerlab.sessions.format import CABLES, PHASES
from fingerlab.sessions.model import Run, Session

from ..app.context import ApplicationContext, read_session
from ..app.worker import IsCancelled, Progress
from ..widgets.fields import choice
from ..widgets.labels import remark
from ..widgets.layout import hbox

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
OPTION_NAMES = {"--map": "'Columns'", "--rate": "'Samples a second'", "--phase": "phase", "--out": "name"}
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
            name.setTextFormat(Qt.TextFormat.PlainText)
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
        across = hbox(None, self.rig, (self.rig_words, 1))
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
        from fingerlab.sessions.importing import TextRun, describe_all, plan_import

        sources = [
            TextRun(path, str(phase.currentData()), str(cable.currentData()))
            for path, (phase, cable) in zip(self._files, self._each, strict=True)
        ]
        try:
            self.plans = plan_import(sources, self.mapping.text().strip() or None, self.rate.value() or None)
            words = "\n".join(describe_all(self.plans))
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
    for option, name in OPTION_NAMES.items():
        sentence = sentence.replace(option, name)
    return sentence


OWNER = "library"
SESSION_FILTER = "Session files (*.h5)"
TEXTS = "Text files (*.txt *.csv *.tsv);;All files (*)"
FORMATS = {"csv": "CSV", "mat": "MATLAB", "parquet": "Parquet", "txt": "tab-separated text"}


class Writer(QObject):
    """Signal ``written(Path)``: a new session file, or the folder of an export."""

    written = Signal(object)

    def __init__(self, context: ApplicationContext, widget: QWidget, parent: QObject) -> None:
        super().__init__(parent)
        self._context, self._widget = context, widget

    def cut(self, session: Session, run: Run, start: float, stop: float) -> None:
        """Write what lies between two times of a run as a session of its own."""
        suggested = session.path.with_name(f"{session.path.stem}-{run.name}-cut.h5")
        target = self._ask_file("Cut: new session", suggested)
        if target is not None:
            stretch = RunStretch(run, min(start, stop), max(start, stop))
            self._start(
                f"Cutting {session.path.name}",
                lambda progress: cut_session(session, stretch, target, progress),
            )

    def merge(self, paths: Sequence[Path]) -> None:
        """Write the runs of several sessions as one."""
        target = self._ask_file("Merge: new session", paths[0].with_name(f"{paths[0].stem}-merged.h5"))
        if target is None:
            return
        given = tuple(paths)

        def work(progress: Progress) -> Path:
            sessions = [read_session(path) for path in given]
            return merge_sessions(sessions, target, target.stem, progress)

        self._start(f"Merging {len(given)} sessions", work)

    def export(self, path: Path, kind: str) -> None:
        """Write a session for other tools into a folder."""
        name = QFileDialog.getExistingDirectory(
            self._widget, f"Folder for {FORMATS[kind]} files of {path.name}", str(path.parent)
        )
        if not name:
            return
        folder = Path(name)

        def work(progress: Progress) -> Path:
            from fingerlab.sessions.exporting import export_session  # slow to import

            export_session(read_session(path), kind, folder, progress)
            return folder

        self._start(f"Exporting {path.name}", work)

    def copy_with_note(self, facts: SessionFacts, note: Note) -> None:
        """Copy a session and write tags and notes into the copy; the recording stays as it is."""
        suggested = facts.path.with_name(f"{facts.path.stem}-tagged.h5")
        target = self._ask_file("Copy with tags and notes", suggested)
        if target is None:
            return
        tags = list(dict.fromkeys((*facts.tags, *note.tags)))
        notes = "\n".join(text for text in (facts.notes, note.notes) if text)
        attributes: dict[str, Any] = {"tags": tags or None, "notes": notes or None}

        def work(progress: Progress) -> Path:
            progress(0.0, "copying")
            return copy_session(facts.path, target, attributes)

        self._start(f"Copying {facts.path.name}", work)

    def ask_texts(self, folder: Path) -> None:
        """Choose text files of the bench, and go on as with dropped ones."""
        names, _ = QFileDialog.getOpenFileNames(self._widget, "Import text files", str(folder), TEXTS)
        if names:
            self.import_texts([Path(name) for name in names], folder)

    def import_texts(self, files: Sequence[Path], folder: Path) -> None:
        """Ask what text files are, and write them as one session, proposed for ``folder``."""

        self._context.hush()
        try:
            dialog = ImportDialog(sorted(files), self._widget)
        except UserError as error:
            self._context.tell(str(error))
            return
        dialog.accepted.connect(lambda: self._write_texts(dialog, folder))
        dialog.finished.connect(dialog.deleteLater)
        dialog.open()

    def _write_texts(self, dialog: ImportDialog, folder: Path) -> None:
        plans, rig_file = dialog.plans, dialog.rig_file
        names = [plan.table.path for plan in plans]
        target = self._ask_file("Import: new session", folder / f"{names[0].stem}.h5")
        if target is None:
            return

        def work(progress: Progress) -> Path:
            from fingerlab.rig.file import default_rig, load_rig
            from fingerlab.sessions.importing import import_files

            rig = load_rig(rig_file) if rig_file is not None else default_rig()
            title = f"imported from {', '.join(path.name for path in names)}"
            return import_files(plans, target, rig, title, progress=progress)

        self._start(f"Importing {len(plans)} text {'file' if len(plans) == 1 else 'files'}", work)

    def _ask_file(self, title: str, suggested: Path) -> Path | None:
        """Where to; a name that is taken is refused by whoever writes, so the dialog does not offer to."""
        name, _ = QFileDialog.getSaveFileName(
            self._widget,
            title,
            str(suggested),
            SESSION_FILTER,
            options=QFileDialog.Option.DontConfirmOverwrite,
        )
        if not name:
            return None
        path = Path(name)
        return path if path.suffix else path.with_suffix(".h5")

    def _start(self, title: str, write: Callable[[Progress], Path]) -> None:
        self._context.hush()

        def work(progress: Progress, cancelled: IsCancelled) -> Path:
            progress(0.0, "reading")
            return write(progress)

        self._context.tasks.start(title, work, self._on_done, OWNER)

    def _on_done(self, path: Path) -> None:
        self._context.announce(f"Written: {path}", path)
        self.written.emit(path)
