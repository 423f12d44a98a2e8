"""Files, lines, levels and arrows of the program by room, counted from its imports::

    python docs/structure.py                    # of this checkout
    python docs/structure.py --before REVISION  # beside an earlier revision, as docs/architecture.md has it

A room is a folder. An arrow is one file that imports another one, wherever in the file; what is imported
for type checking alone counts too, so that a circle cannot hide there. A room has as many levels as the
longest chain of its files in which each imports the next.
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
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOPS = ("fingerlab", "ui")
Module = tuple[str, ...]
Graph = Mapping[Module, frozenset[Module]]


@dataclass(frozen=True)
class Room:
    """One folder in numbers; ``inside`` counts arrows between its files, ``out`` those that leave it."""

    name: str
    files: int
    lines: int
    levels: int
    inside: int
    out: int


def graph_of(root: Path = ROOT) -> tuple[Graph, dict[Module, int]]:
    """Which module imports which, and the lines of each; ``root`` holds ``fingerlab/`` and ``ui/``."""
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
    return graph, {name: text.count("\n") for name, text in texts.items()}


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
    height: dict[Module, int] = {}

    def of(one: Module, above: frozenset[Module]) -> int:
        if one not in height:
            below = [of(other, above | {one}) for other in graph[one] & members if other not in above | {one}]
            height[one] = 1 + max(below, default=0)
        return height[one]

    return max((of(one, frozenset()) for one in members), default=0)


def room_of(module: Module) -> str:
    """``fingerlab/diagnosis`` of ``fingerlab.diagnosis.score.evidence``; files at the top are a room."""
    return "/".join(module[:2]) if len(module) > 2 else module[0]


def rooms(root: Path = ROOT) -> list[Room]:
    """Every room, the instrument's first."""
    graph, lines = graph_of(root)
    packages = {module[:2] for module in graph if len(module) > 2}
    members: dict[str, set[Module]] = defaultdict(set)
    for module in graph:
        members["/".join(module) if module in packages else room_of(module)].add(module)
    found = []
    for name in sorted(members):
        own = members[name]
        found.append(
            Room(
                name,
                len(own),
                sum(lines[m] for m in own),
                levels(graph, own),
                sum(len(graph[m] & own) for m in own),
                sum(len(graph[m] - own) for m in own),
            )
        )
    return found


def table(root: Path = ROOT) -> str:
    """The rooms as Markdown, with their sum and the circles."""
    found = rooms(root)
    rows = [f"| `{r.name}/` | {r.files} | {r.lines:,} | {r.levels} | {r.inside} | {r.out} |" for r in found]
    total = f"| together | {sum(r.files for r in found)} | {sum(r.lines for r in found):,} | | | |"
    loops = circles(graph_of(root)[0])
    said = "No circle of imports." if not loops else f"Circles of imports: {len(loops)}."
    for loop in loops:
        said += f"\n`{'`, `'.join('.'.join(m) for m in loop)}`."
    head = "| room | files | lines | levels | arrows inside | arrows out |\n|---|---:|---:|---:|---:|---:|"
    return "\n".join([head, *rows, total]) + f"\n\n{said}"


def before(revision: str) -> str:
    """The same of an earlier revision, from the repository's history."""
    archive = subprocess.run(["git", "archive", revision, *TOPS], cwd=ROOT, capture_output=True, check=True)
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as tar:
            tar.extractall(folder, filter="data")
        return table(Path(folder))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--before", metavar="REVISION", help="an earlier revision to count beside this checkout"
    )
    revision = parser.parse_args().before
    if revision:
        print(f"Before (`{revision}`):\n\n{before(revision)}\n\nNow:\n")
    print(table())


if __name__ == "__main__":
    main()
