"""The Sessions tab: the folder's sessions, and the review of one."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtWidgets import QFileDialog, QWidget

from fingerlab.core.errors import UserError
from fingerlab.core.files import seen_as
from fingerlab.library.index import SessionFacts, scan
from fingerlab.library.notes import Note, Notebook, StoredVerdict, find_verdicts, verdict_of
from fingerlab.sessions.model import Session

from ..app.bars import time_left
from ..app.context import ApplicationContext, read_session
from ..app.tab_registry import SEPARATOR, Command, Tab, run_commands
from ..app.worker import Failed, IsCancelled, Progress, Worker
from ..widgets.layout import OnePage
from ..widgets.tables import header_name
from .import_dialog import TABLE_ENDINGS
from .library_page import LibraryPage
from .review_data import ReviewData
from .session_files import FORMATS, BatchControl, EditHistory, FileEdit, NoteEdit, Writer
from .session_table import Thumbnails

if TYPE_CHECKING:
    from fingerlab.batch.run import BatchResult
    from fingerlab.signals.run_pairs import SessionPair

    from .result_dialogs import PairsDialog
    from .review_page import ReviewPage
    from .trend_dialog import TrendDialog


@dataclass(frozen=True)
class FolderScan:
    """What a scan of a folder brought: facts, notes, verdicts, and what is wrong with the side file."""

    folder: Path
    facts: tuple[SessionFacts, ...]
    notebook: Notebook
    verdicts: dict[Path, StoredVerdict]
    trouble: str


def look_through(
    folder: Path,
    known: Sequence[SessionFacts],
    coming: list[SessionFacts],
    progress: Progress,
    cancelled: IsCancelled,
) -> FolderScan:
    """Read a folder anew; in the background. ``coming`` takes what has been read so far."""

    def found(facts: SessionFacts, share: float) -> None:
        coming.append(facts)
        progress(share, facts.name)

    facts = scan(folder, known, found, cancelled)
    notebook, trouble = Notebook(folder), ""
    try:
        notebook.read()
    except UserError as error:
        trouble = str(error)
    return FolderScan(folder, facts, notebook, find_verdicts(folder, facts), trouble)


SESSION_FILTER = "Session files (*.h5 *.hdf5);;All files (*)"


class SessionsTab(Tab):
    """Composes the tab."""

    history: EditHistory

    def __init__(self, context: ApplicationContext) -> None:
        super().__init__(context)
        self.folder = context.settings.library()
        self.thumbnails = Thumbnails(self)
        self.page = LibraryPage(self.thumbnails)
        self.page.remember(context.settings)
        self.data = ReviewData(self)
        self._review: ReviewPage | None = None
        self.pages = OnePage()
        self.pages.addWidget(self.page)
        self.widget = self.pages
        self.header = self.name = header_name("reviewSession", "Session under review")
        self.writer = Writer(context, self.widget, self)
        self.notebook = Notebook(self.folder)
        self.history = EditHistory(self)
        self.clock: Callable[[], float] = time.monotonic
        self.batch = BatchControl(self)
        self._trend: TrendDialog | None = None
        self._pairs: PairsDialog | None = None
        self._scanner = Worker(self)
        self._coming: list[SessionFacts] = []
        self._looked, self._began = False, 0.0
        self._choose_next: Path | None = None
        self.commands = self._menu()
        self._connect()
        self.page.show_folder(str(self.folder))
        self.page.show_count("Not read yet")

    def _connect(self) -> None:
        page = self.page
        page.folder_asked.connect(self.ask_folder)
        page.texts_asked.connect(self.ask_texts)
        page.again_asked.connect(self._read_or_stop)
        page.diagnose_asked.connect(self._diagnose_or_stop)
        page.trend_asked.connect(self.show_trend)
        self.batch.found.connect(self._on_verdict)
        self.batch.progress_changed.connect(self.page.show_diagnosing)
        self.batch.ended.connect(self._on_diagnosed)
        self.batch.stopped.connect(self._on_stopped)
        self.batch.failed.connect(lambda failed: self.context.tell(failed.sentence, failed.details))
        page.lab_asked.connect(self.open_in_lab)
        page.review_asked.connect(self.review)
        page.chosen.connect(self.context.commands_changed)
        page.details.noted.connect(self._keep_note)
        page.details.merge_asked.connect(self.merge)
        page.details.compare_asked.connect(self.compare)
        for kind, title in FORMATS.items():
            action = page.details.exports.addAction(f"{title}…")
            action.triggered.connect(lambda _checked=False, k=kind: self.export(k))
        page.details.exports.addAction("Copy with tags and notes…").triggered.connect(self.copy_with_note)
        self.writer.written.connect(self._on_written)
        self.history.changed.connect(self.context.commands_changed)
        self.data.opened.connect(self._on_opened)
        self.data.failed.connect(self.context.tell)
        self._scanner.progressed.connect(self._on_read)
        self._scanner.failed.connect(self._on_failed)

    @property
    def review_page(self) -> ReviewPage:
        """Made for the first review: the table is there sooner without the plots."""
        return self._review or self._make_review()

    def _make_review(self) -> ReviewPage:
        from .review_page import ReviewPage

        self._review = review = ReviewPage(self.data)
        review.remember(self.context.settings)
        self.pages.addWidget(review)
        review.back_asked.connect(self.show_table)
        review.changed.connect(self.context.commands_changed)
        review.changed.connect(lambda: self.name.setText(self.window_title()))
        review.cut_asked.connect(self.cut)
        review.beside_asked.connect(self.review_beside)
        review.refused.connect(self.context.tell)
        self.data.beside.connect(review.show_beside)
        return review

    def _menu(self) -> tuple[Command, ...]:
        page = self.page
        return (
            Command("Choose &folder…", self.ask_folder, "Ctrl+Shift+O"),
            Command("&Import tables…", self.ask_texts),
            Command("Read a&gain", self.read_again, "F5"),
            Command(
                "&Diagnose all of the folder",
                self.diagnose_all,
                None,
                lambda: not self.batch.busy and self.page.diagnose.isEnabled(),
            ),
            Command("Tre&nd over days…", self.show_trend, None, self.page.trend.isEnabled),
            Command("&Search", page.search.setFocus, "Ctrl+F"),
            SEPARATOR,
            Command("&Review runs", page.ask_review, None, lambda: bool(page.paths())),
            Command("Open in &Model lab", self.open_chosen, "Ctrl+Return", lambda: bool(self.chosen())),
            SEPARATOR,
            Command("&Force trial…", self.show_force_trial, None, self._one),
            Command("Compare two sessions run &by run…", self.compare, None, lambda: len(page.paths()) == 2),
            Command("M&erge the chosen sessions…", self.merge, "Ctrl+M", lambda: len(page.paths()) > 1),
            *(
                Command(f"Export as {title}…", lambda k=kind: self.export(k), None, self._one)  # type: ignore[misc]
                for kind, title in FORMATS.items()
            ),
            Command("Cop&y with tags and notes in the file…", self.copy_with_note, None, self._one),
            SEPARATOR,
            Command("&All sessions", self.show_table, "Alt+Left", self._reviewing),
            *run_commands(lambda: self.review_page.runs, self._reviewing),
            Command("Whole run", lambda: self.review_page.plots.show_whole(), "Alt+Home", self._reviewing),
            Command("Cu&t between the cursors…", self.cut, "Ctrl+T", self._can_cut),
            Command(
                "&Cursors",
                lambda: self.review_page.cursors.toggle(),
                "Ctrl+K",
                self._reviewing,
                lambda: self._review is not None and self._review.cursors.isChecked(),
            ),
        )

    # what the frame asks

    def on_shown(self) -> None:
        if not self._looked:
            self.read_again()

    def on_session_recorded(self, path: Path) -> None:
        if self._looked and path.resolve().is_relative_to(self.folder.resolve()):
            self.read_again(path)

    def accept_files(self, paths: Sequence[Path]) -> bool:
        """A folder is browsed, tables are imported; sessions go to the Model lab as everywhere."""
        if all(path.suffix.lower() in TABLE_ENDINGS and seen_as(path) == "file" for path in paths):
            self.writer.import_texts(paths, self.folder)
            return True
        folders = [path for path in paths if seen_as(path) == "folder"]
        if not folders:
            return False
        self.browse(folders[0])
        return True

    def can_close(self) -> bool:
        self.page.details.flush()
        return True

    def on_hidden(self) -> None:
        self.page.details.flush()

    def shut_down(self) -> None:
        self.batch.shut_down()
        self._scanner.shut_down()
        self.thumbnails.shut_down()
        self.data.shut_down()

    # undo

    def undo(self) -> None:
        """Tags and notes as they were before, or a new file to the trash."""
        self.page.details.flush()  # what was just typed is the last thing done
        self._step(self.history.undo, "Undone")

    def redo(self) -> None:
        self.page.details.flush()
        self._step(self.history.redo, "Done again")

    def _step(self, step: Callable[[], str], word: str) -> None:
        self.context.hush()
        try:
            self.context.say(f"{word}: {step()}")
        except UserError as error:
            self.context.tell(str(error))
        self.page.refresh_details()
        self.read_again()

    # folder

    def ask_folder(self) -> None:
        """Choose another folder in a dialog."""
        name = QFileDialog.getExistingDirectory(self.widget, "Folder of sessions", str(self.folder))
        if name:
            self.browse(Path(name))

    def browse(self, folder: Path) -> None:
        """Show another folder, and remember it."""
        self.context.hush()
        self.folder = folder
        self.context.settings.set_library(folder)
        self.page.show_folder(str(folder))
        self.page.model.show_all((), {}, {})
        self.read_again()

    def read_again(self, choose: Path | None = None) -> None:
        """Look for new and changed files; ``choose`` is marked when it is found."""
        self._looked = True
        self._choose_next = choose if isinstance(choose, Path) else None
        folder, known = self.folder, self.page.model.all_facts()
        if seen_as(folder) != "folder" and folder == self.context.settings.recordings():
            self.page.show_count()  # nothing has been recorded yet; that is no mistake
            return
        self.page.show_reading(True)
        self._began = self.clock()
        coming = self._coming = []

        def work(progress: Progress, cancelled: IsCancelled) -> FolderScan:
            return look_through(folder, known, coming, progress, cancelled)

        self._scanner.start("Browsing", work, self._on_found)

    def _read_or_stop(self) -> None:
        if not self._scanner.busy:
            self.read_again()
            return
        self._scanner.cancel()
        self.page.show_reading(False)

    def _on_read(self, share: float, _what: str) -> None:
        """Rows as they come: whenever there are twice as many as the table has."""
        model = self.page.model
        if len(self._coming) > 2 * model.total:
            chosen = self.page.paths()
            model.show_all(tuple(self._coming), {}, {})
            for path in chosen[:1]:
                self.page.choose_path(path)
        left = time_left(share, self.clock() - self._began)
        self.page.show_count(f"Reading, {100 * share:.0f} %{f', {left}' if left else ''}")

    def _on_found(self, found: FolderScan) -> None:
        if found.folder != self.folder:
            return
        chosen = self.page.paths()
        self.notebook = found.notebook
        names = {one.name for one in found.facts}
        notes = {one.path: found.notebook.note_of(one, names) for one in found.facts}
        self.page.model.show_all(found.facts, notes, found.verdicts)
        self.page.show_reading(False)
        if found.trouble:
            self.context.tell(found.trouble)
        for path in [self._choose_next] if self._choose_next is not None else chosen[:1]:
            self.page.choose_path(path)
        if not self.page.details.changed:
            self.page.refresh_details()
        self.context.commands_changed.emit()

    def _on_failed(self, failed: Failed) -> None:
        self.page.show_reading(False)
        self.context.tell(failed.sentence, failed.details)

    # verdicts

    def diagnose_all(self) -> None:
        """Diagnose every session below the folder that no table there holds yet, in the background."""
        if not self.batch.busy:
            self.context.hush()
            self.batch.start(self.folder, self.context.bench is not None)
            self.context.commands_changed.emit()

    def _diagnose_or_stop(self) -> None:
        if self.batch.busy:
            self.batch.stop()
        else:
            self.diagnose_all()

    def _on_verdict(self, row: dict[str, Any]) -> None:
        """A row of the batch into the table, if its folder is still the one shown."""
        path = self.batch.folder / str(row["session"])
        names = {one.name: one.path for one in self.page.model.all_facts()}
        path = names.get(str(row["session"]), path)
        verdict = verdict_of(row, self.batch.folder / "this batch")
        if self.batch.folder != self.folder or verdict is None or self.page.model.facts(path) is None:
            return
        self.page.model.show_verdict(path, verdict)
        if path in self.page.paths() and not self.page.details.changed:
            self.page.refresh_details()

    def _on_diagnosed(self, result: BatchResult, table: Path) -> None:
        failed = len(result.failed)
        words = f"{result.done} sessions diagnosed, {result.kept} were in the table already"
        words += f"; {failed} could not be, {table.name} says why" if failed else ""
        self.context.announce(f"{words}: {table}", table)
        self._after_batch()
        if self._trend is not None and self._trend.isVisible():
            self.show_trend()

    def _on_stopped(self) -> None:
        self.context.say("Diagnosing stopped; what is done is kept, and it goes on there next time")
        self._after_batch()

    def _after_batch(self) -> None:
        self.context.commands_changed.emit()
        if self.batch.folder == self.folder:
            self.read_again()

    def show_trend(self) -> None:
        """How the sessions of the folder went over time, in a window of its own."""
        from fingerlab.batch.run import contents_beside

        from .trend_dialog import TrendDialog

        try:
            contents = contents_beside(self.folder)
        except UserError as error:
            self.context.tell(str(error))
            return
        if self._trend is None:
            self._trend = TrendDialog(self.widget)
            self._trend.chosen.connect(self._choose_session)
        self._trend.show_contents(contents, self.folder)
        self._trend.show()
        self._trend.raise_()

    def _choose_session(self, name: str) -> None:
        path = next((one.path for one in self.page.model.all_facts() if one.name == name), None)
        if path is not None:
            self.page.choose_path(path)

    # sessions

    def chosen(self) -> list[Path]:
        """The sessions that a command is about: the one under review, or those marked in the table."""
        session = self._reviewed
        if self._reviewing() and session is not None:
            return [session.path]
        return self.page.paths()

    def review(self, paths: Sequence[Path]) -> None:
        """Open sessions and show the runs of the first against time; those of the others can be laid over."""
        self.context.hush()
        self.page.details.flush()
        self.context.when_whole(paths, lambda whole: self.data.open(whole, read_session))

    def review_beside(self) -> None:
        """Choose another session whose runs can be laid over those under review."""
        name, _ = QFileDialog.getOpenFileName(
            self.widget, "Session to lay over", str(self.folder), SESSION_FILTER
        )
        if name:
            self.context.hush()
            self.data.open_beside(Path(name), read_session)

    def show_table(self) -> None:
        """Back to the table."""
        if self._review is not None:
            self._review.show_session(None)
        self.pages.setCurrentWidget(self.page)
        self.page.table.setFocus()
        self.context.commands_changed.emit()

    def window_title(self) -> str:
        return self._reviewed.path.name if self._reviewed is not None else ""

    def figure_source(self, plot: QWidget) -> str:
        from fingerlab.report.recording_words import recorded_words

        session, run = self._reviewed, self.review_page.run
        if session is None or run is None:
            return ""
        return f"{recorded_words([session])}; run {run.name}"

    @property
    def _reviewed(self) -> Session | None:
        return self._review.session if self._review is not None else None

    def _reviewing(self) -> bool:
        return self._review is not None and self.pages.currentWidget() is self._review

    def _can_cut(self) -> bool:
        return self._review is not None and self._review.cut.isEnabled()

    def _on_opened(self, sessions: tuple[Session, ...]) -> None:
        self.pages.setCurrentWidget(self.review_page)
        self.review_page.show_session(sessions[0], sessions[1:])
        self.context.commands_changed.emit()

    def open_in_lab(self, paths: Sequence[Path]) -> None:
        """Open sessions together in the Model lab."""
        if paths:
            self.context.hush()
            self.context.open_paths(list(paths), "model_lab")

    def open_chosen(self) -> None:
        self.open_in_lab(self.chosen())

    def _one(self) -> bool:
        return len(self.chosen()) == 1

    # new files

    def ask_texts(self) -> None:
        self.writer.ask_texts(self.folder)

    def cut(self) -> None:
        """Write what lies between the cursors as a session of its own."""
        review = self.review_page
        cursors, session, run = review.plots.cursors, review.session, review.run
        if cursors is not None and session is not None and run is not None:
            self.writer.cut(session, run, *cursors)

    def merge(self) -> None:
        """Write the runs of the marked sessions as one session."""
        if len(self.page.paths()) > 1:
            self.writer.merge(self.page.paths())

    def compare(self) -> None:
        """The runs of two sessions beside those of the same motion, in phase, in a window of its own."""
        paths = self.page.paths()
        if len(paths) != 2:
            return

        def work(progress: Progress, cancelled: IsCancelled) -> SessionPair:
            from fingerlab.core.progress import Watch
            from fingerlab.signals.run_pairs import compare_sessions

            # The earlier one first, as the table's order is the user's own.
            a, b = sorted((read_session(path) for path in paths), key=lambda one: str(one.created))
            return compare_sessions(a, b, Watch(progress, cancelled))

        names = " and ".join(path.name for path in paths)
        self.context.hush()
        self.context.tasks.start(f"Comparing {names}", work, self.show_pair, "comparing runs")

    def show_pair(self, found: SessionPair) -> None:
        """Show two sessions that were compared run by run."""
        from .result_dialogs import PairsDialog

        if self._pairs is None:
            self._pairs = PairsDialog(self.widget)
        self._pairs.show_pair(found)
        self._pairs.show()
        self._pairs.raise_()

    def show_force_trial(self) -> None:
        """By how much the force error fell in the chosen session, in a window of its own."""
        from .result_dialogs import show_force_trial

        if self._one():
            self.context.hush()
            show_force_trial(self.context, self.chosen()[0], self.widget)

    def export(self, kind: str) -> None:
        """Write the chosen session for other tools."""
        if self._one():
            self.writer.export(self.chosen()[0], kind)

    def copy_with_note(self) -> None:
        """Copy the chosen session with its tags and notes written into the copy."""
        self.page.details.flush()
        facts = self.page.model.facts(self.chosen()[0]) if self._one() else None
        if facts is not None:
            self.writer.copy_with_note(facts, self.page.model.note(facts.path))

    def _on_written(self, path: Path) -> None:
        if path.is_file():
            self.history.add(FileEdit(path, self._in_use))
        if path.is_file() and path.resolve().is_relative_to(self.folder.resolve()):
            self.read_again(path)

    def _in_use(self, path: Path) -> bool:
        """Whether a session file is open in a tab."""
        reviewed = self._reviewed
        opened = [*self.context.sessions, *([] if reviewed is None else [reviewed])]
        return any(session.path.resolve() == path.resolve() for session in opened)

    def _keep_note(self, facts: SessionFacts, note: Note) -> None:
        before, notebook = self.page.model.note(facts.path), self.notebook
        try:
            self._write_note(notebook, facts, note)
        except UserError as error:
            self.context.tell(str(error))
            return
        self.page.details.kept(note)
        self.history.add(NoteEdit(facts, before, note, partial(self._write_note, notebook)))
        self.context.say(f"Tags and notes of {facts.name} kept")

    def _write_note(self, notebook: Notebook, facts: SessionFacts, note: Note) -> None:
        """Into the side file of the folder in which the session was; and into the table, if it is there."""
        here = notebook.folder == self.folder
        notebook.write(facts, note, {one.name for one in self.page.model.all_facts()} if here else ())
        if self.page.model.facts(facts.path) is not None:
            self.page.model.show_note(facts.path, note)
