"""Files that ``fit`` and ``predict`` write: all of them, or none."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click
from rich.console import Console

from fingerlab.core.errors import UserError
from fingerlab.core.files import OutputSet, refuse_taken
from fingerlab.models.file import Model, write_model

if TYPE_CHECKING:  # matplotlib takes a while to load and most calls draw nothing
    from matplotlib.figure import Figure

TABLE_WIDTH = 128
"""Columns of a table that goes to a file or a pipe, where no terminal says how wide it is."""


def table_console(stream: IO[str] | None = None) -> Console:
    """A console for result tables on standard output."""
    console = Console(file=stream, highlight=False)
    return console if console.is_terminal else Console(file=stream, highlight=False, width=TABLE_WIDTH)


def refuse_taken_early(model: Path | None, figures: Path | None) -> None:
    """Find out before the work that a result could not be written.

    Raises:
        UserError: a target exists or its folder does not.
    """
    if model is not None:
        refuse_taken(model)
    if figures is not None and figures.exists() and not figures.is_dir():
        raise UserError(f"{figures} is a file; give '--figures' a folder to write to.")


def write_results(
    result: dict[str, Any],
    json_target: str | None,
    model: tuple[Model, Path] | None = None,
    figures: tuple[Mapping[str, Figure], Path] | None = None,
) -> None:
    """Write JSON, model file and figures together; ``-`` prints the JSON instead.

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
                write_model(model[0], outputs.claim(model[1]))
            if json_target not in (None, "-"):
                part = outputs.claim(Path(str(json_target)))
                part.write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(
            f"{error.filename or 'The result'} cannot be written ({error.strerror}); "
            "choose a place with room and write access."
        ) from None
    if json_target == "-":
        click.echo(json.dumps(result, indent=1, allow_nan=False))
