"""What several commands share: the ``--json`` option, progress on standard error, safe output files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from fingerlab.core.errors import UserError


def _free_for_json(context: click.Context, parameter: click.Parameter, target: str | None) -> str | None:
    """Find out before the work that the JSON could not be written."""
    if target not in (None, "-") and not context.resilient_parsing:
        refuse_existing(Path(str(target)))
    return target


json_option = click.option(
    "--json",
    "json_target",
    metavar="FILE",
    callback=_free_for_json,
    help="Write the result as JSON to FILE, or to standard output with '-'.",
)
"""``json_target`` is None, ``-`` or a free path. With ``-`` nothing else may go to standard output."""


def write_json(result: dict[str, Any], target: str) -> None:
    """Write ``result`` as JSON to a file, or to standard output where ``target`` is ``-``."""
    text = json.dumps(result, indent=1, allow_nan=False)
    if target == "-":
        click.echo(text)
    else:
        write_text_safely(Path(target), text + "\n")


def refuse_existing(path: Path) -> None:
    """Nothing is overwritten without being asked.

    Raises:
        UserError: the file is there already, or its folder is not.
    """
    if path.exists():
        raise UserError(
            f"{path} exists already and is not overwritten; choose another name or remove it first."
        )
    if not path.parent.is_dir():
        raise UserError(f"The folder {path.parent} does not exist; make it first or choose another place.")


def write_text_safely(path: Path, text: str) -> None:
    """Write a file whole or not at all: first beside it, then moved into place, over no other one.

    Raises:
        UserError: the place is taken, cannot be written to, or is full.
    """
    from fingerlab.core.files import new_file

    with new_file(path, "choose a folder with room and write access.") as part:
        part.write_text(text, encoding="utf-8")


def tell_own_effects() -> None:
    """Say on standard error which effect files of the user wait to be confirmed or do not work."""
    from fingerlab.effects import CATALOGUE, own

    for sentence in own.notices(CATALOGUE):
        click.echo(sentence, err=True)


def counted(number: int, noun: str) -> str:
    """``1 run``, ``2 runs``."""
    return f"{number} {noun}{'s' * (number != 1)}"


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
