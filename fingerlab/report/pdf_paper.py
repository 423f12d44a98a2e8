"""Paper of the PDF report: A4, one typeface, headings that stay with what follows, places for figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from fpdf import FPDF
from fpdf.enums import MethodReturnValue

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
class Placed:
    """Where a figure belongs: page from 1, left, top and width in mm."""

    key: str
    page: int
    x: float
    y: float
    width: float


@dataclass(frozen=True)
class Wanted:
    """A figure to be set: height over width, caption, and the share of its column's width that it takes."""

    key: str
    shape: float
    caption: str
    share: float


class Paper(FPDF):
    """A document of A4 pages with the report's typeface; text in, from top to bottom."""

    def __init__(self, title: str) -> None:
        super().__init__(orientation="portrait", unit="mm", format="A4")
        self.placed: list[Placed] = []
        self._title = title
        self.set_title(title)
        self.set_creator("FingerLab")
        self.set_lang("en")
        self.set_margins(MARGIN, MARGIN)
        self.set_auto_page_break(True, margin=FOOT + 4.0)
        folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
        for name, style, file in (
            ("text", "", "DejaVuSans.ttf"),
            ("text", "B", "DejaVuSans-Bold.ttf"),
        ):
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

    def figures(self, wanted: Sequence[Wanted], columns: int) -> None:
        """Figures beside each other, each with its caption below; smaller where they fit the page only so."""
        if self.least_height(wanted, columns) > self.room():
            self.add_page()
        scale = self._scale(wanted, columns, self.room())
        width, tall = self._column(columns), self._row_height(wanted, columns, scale)
        top, x = self.get_y() + 1.0, self.l_margin
        for one in wanted:
            drawn = scale * one.share * width
            self.placed.append(Placed(one.key, self.page_no(), x, top, drawn))
            if one.caption:
                self._letters("small", MUTED)
                self.set_xy(x, top + drawn * one.shape + 0.5)
                self.multi_cell(width, _line("small"), one.caption, align="L")
            x += width + 2 * GAP
        self.set_xy(self.l_margin, top + tall)

    def least_height(self, wanted: Sequence[Wanted], columns: int) -> float:
        """Height that a row of figures takes at least, mm."""
        return self._row_height(wanted, columns, self._scale(wanted, columns, 0.0))

    def _scale(self, wanted: Sequence[Wanted], columns: int, room: float) -> float:
        """Share of their size, from ``SMALLEST`` to 1, at which figures fit into ``room`` mm."""
        highest = max(one.share * self._column(columns) * one.shape for one in wanted)
        if highest < SHRINKS_FROM:
            return 1.0
        over = self._row_height(wanted, columns, 1.0) - room
        return min(max(1.0 - over / highest, SMALLEST), 1.0)

    def _row_height(self, wanted: Sequence[Wanted], columns: int, scale: float) -> float:
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
