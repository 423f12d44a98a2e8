"""Calibrations of a rig, one JSON file each: dated, versioned, never overwritten."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from fingerlab.calibration.outcome import CalibrationOutcome
from fingerlab.calibration.sensors import SENSORS
from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import parsed, structured
from fingerlab.core.text import ParameterEstimate

Verdict = Literal["accepted", "accepted with a reason", "rejected"]
ACCEPTED, WITH_REASON, REJECTED = "accepted", "accepted with a reason", "rejected"
_NAME = re.compile(r"(?P<sensor>[a-z-]+)-v(?P<version>\d{4,})-.*\.json")


@dataclass(frozen=True)
class CalibrationRecord:
    """A stored calibration.

    Attributes:
        sensor: its word. version: from 1, counted for each sensor of the rig. created: ISO 8601 with offset.
        verdict: what the operator decided. reason: why, where there are objections.
        source: what it was measured with, or the files it was read from.
        data: the whole of the file, SI.
    """

    sensor: str
    version: int
    created: str
    verdict: Verdict
    reason: str
    source: str
    data: Mapping[str, Any]
    path: Path | None = None

    @property
    def gain(self) -> float:
        """``unit``/V."""
        return float(self.data["gain"]["value"])

    @property
    def offset(self) -> float:
        """``unit``."""
        return float(self.data["offset"]["value"])

    @property
    def title(self) -> str:
        """Version and date: ``version 3 of 2026-11-21``."""
        return f"version {self.version} of {self.created[:10]}"


class CalibrationStore:
    """The folder of one rig's calibrations; it is made when the first one is stored."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def save(
        self,
        outcome: CalibrationOutcome,
        verdict: Verdict,
        reason: str = "",
        source: str = "",
        operator: str = "",
        now: datetime | None = None,
    ) -> CalibrationRecord:
        """Store a calibration with what was decided on it, rejected ones too: nothing measured is lost.

        Raises:
            UserError: there are objections and no reason was given, or the file cannot be written.
        """
        reason = reason.strip()
        if verdict == ACCEPTED and outcome.objections:
            raise UserError(
                "There are objections to this calibration; give a reason to accept it all the same."
            )
        if verdict == WITH_REASON and not reason:
            raise UserError("Say why it is accepted all the same; the reason is stored with the calibration.")
        created = (now or datetime.now()).astimezone()
        data = {
            **outcome.to_json(),
            "created": created.isoformat(timespec="seconds"),
            "verdict": verdict,
            "reason": reason,
            "source": source,
            "operator": operator,
        }
        return self._write(outcome.sensor.name, data, created)

    def history(self, sensor: str) -> list[CalibrationRecord]:
        """All calibrations of a sensor, newest first.

        Raises:
            UserError: a file of the folder is damaged.
        """
        return [read_record(path) for _, path in sorted(self._files(sensor), reverse=True)]

    def latest(self, sensor: str) -> CalibrationRecord | None:
        """The newest calibration that was accepted."""
        return next((one for one in self.history(sensor) if one.verdict != REJECTED), None)

    def current(self) -> dict[str, CalibrationRecord]:
        """The newest accepted calibration of each sensor that has one."""
        found = {name: self.latest(name) for name in SENSORS}
        return {name: record for name, record in found.items() if record is not None}

    def _files(self, sensor: str) -> list[tuple[int, Path]]:
        if not self.folder.is_dir():
            return []
        matches = ((_NAME.fullmatch(path.name), path) for path in self.folder.iterdir())
        return [(int(m["version"]), path) for m, path in matches if m is not None and m["sensor"] == sensor]

    def _write(self, sensor: str, data: dict[str, Any], created: datetime) -> CalibrationRecord:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            version = max((number for number, _ in self._files(sensor)), default=0)
            while True:
                version += 1
                path = self.folder / f"{sensor}-v{version:04d}-{created:%Y%m%dT%H%M%S}.json"
                if any(number == version for number, _ in self._files(sensor)):
                    continue  # another program has taken the version meanwhile
                text = json.dumps({**data, "version": version}, indent=1, ensure_ascii=False)
                with path.open("x", encoding="utf-8") as file:
                    file.write(text)
                return read_record(path)
        except OSError as error:
            raise UserError(
                f"The calibration cannot be stored in {self.folder} ({error.strerror}); "
                "the folder should be writable and have room."
            ) from None


def read_record(path: Path) -> CalibrationRecord:
    """Read one stored calibration.

    Raises:
        UserError: the file cannot be read or is no calibration.
    """
    try:
        data = parsed(read_text(path, "a stored calibration"))
        found = structured(_StoredCalibration, data)
        if found.sensor not in SENSORS or found.gain.value == 0:
            raise ValueError("its sensor or its line is impossible")
    except ValueError as error:
        raise UserError(
            f"{path} is no stored calibration ({error}); move it out of the folder, then the others count."
        ) from None
    return CalibrationRecord(
        found.sensor, found.version, found.created, found.verdict, found.reason, found.source, data, path
    )


@dataclass(frozen=True)
class _StoredCalibration:
    """What every file of a calibration holds."""

    sensor: str
    version: int
    created: str
    verdict: Verdict
    reason: str
    source: str
    gain: ParameterEstimate
    offset: ParameterEstimate
