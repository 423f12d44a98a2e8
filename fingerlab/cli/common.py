"""What several commands share: options, progress on standard error, tables, Ctrl-C, files written safely.

What takes a while to load is imported when it is used: every command imports this module.
"""

from __future__ import annotations

import json
import math
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import FrameType, TracebackType
from typing import IO, TYPE_CHECKING, Any

import click

from fingerlab.core.errors import UserError
from fingerlab.core.files import OutputSet, new_file, refuse_taken

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console
    from rich.table import Table

    from fingerlab.models.file import SavedModel
    from fingerlab.rig.file import Rig
    from fingerlab.sessions import Session

PATH = click.Path(path_type=Path)
TABLE_WIDTH = 128
"""Columns of a table that goes to a file or a pipe, where no terminal says how wide it is."""


class NewFile(click.Path):
    """A file to be written: that it could not be is found out before the work."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = Path(str(super().convert(value, param, ctx)))
        if ctx is None or not ctx.resilient_parsing:
            refuse_taken(path)
        return path


NEW_FILE = NewFile(path_type=Path)


def _free_for_json(context: click.Context, parameter: click.Parameter, target: str | None) -> str | None:
    return target if target in (None, "-") else str(NEW_FILE.convert(target, parameter, context))


json_option = click.option(
    "--json",
    "json_target",
    metavar="FILE",
    callback=_free_for_json,
    help="Write the result as JSON to FILE, or to standard output with '-'.",
)
"""``json_target`` is None, ``-`` or a free path. With ``-`` nothing else may go to standard output."""

session_argument = click.argument("session_file", metavar="S.h5", type=PATH)
sessions_argument = click.argument("sessions", nargs=-1, required=True, type=PATH, metavar="S.h5 [S2.h5 ...]")


def _folder_for_figures(
    context: click.Context, parameter: click.Parameter, folder: Path | None
) -> Path | None:
    """Find out before the work that the figures could not be written."""
    if folder is None or context.resilient_parsing:
        return folder
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder} is a file; give '--figures' a folder to write to.")
    if not folder.parent.is_dir():
        raise UserError(f"--figures is {folder}; the folder {folder.parent} does not exist, make it first.")
    return folder


def figures_option(what: str) -> Callable[[Any], Any]:
    """``figures``: None, or the folder into which ``what`` is drawn."""
    return click.option("--figures", metavar="DIR", type=PATH, callback=_folder_for_figures, help=what)


added_option = click.option(
    "--add", "added", multiple=True, metavar="ID", help="Effect that the model holds already; repeatable."
)


def asked_device(rig: Rig | None, what_for: str) -> str:
    """Which bench, said by the person at the terminal: a card that is there is not taken unasked.

    Args:
        rig: names card and server; None for the default. what_for: such as ``to check``.

    Raises:
        UserError: nobody is there to ask.
    """
    from fingerlab.devices.choosing import detect, opening_sentence

    found = detect(rig)
    names = [one.name for one in found if one.available]
    if not somebody_there():
        raise UserError(
            f"--device is missing; name the bench {what_for}: {', '.join(names)}, or a card such as Dev1."
        )
    click.echo(opening_sentence(found), err=True)
    return str(click.prompt(f"Which bench ({', '.join(names)}, or a card such as Dev1)", err=True))


class Within(click.FloatRange):
    """Finite numbers: click's own lets ``nan`` through, and ``inf`` where there is no bound."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


class NewSession(NewFile):
    """The same of a session, whose name says what it is."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = Path(str(value))
        if path.suffix.lower() != ".h5":
            raise UserError(f"--out is {path}; a session's file is HDF5, so its name should end in .h5.")
        return super().convert(value, param, ctx)


NEW_SESSION = NewSession(path_type=Path)


def refuse_same_place(places: Mapping[str, Path | str | None]) -> None:
    """Find out before the work that two results have one name.

    Args:
        places: of every option, where it writes to; None or ``-``: to no file.

    Raises:
        UserError: two are one.
    """
    taken: dict[Path, str] = {}
    for option, place in places.items():
        if place is None or place == "-":
            continue
        path = Path(place).absolute()
        if path in taken:
            raise UserError(f"{taken[path]} and {option} both name {place}; give each a name of its own.")
        taken[path] = option


def open_each(paths: Sequence[Path]) -> list[Session]:
    """Sessions of files that differ: what was recorded once is evidence once.

    Raises:
        UserError: a file is no session, or two hold the same.
    """
    from fingerlab.sessions import open_session, refuse_twice

    opened = [open_session(path) for path in paths]
    refuse_twice(opened)
    return opened


def counted(number: int, noun: str) -> str:
    """``1 run``, ``2 runs``."""
    return f"{number} {noun}{'s' * (number != 1)}"


def tell_own_effects() -> None:
    """Say on standard error which effect files of the user wait to be confirmed or do not work."""
    from fingerlab.effects import CATALOGUE, own

    for sentence in own.notices(CATALOGUE):
        click.echo(sentence, err=True)


def progress_bar(title: str) -> tuple[Any, Callable[[float, str], None]]:
    """A progress bar on standard error.

    Returns:
        A context manager, and a function to call with the share done (0 to 1) and what is being done.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    task = bar.add_task(title, total=1.0)

    def report(share: float, what: str) -> None:
        bar.update(task, completed=share, description=f"{title}: {what}")

    return bar, report


