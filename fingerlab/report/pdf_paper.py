"""Paper of the PDF report: A4, one typeface, headings that stay with what follows, figures, and tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
from fpdf import FPDF
from fpdf.enums import MethodReturnValue, TableBordersLayout, VAlign
from fpdf.fonts import FontFace

MARGIN, FOOT = 18.0, 16.0  # mm
GAP = 2.0
LINE = 1.42
"""Line height as a multiple of the letters' size."""
SIZES = {1: 17.0, 2: 13.0, 3: 10.0, "text": 9.0, "small": 7.5}
TEXT, MUTED, LINES, SURFACE, ACCENT = (
    (26, 26, 26),
    (95, 95, 95),
    (200, 200, 200),
    (244, 244, 244),
    (0, 158, 115),
)
KEEP = {1: 40.0, 2: 45.0, 3: 30.0}
"""Room in mm that has to be left below a heading, else it begins a page."""
HIGHEST = 150.0
"""What a heading announces counts up to here, mm; more would leave pages empty."""
SMALLEST = 0.78
"""A picture shrinks to this share of its size before it leaves the rest of a page empty."""
SHRINKS_FROM = 40.0
"""Lower figures, such as formulas, keep their size, mm."""
MM_PER_POINT = 25.4 / 72.0


@dataclass(frozen=True)
class PlacedFigure:
    """Where a figure belongs: page from 1, left, top and width in mm."""

    key: str
    page: int
    x: float
    y: float
    width: float


@dataclass(frozen=True)
class FigurePlace:
    """A figure to be set: height over width, caption, and the share of its column's width that it takes."""

    key: str
    shape: float
    caption: str
    share: float


class PdfPaper(FPDF):
    """A document of A4 pages with the report's typeface; text in, from top to bottom."""

    def __init__(self, title: str) -> None:
        super().__init__(orientation="portrait", unit="mm", format="A4")
        self.placed: list[PlacedFigure] = []
        self._title = title
        self.set_title(title)
        self.set_creator("FingerLab")
        self.set_lang("en")
        self.set_margins(MARGIN, MARGIN)
        self.set_auto_page_break(True, margin=FOOT + 4.0)
        folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
        for name, style, file in (("text", "", "DejaVuSans.ttf"), ("text", "B", "DejaVuSans-Bold.ttf")):
            self.add_font(name, style, folder / file)
        self.add_page()

    def footer(self) -> None:
        """Title and page at the foot of every page."""
        self.set_y(-FOOT)
        self._letters("small", MUTED)
        self.cell(self.epw / 2, 5, self._title[:80])
        self.cell(self.epw / 2, 5, f"{self.page_no()} / {{nb}}", align="R")

    def heading(self, text: str, level: int, announced: float = 0.0) -> None:
        """A heading with room below it for what it announces (mm)."""
        if self.room() < max(KEEP[level], min(announced, HIGHEST) + 12.0):
            self.add_page()
        elif level == 2:
            self.ln(3.0)
            self.set_draw_color(*LINES)
            self.line(self.l_margin, self.get_y(), self.w - self.r_margin, self.get_y())
            self.ln(2.0)
        else:
            self.ln(1.5)
        if level == 2:
            self.start_section(text)  # so that a viewer lists the parts
        self._letters(level, TEXT, "B")
        self._lines(text, SIZES[level])
        self.ln(0.8)

    def paragraph(
        self, text: str, quiet: bool = False, pieces: Sequence[tuple[str, bool]] | None = None
    ) -> None:
        """Running text; what is short stays on one page.

        Args:
            pieces: the same text in parts, and whether each is an index below the line.
        """
        if self.room() < self.text_height(text) < KEEP[3]:
            self.add_page()
        self._letters("text", MUTED if quiet else TEXT)
        if pieces is None:
            self._lines(text, SIZES["text"])
        else:
            self._with_indices(pieces)
        self.ln(1.2)

    def _with_indices(self, pieces: Sequence[tuple[str, bool]]) -> None:
        high = _line("text")
        for text, below in pieces:
            self.char_vpos = "SUB" if below else "LINE"
            self.write(high, text)
        self.char_vpos = "LINE"
        self.ln(high)

    def boxed(self, text: str) -> None:
        """The one sentence that answers the question."""
        self.ln(2.0)
        self._letters(2, TEXT)
        self.set_fill_color(*SURFACE)
        self.set_font_size(11.5)
        top, left = self.get_y(), self.l_margin
        self.set_left_margin(left + 3.0)
        self.set_x(left + 3.0)
        self.multi_cell(
            self.epw,
            11.5 * MM_PER_POINT * LINE,
            text,
            fill=True,
            align="L",
            padding=3,
            new_x="LMARGIN",
            new_y="NEXT",
        )
        self.set_left_margin(left)
        self.set_x(left)
        self.set_fill_color(*ACCENT)
        self.rect(left, top, 1.6, self.get_y() - top, style="F")
        self.ln(2.0)

    def facts(self, rows: Sequence[Sequence[str]]) -> None:
        """Names and what they are, two columns."""
        for name, value in rows:
            self._letters("text", MUTED)
            self.cell(28.0, SIZES["text"] * MM_PER_POINT * LINE, name)
            self._letters("text", TEXT)
            self._lines(value, SIZES["text"], self.epw - 28.0)
        self.ln(1.5)

    def figures(self, wanted: Sequence[FigurePlace], columns: int) -> None:
        """Figures beside each other, each with its caption below; smaller where they fit the page only so."""
        if self.least_height(wanted, columns) > self.room():
            self.add_page()
        scale = self._scale(wanted, columns, self.room())
        width, tall = self._column(columns), self._row_height(wanted, columns, scale)
        top, x = self.get_y() + 1.0, self.l_margin
        for one in wanted:
            drawn = scale * one.share * width
            self.placed.append(PlacedFigure(one.key, self.page_no(), x, top, drawn))
            if one.caption:
                self._letters("small", MUTED)
                self.set_xy(x, top + drawn * one.shape + 0.5)
                self.multi_cell(width, _line("small"), one.caption, align="L")
            x += width + 2 * GAP
        self.set_xy(self.l_margin, top + tall)

    def least_height(self, wanted: Sequence[FigurePlace], columns: int) -> float:
        """Height that a row of figures takes at least, mm."""
        return self._row_height(wanted, columns, self._scale(wanted, columns, 0.0))

    def _scale(self, wanted: Sequence[FigurePlace], columns: int, room: float) -> float:
        """Share of their size, from ``SMALLEST`` to 1, at which figures fit into ``room`` mm."""
        highest = max(one.share * self._column(columns) * one.shape for one in wanted)
        if highest < SHRINKS_FROM:
            return 1.0
        over = self._row_height(wanted, columns, 1.0) - room
        return min(max(1.0 - over / highest, SMALLEST), 1.0)

    def _row_height(self, wanted: Sequence[FigurePlace], columns: int, scale: float) -> float:
        width = self._column(columns)
        self._letters("small", MUTED)
        below = [self._height(one.caption, width, "small") for one in wanted]
        drawn = [scale * one.share * width * one.shape for one in wanted]
        return 2.5 + max(high + text for high, text in zip(drawn, below, strict=True))

    def text_height(self, text: str) -> float:
        """Height that a paragraph takes, mm."""
        self._letters("text", TEXT)
        return 1.2 + self._height(text, self.epw, "text")

    def _column(self, columns: int) -> float:
        return float((self.epw - GAP * 2 * (columns - 1)) / columns)

    def room(self) -> float:
        """What is left of the page, mm."""
        return float(self.h - self.b_margin - self.get_y())

    def _height(self, text: str, width: float, size: str) -> float:
        if not text:
            return 0.0
        lines = self.multi_cell(width, _line(size), text, dry_run=True, output=MethodReturnValue.LINES)
        return _line(size) * len(lines)  # type: ignore[arg-type]

    def _letters(self, size: Any, colour: tuple[int, int, int], style: str = "") -> None:
        self.set_font("text", style, SIZES[size])
        self.set_text_color(*colour)

    def _lines(self, text: str, size: float, width: float = 0.0) -> None:
        self.multi_cell(width, size * MM_PER_POINT * LINE, text, align="L", new_x="LMARGIN", new_y="NEXT")


