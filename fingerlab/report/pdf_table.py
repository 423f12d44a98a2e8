"""Tables of the PDF report: columns as wide as their text needs, the head on every page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from xml.etree import ElementTree

from fpdf.enums import TableBordersLayout, VAlign
from fpdf.fonts import FontFace

from fingerlab.report.pdf_paper import KEEP, LINE, LINES, MM_PER_POINT, MUTED, SIZES, TEXT, Paper

XHTML = "{http://www.w3.org/1999/xhtml}"
PADDING = 1.4  # mm
ROUNDING = 1e-3  # mm
LONGEST_WORD = 40.0
"""A word longer than this may be broken where a table is too wide, mm."""


@dataclass(frozen=True)
class Table:
    """Text of a table; bars are left out, the number beside each says the same."""

    caption: str
    head: list[str]
    rows: list[list[str]]
    right: list[bool]


def read_table(element: ElementTree.Element, words: Callable[[ElementTree.Element], str]) -> Table:
    """The table that an element of the page holds."""
    caption = element.find(f"{XHTML}caption")
    head = element.findall(f"{XHTML}thead/{XHTML}tr/*")
    rows = [list(row) for row in element.findall(f"{XHTML}tbody/{XHTML}tr")]
    bars = {i for row in rows for i, cell in enumerate(row) if "bar" in (cell.get("class") or "").split()}
    count = max((len(row) for row in rows), default=len(head))
    kept = [i for i in range(count) if i not in bars]
    first = head or (rows[0] if rows else [])
    return Table(
        "" if caption is None else words(caption),
        [words(head[i]) for i in kept] if head else [],
        [[words(row[i]) if i < len(row) else "" for i in kept] for row in rows],
        ["number" in (first[i].get("class") or "").split() if i < len(first) else False for i in kept],
    )


def set_table(paper: Paper, table: Table) -> None:
    """Write a table where the text stands."""
    if not table.rows:
        return
    if paper.room() < KEEP[3]:
        paper.add_page()
    if table.caption:
        paper.paragraph(table.caption, quiet=True)
    paper.set_font("text", "", SIZES["small"])
    paper.set_text_color(*TEXT)
    paper.set_draw_color(*LINES)
    paper.set_fill_color(255, 255, 255)
    widths = _widths(paper, table)
    head = FontFace(family="text", emphasis="BOLD", color=MUTED)
    with paper.table(
        width=min(sum(widths), paper.epw), col_widths=tuple(widths), align="LEFT", headings_style=head,
        first_row_as_headings=bool(table.head), borders_layout=TableBordersLayout.HORIZONTAL_LINES,
        text_align=tuple("RIGHT" if right else "LEFT" for right in table.right),
        v_align=VAlign.T, line_height=SIZES["small"] * MM_PER_POINT * LINE, padding=(0.6, PADDING, 0.6, 0.0),
    ) as grid:  # fmt: skip
        for row in ([table.head] if table.head else []) + table.rows:
            grid.row(row)
    paper.ln(2.5)


def _widths(paper: Paper, table: Table) -> list[float]:
    """What each column would like; where that is too much, words wrap and numbers stay whole."""
    like, least = [], []
    for i, right in enumerate(table.right):
        lines = [line for row in table.rows for line in row[i].split("\n")]
        body = max((paper.get_string_width(line) for line in lines), default=0.0)
        word = max((paper.get_string_width(w) for line in lines for w in line.split()), default=0.0)
        paper.set_font("text", "B", SIZES["small"])
        title = table.head[i] if table.head else ""
        head = paper.get_string_width(title)
        head_word = max((paper.get_string_width(w) for w in title.split()), default=0.0)
        paper.set_font("text", "", SIZES["small"])
        room = 2 * PADDING + 1.0
        like.append(max(body, head) + room)
        least.append(max(body if right else min(word, LONGEST_WORD), head_word) + room)
    while (over := sum(like) - paper.epw) > ROUNDING:
        i = max(range(len(like)), key=lambda k: like[k] - least[k])
        if like[i] <= least[i]:
            return [w * paper.epw / sum(like) for w in like]
        like[i] = max(least[i], like[i] - over)
    return like