def table_console(stream: IO[str] | None = None, width: int | None = None) -> Console:
    """A console for result tables on standard output; text is shown as it is, whatever markup it looks like.

    Args:
        width: columns where no terminal says how wide it is; ``TABLE_WIDTH`` for None.
    """
    from rich.console import Console

    plain: dict[str, Any] = {"file": stream, "highlight": False, "markup": False, "emoji": False}
    console = Console(**plain)
    return console if console.is_terminal else Console(**plain, width=width or TABLE_WIDTH)


def result_table(*columns: str, no_wrap: bool = False, **options: Any) -> Table:
    """An empty table; the columns whose title begins with ``>`` hold numbers and stand at the right.

    Args:
        no_wrap: for the columns at the left. options: of ``rich.table.Table``.
    """
    from rich.table import Table

    table = Table(title_justify="left", **options)
    for title in columns:
        if title.startswith(">"):
            table.add_column(title[1:], justify="right")
        else:
            table.add_column(title, no_wrap=no_wrap)
    return table


def somebody_there() -> bool:
    """Whether somebody sits at a terminal to be asked."""
    return sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()


class Interrupts:
    """While it is entered, Ctrl-C and SIGTERM call ``first`` and then raise KeyboardInterrupt, once.

    Args:
        raises: whether they raise anything; else ``first`` alone has to see to it.

    Python drops an exception that is raised while it clears away an object, and tells its traceback: here
    nothing is told of it, ``first`` has run by then, and :meth:`check` raises it again.

    A program started in the background may find Ctrl-C switched off; here it listens all the same.
    """

    def __init__(self, first: Callable[[], None], raises: bool = True) -> None:
        self.first, self._raises = first, raises
        self.asked = False
        self._before: dict[signal.Signals, Any] = {}
        self._told_before = sys.unraisablehook

    def __enter__(self) -> Interrupts:
        self._told_before, sys.unraisablehook = sys.unraisablehook, self._on_dropped
        for which in (signal.SIGINT, signal.SIGTERM):
            self._before[which] = signal.signal(which, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for which, handler in self._before.items():
            signal.signal(which, handler)
        sys.unraisablehook = self._told_before

    def check(self) -> None:
        """Raise what was asked for and may have been dropped.

        Raises:
            KeyboardInterrupt: somebody asked.
        """
        if self.asked:
            raise KeyboardInterrupt

    def _on_dropped(self, dropped: sys.UnraisableHookArgs) -> None:
        if not (self.asked and isinstance(dropped.exc_value, KeyboardInterrupt)):
            self._told_before(dropped)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.first()
        if not self.asked:  # who presses again must not break what is being saved
            self.asked = True
            if self._raises:
                raise KeyboardInterrupt


def _json_text(result: Mapping[str, Any]) -> str:
    return json.dumps(result, indent=1, allow_nan=False)


def write_json(result: Mapping[str, Any], target: str) -> None:
    """Write ``result`` as JSON to a file, or to standard output where ``target`` is ``-``."""
    if target == "-":
        click.echo(_json_text(result))
    else:
        write_text_safely(Path(target), _json_text(result) + "\n")


def write_text_safely(path: Path, text: str) -> None:
    """Write a file whole or not at all: first beside it, then moved into place, over no other one.

    Raises:
        UserError: the place is taken, cannot be written to, or is full.
    """
    with new_file(path, "choose a folder with room and write access.") as part:
        part.write_text(text, encoding="utf-8")


def write_results(
    result: Mapping[str, Any],
    json_target: str | None,
    model: tuple[SavedModel, Path] | None = None,
    figures: tuple[Mapping[str, Figure], Path] | None = None,
) -> None:
    """Write JSON, model file and figures: all of them, or none; ``-`` prints the JSON instead.

    Raises:
        UserError: a place is taken, read-only or full.
    """
    try:
        with OutputSet() as outputs:
            if figures is not None:
                drawn, folder = figures
                outputs.make_folder(folder)
                for name, figure in drawn.items():
                    figure.savefig(outputs.claim(folder / f"{name}.png"), format="png")
            if model is not None:
                from fingerlab.models.file import write_model

                write_model(model[0], outputs.claim(model[1]))
            if json_target not in (None, "-"):
                part = outputs.claim(Path(str(json_target)))
                part.write_text(_json_text(result) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(
            f"{error.filename or 'The result'} cannot be written ({error.strerror}); "
            "choose a place with room and write access."
        ) from None
    if json_target == "-":
        click.echo(_json_text(result))
