"""The numbers by which the diagnosis decides, read from its modules with what they say of themselves."""

from __future__ import annotations

import ast
import importlib
import inspect
import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

MODULES = {
    "score.evidence": "When an effect is missing, and what could not show",
    "score.selection": "When a step of the path is justified, and which effect it is",
    "fit.solver": "How a fit ends, and constants that go together",
    "signals.conditions": "Runs of one condition",
    "fit.noise": "How far an equation is trusted, in motion and at rest",
    "experiment.proposal": "The next experiment",
}
"""Modules of the diagnosis whose numbers decide, and what they decide."""


def stated(name: str) -> Iterator[tuple[str, Any, str]]:
    """Name, value and text of each number of a module that has a text of its own, in its order.

    Args:
        name: of a module of ``fingerlab.diagnosis``, after the package.
    """
    module = importlib.import_module(f"fingerlab.diagnosis.{name}")
    body = ast.parse(inspect.getsource(module)).body
    for one, after in pairwise(body):
        targets = one.targets[0] if isinstance(one, ast.Assign) else None
        names = targets.elts if isinstance(targets, ast.Tuple) else [targets]
        said = (
            after.value.value
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            else None
        )
        for target in names:
            if isinstance(target, ast.Name) and target.id.isupper() and isinstance(said, str):
                value = getattr(module, target.id)
                if shown(value):
                    yield target.id, value, " ".join(said.split())


def shown(value: Any) -> str:
    """A number, or several, as text; empty for what is none."""
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
        "of physics gives. Here they all stand, read from the program when this page was built, with what it "
        "says of them. A squared score is a misfit per independent value, in units of the floor; log odds "
        "are natural.",
    ]
    for name, title in MODULES.items():
        rows = [f"| `{key}` | {shown(value)} | {said} |" for key, value, said in stated(name)]
        if rows:
            parts.append(f"## {title}\n\n`diagnosis/{name.replace('.', '/')}.py`")
            parts.append("\n".join(["| name | value | what it is |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"
