"""Tables of the PDF report: columns as wide as their text needs, the head on every page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from xml.etree import ElementTree

from fpdf.enums import TableBordersLayout, VAlign
from fpdf.fonts import FontFace

from fingerlab.report.pdf_paper import KEEP, LINE, LINES, MM_PER_POINT, MUTED, SIZES, TEXT, Paper

XHTML = "{http://www.w3.org/1999/xhtml}"
PADDING, ABOVE = 1.4, 0.6  # mm
FEWEST_ROWS = 3
"""Rows that the last page of a table has at least."""
ROUNDING = 1e-3  # mm
LONGEST_WORD = 40.0
"""A word longer than this may be broken where a table is too wide, mm."""
NAMES = 0.25
"""Share of the paper's width that a column of names keeps beside one that holds whole sentences."""


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
    for rows in _pages(paper, table):
        if rows[0] is not table.rows[0]:
            paper.add_page()
        _set_rows(paper, table, rows)
    paper.ln(2.5)


def _pages(paper: Paper, table: Table) -> list[list[list[str]]]:
    """The rows in one piece; in two where a page would else begin with one or two rows alone."""
    high = SIZES["small"] * MM_PER_POINT * LINE + 2 * ABOVE
    here = int(paper.room() // high) - bool(table.head)
    count = len(table.rows)
    if not 0 < count - here < FEWEST_ROWS or count < 2 * FEWEST_ROWS:
        return [table.rows]
    return [table.rows[:-FEWEST_ROWS], table.rows[-FEWEST_ROWS:]]


def _set_rows(paper: Paper, table: Table, rows: list[list[str]]) -> None:
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
        v_align=VAlign.T, line_height=SIZES["small"] * MM_PER_POINT * LINE,
        padding=(ABOVE, PADDING, ABOVE, 0.0),
    ) as grid:  # fmt: skip
        for row in ([table.head] if table.head else []) + rows:
            grid.row(row)


def _widths(paper: Paper, table: Table) -> list[float]:
    """What each column would like; where that is too much, heads wrap, then words; numbers stay whole.

    A head takes more than two lines only where no column of sentences can give way before it.
    """
    measured = [_needs(paper, table, i) for i in range(len(table.right))]
    likes, in_two, whole, least = (list(needs) for needs in zip(*measured, strict=True))
    widths = likes
    _narrow(widths, in_two, paper.epw)
    if max(widths) > paper.epw:  # a column of whole sentences: names beside it give way before it does
        names = NAMES * paper.epw
        kept = [
            two if two > paper.epw else max(low, min(two, names))
            for two, low in zip(in_two, least, strict=True)
        ]
        _narrow(widths, kept, paper.epw)
    else:
        _narrow(widths, whole, paper.epw)
    _narrow(widths, least, paper.epw)
    over = sum(widths) / paper.epw
    return [w / over for w in widths] if over > 1.0 + ROUNDING else widths


def _needs(paper: Paper, table: Table, column: int) -> list[float]:
    """Widths of a column: nothing wrapped, the head in two lines, in more, its words wrapped too, mm."""
    lines = [line for row in table.rows for line in row[column].split("\n")]
    body = max((paper.get_string_width(line) for line in lines), default=0.0)
    word = max((paper.get_string_width(w) for line in lines for w in line.split()), default=0.0)
    paper.set_font("text", "B", SIZES["small"])
    title = table.head[column] if table.head else ""
    head = paper.get_string_width(title)
    head_two = _in_two_lines(paper, title)
    head_word = max((paper.get_string_width(w) for w in title.split()), default=0.0)
    paper.set_font("text", "", SIZES["small"])
    room = 2 * PADDING + 1.0
    least = body if table.right[column] else min(word, LONGEST_WORD)
    pairs = ((body, head), (body, head_two), (body, head_word), (least, head_word))
    return [max(pair) + room for pair in pairs]


def _in_two_lines(paper: Paper, title: str) -> float:
    """Width from which a head takes no more than two lines, mm."""
    apart = title.split()
    if len(apart) < 2:
        return float(paper.get_string_width(title))
    splits = ((" ".join(apart[:k]), " ".join(apart[k:])) for k in range(1, len(apart)))
    return min(max(float(paper.get_string_width(line)) for line in split) for split in splits)


def _narrow(widths: list[float], floors: list[float], room: float) -> None:
    """Take from the columns what is over ``room``, first where most can be spared, down to the floors."""
    while (over := sum(widths) - room) > ROUNDING:
        i = max(range(len(widths)), key=lambda k: widths[k] - floors[k])
        if widths[i] <= floors[i]:
            return
        widths[i] = max(floors[i], widths[i] - over)
