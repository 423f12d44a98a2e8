"""What is done to the files of a folder: cut, merged, exported, imported, diagnosed; and undone."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from PySide6.QtCore import QFile, QObject, QStandardPaths, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from fingerlab.core.errors import UserError
from fingerlab.library.index import RunStretch, SessionFacts, cut_session, merge_sessions
from fingerlab.library.notes import Note
from fingerlab.sessions.exporting import copy_session
from fingerlab.sessions.model import Run, Session

from ..app.bars import time_left
from ..app.context import ApplicationContext, read_session
from ..app.undo import UndoSteps
from ..app.worker import IsCancelled, Progress, Worker
from .import_dialog import TABLE_ENDINGS, ImportDialog

if TYPE_CHECKING:
    from fingerlab.batch.run import BatchResult


class Gone(UserError):
    """What was done can never be taken back any more, or never be done again."""


class Edit(Protocol):
    """Something that was done and can be taken back; ``words`` name it in the status line."""

    @property
    def words(self) -> str: ...

    def undo(self) -> None: ...

    def redo(self) -> None: ...


@dataclass(frozen=True)
class NoteEdit:
    """Other tags and notes of a session. ``write`` puts a note down and shows it."""

    facts: SessionFacts
    before: Note
    after: Note
    write: Callable[[SessionFacts, Note], None]

    @property
    def words(self) -> str:
        return f"tags and notes of {self.facts.name}"

    def undo(self) -> None:
        self.write(self.facts, self.before)

    def redo(self) -> None:
        self.write(self.facts, self.after)


class FileEdit:
    """A new session file. To undo it is to move it to the desktop's trash, from where it comes back.

    Args:
        in_use: whether a file is open in the window now.
    """

    def __init__(self, path: Path, in_use: Callable[[Path], bool]) -> None:
        self.path = path
        self._in_use = in_use
        self._stamp = _stamp(path)
        self._in_trash: Path | None = None

    @property
    def words(self) -> str:
        return f"new file {self.path.name}"

    def undo(self) -> None:
        if self._in_use(self.path):
            raise UserError(f"{self.path} is open; close it before its making is undone.")
        if _stamp(self.path) != self._stamp:
            raise Gone(f"{self.path} was changed or moved since it was written; nothing was undone.")
        # Where the trash's folder is missing, as for a new user, Qt makes none.
        place = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.GenericDataLocation)
        with suppress(OSError):
            Path(place).mkdir(parents=True, exist_ok=True)
        file = QFile(str(self.path))
        if not file.moveToTrash():
            # Gone: a disk without a trash has none later either, and would bar the way to older steps.
            raise Gone(
                f"{self.path} stays, for there is no trash that it can be moved to (a network folder or a "
                "memory card may have none); delete it in the file manager if it is not wanted."
            )
        self._in_trash = Path(file.fileName()) if file.fileName() else None

    def redo(self) -> None:
        kept = self._in_trash
        if kept is None or not kept.is_file():
            raise Gone(f"{self.path.name} is not in the trash any more; make it again.")
        if self.path.exists():
            raise UserError(f"{self.path} is there already; nothing was brought back over it.")
        try:
            shutil.move(kept, self.path)
        except OSError as error:
            raise UserError(
                f"{self.path} cannot be brought back from the trash ({error.strerror})."
            ) from None
        # On Linux the trash keeps a line beside each file on where it came from.
        (kept.parent.parent / "info" / f"{kept.name}.trashinfo").unlink(missing_ok=True)
        self._stamp = _stamp(self.path)


class EditHistory(UndoSteps[Edit]):
    """Steps are edits, which undo and redo themselves."""

    def undo(self) -> str:
        """Take the last thing back; returns its words.

        Raises:
            UserError: why it cannot be taken back now; it may be tried again, unless it is :class:`Gone`.
        """
        return self._step(self._done, self._undone, lambda edit: edit.undo())

    def redo(self) -> str:
        """The opposite of :meth:`undo`, with the same errors."""
        return self._step(self._undone, self._done, lambda edit: edit.redo())

    def _step(self, source: list[Edit], target: list[Edit], do: Callable[[Edit], None]) -> str:
        edit = source[-1]
        try:
            do(edit)
            target.append(edit)
        except Gone:
            source.remove(edit)
            raise
        else:
            source.remove(edit)
        finally:
            self.changed.emit()
        return edit.words


def _stamp(path: Path) -> tuple[int, int] | None:
    """Size and time of a file; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_size, found.st_mtime_ns


