"""A figure as inline SVG that belongs to the page: its text, its colours, no identifier twice."""

from __future__ import annotations

import html
import io
import re

import matplotlib as mpl
from matplotlib.figure import Figure

from fingerlab.report.figure_style import CANDIDATE, FLOOR, MEASURED, MODELLED, RESIDUAL

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
