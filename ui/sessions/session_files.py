"""New files from sessions and from text: cut, merged, exported, copied with tags, imported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import (
    QFileDialog,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.library.index import RunStretch, SessionFacts, cut_session, merge_sessions
from fingerlab.library.notes import Note
from fingerlab.sessions.exporting import copy_session
from fingerlab.sessions.model import Run, Session

from ..app.context import ApplicationContext, read_session
from ..app.worker import IsCancelled, Progress
from .import_dialog import TABLE_ENDINGS, ImportDialog

if TYPE_CHECKING:
    pass

OWNER = "library"
SESSION_FILTER = "Session files (*.h5)"
TEXTS = f"Tables ({' '.join(f'*{ending}' for ending in TABLE_ENDINGS)});;All files (*)"
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
        names, _ = QFileDialog.getOpenFileNames(self._widget, "Import tables", str(folder), TEXTS)
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
        plans, rig_file, axis_rig = dialog.plans, dialog.rig_file, dialog.axis_rig
        names = [plan.table.path for plan in plans]
        target = self._ask_file("Import: new session", folder / f"{names[0].stem}.h5")
        if target is None:
            return

        def work(progress: Progress) -> Path:
            from fingerlab.rig.file import default_rig, load_rig
            from fingerlab.sessions.importing import import_files

            bench = load_rig(rig_file) if rig_file is not None else default_rig()
            rig = axis_rig if axis_rig is not None else bench
            title = f"imported from {', '.join(path.name for path in names)}"
            return import_files(plans, target, rig, title, progress=progress)

        self._start(f"Importing {len(plans)} {'table' if len(plans) == 1 else 'tables'}", work)

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
