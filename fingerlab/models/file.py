"""Files of models: the JSON in which a fit is kept, and a project with all models tried on some sessions.

::

    {"format": "fingerlab-model", "format_version": "1", "software": "fingerlab 0.1.0",
     "created": "2024-05-06T07:08:09+02:00", "method": "regions", "effects": [],
     "sign_convention": "...", "sessions": [{"name": "S.h5", "sha256": "..."}],
     "parameters": {"extension/pip/flexion/moment_arm": {"value": v, "unit": "m", "low": v, "high": v}},
     "details": {...}}

``low`` and ``high`` bound the 90 % interval; null where the data cannot give one. ``details`` belongs to
the method. Later versions add keys and never rename them.

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
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.core.files import new_file, own_data, read_text, whole_file
from fingerlab.core.plain_data import Mismatch, json_ready, parsed, read_object, structured
from fingerlab.core.text import ParameterEstimate as ParameterEstimate
from fingerlab.sessions.disk_files import content_hash
from fingerlab.sessions.model import Session

FORMAT = "fingerlab-model"
FORMAT_VERSION = "1"
DIAGNOSIS_METHOD = "diagnosis"
"""``method`` of a model that a diagnosis fitted: nominal equations with effects."""

SIGN_CONVENTION = (
    "Angles are flexion positive; tension T >= 0; s = +1 for a flexion cable, -1 for an extension cable; "
    "moment arms a, b are magnitudes (negative: the torque did not follow the cable); "
    "LHS = s a T + L on air, LHS2 = s b T + L2 - 2 l2 F cos(theta1 + theta2 - alpha) in contact; "
    "a delay is positive where the joint angles come later than the tension."
)


@dataclass(frozen=True)
class SessionHash:
    """Name of a session file and the SHA-256 of its bytes, hexadecimal."""

    name: str
    sha256: str


@dataclass(frozen=True)
class SavedModel:
    """A fitted model. ``created`` is ISO 8601 with offset; ``software`` is name and version."""

    method: str
    parameters: Mapping[str, ParameterEstimate]
    sessions: tuple[SessionHash, ...]
    effects: tuple[str, ...] = ()
    details: Mapping[str, Any] = field(default_factory=dict)
    created: str = field(default_factory=lambda: datetime.now().astimezone().isoformat(timespec="seconds"))
    software: str = f"fingerlab {fingerlab.__version__}"
    sign_convention: str = SIGN_CONVENTION


def hash_sessions(sessions: Sequence[Session]) -> tuple[SessionHash, ...]:
    """Name and hash of each session's file.

    Raises:
        UserError: a file can no longer be read.
    """
    return tuple(SessionHash(session.path.name, content_hash(session)) for session in sessions)


def model_to_json(model: SavedModel) -> dict[str, Any]:
    """The object that the file holds, ready for ``json.dumps``."""
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "software": model.software,
        "created": model.created,
        "method": model.method,
        "effects": list(model.effects),
        "sign_convention": model.sign_convention,
        "sessions": [{"name": s.name, "sha256": s.sha256} for s in model.sessions],
        "parameters": {name: estimate_to_json(p) for name, p in model.parameters.items()},
        "details": json_ready(model.details),
    }


def estimate_to_json(estimate: ParameterEstimate) -> dict[str, Any]:
    """A parameter as ``{"value", "unit", "low", "high"}``."""
    data: dict[str, Any] = json_ready(vars(estimate))
    return data


def save_model(model: SavedModel, path: str | Path) -> None:
    """Write a model file, whole or not at all; an existing file is never overwritten.

    Raises:
        UserError: the file exists, or its folder is missing, read-only or full.
    """
    with new_file(Path(path)) as part:
        write_model(model, part)


def write_model(model: SavedModel, path: Path) -> None:
    """Write the model's text to a place that has been claimed for it.

    Raises:
        OSError: the disk is full or gone.
    """
    text = json.dumps(model_to_json(model), indent=1, allow_nan=False, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def load_model(path: str | Path) -> SavedModel:
    """Read a model file.

    Raises:
        UserError: the file is missing, not a model file, of a newer version, or lacks something.
    """
    path = Path(path)
    text = read_text(path, "a model file, as 'fingerlab fit' writes it")
    data = read_object(text, f"{path} is not a model file: it", "'fingerlab fit' writes one")
    if data.get("format") != FORMAT:
        raise UserError(
            f"{path} is not a FingerLab model file ('format' is {data.get('format')!r} and should be "
            f"'{FORMAT}'); write one with 'fingerlab fit SESSION --model {path.name}'."
        )
    _check_version(path, data.get("format_version"))
    try:
        found = structured(_Document, data)
    except Mismatch as error:
        what = error.place[0] if error.place else str(error).split("'")[1]
        if what == "sessions" and len(error.place) > 1:
            raise UserError(f"{path}, 'sessions' should hold objects with 'name' and 'sha256'.") from None
        raise UserError(f"{path} lacks '{what}'; a model file holds {_HELD[what]} there.") from None
    return SavedModel(
        found.method,
        {name: _estimate(path, name, p) for name, p in found.parameters.items()},
        tuple(found.sessions),
        tuple(str(effect) for effect in found.effects or ()),
        found.details,
        found.created,
        found.software,
        str(found.sign_convention),
    )


@dataclass(frozen=True)
class _Document:
    """The file as it is, but for the parameters, of which each has a sentence of its own."""

    method: str
    parameters: dict[str, Any]
    sessions: list[SessionHash]
    created: str
    software: str
    effects: list[Any] | None = None
    details: dict[str, Any] = field(default_factory=dict)
    sign_convention: Any = SIGN_CONVENTION


_HELD = {
    "parameters": "an object",
    "details": "an object",
    "sessions": "a list",
    "effects": "a list",
} | dict.fromkeys(("method", "created", "software"), "text")


def _check_version(path: Path, version: Any) -> None:
    major = str(version).split(".")[0]
    if not major.isdigit() or int(major) < 1:
        raise UserError(f"{path} has format_version {version!r}; this program reads '{FORMAT_VERSION}'.")
    if int(major) > int(FORMAT_VERSION):
        raise UserError(
            f"{path} is a model file of version {version}, this program reads up to version "
            f"{FORMAT_VERSION}; open it with a newer FingerLab."
        )


def _estimate(path: Path, name: str, data: Any) -> ParameterEstimate:
    wrong = UserError(
        f"{path}, parameter '{name}' should hold a finite 'value', a 'unit', and 'low' and 'high'."
    )
    if not isinstance(data, dict) or not isinstance(data.get("unit"), str):
        raise wrong
    value = _number(data.get("value"))
    if not math.isfinite(value) or not {"low", "high"} <= data.keys():
        raise wrong
    return ParameterEstimate(value, data["unit"], _number(data["low"]), _number(data["high"]))


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return math.nan
    return float(value)


PROJECT_FORMAT, PROJECT_VERSION = "fingerlab-project", "1"
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
    return own_data("projects", place)


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
    document = {"format": PROJECT_FORMAT, "format_version": PROJECT_VERSION, **asdict(project)}
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
    if not isinstance(data, dict) or data.get("format") != PROJECT_FORMAT:
        raise ValueError(f"'format' is not '{PROJECT_FORMAT}'")
    project = structured(Project, data)
    return replace(project, now=min(max(project.now, 0), max(len(project.path) - 1, 0)))


def _put_aside(path: Path) -> Path:
    number = 1
    while (aside := path.with_name(f"{path.name}{DAMAGED}{number}")).exists():
        number += 1
    return path.rename(aside)
