"""The figures of a report: drawn into the page, and kept for the PDF and for files of their own."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from fingerlab.core.files import OutputSet
from fingerlab.report.figure_style import CANDIDATE, FLOOR, MEASURED, MODELLED, RESIDUAL

FORMATS = ("png", "svg", "pdf")
"""What every figure is written as: for a slide, for a page, for print."""
LONGEST_NAME = 60


@dataclass(frozen=True)
class NamedFigure:
    """A figure of the page: ``name`` is fit for a file, ``description`` for those who hear the page."""

    name: str
    description: str
    figure: Figure


class Pictures:
    """Draws figures into the page, each with identifiers of its own, and keeps them by identifier."""

    def __init__(self, progress: Callable[[float, str], None], expected: int) -> None:
        self._progress, self._expected = progress, max(expected, 1)
        self.drawn: dict[str, NamedFigure] = {}

    def draw(self, figure: Figure, description: str, outlines: bool = False) -> Markup:
        """The figure as an ``<svg>`` element whose id is its key in ``drawn``; ``outlines`` for formulas."""
        self._progress(min(len(self.drawn) / self._expected, 1.0), f"drawing, {description}")
        key = f"f{len(self.drawn) + 1}"
        self.drawn[key] = NamedFigure(
            f"{len(self.drawn) + 1:02d}-{file_name(description)}", description, figure
        )
        drawn = Markup(inline_svg(figure, key, description, outlines))
        figure.set_layout_engine("none")  # all is in its place now; the next format need not search again
        return drawn


def file_name(words: str) -> str:
    """Words as a part of a file's name: small letters, digits and hyphens."""
    plain = re.sub(r"[^a-z0-9.]+", "-", words.lower()).strip("-.")
    return plain[:LONGEST_NAME].rstrip("-.")


def save_figures(figures: Mapping[str, NamedFigure], folder: Path, outputs: OutputSet) -> None:
    """Every figure in every format into a folder, on white and with letters as they are.

    Raises:
        UserError: a file of that name is there already, or the folder cannot be made or written to.
    """
    outputs.make_folder(folder)
    for one in figures.values():
        one.figure.patch.set_alpha(1.0)  # the page's drawing has no ground of its own
        # A formula stands at the left of a wide sheet, of which a file needs nothing.
        cut: dict[str, Any] = {} if one.figure.axes else {"bbox_inches": "tight", "pad_inches": 0.05}
        for kind in FORMATS:
            part = outputs.claim(folder / f"{one.name}.{kind}")
            # Dates would make two reports of one diagnosis differ.
            with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": one.name}):
                one.figure.savefig(part, format=kind, facecolor="white", metadata=_undated(kind), **cut)


def _undated(kind: str) -> dict[str, None]:
    return {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})


PAGE_COLOURS = {
    MEASURED: "measured",
    MODELLED: "modelled",
    RESIDUAL: "residual",
    CANDIDATE: "candidate",
    FLOOR: "floor",
    "#000000": "text",
}
"""Colours of ``figure_style`` -> the page's variable, so that a figure follows light and dark."""

_DECLARATIONS = re.compile(r"<metadata>.*?</metadata>|<style.*?</style>", re.DOTALL)
_IDENTIFIERS = re.compile(r'\bid="|(?<=url\()#|(?<=href=")#')
_FONT = re.compile(r"(font(?:-family)?: [^;\"]*?)'DejaVu Sans'[^;\"]*")
_BY_LOWER = {colour.lower(): name for colour, name in PAGE_COLOURS.items()}
_COLOUR = re.compile("|".join(_BY_LOWER), re.IGNORECASE)


def inline_svg(figure: Figure, key: str, description: str, outlines: bool = False) -> str:
    """The ``<svg>`` element of a figure, to be put into a page as it is.

    Args:
        key: starts every identifier in it; letters and digits, another one for each figure of the page.
        description: said in place of the picture where it cannot be seen.
        outlines: letters as drawn shapes, for formulas, whose typeface a browser does not have.
    """
    figure.patch.set_alpha(0.0)
    for axes in figure.axes:
        axes.patch.set_alpha(0.0)
    text = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "path" if outlines else "none", "svg.hashsalt": key}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    drawn = text.getvalue()
    drawn = _DECLARATIONS.sub("", drawn[drawn.index("<svg") :])
    drawn = _IDENTIFIERS.sub(lambda found: f"{found.group(0)}{key}-", drawn)
    drawn = _FONT.sub(r"\1var(--font)", drawn)
    drawn = _COLOUR.sub(lambda found: f"var(--{_BY_LOWER[found.group(0).lower()]})", drawn)
    return _named(drawn, key, description).strip()


def _named(drawn: str, key: str, description: str) -> str:
    """Without a size of its own, so that the page decides; with an id, and a name for those who hear it."""
    end = drawn.index(">")
    head = re.sub(r'\s(?:width|height)="[^"]*"', "", drawn[:end])
    return f'{head} id="{key}" role="img" aria-label="{html.escape(description, quote=True)}"{drawn[end:]}'
