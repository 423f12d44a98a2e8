"""One session's row: what a worker does, in whatever process or machine it runs."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import json_ready
from fingerlab.core.text import ParameterEstimate
from fingerlab.core.trust import OwnSource
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.effects.own import only_these
from fingerlab.sessions import Session, file_hash, open_session

SOFTWARE = f"fingerlab {fingerlab.__version__}"

MAIN_PARAMETERS = (
    "arm_mcp", "arm_pip", "loss_mcp", "loss_pip", "offset", "cable_compliance", "torque_gain",
    "mcp_stiffness", "pip_stiffness", "bench_inertia", "bench_gain", "bench_offset",
)  # fmt: skip
"""Unknowns of every model that say something about the bench; nuisances of the analysis stay out."""
ALONE = (
    "coulomb_friction",
    "viscous_friction",
    "motor_coulomb_friction",
    "motor_viscous_friction",
    "transport_delay",
)
"""Effects whose strength is kept for every session, found missing or not, so that it can be followed."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Options:
    """What a diagnosis depends on besides the session: effects in the model, and the user's own effects."""

    added: tuple[str, ...] = ()
    own: tuple[OwnSource, ...] = ()

    @property
    def key(self) -> str:
        """Tells two sets of options apart; short enough for a column."""
        text = json.dumps([sorted(set(self.added)), sorted(source.sha256 for source in self.own)])
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Task:
    """A session to diagnose: where it is, and its path relative to the folder, with forward slashes."""

    path: str
    name: str


@dataclass(frozen=True)
class SessionRow:
    """A row and the unit of each of its columns that has one; both go through JSON as they are."""

    row: Row
    units: dict[str, str]


def diagnose_file(task: Task, options: Options) -> SessionRow:
    """Diagnose one session. Nothing is raised: a session that cannot be diagnosed is a row that says why."""
    started = time.perf_counter()
    row: Row = {"session": task.name, "software": SOFTWARE, "options": options.key}
    units: dict[str, str] = {}
    try:
        row["sha256"] = file_hash(Path(task.path))
        with only_these(options.own):
            session = open_session(task.path)
            row |= _facts(session)
            answer = diagnose([session], options.added, with_curves=False)
        row |= _answer(answer)
        columns, units = _parameters(answer)
        row |= columns
    except UserError as error:
        row["error"] = str(error)
    except Exception as error:  # one bad file must not end a night's work
        what = " ".join(f"{type(error).__name__}: {error}".split())
        row["error"] = f"{task.path} could not be diagnosed, by a mistake of the program ({what})."
    row["seconds"] = time.perf_counter() - started
    return SessionRow(json_ready(row), units)


def recorded_at(created: object) -> datetime | None:
    """The time in UTC of an ISO 8601 text (UTC where it gives no offset); None where it is no time."""
    try:
        when = datetime.fromisoformat(str(created))
    except ValueError:
        return None
    return when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)


def _facts(session: Session) -> Row:
    operator = session.attributes.get("operator")
    return {
        "created": session.created,
        "title": session.title,
        "operator": None if operator is None else str(operator),
        "runs": len(session.runs),
        "recorded_seconds": sum(run.seconds for run in session.runs),
    }


def _answer(result: Diagnosis) -> Row:
    first = result.candidates[0] if result.candidates else None
    chance = {"nothing_missing": result.probability_nothing, "not_in_catalogue": result.probability_unknown}
    in_set = [c for c in result.candidates if c.effect in result.set]
    row: Row = {
        "verdict": result.verdict,
        "probability": chance.get(result.verdict, sum(c.probability for c in in_set)),
        "set": list(result.set),
        "first_effect": None if first is None else first.effect,
        "first_probability": None if first is None else first.probability,
        "score": result.score,
        "final_score": result.path[-1].score,
        "final_model": list(result.final_model),
        "error_path": [{"added": step.added, "score": step.score} for step in result.path],
    }
    for family, error in result.errors.items():
        row |= {f"rmse.{family}": error.rmse, f"floor.{family}": error.floor, f"r2.{family}": error.r2}
    return row


def _parameters(result: Diagnosis) -> tuple[Row, dict[str, str]]:
    """Columns ``param.NAME`` of the final model, and ``alone.EFFECT.NAME`` of an effect with the given one.

    Each with its 90 % interval as ``.low`` and ``.high``; and the units of these and of the errors.
    """
    columns: Row = {}
    units: dict[str, str] = {}
    for family, error in result.errors.items():
        units |= {f"rmse.{family}": error.unit, f"floor.{family}": error.unit}

    def keep(column: str, found: ParameterEstimate) -> None:
        for ending, value in (("", found.value), (".low", found.low), (".high", found.high)):
            columns[column + ending] = value
            units[column + ending] = found.unit

    for key, found in result.final_parameters.items():
        if key.split("@")[0] in MAIN_PARAMETERS or _effect_of(key) in result.final_model:
            keep(f"param.{key}", found)
    for candidate in result.candidates:
        if candidate.effect in ALONE:
            for name, found in candidate.parameters.items():
                if not name.endswith("_deg"):
                    keep(f"alone.{candidate.effect}.{name}", found)
    return columns, units


def _effect_of(key: str) -> str:
    """The effect that a parameter belongs to; a delay has a name of its own."""
    return "transport_delay" if key == "delay" else key.split(".")[0]
