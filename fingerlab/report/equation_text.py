"""The fitted model's equations as Markdown, as LaTeX, and as figures for the page."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from fingerlab.core.errors import UserError
from fingerlab.report.equation import EquationPart, FinalEquation, Value, latex
from fingerlab.report.figure_style import DPI, MEASURED

OF_A_FINGER = (
    "Every number in the equations is in SI: angles in rad, tension and force in N, torques in N m, lengths "
    "in m. Angles are flexion positive; T and F are never negative."
)
OF_A_MOTOR = (
    "Every number in the equations is in SI: angles in rad, torques in N m. A positive torque drives towards "
    "larger angles."
)


def si_note(equation: FinalEquation) -> str:
    """In what units and senses the numbers are."""
    return OF_A_FINGER if equation.finger else OF_A_MOTOR


VALUES_TITLE = "Fitted values, ± half the 90 % interval; one without was chosen among values that were tried"
UNIT_LATEX = {"1": "", "tan": "", "deg": r"^\circ", "of the distal length": ""}
LINE_INCHES, FONT_SIZE, WIDTH_INCHES = 0.3, 10.5, 7.2


def to_markdown(equation: FinalEquation, title: str, model: str) -> str:
    """Equations as ``$$`` blocks, values as a table."""
    parts = [f"# {title}", f"The equations of {model}, as fitted. {si_note(equation)}"]
    for part in equation.parts:
        parts.append(f"## {part.title}")
        if part.lines:
            parts.append(f"$$\n{_aligned(part, 'aligned')}\n$$")
        if part.note:
            parts.append(markdown_words(part.note))
    rows = [
        f"| {f'${v.symbol}$' if v.symbol else ''} | {v.title} | ${value_latex(v)}$ | {_unit(v)} |"
        for v in equation.values
    ]
    parts += [f"## {VALUES_TITLE}"]
    parts += ["\n".join(["| symbol | what | value | unit |", "|---|---|---|---|", *rows])]
    return "\n\n".join(parts) + "\n"


def to_latex(equation: FinalEquation, title: str, model: str) -> str:
    r"""A piece to ``\input``; it needs amsmath."""
    lines = [f"% {title}: the equations of {model}, as fitted. Needs amsmath."]
    lines += [f"% {si_note(equation)}"]
    for part in equation.parts:
        lines += [rf"\paragraph{{{_escaped(part.title)}}}"]
        if part.lines:
            lines.append(_aligned(part, "align*"))
        if part.note:
            lines.append(rf"\noindent {{\small {latex_words(part.note)}}}\par")
    lines += [rf"\paragraph{{{_escaped(VALUES_TITLE.replace('±', 'with'))}}}", r"\medskip\noindent\\"]
    lines += [r"\begin{tabular}{llll}", r"symbol & what & value & unit \\ \hline\rule{0pt}{2.6ex}%"]
    for v in equation.values:
        symbol = f"${v.symbol}$" if v.symbol else ""
        unit = f"$\\mathrm{{{_unit_latex(v)}}}$" if _unit_latex(v) else ""
        lines.append(rf"{symbol} & {_escaped(v.title)} & ${value_latex(v)}$ & {unit} \\")
    return "\n".join([*lines, r"\end{tabular}"]) + "\n"


WRITERS = {".md": to_markdown, ".tex": to_latex}
"""What ``--equation`` can write, by the ending of the file's name."""


def check_ending(path: Path) -> None:
    """Find out before the work that the equation's file has an ending that says how to write it.

    Raises:
        UserError: it is neither Markdown nor LaTeX.
    """
    if path.suffix.lower() not in WRITERS:
        raise UserError(f"{path} ends with neither .md (Markdown) nor .tex (LaTeX); give it one of the two.")


def equation_text(equation: FinalEquation, path: Path, title: str, model: str) -> str:
    """The text for a file of that name."""
    # A title is a stranger's text: on one line, and no page of its own in either language.
    title = " ".join(re.sub(r"[<>\\`$*_\[\]{}#|]", " ", title).split())
    return WRITERS[path.suffix.lower()](equation, title, model)


def value_latex(value: Value) -> str:
    r"""``0.003728 \pm 9.9\times 10^{-5}``: the value, and half the interval where it has one."""
    one = value.estimate
    half = (one.high - one.low) / 2.0
    return latex(one.value) + (rf" \pm {latex(half, 2)}" if half > 0 else "")


