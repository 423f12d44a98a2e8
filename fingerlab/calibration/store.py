"""Calibrations of a rig: dated, versioned, never overwritten; put to use in its file and in old sessions."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fingerlab.calibration.outcome import CalibrationOutcome
from fingerlab.calibration.sensors import SENSORS
from fingerlab.core.errors import UserError
from fingerlab.core.files import own_data, read_text
from fingerlab.core.plain_data import parsed, structured
from fingerlab.core.progress import Progress
from fingerlab.core.text import ParameterEstimate, factor
from fingerlab.rig.daq import AnalogInput, plain_section
from fingerlab.rig.file import Rig
from fingerlab.sessions.exporting import edited_copy
from fingerlab.sessions.hdf5 import write_attributes
from fingerlab.sessions.model import Array, Run
from fingerlab.sessions.reading import open_session

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


CHANNELS = {
    "load-cell": ("load_cell", "endpoint_force", ("raw/force_volts", "raw/load_cell", "raw/load_cell_volts")),
    "mcp": ("mcp", "mcp_angle", ("raw/mcp_volts", "raw/mcp")),
    "pip": ("pip", "pip_angle", ("raw/pip_volts", "raw/pip")),
}
"""Sensor -> its entry in the rig's wiring, its channel of a run, and the names of its volts as read."""

READING, COPIED = 0.5, 0.7
"""Shares of the work after which the volts are read, and the session is copied."""
NO_REFERENCE = 1e-5
"""A channel that differs from its own line by less than this share was not tared (single precision)."""


def default_folder(rig_file: Path | None = None, kind: str = "default") -> Path:
    """The rig folder: beside a rig file, else among the user's data, apart for real and simulated rigs."""
    if rig_file is not None:
        return rig_file.with_name(f"{rig_file.stem}-calibrations")
    return own_data("rigs", kind, "calibrations")


def calibrated_rig(rig: Rig, records: Mapping[str, CalibrationRecord]) -> Rig:
    """The rig with the lines of these calibrations in its wiring; what has none stays as it is."""
    daq = rig.daq
    sources = dict(daq.sources)
    for name, record in records.items():
        entry = CHANNELS[name][0]
        channel: AnalogInput = getattr(daq, entry)
        # The calibration has the sign in it already; the wiring multiplies by its own once more.
        line = replace(channel, gain=channel.sign * record.gain, offset=channel.sign * record.offset)
        changed: dict[str, Any] = {entry: line}
        daq = replace(daq, **changed)
        for what in ("gain", "offset"):
            sources[f"{entry}.{what}"] = f"calibration {record.title}"
    daq = replace(daq, sources=sources)
    return replace(rig, extra={**rig.extra, "daq": plain_section(daq)}) if records else rig


def calibration_text(records: Mapping[str, CalibrationRecord]) -> str:
    """For a session's attribute ``calibration``: the records whole, by sensor."""
    return json.dumps({name: dict(record.data) for name, record in records.items()}, ensure_ascii=False)


def rig_and_attributes(rig: Rig, folder: Path) -> tuple[Rig, dict[str, Any]]:
    """A rig with the newest accepted calibrations of a folder, and what sessions are to say of them.

    Raises:
        UserError: a file of the folder is damaged.
    """
    records = CalibrationStore(folder).current()
    return calibrated_rig(rig, records), ({"calibration": calibration_text(records)} if records else {})


def apply_again(
    source: Path, target: Path, records: Mapping[str, CalibrationRecord], progress: Progress = lambda *_: None
) -> tuple[Path, list[str]]:
    """A copy of a session whose forces and angles are calculated anew from the volts as read.

    A channel that was tared or initialised keeps the reading at which that was done as its zero; a stated
    joint angle at initialising is taken as 0 (the window and the command line state no other).

    Returns:
        The copy, and for each sensor what was done, one sentence each.

    Raises:
        UserError: no run has volts as read of these sensors, the source is no session, or the target is
            taken.
    """
    session = open_session(source)
    pieces = _recalculated(session.runs, session.rig, records, progress)
    if not pieces:
        raise UserError(
            f"{source} holds no volts as read of these sensors (/runs/NNN/raw); it cannot be calibrated anew."
        )
    used = {name: records[name] for name in dict.fromkeys(name for _, name, _ in pieces)}
    attributes = {"rig": calibrated_rig(session.rig, used).to_json(), "calibration": calibration_text(used)}
    progress(READING, "copying")
    with edited_copy(source, target) as copy:
        for number, (run, name, values) in enumerate(pieces):
            progress(COPIED + (1 - COPIED) * number / len(pieces), f"writing run {run}")
            dataset = copy[f"runs/{run}/{CHANNELS[name][1]}"]
            dataset[...] = values.astype(dataset.dtype)
        write_attributes(copy, attributes)
    sentences = []
    for name, record in used.items():
        runs = sum(1 for _, one, _ in pieces if one == name)
        sentences.append(f"{name}: {runs} {'run' if runs == 1 else 'runs'} by {record.title}")
    return target, sentences


def _recalculated(
    runs: tuple[Run, ...], rig: Rig, records: Mapping[str, CalibrationRecord], progress: Progress
) -> list[tuple[str, str, Array]]:
    """Run, sensor and new values of each channel that can be calculated anew."""
    pieces = []
    for number, run in enumerate(runs):
        progress(READING * number / len(runs), f"run {run.name}")
        for name, record in records.items():
            entry, channel, names = CHANNELS[name]
            raw = next((one for one in names if one in run.units), None)
            times = None if raw is None else factor(run.units[raw], "V")
            if raw is None or times is None or not run.has(channel):
                continue
            samples = run.load([raw, channel])
            volts = samples[raw] * times
            old: AnalogInput = getattr(rig.daq, entry)
            pieces.append((run.name, name, _anew(volts, samples[channel], old, record)))
    return pieces


def _anew(volts: Array, values: Array, old: AnalogInput, record: CalibrationRecord) -> Array:
    """New values (SI) from volts (V), with the zero that the old values (SI) had; shapes (n,)."""
    by_line = old.quantity(volts)
    moved = values - by_line
    size = np.abs(old.gain * volts) + abs(old.offset)
    fresh = record.gain * volts + record.offset
    zero_volts = old.volts(-moved)  # where the old channel was told to be zero
    result: Array = np.where(np.abs(moved) <= NO_REFERENCE * size, fresh, record.gain * (volts - zero_volts))
    return result
