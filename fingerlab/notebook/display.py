"""How objects show themselves: sentences, tables and figures, on a terminal and in a notebook."""

from __future__ import annotations

import html
import io
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fingerlab.core.files import OutputSet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 88
"""Characters of a line of text."""


@dataclass(frozen=True)
class ShownTable:
    """Columns and rows of text; the columns in ``right`` hold numbers and stand at the right."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: frozenset[int] = frozenset()
    title: str = ""

    def text(self) -> str:
        """Aligned lines, two spaces between columns."""
        lines = [self.columns, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        shown = [
            "  ".join(
                cell.rjust(width) if i in self.right else cell.ljust(width)
                for i, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        ]
        return "\n".join([*([self.title] if self.title else []), *shown])

    def html(self) -> str:
        """A table element; everything in it is escaped."""
        head = "".join(self._cell("th", i, name) for i, name in enumerate(self.columns))
        body = "".join(
            "<tr>" + "".join(self._cell("td", i, cell) for i, cell in enumerate(row)) + "</tr>"
            for row in self.rows
        )
        caption = f"<caption>{html.escape(self.title)}</caption>" if self.title else ""
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def _cell(self, kind: str, column: int, text: str) -> str:
        side = "right" if column in self.right else "left"
        return f'<{kind} style="text-align:{side}">{html.escape(text)}</{kind}>'


Displayable = str | ShownTable


def filled(text: str) -> str:
    """Lines of at most ``WIDTH`` characters; a number and its unit stay together."""
    bound = re.sub(r"(?<=\d) (?=(?:s|ms|Hz|N|mm|mN|%|°)\b|%)", "\u00a0", text)
    return textwrap.fill(bound, WIDTH).replace("\u00a0", " ")


class Displayed:
    """An object that shows itself: a subclass says in ``_parts`` what there is to see."""

    def _parts(self) -> Sequence[Displayable]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return "\n\n".join(
            part.text() if isinstance(part, ShownTable) else filled(part) for part in self._parts()
        )

    def _repr_html_(self) -> str:
        first, *rest = self._parts()
        head = first.html() if isinstance(first, ShownTable) else f"<p><b>{html.escape(first)}</b></p>"
        return head + "".join(
            part.html() if isinstance(part, ShownTable) else f"<p>{html.escape(part)}</p>" for part in rest
        )


class Figures(Mapping[str, "Figure"]):
    """Matplotlib figures by name. They belong to no pyplot session: change, combine and save them freely."""

    def __init__(self, figures: Mapping[str, Figure]) -> None:
        self._figures = dict(figures)

    def __getitem__(self, name: str) -> Figure:
        return self._figures[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._figures)

    def __len__(self) -> int:
        return len(self._figures)

    def __repr__(self) -> str:
        return f"{len(self)} figures: {', '.join(self)}"

    def _repr_html_(self) -> str:
        return "".join(
            f"<figure><figcaption>{html.escape(name)}</figcaption>{_svg(figure)}</figure>"
            for name, figure in self._figures.items()
        )

    def save(self, folder: str | Path, kind: str = "png") -> list[Path]:
        """Write every figure into a folder, all or none; returns the files.

        Args:
            kind: ``png``, ``svg`` or ``pdf``.

        Raises:
            UserError: a file is there already, or the folder cannot be written to.
        """
        folder = Path(folder)
        files = [folder / f"{name}.{kind}" for name in self]
        with OutputSet() as outputs:
            outputs.make_folder(folder)
            for path, figure in zip(files, self.values(), strict=True):
                figure.savefig(outputs.claim(path), format=kind)
        return files


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg")
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]
