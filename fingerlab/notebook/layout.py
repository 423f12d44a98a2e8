"""Sentences and tables as plain text for a terminal and as HTML for a notebook."""

from __future__ import annotations

import html
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

WIDTH = 88
"""Characters of a line of text."""


@dataclass(frozen=True)
class Table:
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


Part = str | Table


def filled(text: str) -> str:
    """Lines of at most ``WIDTH`` characters; a number and its unit stay together."""
    bound = re.sub(r"(?<=\d) (?=(?:s|ms|Hz|N|mm|mN|%|°)\b|%)", "\u00a0", text)
    return textwrap.fill(bound, WIDTH).replace("\u00a0", " ")


class Shown:
    """An object that shows itself: a subclass says in ``_parts`` what there is to see."""

    def _parts(self) -> Sequence[Part]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return "\n\n".join(part.text() if isinstance(part, Table) else filled(part) for part in self._parts())

    def _repr_html_(self) -> str:
        first, *rest = self._parts()
        head = first.html() if isinstance(first, Table) else f"<p><b>{html.escape(first)}</b></p>"
        return head + "".join(
            part.html() if isinstance(part, Table) else f"<p>{html.escape(part)}</p>" for part in rest
        )
