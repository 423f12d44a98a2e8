"""Files, lines, levels and arrows of the program by room, counted from its source::

    python docs/structure.py                            # of this checkout
    python docs/structure.py --before REVISION --write  # beside an earlier one, into docs/architecture.md

A room is a folder. An arrow is one file that imports another one, wherever in the file; what is imported
for type checking alone counts too, so that a circle cannot hide there. A room has as many levels as the
longest chain of its files in which each imports the next. Code is what is left of the lines without those
that are empty, comments, texts that explain, and imports.
"""

from __future__ import annotations

import argparse
import ast
import io
import subprocess
import tarfile
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
MARK, END = "<!-- docs/structure.py counts from here -->", "<!-- to here -->"
TOPS = ("fingerlab", "ui")
Module = tuple[str, ...]
Graph = Mapping[Module, frozenset[Module]]


@dataclass(frozen=True)
class Room:
    """One folder in numbers; ``inside`` counts arrows between its files, ``out`` those that leave it."""

    name: str
    files: int
    lines: int
    code: int
    levels: int
    inside: int
    out: int


@cache
def graph_of(root: Path = ROOT) -> tuple[Graph, dict[Module, tuple[int, int]]]:
    """Which module imports which, and lines and code of each; ``root`` holds ``fingerlab/`` and ``ui/``."""
    paths = {
        path.relative_to(root).with_suffix("").parts: path
        for top in TOPS
        for path in (root / top).rglob("*.py")
    }
    texts = {_module(parts): path.read_text(encoding="utf-8") for parts, path in paths.items()}
    packages = {parts[:-1] for parts in paths if parts[-1] == "__init__"}
    graph = {
        name: frozenset(
            found
            for wanted in _imported(ast.parse(text), name if name in packages else name[:-1])
            if (found := _known(wanted, texts)) not in (None, name) and found is not None
        )
        for name, text in texts.items()
    }
    return graph, {name: (text.count("\n"), code_lines(text)) for name, text in texts.items()}


def code_lines(text: str) -> int:
    """Lines that are neither empty nor comments, nor belong to a text that explains or to an import."""
    left = {
        k for k, line in enumerate(text.splitlines(), 1) if line.strip() and not line.lstrip().startswith("#")
    }
    for node in ast.walk(ast.parse(text)):
        explains = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if explains or isinstance(node, ast.Import | ast.ImportFrom):
            left -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(left)


def _module(parts: Module) -> Module:
    return parts[:-1] if parts[-1] == "__init__" else parts


def _known(wanted: Module, known: Mapping[Module, str]) -> Module | None:
    """The module that holds what is imported: the name itself, or the module it stands in."""
    if wanted[:2] == ("fingerlab", "ui"):
        wanted = wanted[1:]
    return next((w for w in (wanted, wanted[:-1]) if w in known and len(w) > 1), None)


def _imported(tree: ast.AST, package: Module) -> Iterator[Module]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = (*above, *(node.module.split(".") if node.module else ()))
            yield from ((*base, alias.name) for alias in node.names)


def circles(graph: Graph) -> list[list[Module]]:
    """Groups of modules that import each other in a loop (Tarjan 1972)."""
    order: dict[Module, int] = {}
    low: dict[Module, int] = {}
    stack: list[Module] = []
    found: list[list[Module]] = []

    def visit(one: Module) -> None:
        order[one] = low[one] = len(order)
        stack.append(one)
        for other in graph[one]:
            if other not in order:
                visit(other)
                low[one] = min(low[one], low[other])
            elif other in stack:
                low[one] = min(low[one], order[other])
        if low[one] == order[one]:
            place = stack.index(one)
            group = stack[place:]
            del stack[place:]
            if len(group) > 1:
                found.append(sorted(group))

    for module in sorted(graph):
        if module not in order:
            visit(module)
    return found


def levels(graph: Graph, members: set[Module]) -> int:
    """Length of the longest chain of imports among ``members``; files in one circle stand on one level."""
    own = {module: graph[module] & members for module in members}
    one_of = {module: loop[0] for loop in circles(own) for module in loop}
    height: dict[Module, int] = {}

    def of(one: Module) -> int:
        if one not in height:
            together = [m for m in members if one_of.get(m, m) == one]
            below = {one_of.get(other, other) for m in together for other in own[m]} - {one}
            height[one] = 1 + max((of(other) for other in below), default=0)
        return height[one]

    return max((of(one_of.get(module, module)) for module in members), default=0)


def rooms(root: Path = ROOT) -> list[Room]:
    """Every folder that holds modules."""
    graph, lines = graph_of(root)
    packages = {module[:-1] for module in graph} | {module for module in graph if len(module) == 1}
    members: dict[str, set[Module]] = defaultdict(set)
    for module in graph:
        members["/".join(module if module in packages else module[:-1])].add(module)
    return [
        Room(
            name,
            len(own),
            sum(lines[m][0] for m in own),
            sum(lines[m][1] for m in own),
            levels(graph, own),
            sum(len(graph[m] & own) for m in own),
            sum(len(graph[m] - own) for m in own),
        )
        for name, own in sorted(members.items())
    ]


def table(root: Path = ROOT) -> str:
    """The rooms as Markdown, with their sum and the circles."""
    found = rooms(root)
    rows = [
        f"| {r.name}/ | {r.files} | {r.lines:,} | {r.code:,} | {r.levels} | {r.inside} | {r.out} |"
        for r in found
    ]
    sums = (sum(r.files for r in found), sum(r.lines for r in found), sum(r.code for r in found))
    total = "| together | {:,} | {:,} | {:,} | | | |".format(*sums)
    loops = circles(graph_of(root)[0])
    said = "No circle of imports." if not loops else f"Circles of imports: {len(loops)}."
    for loop in loops:
        said += f"\n`{'`, `'.join('.'.join(m) for m in loop)}`."
    head = "| room | files | lines | code | levels | arrows inside | arrows out |"
    return "\n".join([head, f"|---|{'---:|' * 6}", *rows, total]) + f"\n\n{said}"


def before(revision: str) -> str:
    """The same of an earlier revision, from the repository's history."""
    archive = subprocess.run(["git", "archive", revision, *TOPS], cwd=ROOT, capture_output=True, check=True)
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as tar:
            tar.extractall(folder, filter="data")
        return table(Path(folder))


def with_tables(page: str, tables: str) -> str:
    """The page with these tables between its two marks."""
    begin, end = page.index(MARK) + len(MARK), page.index(END)
    return f"{page[:begin]}\n\n{tables}\n\n{page[end:]}"


def main() -> None:
    """Print the tables, or write them into the page on architecture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--before", metavar="REVISION", help="an earlier revision to count beside this checkout"
    )
    parser.add_argument("--write", action="store_true", help="into docs/architecture.md, not to the screen")
    asked = parser.parse_args()
    tables = table()
    if asked.before:
        tables = f"Before (`{asked.before}`):\n\n{before(asked.before)}\n\nNow:\n\n{tables}"
    if asked.write:
        PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8"), tables), encoding="utf-8")
    else:
        print(tables)


if __name__ == "__main__":
    main()
