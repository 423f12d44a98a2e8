"""Where a file is to be written: claimed, written beside it, and moved into place when it is whole."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

from fingerlab.core.errors import UserError

ADVICE = "choose a place with room and write access."


MOST_BYTES = 1 << 24
"""Of a text file that is read whole."""


DATA_VARIABLE = "FINGERLAB_DATA_DIR"
"""Environment variable that puts what is kept for the user elsewhere than where the system has it."""


def own_data(*place: str) -> Path:
    """A place among what the program keeps for its user, whether anything is there yet or not."""
    given = os.environ.get(DATA_VARIABLE)
    if given:
        return Path(given, *place)
    from platformdirs import user_data_path

    return user_data_path("FingerLab", appauthor=False).joinpath(*place)


def seen_as(path: Path) -> str:
    """``file``, ``folder``, or empty for what is missing, is something else, or may not be looked at.

    ``Path.is_file`` raises where a folder above may not be entered, or a link leads to no possible name.
    """
    try:
        return "file" if path.is_file() else "folder" if path.is_dir() else ""
    except OSError:
        return ""


def read_text(path: Path, what: str) -> str:
    """A text file of somebody's, whole.

    Args:
        what: it should be, with its article; ends the sentence of an error.

    Raises:
        UserError: it is missing, no plain file, too large, not text in UTF-8, or may not be read.
    """
    try:
        if not path.is_file():
            raise OSError(0, "it is no file" if path.exists() else "it does not exist")
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise OSError(0, f"it is larger than {MOST_BYTES >> 20} MB")
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        why = "it is not text in UTF-8"
    except (OSError, ValueError) as error:  # the second of a name with a zero in it
        why = getattr(error, "strerror", None) or str(error)
    raise UserError(f"{path} cannot be read ({why}); give {what}.")


@contextmanager
def whole_file(path: Path, advice: str = ADVICE) -> Iterator[Path]:
    """Write a file whole or not at all; what has its name is replaced, so whoever calls has the right to.

    Use as a context manager: its value is the path to write to, beside the place and of this process alone.
    It takes the place in one step when the body ends. Where the body raises, it is removed, and what was
    there stays.

    Args:
        advice: what the user can do where the place takes no file; ends the sentence.

    Raises:
        UserError: the place cannot be written to, or is full.
    """
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    if path.is_dir():  # told before the work, which may take minutes
        raise UserError(f"{path} cannot be written (it is a folder); {advice}")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise _refused(path, error, advice) from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def put_in_place(part: Path, path: Path, advice: str = ADVICE, deed: str = "written") -> None:
    """Give a finished file its name in one step; what has the name is replaced.

    Args:
        advice, deed: words of the sentence: ``PATH cannot be DEED (reason); ADVICE``.

    Raises:
        UserError: it cannot be moved; the part file is removed.
    """
    try:
        part.replace(path)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise _refused(path, error, advice, deed) from None


def _refused(path: Path, error: OSError, advice: str, deed: str = "written") -> UserError:
    return UserError(f"{path} cannot be {deed} ({error.strerror or error}); {advice}")


def claim(path: Path) -> Path:
    """Make ``NAME.part`` beside the wanted place, empty, so that no two programs write the same file.

    Returns:
        The path of the part file.

    Raises:
        UserError: the place is taken already, its folder is missing, or it cannot be written to.
    """
    refuse_taken(path)
    part = path.with_name(path.name + ".part")
    try:
        part.open("xb").close()
    except FileExistsError:
        raise UserError(
            f"{part} is there already, from a write that is under way or was broken off; "
            "wait for it, or remove it and try again."
        ) from None
    except OSError as error:
        raise _refused(path, error, ADVICE) from None
    return part


@contextmanager
def new_file(path: Path, advice: str = ADVICE) -> Iterator[Path]:
    """Write a file whole or not at all, and over no other one.

    Use as a context manager: its value is the part file to write to, as :func:`claim` gives it.

    Args:
        advice: as for :func:`whole_file`.

    Raises:
        UserError: the place is taken, now or meanwhile, cannot be written to, or is full.
    """
    part = claim(path)
    try:
        yield part
    except BaseException as error:
        part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise _refused(path, error, advice) from None
        raise
    move_into_place(part, path)


def refuse_taken(path: Path) -> None:
    """Nothing is overwritten without being asked.

    Raises:
        UserError: something of that name exists, or its folder does not.
    """
    if path.exists():
        raise UserError(
            f"{path} exists already and is not overwritten; choose another name or remove it first."
        )
    if not path.parent.is_dir():
        raise UserError(f"The folder {path.parent} does not exist; make it first or choose another place.")


def move_into_place(part: Path, path: Path) -> None:
    """Give the finished file its name, unless somebody else took the name meanwhile.

    Raises:
        UserError: the name is taken by now, or moving failed; the part file is removed.
    """
    try:
        refuse_taken(path)
    except UserError:
        part.unlink(missing_ok=True)
        raise
    put_in_place(part, path)


class OutputSet:
    """Several files that are to appear together or not at all. Use as a context manager."""

    def __init__(self) -> None:
        self._parts: dict[Path, Path] = {}
        self._folder: Path | None = None

    def make_folder(self, folder: Path) -> None:
        """Make the folder where it is missing; it goes again if the files do not come about.

        Raises:
            UserError: it is a file, its parent is missing, or it cannot be made.
        """
        if folder.is_dir():
            return
        if folder.exists():
            raise UserError(f"{folder} is a file; give a folder to write to.")
        if not folder.parent.is_dir():
            raise UserError(f"The folder {folder.parent} does not exist; make it first or choose another.")
        try:
            folder.mkdir()
        except OSError as error:
            raise UserError(
                f"The folder {folder} cannot be made ({error.strerror}); choose a place with write access."
            ) from None
        self._folder = folder

    def claim(self, path: Path) -> Path:
        """The part file to write to in place of ``path``.

        Raises:
            UserError: as :func:`claim`.
        """
        self._parts[path] = claim(path)
        return self._parts[path]

    def __enter__(self) -> OutputSet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        moved: list[Path] = []
        try:
            if kind is None:
                for path in self._parts:
                    refuse_taken(path)
                for path, part in self._parts.items():
                    move_into_place(part, path)
                    moved.append(path)
                self._folder = None
                moved = []
        finally:
            for path in moved:  # a later one failed; these are ours and not whole without it
                with suppress(OSError):
                    path.unlink()
            for part in self._parts.values():
                with suppress(OSError):
                    part.unlink(missing_ok=True)
            if self._folder is not None:
                with suppress(OSError):
                    self._folder.rmdir()
