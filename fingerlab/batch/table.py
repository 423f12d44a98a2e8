"""One row a session, as a worker makes it, and the Parquet file that a batch puts its rows together in.

While a batch runs, every finished session is kept as a small JSON file in ``T.parquet.parts`` beside the
table: a kill loses only the sessions in work. At the end table and parts are merged into a new table that
takes the old one's place in one step, and the parts are removed. A later batch reads both.
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text, whole_file
from fingerlab.core.plain_data import json_ready, parsed
from fingerlab.core.text import ParameterEstimate
from fingerlab.core.trust import OwnSource
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.equations.coefficients import DELAY
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.effects import find_effect
from fingerlab.effects.own import only_these
from fingerlab.sessions import Session, file_hash, open_session

SOFTWARE = f"fingerlab {fingerlab.__version__}"

MAIN_PARAMETERS = (
    "arm_mcp", "arm_pip", "loss_mcp", "loss_pip", "offset", "cable_compliance", "torque_gain",
    "mcp_stiffness", "pip_stiffness", "bench_inertia", "bench_gain", "bench_offset",
)  # fmt: skip
"""Unknowns of every model that say something about the bench; nuisances of the analysis stay out."""

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
    chance = {
        Verdict.NOTHING_MISSING: result.probability_nothing,
        Verdict.NOT_IN_CATALOGUE: result.probability_unknown,
    }
    titles = {c.effect: c.title for c in result.candidates}
    in_set = [c for c in result.candidates if c.effect in result.set]
    row: Row = {
        "verdict": result.verdict,
        "probability": chance.get(result.verdict, sum(c.probability for c in in_set)),
        "set": list(result.set),
        "set_titles": [titles[effect] for effect in result.set],
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

    Each with its 90 % interval as ``.low`` and ``.high``; and the units of these and of the errors. What an
    effect would be alone is kept of every one, so that it has a strength in sessions that do not need it.
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
        if key.split("@")[0] in MAIN_PARAMETERS or _is_of(key, result.final_model):
            keep(f"param.{key}", found)
    for candidate in result.candidates:
        known = find_effect(candidate.effect)
        if known is not None and not candidate.replaces:
            for name, found in candidate.parameters.items():
                if name in known.unknowns:
                    keep(f"alone.{candidate.effect}.{name}", found)
    return columns, units


def _is_of(key: str, model: Sequence[str]) -> bool:
    """Whether a parameter belongs to an effect of the model; a delay has a name of its own."""
    return any(is_delay(name) if key == DELAY else key.split(".")[0] == name for name in model)


def is_delay(name: str) -> bool:
    """Whether the effect with this id is a delay of channels."""
    one = find_effect(name)
    return one is not None and one.special == "delay"


MARK = b"fingerlab_batch"
SCHEMA_VERSION = 1
PART_FORMAT = "fingerlab-batch-part"

_STEP = pa.struct([("added", pa.string()), ("score", pa.float64())])
FIXED_COLUMNS = {
    "session": pa.string(),
    "sha256": pa.string(),
    "created": pa.string(),
    "recorded": pa.timestamp("ms", tz="UTC"),
    "title": pa.string(),
    "operator": pa.string(),
    "runs": pa.int32(),
    "recorded_seconds": pa.float64(),
    "verdict": pa.string(),
    "probability": pa.float64(),
    "set": pa.list_(pa.string()),
    "set_titles": pa.list_(pa.string()),
    "first_effect": pa.string(),
    "first_probability": pa.float64(),
    "score": pa.float64(),
    "final_score": pa.float64(),
    "final_model": pa.list_(pa.string()),
    "error_path": pa.list_(_STEP),
    "error": pa.string(),
    "seconds": pa.float64(),
    "software": pa.string(),
    "options": pa.string(),
}
"""Columns of every table in their order; errors and parameters, all float64, follow by name.

