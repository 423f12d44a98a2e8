"""What the window remembers between two starts: recent files, its place on the screen, its appearance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QByteArray, QPoint, QRect, QSettings, QSize
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QWidget

from fingerlab.core.files import seen_as

from ..widgets.theme import Appearance
from .stop_key import DEFAULT_STOP_KEY, STOP_KEYS

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
