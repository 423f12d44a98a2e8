"""What a report says of its own making: versions, hashes of the files and of the bench, calibrations."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import fingerlab
from fingerlab.calibration.sensors import SENSORS
from fingerlab.core.text import r2_text, with_minus
from fingerlab.sessions.model import Session

LIBRARIES = ("numpy", "scipy", "h5py")
"""Whose version can change a number of the report."""


@dataclass(frozen=True)
class CalibrationRow:
    """A sensor's line as the session file holds it, ready to be read."""

    sensor: str
    line: str
    r2: str
    version: str
    verdict: str


def versions() -> list[tuple[str, str]]:
    """Program and what its numbers rest on, with the system they were made on."""
    rows = [("FingerLab", fingerlab.__version__), ("Python", platform.python_version())]
    for name in LIBRARIES:
        try:
            rows.append((name, version(name)))
        except PackageNotFoundError:  # a bundled program may leave the libraries' own data out
            continue
    return [*rows, ("System", f"{platform.system()} {platform.machine()}")]


def rig_hash(session: Session) -> str:
    """SHA-256 of the bench's constants as the file holds them, so that two sessions can be compared."""
    text = str(session.attributes.get("rig", session.rig.to_json()))
    with suppress(ValueError):
        text = json.dumps(json.loads(text), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def calibration_rows(session: Session) -> list[CalibrationRow]:
    """The calibrations that the file holds; empty where it holds none or what is there cannot be read."""
    try:
        held = json.loads(str(session.attributes.get("calibration", "{}")))
        return [_row(name, record) for name, record in held.items()]
    except (ValueError, AttributeError, TypeError, KeyError):
        return []


def _row(name: str, record: Mapping[str, Any]) -> CalibrationRow:
    sensor = SENSORS.get(name)
    unit = str(record.get("unit", ""))
    factor, shown = (57.29577951308232, "°") if unit == "rad" else (1.0, f" {unit}")
    gain, offset = (factor * float(record[key]["value"]) for key in ("gain", "offset"))
    line = f"{gain:.4g}{shown}/V · U {'−' if offset < 0 else '+'} {abs(offset):.4g}{shown}"
    verdict = str(record.get("verdict", ""))
    if record.get("reason"):
        verdict += f": {record['reason']}"
    return CalibrationRow(
        name.replace("-", " ") if sensor is None else sensor.title,
        with_minus(line),
        r2_text(float(record.get("r2", "nan"))),
        f"version {record['version']} of {str(record['created'])[:10]}",
        verdict,
    )


def calibration_sentence(sessions: Sequence[Session]) -> str:
    """What to say where a file holds no calibration."""
    without = [s.path.name for s in sessions if not calibration_rows(s)]
    if not without:
        return ""
    names = ", ".join(without)
    return f"{names} holds no calibration of its sensors; forces and angles are taken as the file gives them."
