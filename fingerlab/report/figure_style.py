"""How every figure looks, and how it is drawn into the page, kept for the PDF and for a file of its own.

Figures are made with the object API and never registered with pyplot, so that they can be drawn from any
thread, with or without a display.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from fingerlab.core.files import OutputSet
from fingerlab.core.text import score_text

MEASURED = "#1a1a1a"
MODELLED = "#0072B2"
RESIDUAL = "#E69F00"
CANDIDATE = "#009E73"
FLOOR = "#bdbdbd"
SECOND = "#CC79A7"
THIRD = "#56B4E9"
"""Okabe and Ito's palette; the first five are reserved as their names say where they meet in one plot."""

JOINT_COLOURS = {"mcp": MODELLED, "pip": RESIDUAL}
"""As in thesis figure 4.3: MCP blue, PIP orange."""

REGION_SHADES = {"flexion": "#cfe9df", "static_1": "#f2f2f2", "extension": "#dbe9f5", "static_2": "#e2e2e2"}

SIZE_INCHES = (7.2, 4.2)
DPI = 150
TITLE_SIZE, LABEL_SIZE, TICK_SIZE = 10.5, 9.0, 8.0


class LettersFigure(Figure):
    """A figure without mathematics: names of runs and titles are somebody's text, dollars and all."""

    def draw(self, renderer: RendererBase) -> None:
        """As any figure; every text is drawn as it is written."""
        for axes in self.axes:
            for axis in (axes.xaxis, axes.yaxis):
                axis.get_majorticklabels()  # made now, to be among the texts
        for text in self.findobj(Text):
            text.set_parse_math(False)
        super().draw(renderer)


def new_figure(
    rows: int = 1, columns: int = 1, size: tuple[float, float] = SIZE_INCHES, **options: Any
) -> tuple[Figure, list[Axes]]:
    """A figure and its axes, row by row; ``options`` go to ``Figure.subplots``."""
    figure = LettersFigure(figsize=size, dpi=DPI, layout="constrained", facecolor="white")
    axes = np.atleast_1d(figure.subplots(rows, columns, **options)).ravel().tolist()
    for one in axes:
        _quiet(one)
    return figure, axes


def _quiet(axes: Axes) -> None:
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(labelsize=TICK_SIZE)
    axes.xaxis.set_major_locator(MaxNLocator(7))
    axes.yaxis.set_major_locator(MaxNLocator(6))


def label(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Quantity and unit on both axes, and a title."""
    axes.set_xlabel(x, fontsize=LABEL_SIZE)
    axes.set_ylabel(y, fontsize=LABEL_SIZE)
    if title:
        axes.set_title(title, fontsize=TITLE_SIZE, loc="left")


def named_handles(axes: Axes) -> dict[str, Any]:
    """What the axes show, by the words of their legend."""
    return dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))


def score_bars(
    names: Sequence[str],
    scores: Sequence[float],
    colours: Sequence[str],
    size: tuple[float, float],
    name_size: float = TICK_SIZE,
) -> tuple[Figure, Axes]:
    """A figure of its own with :func:`draw_score_bars`, and its axes."""
    figure = LettersFigure(figsize=size, dpi=DPI, layout="constrained", facecolor="white")
    return figure, draw_score_bars(figure, names, scores, colours, name_size)


def draw_score_bars(
    figure: Figure,
    names: Sequence[str],
    scores: Sequence[float],
    colours: Sequence[str],
    name_size: float = TICK_SIZE,
) -> Axes:
    """Errors in multiples of the floor as bars from top to bottom, each with its number; 1 is the floor."""
    axes = figure.subplots()
    _quiet(axes)
    at = np.arange(len(names), dtype=float)[::-1]
    axes.axvspan(0.0, 1.0, color=FLOOR, alpha=0.6, lw=0, zorder=0, label="floor")
    axes.barh(at, scores, 0.6, color=colours)
    for y, score in zip(at, scores, strict=True):
        axes.annotate(
            score_text(score), (score, y), xytext=(5, 0), textcoords="offset points", va="center",
            fontsize=LABEL_SIZE,
        )  # fmt: skip
    named_rows(axes, names, name_size)
    axes.set_xlim(0.0, 1.12 * max(*scores, 1.0))
    legend_below(figure, axes)
    return axes


def named_rows(axes: Axes, names: Sequence[str], size: float = TICK_SIZE) -> None:
    """Names beside horizontal bars, the first at the top."""
    axes.set_yticks(np.arange(len(names), dtype=float)[::-1], names, fontsize=size)
    axes.tick_params(axis="y", length=0)


def legend(axes: Axes, **options: Any) -> None:
    """A legend without a frame, where there is something to name."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=TICK_SIZE, frameon=False, **options)


def legend_below(figure: Figure, of: Axes | Mapping[str, Any], most: int = 8) -> None:
    """One legend for the whole figure, under it: of what one of its axes names, or handles by their words.

    ``most``: columns that there is room for.
    """
    handles = of if isinstance(of, Mapping) else named_handles(of)
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower center",
        ncols=min(max(len(handles), 1), most),
        fontsize=TICK_SIZE,
        frameon=False,
    )


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


LETTERS_AN_INCH = 15.0
"""Of the words above a figure."""


def in_lines(words: str, figure: Figure) -> str:
    """Words above a figure, in lines no wider than it."""
    return "\n".join(wrap(words, int(LETTERS_AN_INCH * float(figure.get_figwidth()))))


def titled(figures: Mapping[str, Figure], titles: Mapping[str, str], source: str) -> Mapping[str, Figure]:
    """The figures, above each of which now stands what it shows, and of what.

    Args:
        titles: what each shows, by its name. source: session with its day, model, runs.
    """
    for name, figure in figures.items():
        words = in_lines(f"{titles[name]} – {source}", figure)
        figure.suptitle(words, x=0.01, ha="left", fontsize=TICK_SIZE)
    return figures


@contextmanager
def headed(figure: Figure, words: str) -> Iterator[None]:
    """The figure with words above it, for a file of its own: beyond its edge, so that nothing in it moves."""
    head = figure.text(0.01, 1.01, in_lines(words, figure), va="bottom", fontsize=TICK_SIZE)
    try:
        yield
    finally:
        head.remove()


def save_figures(figures: Mapping[str, NamedFigure], folder: Path, outputs: OutputSet, title: str) -> None:
    """Every figure in every format into a folder, on white and with letters as they are.

    Above each stands what it shows, and of what: ``title``.

    Raises:
        UserError: a file of that name is there already, or the folder cannot be made or written to.
    """
    outputs.make_folder(folder)
    for one in figures.values():
        one.figure.patch.set_alpha(1.0)  # the page's drawing has no ground of its own
        # A formula stands at the left of a wide sheet, of which a file needs nothing; the words need more.
        cut: dict[str, Any] = {"bbox_inches": "tight", "pad_inches": 0.05}
        for kind in FORMATS:
            part = outputs.claim(folder / f"{one.name}.{kind}")
            # Dates would make two reports of one diagnosis differ.
            told = headed(one.figure, f"{one.description} – {title}")
            with told, mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": one.name}):
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
