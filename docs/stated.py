"""The numbers by which the diagnosis decides, read from its settings with what these say of themselves."""

from __future__ import annotations

import ast
import inspect
import math
import re
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from fingerlab.diagnosis import settings

SECTION = re.compile(r"^# ## (.+)$", re.MULTILINE)
"""A heading in the file of settings."""


def stated() -> dict[str, list[tuple[str, Any, str]]]:
    """Name, value and text of each number of the diagnosis, in the order of its file, by heading."""
    source = inspect.getsource(settings)
    headings = [(source.count("\n", 0, m.start()) + 1, m[1]) for m in SECTION.finditer(source)]
    found: dict[str, list[tuple[str, Any, str]]] = {title: [] for _, title in headings}
    for one, after in pairwise(ast.parse(source).body):
        if not isinstance(one, ast.Assign):
            continue
        if not (isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)):
            raise ValueError(f"settings.py says nothing of what stands in line {one.lineno}.")
        title = [title for line, title in headings if line < one.lineno][-1]
        target = one.targets[0]
        for name in target.elts if isinstance(target, ast.Tuple) else [target]:
            key = ast.unparse(name)
            found[title].append((key, getattr(settings, key), " ".join(str(after.value.value).split())))
    return found


def shown(value: Any) -> str:
    """A number or name, or several, as text; empty for what is neither."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        parts = [f"{str(name).replace('_', ' ')} {shown(one)}" for name, one in value.items()]
        return ", ".join(parts) if all(shown(one) for one in value.values()) else ""
    if isinstance(value, tuple):
        return ", ".join(shown(one) for one in value) if all(shown(one) for one in value) else ""
    number = isinstance(value, (int, float)) or hasattr(value, "__float__")
    return f"{float(value):.4g}" if number and math.isfinite(float(value)) else ""


def page() -> str:
    """Every such number, Markdown."""
    parts = [
        "# Numbers of the diagnosis",
        "Each decision of [the diagnosis](theory.md#floor-score-and-evidence) rests on numbers that no law "
        "of physics gives. Here they all stand, read from `diagnosis/settings.py` when this page was "
        "built, with what it says of them. A squared score is a misfit per independent value, in units of "
        "the floor; log odds are natural.",
    ]
    for title, rows in stated().items():
        lines = [f"| `{key}` | {shown(value)} | {said} |" for key, value, said in rows]
        parts.append(f"## {title}")
        parts.append("\n".join(["| name | value | what it is |", "|---|---|---|", *lines]))
    return "\n\n".join(parts) + "\n"