``set_titles`` are what the effects of ``set`` are called as they were found: a ripple of one period a turn is
the weight of a link. ``score`` and ``final_score`` are in multiples of the floor; ``recorded`` is ``created``
in UTC, null where that is no time. A column's unit is in its metadata.
"""
FIXED_UNITS = {"recorded_seconds": "s", "seconds": "s", "score": "1", "final_score": "1"}


@dataclass(frozen=True)
class Contents:
    """What a table says of itself, its rows in order, and the unit of each column that has one."""

    folder: str
    added: tuple[str, ...]
    rows: tuple[Row, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)


def read_table(path: Path) -> Contents | None:
    """An earlier batch's table; None where there is no file.

    Raises:
        UserError: the file is something else, or cannot be read.
    """
    if not path.exists():
        return None
    refusal = f"{path} is not a table of 'fingerlab batch' and is not touched; choose another name for --out."
    try:
        schema = pq.read_schema(path)
        header = json.loads((schema.metadata or {})[MARK])
        if header["schema"] != SCHEMA_VERSION:
            raise UserError(
                f"{path} has version {header['schema']} of the table; this program reads {SCHEMA_VERSION}."
            )
        rows = pq.read_table(path, schema=schema).drop_columns(["recorded"]).to_pylist()
        folder, added = str(header["folder"]), tuple(str(name) for name in header["added"])
    except OSError as error:
        if isinstance(error, PermissionError):
            raise UserError(f"{path} cannot be read ({error.strerror}); close it elsewhere.") from None
        raise UserError(refusal) from None
    except (pa.ArrowException, KeyError, ValueError, TypeError):
        raise UserError(refusal) from None
    units = {f.name: f.metadata[b"unit"].decode() for f in schema if f.metadata and b"unit" in f.metadata}
    return Contents(folder, added, tuple(complete(row) for row in rows), units)


def write_table(path: Path, contents: Contents) -> None:
    """Write the table whole and put it in place of the old one in one step.

    Raises:
        UserError: the place cannot be written to, or another program holds the old table open.
    """
    others = sorted({name for row in contents.rows for name in row} - set(FIXED_COLUMNS))
    types = FIXED_COLUMNS | dict.fromkeys(others, pa.float64())
    units = FIXED_UNITS | dict(contents.units)
    fields = [
        pa.field(name, kind, metadata={"unit": units[name]} if name in units else None)
        for name, kind in types.items()
    ]
    header = {"schema": SCHEMA_VERSION, "folder": contents.folder, "added": list(contents.added)}
    schema = pa.schema(fields, metadata={MARK: json.dumps(header).encode()})
    rows = [{**row, "recorded": recorded_at(row.get("created"))} for row in contents.rows]
    advice = (
        "close it elsewhere and give it room, then start the same batch again: what is done is kept beside "
        "it."
    )
    with whole_file(path, advice) as part:
        pq.write_table(pa.Table.from_pylist(rows, schema=schema), part)


def complete(row: Mapping[str, Any]) -> Row:
    """The row with every fixed column, and without the parameters that only other sessions have."""
    fixed = {name: row.get(name) for name in FIXED_COLUMNS if name != "recorded"}
    own = {name: row[name] for name in sorted(row) if name not in FIXED_COLUMNS and row[name] is not None}
    return fixed | own


@dataclass(frozen=True)
class Parts:
    """The folder beside the table in which results are kept as they come."""

    folder: Path

    @classmethod
    def of(cls, table: Path) -> Parts:
        return cls(table.with_name(table.name + ".parts"))

    def keep(self, outcome: SessionRow) -> None:
        """Write a result, whole or not at all; an earlier one of the same session and options is replaced.

        Raises:
            UserError: the place cannot be written to.
        """
        key = json.dumps([outcome.row["session"], outcome.row["options"], outcome.row["software"]])
        path = self.folder / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.json"
        text = json.dumps(
            {"format": PART_FORMAT, "row": outcome.row, "units": outcome.units}, allow_nan=False
        )
        advice = (
            "results are kept there until all are done, so give the place room and write access and start "
            "the same batch again."
        )
        with whole_file(path, advice) as part:
            self.folder.mkdir(exist_ok=True)
            part.write_text(text, encoding="utf-8")

    def read(self) -> list[SessionRow]:
        """What was kept; a damaged part is as good as absent, so its session is done again."""
        found = []
        for path in sorted(self.folder.glob("*.json")):
            try:
                data = parsed(read_text(path, "a part of the table"))
                if data["format"] == PART_FORMAT and data["row"]["session"]:
                    found.append(SessionRow(dict(data["row"]), dict(data["units"])))
            except (UserError, ValueError, KeyError, TypeError):
                continue
        return found

    def clear(self) -> None:
        """Remove the parts, once they are in the table."""
        shutil.rmtree(self.folder, ignore_errors=True)


def in_order_of_time(rows: Iterable[Row]) -> list[Row]:
    """Rows by the time of recording, those without one last, then by name."""

    def place(row: Row) -> tuple[bool, float, str]:
        when = recorded_at(row.get("created"))
        return when is None, 0.0 if when is None else when.timestamp(), str(row["session"])

    return sorted(rows, key=place)


def units_of(outcomes: Sequence[SessionRow], known: Mapping[str, str]) -> dict[str, str]:
    """Units of all columns, those of an earlier table included."""
    result = dict(known)
    for outcome in outcomes:
        result |= outcome.units
    return result


def number_of(value: object) -> float:
    """A cell as a number; NaN where it is none."""
    return float(value) if isinstance(value, (int, float)) else math.nan
