"""The one-way arrows between the parts of the program, drawn from the imports that its files hold."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Set
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MARK = "<!-- docs/generate.py draws the arrows here -->"
"""What ``architecture.md`` holds in place of the drawing."""
ROWS = (
    {"ui": (0.40, "the window (Qt)")},
    {
        "notebook": (0.13, "import fingerlab"),
        "cli": (0.65, "commands"),
        "library": (0.88, "folders of sessions"),
    },
    {
        "report": (0.40, "pages, figures"),
        "acquisition": (0.66, "loop, recorder"),
        "batch": (0.89, "many sessions"),
    },
    {"prediction": (0.36, "endpoint force"), "devices": (0.80, "card, simulated rig, replay")},
    {
        "diagnosis": (0.36, "which effect is missing"),
        "thesis": (0.12, "the thesis' regressions"),
        "twin": (0.80, "the simulated bench"),
    },
    {"models": (0.12, "fitted models, their file"), "effects": (0.36, "the catalogue")},
    {
        "calibration": (0.12, "volts to units"),
        "physics": (0.37, "equations"),
        "signals": (0.62, "filters, regions"),
        "told": (0.87, "trajectories, limits"),
    },
    {"ground": (0.50, "sessions, rig, core")},
)
"""Parts from the top down: place across the drawing, and what they are. Imports lead to rows further down."""
GROUND = ("core", "rig", "sessions")
COMMANDING = ("control",)
"""Rooms of ``acquisition`` that say what the motor is told, and know no device."""
WIDTH, ROW, BOX_WIDTH, BOX_HEIGHT = 880.0, 92.0, 182.0, 46.0
Edge = tuple[str, str]


def part_of(words: tuple[str, ...]) -> str:
    """The part to which a module belongs, by the words of its name: ``("fingerlab", "rig")`` -> ground."""
    if words[0] == "ui":
        return "ui"
    name = words[1] if len(words) > 1 else ""
    if name in GROUND:
        return "ground"
    return "told" if name == "acquisition" and len(words) > 2 and words[2] in COMMANDING else name


@cache
def imports(root: Path = ROOT) -> frozenset[Edge]:
    """Which part imports which, as the files say; what is only for type checking is left out."""
    edges, known = set(), ranks()
    for top in ("fingerlab", "ui"):
        for path in (root / top).rglob("*.py"):
            own = part_of(path.relative_to(root).with_suffix("").parts)
            for name in _imported(ast.parse(path.read_text(encoding="utf-8"))):
                other = part_of(tuple(name.split(".")))
                if other not in (own, "") and own in known and other in known:
                    edges.add((own, other))
    return frozenset(edges)


def _imported(tree: ast.AST) -> Iterator[str]:
    left = [tree]
    while left:
        node = left.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{a.name}" for a in node.names] if node.level == 0 and node.module else []
        else:
            inner = ast.iter_child_nodes(node)
            left.extend(
                one for one in inner if not isinstance(one, ast.expr)
            )  # no expression holds an import
            continue
        yield from (name for name in names if name.startswith("fingerlab."))


def ranks() -> dict[str, int]:
    """Row of each part, 0 at the top."""
    return {name: row for row, parts in enumerate(ROWS) for name in parts}


def drawn(edges: Set[Edge]) -> set[Edge]:
    """The edges that others do not say already: a way over a third part leaves out the direct one."""
    rank = ranks()
    after = {name: {b for a, b in edges if a == name} for name in rank}

    def reached(name: str) -> set[str]:
        lower = [one for one in after[name] if rank[one] > rank[name]]
        return after[name].union(*(reached(one) for one in lower))

    return {(a, b) for a, b in edges if not any(b in reached(c) for c in after[a] - {b})}


def drawing() -> str:
    """The parts and their arrows as SVG in the page's own colours."""
    places = {
        name: (WIDTH * across, 12.0 + ROW * row)
        for row, parts in enumerate(ROWS)
        for name, (across, _) in parts.items()
    }
    height = ROW * (len(ROWS) - 1) + BOX_HEIGHT + 24.0
    lines = [_arrow(places[a], places[b]) for a, b in sorted(drawn(imports()))]
    boxes = [_box(name, said, *places[name]) for parts in ROWS for name, (_, said) in parts.items()]
    head = (
        '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0L8 4L0 8z" fill="currentColor"/></marker>'
    )
    return (
        f'<svg class="arrows" viewBox="0 0 {WIDTH:g} {height:g}" role="img" '
        f'aria-label="Parts of the program and the arrows of their imports">'
        f"<defs>{head}</defs>{''.join(lines)}{''.join(boxes)}</svg>"
    )


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    (x1, y1), (x2, y2) = (start[0], start[1] + BOX_HEIGHT), end
    bend = 0.45 * (y2 - y1)
    curve = f"M{x1:g} {y1:g}C{x1:g} {y1 + bend:g} {x2:g} {y2 - bend:g} {x2:g} {y2 - 1:g}"
    return (
        f'<path d="{curve}" fill="none" stroke="currentColor" stroke-opacity="0.55" marker-end="url(#tip)"/>'
    )


def _box(name: str, said: str, x: float, y: float) -> str:
    left = x - BOX_WIDTH / 2
    return (
        f'<rect x="{left:g}" y="{y:g}" width="{BOX_WIDTH:g}" height="{BOX_HEIGHT:g}" rx="6"/>'
        f'<text x="{x:g}" y="{y + 19:g}" class="name">{escape(name)}</text>'
        f'<text x="{x:g}" y="{y + 36:g}">{escape(said)}</text>'
    )