Row = dict[str, Any]
BatchCall = Callable[[Path, Callable[[Row], None], int, Progress, IsCancelled], "tuple[BatchResult, Path]"]


def diagnose_all(
    folder: Path, found: Callable[[Row], None], processes: int, progress: Progress, cancelled: IsCancelled
) -> tuple[BatchResult, Path]:
    """What ``fingerlab batch`` does, with a table beside the sessions; in the background.

    Raises:
        UserError: there is no session, or the table cannot be written. Cancelled: it was stopped.
    """
    from fingerlab.batch.run import locally, run_batch, table_beside
    from fingerlab.batch.table import Options
    from fingerlab.effects import CATALOGUE, own

    table = table_beside(folder)
    options = Options((), own.trusted_sources(CATALOGUE))
    runner = locally(processes, cancelled)
    return run_batch(folder, table, options, runner, False, progress, cancelled, found), table


class BatchControl(QObject):
    """One batch at a time.

    Signals:
        found(row): one more session was diagnosed, or could not be.
        progress_changed(words): how far it is; empty when it is over.
        ended(BatchResult, Path): all were done; the table holds them. stopped(): it was stopped.
        failed(Failed).
    """

    found = Signal(object)
    progress_changed = Signal(str)
    ended = Signal(object, object)
    stopped = Signal()
    failed = Signal(object)

    def __init__(self, parent: QObject | None = None, call: BatchCall = diagnose_all) -> None:
        super().__init__(parent)
        self.call = call
        self.folder = Path()
        self.clock: Callable[[], float] = time.monotonic
        self._worker = Worker(self)
        self._began = 0.0
        self._worker.progressed.connect(self._on_progress)
        self._worker.failed.connect(self.failed)
        self._worker.ended.connect(self._on_ended)

    @property
    def busy(self) -> bool:
        """Whether a folder is being diagnosed."""
        return self._worker.busy

    def start(self, folder: Path, beside_rig: bool) -> None:
        """Diagnose all that no table of this folder holds yet.

        Args:
            beside_rig: a rig is connected; then one diagnosis at a time, and every one gives way to its loop.
        """
        self.folder, self._began = folder, self.clock()
        processes = 1 if beside_rig else max((os.cpu_count() or 1) - 1, 1)

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[BatchResult, Path]:
            return self.call(folder, self.found.emit, processes, progress, cancelled)

        self._worker.start("Diagnosing", work, lambda done: self.ended.emit(*done))
        self.progress_changed.emit("Diagnosing …")

    def stop(self) -> None:
        """End it; what is done is kept, and the next one goes on there."""
        self._worker.cancel()

    def shut_down(self) -> None:
        self._worker.shut_down()

    def _on_progress(self, share: float, what: str) -> None:
        left = time_left(share, self.clock() - self._began)
        self.progress_changed.emit(f"Diagnosing: {what}{f', {left}' if left else ''}")

    def _on_ended(self, how: str) -> None:
        self.progress_changed.emit("")
        if how == "stopped":
            self.stopped.emit()


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
            from fingerlab.report.recording_words import short_runs_words
            from fingerlab.rig.file import default_rig, load_rig
            from fingerlab.sessions.importing import import_files, left_out_words

            bench = load_rig(rig_file) if rig_file is not None else default_rig()
            rig = axis_rig if axis_rig is not None else bench
            title = f"imported from {', '.join(path.name for path in names)}"
            path = import_files(plans, target, rig, title, progress=progress)
            left_out.extend(left_out_words(path))
            left_out.extend(filter(None, (short_runs_words(path),)))
            return path

        left_out: list[str] = []
        what = f"Importing {len(plans)} {'table' if len(plans) == 1 else 'tables'}"
        self._start(what, work, lambda path: self._on_done(path, left_out))

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

    def _start(
        self, title: str, write: Callable[[Progress], Path], done: Callable[[Path], None] | None = None
    ) -> None:
        self._context.hush()

        def work(progress: Progress, cancelled: IsCancelled) -> Path:
            progress(0.0, "reading")
            return write(progress)

        self._context.tasks.start(title, work, done or self._on_done, OWNER)

    def _on_done(self, path: Path, told: Sequence[str] = ()) -> None:
        self._context.announce("; ".join([f"Written: {path}", *told]), path)
        self.written.emit(path)