def equation_figure(part: EquationPart) -> Figure | None:
    """A part's equations drawn with matplotlib's own LaTeX; None where it has none."""
    if not part.lines:
        return None
    height = LINE_INCHES * (sum(1.6 if "frac" in line else 1.0 for line in part.lines) + 0.3)
    figure = Figure(figsize=(WIDTH_INCHES, height), dpi=DPI, facecolor="white")
    down = 0.5 * LINE_INCHES
    for line in part.lines:
        tall = 1.6 if "frac" in line else 1.0
        middle = 1.0 - (down + 0.5 * (tall - 1.0) * LINE_INCHES + 0.15 * LINE_INCHES) / height
        figure.text(
            0.0,
            middle,
            f"${line}$".replace(r"\frac", r"\dfrac"),
            fontsize=FONT_SIZE,
            color=MEASURED,
            va="center",
            math_fontfamily="cm",
        )
        down += tall * LINE_INCHES
    return figure


def equation_figures(equation: FinalEquation) -> Mapping[str, Figure]:
    """Figures by the title of their part."""
    drawn = ((part.title, equation_figure(part)) for part in equation.parts)
    return {title: figure for title, figure in drawn if figure is not None}


def _aligned(part: EquationPart, environment: str) -> str:
    lines = [_with_mark(line) for line in part.lines]
    return "\n".join([rf"\begin{{{environment}}}", " \\\\\n".join(lines), rf"\end{{{environment}}}"])


def _with_mark(line: str) -> str:
    """An alignment mark in front of the first relation; a line that goes on begins behind it."""
    if line.startswith(r"\qquad"):
        return "&" + line
    for relation in ("=", r"\leq"):
        if relation in line:
            return line.replace(relation, "&" + relation, 1)
    return "&" + line


def _unit(value: Value) -> str:
    return "" if value.estimate.unit in ("1", "tan") else value.estimate.unit


def _unit_latex(value: Value) -> str:
    unit = value.estimate.unit
    return UNIT_LATEX.get(unit, unit.replace(" ", r"\,"))


SYMBOL = re.compile(
    r"(?:(?<![^\W_])(?P<base>Δ?[A-Za-zα-ωℓ])(?:_(?P<below>\w+)|(?P<digit>[₁₂])))"
    r"|(?P<greek>[α-ωΔℓ])|(?<!\w)(?P<lone>[A-Za-z])(?=:|, [A-Za-z]:)"
)
"""A symbol in a sentence: with an index, Greek, or a letter that is explained."""
GREEK = (
    *(
        "alpha",
        "beta",
        "gamma",
        "delta",
        "varepsilon",
        "zeta",
        "eta",
        "theta",
        "iota",
        "kappa",
        "lambda",
        "mu",
    ),
    *("nu", "xi", "o", "pi", "rho", "varsigma", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega"),
)
LATEX_OF = {chr(ord("α") + k): rf"\{name} " for k, name in enumerate(GREEK)} | {
    "Δ": r"\Delta ",
    "ℓ": r"\ell ",
}


def latex_words(text: str) -> str:
    r"""A sentence whose symbols stand in mathematics: ``δ, C_j`` as ``$\delta$, $C_{j}$``."""
    return "".join(f"${part}$" if k % 2 else _escaped(part) for k, part in enumerate(_symbols_apart(text)))


def markdown_words(text: str) -> str:
    r"""The same in Markdown, where nothing else of the sentence is changed."""
    return "".join(f"${part}$" if k % 2 else part for k, part in enumerate(_symbols_apart(text)))


def html_words(text: str) -> str:
    """The same as HTML: ``f_H`` as a slanted f with an index; all else is escaped."""

    def symbol(found: re.Match[str]) -> str:
        below = found["below"] or {"₁": "1", "₂": "2"}.get(found["digit"] or "", "")
        index = f"<sub>{below}</sub>" if below else ""
        return f"<var>{found['base'] or found['greek'] or found['lone']}{index}</var>"

    return SYMBOL.sub(symbol, html.escape(text, quote=False))


def _symbols_apart(text: str) -> list[str]:
    """A sentence in parts: words and symbols (as LaTeX) in turns, so that words alone can be escaped."""

    def letters(found: str) -> str:
        return "".join(LATEX_OF.get(letter, letter) for letter in found).strip()

    def symbol(found: re.Match[str]) -> str:
        below = found["below"] or {"₁": "1", "₂": "2"}.get(found["digit"] or "", "")
        index = f"_{{{letters(below)}}}" if below else ""
        return f"\0{letters(found['base'] or found['greek'] or found['lone'])}{index}\0"

    return SYMBOL.sub(symbol, text.replace("−", "\0-\0")).split("\0")


def _escaped(text: str) -> str:
    for mark in "&%#_":
        text = text.replace(mark, "\\" + mark)
    return text
