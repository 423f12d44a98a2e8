"""The JSON file in which the result of a fit is kept, and read back.

::

    {"format": "fingerlab-model", "format_version": "1", "software": "fingerlab 0.1.0",
     "created": "2024-05-06T07:08:09+02:00", "method": "regions", "effects": [],
     "sign_convention": "...", "sessions": [{"name": "S.h5", "sha256": "..."}],
     "parameters": {"extension/pip/flexion/moment_arm": {"value": v, "unit": "m", "low": v, "high": v}},
     "details": {...}}

``low`` and ``high`` bound the 90 % interval; null where the data cannot give one. ``details`` belongs to
the method. Later versions add keys and never rename them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.core.files import new_file, read_text
from fingerlab.core.plain_data import Mismatch, json_ready, read_object, structured
from fingerlab.core.text import ParameterEstimate as ParameterEstimate
from fingerlab.sessions.model import Session
from fingerlab.sessions.reading import content_hash

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
class Model:
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


def model_to_json(model: Model) -> dict[str, Any]:
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


def save_model(model: Model, path: str | Path) -> None:
    """Write a model file, whole or not at all; an existing file is never overwritten.

    Raises:
        UserError: the file exists, or its folder is missing, read-only or full.
    """
    with new_file(Path(path)) as part:
        write_model(model, part)


def write_model(model: Model, path: Path) -> None:
    """Write the model's text to a place that has been claimed for it.

    Raises:
        OSError: the disk is full or gone.
    """
    text = json.dumps(model_to_json(model), indent=1, allow_nan=False, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def load_model(path: str | Path) -> Model:
    """Read a model file.

    Raises:
        UserError: the file is missing, not a model file, of a newer version, or lacks something.
    """
    path = Path(path)
    data = _read_object(path)
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
    return Model(
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
    effects: Any = ()
    details: dict[str, Any] = field(default_factory=dict)
    sign_convention: Any = SIGN_CONVENTION


_HELD = {"parameters": "an object", "details": "an object", "sessions": "a list"} | dict.fromkeys(
    ("method", "created", "software"), "text"
)


def _read_object(path: Path) -> dict[str, Any]:
    text = read_text(path, "a model file, as 'fingerlab fit' writes it")
    return read_object(text, f"{path} is not a model file: it", "'fingerlab fit' writes one")


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
