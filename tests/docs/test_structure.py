"""The structure that the documents promise: no circle, rooms in one direction, walks through real files."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def structure() -> ModuleType:
    sys.path.insert(0, str(ROOT / "docs"))
    import structure as module

    return module


def test_nothing_imports_in_a_circle(structure: ModuleType) -> None:
    graph, lines = structure.graph_of(ROOT)
    assert structure.circles(graph) == []
    assert ("fingerlab", "diagnosis", "diagnose") in graph[("fingerlab", "diagnosis")]
    rooms = structure.rooms()
    assert sum(every for every, _ in lines.values()) == sum(room.lines for room in rooms)
    assert sum(code for _, code in lines.values()) == sum(room.code for room in rooms)


def test_code_is_what_neither_explains_nor_imports(structure: ModuleType) -> None:
    lines = [
        '"""Two',
        'lines."""',
        "",
        "import os",
        "from a import (",
        "    b,",
        ")",
        "# said",
        "X = b  # one",
    ]
    assert structure.code_lines("\n".join([*lines, '"""What X is."""', "Y = (", "    os", ")"])) == 4


def test_a_circle_is_seen(structure: ModuleType, tmp_path: Path) -> None:
    package = tmp_path / "fingerlab"
    (package / "sub").mkdir(parents=True)
    for name in ("__init__", "sub/__init__"):
        (package / f"{name}.py").write_text("", encoding="utf-8")
    (package / "a.py").write_text("from fingerlab.sub import b\n", encoding="utf-8")
    (package / "sub" / "b.py").write_text("def late():\n    from ..c import x\n", encoding="utf-8")
    (package / "c.py").write_text("import fingerlab.a\n", encoding="utf-8")
    graph, _ = structure.graph_of(tmp_path)
    assert structure.circles(graph) == [[("fingerlab", "a"), ("fingerlab", "c"), ("fingerlab", "sub", "b")]]
    assert {r.name: (r.files, r.levels) for r in structure.rooms(tmp_path)} == {
        "fingerlab": (3, 2),
        "fingerlab/sub": (2, 1),
    }


def test_the_rooms_of_the_diagnosis_stand_on_at_most_eight_levels(structure: ModuleType) -> None:
    graph, _ = structure.graph_of(ROOT)
    folder = ("fingerlab", "diagnosis")
    members = [module for module in graph if module[:2] == folder and len(module) > 2]
    rooms: dict[tuple[str, ...], set[tuple[str, ...]]] = defaultdict(set)
    for module in members:
        rooms[module[:3]] |= {other[:3] for other in graph[module] if other in members} - {module[:3]}
    as_graph = {room: frozenset(others) for room, others in rooms.items()}
    assert structure.circles(as_graph) == []
    assert structure.levels(as_graph, set(as_graph)) <= 8


def test_every_file_of_the_walks_is_there() -> None:
    page = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")
    walks = page[page.index("## Three walks") : page.index("## An effect")]
    assert walks.count("\n**") == 3
    named = re.findall(r"`((?:fingerlab|ui)/[\w/.]+)`", walks)
    assert len(named) > 20
    assert [name for name in named if not (ROOT / name).exists()] == []
    folders = re.findall(r"`(fingerlab/[\w/]+/)`: ([^\n]*(?:\n   [^\n]*)*)", walks)
    for folder, said in folders:
        assert [n for n in re.findall(r"`(\w+\.py)`", said) if not (ROOT / folder / n).exists()] == []


def test_no_class_name_stands_twice(structure: ModuleType) -> None:
    named: dict[str, list[str]] = {}
    for top in structure.TOPS:
        for path in sorted((ROOT / top).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef):
                    named.setdefault(node.name, []).append(path.relative_to(ROOT).as_posix())
    assert {name: places for name, places in named.items() if len(places) > 1} == {}


def test_every_tuned_number_has_a_name_of_its_own() -> None:
    """A name given twice in the settings would quietly take the second value in both places."""
    tree = ast.parse((ROOT / "fingerlab/diagnosis/settings.py").read_text(encoding="utf-8"))
    names = [
        name.id
        for statement in tree.body
        if isinstance(statement, ast.Assign | ast.AnnAssign)
        for target in (statement.targets if isinstance(statement, ast.Assign) else [statement.target])
        for name in ast.walk(target)
        if isinstance(name, ast.Name)
    ]
    assert len(names) > 300
    assert sorted(names) == sorted(set(names))
