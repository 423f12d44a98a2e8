"""What the window remembers and its tabs share: settings, worker, sessions, the rig's state, calls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from PySide6.QtCore import QByteArray, QObject, QPoint, QRect, QSettings, QSize, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QWidget

from fingerlab.core.files import seen_as

from ..widgets.theme import Appearance
from .stop_key import DEFAULT_STOP_KEY, STOP_KEYS
from .worker import IsCancelled, Progress, Worker

if TYPE_CHECKING:
    from fingerlab.sessions.model import Session

    from ..acquire.bench_setup import OpenBench

MAX_RECENT = 8
MINIMUM_VISIBLE = 64
"""Pixels of the window that must lie on a screen, in each direction, for the place to be kept."""


class Settings:
    """Reads and writes the settings; values that do not fit are ignored, never trusted."""

    def __init__(self, store: QSettings | None = None) -> None:
        self._store = store if store is not None else QSettings("FingerLab", "FingerLab")

    def recent(self) -> list[Path]:
        """Recently opened files that still exist, latest first."""
        value = self._store.value("recent", [])
        names = [value] if isinstance(value, str) else value
        if not isinstance(names, (list, tuple)):
            return []
        return [Path(name) for name in names if isinstance(name, str) and seen_as(Path(name)) == "file"]

    def remember(self, paths: Sequence[Path]) -> None:
        """Put files at the head of the recent ones."""
        new = [str(path.resolve()) for path in paths]
        kept = [str(path) for path in self.recent() if str(path) not in new]
        self._store.setValue("recent", (new + kept)[:MAX_RECENT])

    def folder(self) -> str:
        """Where the file dialog starts: beside the latest file."""
        recent = self.recent()
        return str(recent[0].parent) if recent else str(Path.home())

    def appearance(self) -> Appearance:
        """Light, dark, or what the system says."""
        value = self._store.value("appearance", "system")
        return value if value in ("light", "dark") else "system"

    def set_appearance(self, appearance: Appearance) -> None:
        self._store.setValue("appearance", appearance)

    def stop_key(self) -> str:
        """The key of the foot switch, one of ``STOP_KEYS``."""
        value = self._store.value("stop_key", DEFAULT_STOP_KEY)
        return value if value in STOP_KEYS else DEFAULT_STOP_KEY

    def set_stop_key(self, name: str) -> None:
        self._store.setValue("stop_key", name)

    def tab(self) -> str:
        """The tab that was in front, or an empty text."""
        value = self._store.value("tab", "")
        return value if isinstance(value, str) else ""

    def set_tab(self, key: str) -> None:
        self._store.setValue("tab", key)

    def recordings(self) -> Path:
        """Folder for recordings: the one chosen last, else one among the user's documents."""
        value = self._store.value("recordings", "")
        if isinstance(value, str) and value:
            return Path(value)
        from platformdirs import user_documents_path

        return user_documents_path() / "FingerLab"

    def set_recordings(self, folder: Path) -> None:
        self._store.setValue("recordings", str(folder))

    def under_way(self) -> Path | None:
        """The session that was being recorded when this was last written; None where none was."""
        value = self._store.value("under_way", "")
        return Path(value) if isinstance(value, str) and value else None

    def set_under_way(self, session: Path | None) -> None:
        """Written at once: whoever is killed writes nothing more."""
        self._store.setValue("under_way", str(session) if session is not None else "")
        self._store.sync()

    def library(self) -> Path:
        """The folder that Sessions browses: the one chosen last, else that of the recordings."""
        value = self._store.value("library", "")
        return Path(value) if isinstance(value, str) and value else self.recordings()

    def set_library(self, folder: Path) -> None:
        self._store.setValue("library", str(folder))

    def figure(self) -> tuple[str, str]:
        """Size and dots per inch that a figure was saved with last, by key; empty before the first."""
        size, _, dots = str(self._store.value("figure", "")).partition(" ")
        return size, dots

    def set_figure(self, size: str, dots: str) -> None:
        self._store.setValue("figure", f"{size} {dots}")

    def arrangement(self, name: str) -> str:
        """How the user has arranged the plots of a page, as that page has written it; empty before."""
        value = self._store.value(f"arrangement/{name}", "")
        return value if isinstance(value, str) else ""

    def set_arrangement(self, name: str, text: str) -> None:
        self._store.setValue(f"arrangement/{name}", text)

    def heights(self, name: str) -> tuple[int, ...]:
        """Heights of a splitter's parts, px, as the user left them; empty where there are none to trust."""
        return self._sizes(f"heights/{name}")

    def set_heights(self, name: str, heights: Sequence[int]) -> None:
        self._store.setValue(f"heights/{name}", [str(height) for height in heights])

    def widths(self, name: str) -> tuple[int, ...]:
        """Widths of a table's columns, px, as the user left them; empty where there are none to trust."""
        return self._sizes(f"widths/{name}")

    def set_widths(self, name: str, widths: Sequence[int]) -> None:
        self._store.setValue(f"widths/{name}", [str(width) for width in widths])

    def sorting(self, name: str) -> tuple[int, bool]:
        """The column by which a table is sorted, and whether downwards; column -1 where nobody chose one."""
        column, _, order = str(self._store.value(f"sorting/{name}", "")).partition(" ")
        return (
            (int(column), order == "down") if column.isdecimal() and order in ("up", "down") else (-1, False)
        )

    def set_sorting(self, name: str, column: int, descending: bool) -> None:
        self._store.setValue(f"sorting/{name}", f"{column} {'down' if descending else 'up'}")

    def _sizes(self, key: str) -> tuple[int, ...]:
        value = self._store.value(key, [])
        parts = [str(part) for part in value] if isinstance(value, (list, tuple)) else []
        whole = tuple(int(part) for part in parts if part.isdecimal())
        return whole if len(whole) == len(parts) and sum(whole) > 0 else ()

    def save_place(self, window: QWidget) -> None:
        self._store.setValue("geometry", window.saveGeometry())

    def restore_place(self, window: QWidget, size: QSize) -> None:
        """Put the window where it was; where that is no longer on a screen, in the middle of the first.

        A screen may be gone or smaller than last time, and a settings file may hold anything.
        """
        geometry = self._store.value("geometry")
        restored = isinstance(geometry, QByteArray) and window.restoreGeometry(geometry)
        screens = QGuiApplication.screens()
        if restored and any(_shows(screen.availableGeometry(), window.geometry()) for screen in screens):
            return
        room = QGuiApplication.primaryScreen().availableGeometry()
        size = size.boundedTo(room.size())
        window.resize(size)
        spare = room.size() - size
        window.move(room.topLeft() + QPoint(spare.width() // 2, spare.height() // 2))


def _shows(screen: QRect, window: QRect) -> bool:
    shown = screen.intersected(window)
    return shown.width() >= MINIMUM_VISIBLE and shown.height() >= MINIMUM_VISIBLE


Light = Literal["off", "ready", "live", "fault"]
OpenCall = Callable[[Path], "Session"]

LOG_LINES = 1000


@dataclass(frozen=True)
class RigLine:
    """What header and status bar say of the rig.

    Attributes:
        light, state: colour of the state light, and its word.
        doing: what is running, such as ``sine, 15°, 1 Hz``.
        recording: None, or the number of recorded samples; paused: whether recording pauses.
        device: name; samples: cycles since the device was opened; late: late and lost cycles.
        free_bytes: room on the disk, 0 before it is known.
        live: whether the motor may have current now.
        cycle_s, longest_cycle_s: measured cycle of the control loop in the last seconds, s: mean and longest;
            0 before it is known.
    """

    light: Light = "off"
    state: str = "no rig"
    doing: str = ""
    recording: int | None = None
    paused: bool = False
    device: str = ""
    samples: int = 0
    late: int = 0
    free_bytes: int = 0
    warning: str = ""
    live: bool = False
    cycle_s: float = 0.0
    longest_cycle_s: float = 0.0


def read_session(path: Path) -> Session:
    """Open a session file; imported late, so that the window opens without waiting for HDF5."""
    from fingerlab.sessions import open_session

    return open_session(path)


def make_whole(path: Path, progress: Progress) -> Path:
    """Finish a recording that was cut or put off, which may take minutes; the path to read then."""
    from fingerlab.sessions.repair import repaired

    return repaired(path, progress)


def part_of(progress: Progress, number: int, count: int) -> Progress:
    """Tells the progress of one of several parts, the first of which is 0."""
    return lambda share, what: progress((number + share) / count, what)


class ApplicationContext(QObject):
    """One for each window.

    Signals:
        sessions_changed(tuple): other sessions are open, or none.
        session_recorded(Path): a session file has been recorded and verified.
        protocol_handed(steps): for Acquire: sequence of ``fingerlab.acquisition.protocols.steps.Step``.
        model_handed(Model, name): for Predict: a fitted model, as in a model file.
        rig_changed(RigLine): the state of the rig, as shown in header and status bar.
        bench_changed: another bench is connected (:attr:`ApplicationContext.bench`), or none.
        stop_asked: STOP or Escape; whoever drives a motor stops it now.
        tab_asked(key): a tab is wanted at the front. open_asked: the dialog that opens a session is wanted.
        commands_changed: what can be done has changed; menus look again.
        warned(sentence, details): something is wrong, or is to be seen to.
        announced(sentence, path): something was done, and what was written by it, if anything.
        said(line): a line for the status bar and the log.
        logged(line): a line of the log, with its time.
    """

    sessions_changed = Signal(object)
    session_recorded = Signal(object)
    protocol_handed = Signal(object, str)
    model_handed = Signal(object, str)
    rig_changed = Signal(object)
    bench_changed = Signal()
    stop_asked = Signal()
    tab_asked = Signal(str)
    open_asked = Signal()
    commands_changed = Signal()
    warned = Signal(str, str)
    announced = Signal(str, object)
    said = Signal(str)
    logged = Signal(str)

    def __init__(
        self, settings: Settings, tasks: Worker, read: OpenCall = read_session, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self.settings = settings
        self.tasks = tasks
        self.sessions: tuple[Session, ...] = ()
        self.rig_line = RigLine()
        self.bench: OpenBench | None = None
        self.log: list[str] = []
        self._read = read

    # sessions

    def open_paths(self, paths: Sequence[Path], tab: str = "model_lab") -> None:
        """Open session files together and show them in ``tab``; what is open stays until they are read."""
        names = ", ".join(path.name for path in paths)

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[Session, ...]:
            from fingerlab.sessions import refuse_twice

            sessions: list[Session] = []
            for number, path in enumerate(paths):
                progress(number / len(paths), f"reading {path.name}")
                sessions.append(self._read(make_whole(path, part_of(progress, number, len(paths)))))
            refuse_twice(sessions)
            return tuple(sessions)

        def done(sessions: Any) -> None:
            self.settings.remember(paths)
            self.sessions = sessions
            self.sessions_changed.emit(sessions)
            self.show_tab(tab)

        self.tasks.start(f"Opening {names}", work, done)

    def when_whole(self, paths: Sequence[Path], then: Callable[[Sequence[Path]], None]) -> None:
        """Finish recordings among these that were cut or put off, with progress; then call with all paths."""
        existing = {path for path in paths if seen_as(path)}
        if len(existing) == len(set(paths)):
            then(paths)
            return

        def work(progress: Progress, cancelled: IsCancelled) -> list[Path]:
            return [make_whole(path, part_of(progress, n, len(paths))) for n, path in enumerate(paths)]

        def done(whole: list[Path]) -> None:
            then(whole)
            for path in set(whole) - existing:
                self.recorded(path)

        self.tasks.start("Finishing the recording", work, done, "finishing")

    def close_sessions(self) -> None:
        """Close what is open."""
        self.sessions = ()
        self.sessions_changed.emit(())
        self.say("Session closed")

    # calls between tabs

    def show_tab(self, key: str) -> None:
        """Bring a tab to the front; one that is not registered leaves everything as it is."""
        self.tab_asked.emit(key)

    def hand_protocol(self, steps: Sequence[Any], title: str = "") -> None:
        """Hand the steps of a protocol (``plan_steps``) to Acquire and show it."""
        self.show_tab("acquire")
        self.protocol_handed.emit(tuple(steps), title)

    def hand_model(self, model: Any, name: str) -> None:
        """Hand a fitted model (``models.file.SavedModel``) to Predict and show it."""
        self.show_tab("predict")
        self.model_handed.emit(model, name)

    def recorded(self, path: Path) -> None:
        """Say that a session file has been recorded and verified."""
        self.settings.remember([path])
        self.session_recorded.emit(path)

    # rig

    def show_rig(self, line: RigLine) -> None:
        """Say how the rig is, for header and status bar."""
        if line != self.rig_line:
            self.rig_line = line
            self.rig_changed.emit(line)

    def show_bench(self, bench: OpenBench | None) -> None:
        """Say which bench is connected; for tabs that only read it."""
        if bench is not self.bench:
            self.bench = bench
            self.bench_changed.emit()

    def stop(self) -> None:
        """Stop the motor, whatever it does."""
        self.stop_asked.emit()

    # words

    def tell(self, sentence: str, details: str = "") -> None:
        """Show a sentence across the window; with details it can be copied whole for a report."""
        self._note(sentence)
        self.warned.emit(sentence, details)

    def announce(self, sentence: str, path: Path | None = None) -> None:
        """Say across the window that something was done; ``path``: what was written, which can be opened."""
        self._note(sentence)
        self.announced.emit(sentence, path)

    def hush(self) -> None:
        """Take the sentence across the window away."""
        self.warned.emit("", "")

    def say(self, line: str) -> None:
        """The last thing that happened, at the bottom of the window."""
        self._note(line)
        self.said.emit(line)

    def _note(self, line: str) -> None:
        self.log.append(f"{datetime.now():%H:%M:%S}  {line}")
        del self.log[:-LOG_LINES]
        self.logged.emit(self.log[-1])
