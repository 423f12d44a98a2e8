"""The report page as PDF: the same text, tables and figures, read from the page itself.

The page is well-formed XML of few kinds of elements, so that what it says and what the PDF says cannot
differ. Nothing but Python packages is needed: text is set with fpdf2 in the typeface that matplotlib brings,
figures are matplotlib's own PDF, laid over the place that was kept for them, so that they stay sharp.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from xml.etree import ElementTree

from matplotlib.figure import Figure
from pypdf import PdfReader, PdfWriter, Transformation

from fingerlab.report.figure_style import NamedFigure
from fingerlab.report.pdf_paper import FigurePlace, PdfPaper, PlacedFigure, read_table, set_table

XHTML = "{http://www.w3.org/1999/xhtml}"
SVG = "{http://www.w3.org/2000/svg}svg"
POINTS_PER_MM = 72.0 / 25.4
NARROW = 0.62
"""Share of the text's width that a figure takes which the page shows at half its width."""
HEADINGS = {"h1": 1, "h2": 2, "h3": 3}

Element = ElementTree.Element


def pdf_of_page(text: str, figures: Mapping[str, NamedFigure], title: str) -> bytes:
    """The page as a PDF file's content.

    Args:
        text: the page, well-formed. figures: those in it, by the id of their ``<svg>``.
    """
    root = ElementTree.fromstring(text.removeprefix("<!DOCTYPE html>"))
    body = root.find(f"{XHTML}body")
    assert body is not None
    paper = PdfPaper(title)
    _Reader(paper, figures).blocks(body)
    return _with_figures(bytes(paper.output()), paper.placed, figures)


class _Reader:
    """Sets a page's elements one after the other."""

    def __init__(self, paper: PdfPaper, figures: Mapping[str, NamedFigure]) -> None:
        self._paper, self._figures = paper, figures
        self._set: dict[str, Callable[[Element], None]] = {
            "p": self._paragraph,
            "table": lambda e: set_table(paper, read_table(e, words)),
            "dl": self._pairs,
            "figure": lambda e: self._figure_row([e]),
            "nav": lambda e: None,  # paper cannot be clicked
            "details": lambda e: None,  # LaTeX to be copied, which paper cannot be either
        }

    def blocks(self, parent: Element) -> None:
        """Every child that is a block of its own; containers are opened."""
        children = list(parent)
        for i, child in enumerate(children):
            name = child.tag.removeprefix(XHTML)
            if name in HEADINGS:
                self._paper.heading(words(child), HEADINGS[name], self._announced(children[i + 1 :]))
            elif name in self._set:
                self._set[name](child)
            elif name == "div" and "pair" in _classes(child):
                self._pair(child)
            elif name in ("div", "section", "header", "footer"):
                self.blocks(child)
            else:
                raise ValueError(f"The report page holds a <{name}> that the PDF cannot set.")

    def _announced(self, following: list[Element]) -> float:
        """Room in mm that a heading has to find: what stands between it and its first figure, with that."""
        room = 0.0
        for child in following:
            name = child.tag.removeprefix(XHTML)
            if name == "p":
                room += self._paper.text_height(words(child))
            elif name == "figure":
                return room + self._paper.least_height([self._place(child, 1)], 1)
            elif name == "div" and "pair" in _classes(child):
                row = [e for e in child if e.tag == f"{XHTML}figure"][:2]
                return room + (self._paper.least_height([self._place(e, 2) for e in row], 2) if row else 60.0)
            else:
                break
        return room

    def _paragraph(self, element: Element) -> None:
        kinds = _classes(element)
        if "verdict" in kinds:
            self._paper.boxed(words(element))
        else:
            quiet = bool({"muted", "kicker"} & kinds)
            if element.find(f".//{XHTML}sub") is None:
                self._paper.paragraph(words(element), quiet=quiet)
            else:
                self._paper.paragraph(words(element), quiet=quiet, pieces=pieces(element))

    def _pairs(self, element: Element) -> None:
        cells = list(element)
        rows = [[words(name), words(value)] for name, value in zip(cells[0::2], cells[1::2], strict=True)]
        self._paper.facts(rows)

    def _pair(self, element: Element) -> None:
        """Figures two in a row; cards below each other."""
        figures = [child for child in element if child.tag == f"{XHTML}figure"]
        for start in range(0, len(figures), 2):
            self._figure_row(figures[start : start + 2], columns=2)
        for child in element:
            if child.tag != f"{XHTML}figure":
                self.blocks(child)

    def _figure_row(self, elements: list[Element], columns: int = 1) -> None:
        self._paper.figures([self._place(element, columns) for element in elements], columns)

    def _place(self, element: Element, columns: int) -> FigurePlace:
        key = next(element.iter(SVG)).get("id", "")
        width, height = self._figures[key].figure.get_size_inches()
        caption = element.find(f"{XHTML}figcaption")
        narrow = columns == 1 and "half" in _classes(element)
        return FigurePlace(
            key, height / width, "" if caption is None else words(caption), NARROW if narrow else 1.0
        )


def words(element: Element) -> str:
    """The text of an element with single spaces; a line break stays one."""
    parts = [element.text or ""]
    for child in element:
        parts.append("\n" if child.tag == f"{XHTML}br" else words_raw(child))
        parts.append(child.tail or "")
    lines = "".join(parts).split("\n") if element.find(f"{XHTML}br") is not None else ["".join(parts)]
    return "\n".join(
        re.sub(r"[ \t\r\n]+", " ", line).strip() for line in lines
    ).strip()  # no-break spaces stay


def pieces(element: Element) -> list[tuple[str, bool]]:
    """The text of an element in parts, and whether each is an index below the line."""
    parts = [(element.text or "", False)]
    for child in element:
        if child.tag == f"{XHTML}sub":
            parts.append((words_raw(child), True))
        else:
            parts += pieces(child)
        parts.append((child.tail or "", False))
    return [(re.sub(r"[ \t\r\n]+", " ", text), below) for text, below in parts if text]


def words_raw(element: Element) -> str:
    """The text below an element as it stands."""
    return "".join(element.itertext())


def _classes(element: Element) -> set[str]:
    return set((element.get("class") or "").split())


def _with_figures(text: bytes, placed: list[PlacedFigure], figures: Mapping[str, NamedFigure]) -> bytes:
    writer = PdfWriter(clone_from=PdfReader(io.BytesIO(text)))
    for one in placed:
        page = writer.pages[one.page - 1]
        drawing = PdfReader(io.BytesIO(_drawing(figures[one.key].figure))).pages[0]
        scale = one.width * POINTS_PER_MM / float(drawing.mediabox.width)
        top = float(page.mediabox.height) - one.y * POINTS_PER_MM
        down = top - scale * float(drawing.mediabox.height)
        move = Transformation().scale(scale).translate(one.x * POINTS_PER_MM, down)
        page.merge_transformed_page(drawing, move)
    for page in writer.pages:
        page.compress_content_streams()
    result = io.BytesIO()
    writer.write(result)
    return result.getvalue()


def _drawing(figure: Figure) -> bytes:
    target = io.BytesIO()
    figure.savefig(target, format="pdf", transparent=True, metadata={"CreationDate": None})
    return target.getvalue()
