"""What a researcher has done with some sessions: models tried, branches and all, what is looked at, notes.

A project is one JSON file beside the first session, written whole at each change::

    {"format": "fingerlab-project", "format_version": "1", "sessions": ["S.h5"],
     "path": [{"added": [], "score": 12.4}, {"added": ["coulomb_friction"], "score": 1.1,
     "evidence": "The residual flips sign with speed."}], "now": 1,
     "tried": [...], "view": {"equation": "mcp", "run": "1", ...}, "notes": "...", "revealed": false}

Scores are held-out errors in multiples of the floor. What is not there has its default; later versions add
keys and never rename them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from platformdirs import user_data_path

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file
from fingerlab.core.plain_data import Mismatch, parsed, structured
from fingerlab.sessions.model import Session

FORMAT, FORMAT_VERSION = "fingerlab-project", "1"
ENDING = ".project.json"
DAMAGED = ".damaged"
MOST_BYTES = 4_000_000
"""A larger file is no project: notes of a thousand pages would fit."""


Held = tuple[tuple[str, float], ...]
"""Parameters that somebody holds, by key in alphabetical order, and their values, SI."""
ModelKey = tuple[tuple[str, ...], Held]
"""Effects in the order in which they were added, and what is held."""


@dataclass(frozen=True)
class TriedModel:
    """Effects added to the nominal model, in order, and its held-out error in multiples of the floor.

    ``evidence``: what spoke for the last step towards it, in words; empty for a first model. ``held``:
    parameters that were held, by key, and their values, SI.
    """

    added: tuple[str, ...] = ()
    score: float = 0.0
    evidence: str = ""
    held: Held = ()

    @property
    def key(self) -> ModelKey:
        """What tells it from other models of the same sessions."""
        return self.added, self.held


@dataclass(frozen=True)
class View:
    """What was looked at last: an equation of a run, from ``start`` to ``stop`` (s; equal: all of it)."""

    equation: str = ""
    run: str = ""
    start: float = 0.0
    stop: float = 0.0


@dataclass(frozen=True)
class Project:
    """The state of the work on ``sessions`` (file names).

    Attributes:
        path: models from the first to the last that redo reaches; ``now`` is the place of the present one.
        tried: every model that was fitted, those of branches that were left included, in that order.
        revealed: whether the hidden effect of a practice session has been told.
        moved: parameters of the present model that were moved by hand without a fit, by key; values in SI.
    """

    sessions: tuple[str, ...]
    path: tuple[TriedModel, ...] = ()
    now: int = 0
    tried: tuple[TriedModel, ...] = ()
    view: View = View()
    notes: str = ""
    revealed: bool = False
    moved: Held = ()

    @property
    def worth_keeping(self) -> bool:
        """Whether anything was done that a fresh look at the sessions would not give."""
        return len(self.tried) > 1 or bool(self.notes or self.moved) or self.revealed


def project_path(sessions: Sequence[Path]) -> Path:
    """Where the project of these session files is kept: beside the first of them."""
    first = sessions[0]
    others = f"+{len(sessions) - 1}" if len(sessions) > 1 else ""
    return first.with_name(f"{first.stem}{others}{ENDING}")


def elsewhere(path: Path) -> Path:
    """Where it is kept instead if the session's folder takes no file."""
    place = "-".join(part.strip("\\/:") for part in path.absolute().parts if part.strip("\\/:"))
    return user_data_path("FingerLab", appauthor=False) / "projects" / place


def load_project(sessions: Sequence[Session]) -> Project | None:
    """The project of these sessions; None where there is none, or it is of others.

    Raises:
        UserError: there is a file that cannot be read as one; it is put aside under another name, not lost.
    """
    beside = project_path([session.path for session in sessions])
    found = [path for path in (beside, elsewhere(beside)) if path.is_file()]
    if not found:
        return None
    path = max(found, key=lambda one: one.stat().st_mtime)
    try:
        project = _read(path)
    except (Mismatch, ValueError, RecursionError, OSError) as error:
        aside = _put_aside(path)
        raise UserError(
            f"{path} is no project that can be read ({error}); it is kept as {aside.name}; a new one begins."
        ) from None
    names = tuple(session.path.name for session in sessions)
    return project if project.sessions == names else None


def save_project(project: Project, path: Path) -> Path:
    """Write a project whole, at ``path`` or, where that takes no file, :func:`elsewhere`; returns where.

    Raises:
        UserError: neither place takes it.
    """
    document = {"format": FORMAT, "format_version": FORMAT_VERSION, **asdict(project)}
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    try:
        _write(text, path)
    except UserError:
        path = elsewhere(path)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"{path.parent} cannot be made ({error.strerror}); make it by hand.") from None
        _write(text, path)
    return path


def with_model(project: Project, model: TriedModel) -> Project:
    """The project with a model among those tried; one that was tried before has its new score."""
    others = tuple(one for one in project.tried if one.key != model.key)
    return replace(project, tried=(*others, model))


def _write(text: str, path: Path) -> None:
    with whole_file(path, "the work is kept as soon as it can be.") as part:
        part.write_text(text, encoding="utf-8")


def _read(path: Path) -> Project:
    if path.stat().st_size > MOST_BYTES:
        raise ValueError(f"it is larger than {MOST_BYTES // 1_000_000} MB")
    data = parsed(path.read_text(encoding="utf-8"))
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ValueError(f"'format' is not '{FORMAT}'")
    project = structured(Project, data)
    return replace(project, now=min(max(project.now, 0), max(len(project.path) - 1, 0)))


def _put_aside(path: Path) -> Path:
    number = 1
    while (aside := path.with_name(f"{path.name}{DAMAGED}{number}")).exists():
        number += 1
    return path.rename(aside)
