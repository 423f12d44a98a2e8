"""The folder ``NAME.h5.recording`` in which a recording grows until it is whole, and who holds it.

Each run is a file of its own there (``001.h5part``), written so that what was flushed survives its writer.
The session gets its name only when it is whole and has been read back. A folder that nobody holds is what is
left of a recording that was cut.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO

from fingerlab.core.errors import UserError
from fingerlab.sessions.place import refuse_taken

SUFFIX = ".recording"
PART_SUFFIX = ".h5part"
WHOLE = "whole.h5part"
ASSEMBLING = "assembling.h5part"
WRITTEN = "written.h5part"
"""The session, put off when it was written to its end and not yet read back."""
LOCK = "lock"
WRITING, VERIFYING = "writing", "verifying"
"""What is being done when a recording becomes a session."""

Progress = Callable[[float, str], None]
"""Told the share done (0 to 1) and what is being done; puts the work off by raising ``Cancelled``."""


def recording_folder(path: Path) -> Path:
    """Where the recording of ``path`` grows."""
    return path.with_name(path.name + SUFFIX)


def cut_recordings(folder: Path) -> list[Path]:
    """Sessions in a folder that were cut and not yet repaired; ``open_session`` repairs each."""
    found = []
    for place in sorted(folder.glob("*" + SUFFIX)):
        session = place.with_name(place.name.removesuffix(SUFFIX))
        if place.is_dir() and not session.exists() and not is_held(place):
            found.append(session)
    return found


class RecordingPlace:
    """A recording's folder, held by this process; the system lets go of it when the process ends."""

    def __init__(self, path: Path, lock: IO[bytes]) -> None:
        self.path = path
        self.folder = recording_folder(path)
        self._lock = lock

    @classmethod
    def claim(cls, path: Path) -> RecordingPlace:
        """Make the folder for a new recording.

        Raises:
            UserError: the session or the folder exists, or the place cannot be written to.
        """
        refuse_taken(path)
        folder = recording_folder(path)
        try:
            folder.mkdir()
        except FileExistsError:
            raise UserError(
                f"{folder} is there already, from a recording that is under way or was cut; open {path} to "
                "repair it, or choose another name."
            ) from None
        except OSError as error:
            raise UserError(
                f"{path} cannot be written ({error.strerror}); choose a place with room and write access."
            ) from None
        return cls.hold(path)

    @classmethod
    def hold(cls, path: Path) -> RecordingPlace:
        """Take hold of a folder that exists.

        Raises:
            UserError: another program holds it, or it cannot be written to.
        """
        folder = recording_folder(path)
        try:
            lock = (folder / LOCK).open("a+b")
        except OSError as error:
            raise UserError(
                f"{folder} cannot be written ({error.strerror}); copy it to where it can be."
            ) from None
        if not _lock(lock):
            lock.close()
            raise UserError(f"{path} is being recorded at this moment; open it when the recording has ended.")
        return cls(path, lock)

    def parts(self) -> list[Path]:
        """The runs' files in the order taken."""
        return sorted(p for p in self.folder.glob("*" + PART_SUFFIX) if p.stem.isdecimal())

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        self.release()
        with suppress(OSError):
            for file in self.folder.iterdir():
                file.unlink()
            self.folder.rmdir()

    def release(self) -> None:
        """Let go of the folder and leave it."""
        with suppress(OSError):
            self._lock.close()


def is_held(folder: Path) -> bool:
    """Whether some program is recording into the folder."""
    try:
        with (folder / LOCK).open("a+b") as lock:
            return not _lock(lock)
    except OSError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes]) -> bool:
        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _lock(file: IO[bytes]) -> bool:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


def give_name(whole: Path, path: Path) -> Path:
    """Give a finished file its name, or the next free one where somebody took it meanwhile."""
    target, number = path, 2
    while target.exists():
        target = path.with_name(f"{path.stem} ({number}){path.suffix}")
        number += 1
    whole.replace(target)
    return target