def _line(size: Any) -> float:
    """Height of a line, mm."""
    return SIZES[size] * MM_PER_POINT * LINE


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
class PaperTable:
    """Text of a table; bars are left out, the number beside each says the same."""

    caption: str
    head: list[str]
    rows: list[list[str]]
    right: list[bool]


def read_table(element: ElementTree.Element, words: Callable[[ElementTree.Element], str]) -> PaperTable:
    """The table that an element of the page holds."""
    caption = element.find(f"{XHTML}caption")
    head = element.findall(f"{XHTML}thead/{XHTML}tr/*")
    rows = [list(row) for row in element.findall(f"{XHTML}tbody/{XHTML}tr")]
    bars = {i for row in rows for i, cell in enumerate(row) if "bar" in (cell.get("class") or "").split()}
    count = max((len(row) for row in rows), default=len(head))
    kept = [i for i in range(count) if i not in bars]
    first = head or (rows[0] if rows else [])
    return PaperTable(
        "" if caption is None else words(caption),
        [words(head[i]) for i in kept] if head else [],
        [[words(row[i]) if i < len(row) else "" for i in kept] for row in rows],
        ["number" in (first[i].get("class") or "").split() if i < len(first) else False for i in kept],
    )


def set_table(paper: PdfPaper, table: PaperTable) -> None:
    """Write a table where the text stands."""
    if not table.rows:
        return
    high = (len(table.rows) + bool(table.head) + bool(table.caption)) * _row_height()
    if paper.room() < min(KEEP[3], high):  # a table of two rows has no page to itself
        paper.add_page()
    if table.caption:
        paper.paragraph(table.caption, quiet=True)
    for rows in _pages(paper, table):
        if rows[0] is not table.rows[0]:
            paper.add_page()
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
    paper.ln(2.5)


def _row_height() -> float:
    """Of a row that is not wrapped, mm."""
    return SIZES["small"] * MM_PER_POINT * LINE + 2 * ABOVE


def _pages(paper: PdfPaper, table: PaperTable) -> list[list[list[str]]]:
    """The rows in one piece; in two where a page would else begin with one or two rows alone."""
    here = int(paper.room() // _row_height()) - bool(table.head)
    count = len(table.rows)
    if not 0 < count - here < FEWEST_ROWS or count < 2 * FEWEST_ROWS:
        return [table.rows]
    return [table.rows[:-FEWEST_ROWS], table.rows[-FEWEST_ROWS:]]


def _widths(paper: PdfPaper, table: PaperTable) -> list[float]:
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


def _needs(paper: PdfPaper, table: PaperTable, column: int) -> list[float]:
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


def _in_two_lines(paper: PdfPaper, title: str) -> float:
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
