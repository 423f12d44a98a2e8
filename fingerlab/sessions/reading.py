"""Opening a session, structure first, and checking its samples a piece at a time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import read_object
from fingerlab.core.progress import Progress
from fingerlab.core.text import same_unit
from fingerlab.rig.file import Rig, intervention_of
from fingerlab.sessions.hdf5 import MOST_RUNS, DatasetFacts, FileReader, attributes_of, datasets_of, open_hdf5
from fingerlab.sessions.model import (
    CABLES,
    CHANNEL_UNITS,
    FINGER_PHASES,
    FORMAT_MAJOR,
    FORMAT_NAME,
    LEAST_RATE,
    MOST_RATE,
    PHASES,
    RATE_TOLERANCE,
    REQUIRED_CHANNELS,
    REQUIRED_ROOT_ATTRIBUTES,
    REQUIRED_RUN_ATTRIBUTES,
    Array,
    Run,
    Session,
)

PIECE_SAMPLES = 1 << 17
"""Samples looked at together: nine channels of them are 9 MB in double precision."""

TORQUE_TOLERANCE = 0.02
"""Relative difference between motor_torque and kt * N * motor_current that is worth a word.

The tolerance of a rig constant that the file says nothing about (session format, version 1).
"""

Level = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing that the check found; ``run`` is None where it is about the whole file."""

    level: Level
    run: str | None
    text: str


@dataclass(frozen=True)
class RunCheck:
    """What was counted in one run: gaps in time, samples lost in them, samples of force not read."""

    run: str
    gaps: int
    lost_samples: int
    force_not_read: int


@dataclass(frozen=True)
class CheckReport:
    """Everything that :func:`check_session` found."""

    findings: tuple[Finding, ...]
    runs: tuple[RunCheck, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that break the format."""
        return tuple(finding for finding in self.findings if finding.level == "error")

    def raise_first(self) -> None:
        """Raise the first error as the sentence that the user is to read, or do nothing.

        Raises:
            UserError: the session breaks the format.
        """
        if self.errors:
            raise UserError(self.errors[0].text)


@dataclass
class _Tally:
    """Running sums over the pieces of one run."""

    steps: int = 0
    regular: int = 0
    gaps: int = 0
    lost: int = 0
    step_sum: float = 0.0
    force_nan: int = 0
    current_current: float = 0.0
    torque_current: float = 0.0

    def add(self, piece: dict[str, Array], rate: float, first: int) -> None:
        """Count one piece; its first ``first`` samples (0 or 1) were counted with the one before."""
        steps = np.diff(piece["time"]) * rate
        irregular = np.abs(steps - 1.0) > RATE_TOLERANCE
        late = steps > 1.0 + RATE_TOLERANCE
        self.steps += steps.size
        self.regular += int(steps.size - irregular.sum())
        self.gaps += int(late.sum())
        self.lost += int(np.rint(steps[late] - 1.0).sum())
        self.step_sum += float(steps.sum())
        if "endpoint_force" in piece:
            self.force_nan += int(np.isnan(piece["endpoint_force"][first:]).sum())
        if "motor_current" in piece:
            current, torque = piece["motor_current"][first:], piece["motor_torque"][first:]
            # Not "@": a threaded BLAS waits for busy cores longer than these sums take.
            self.current_current += float(np.einsum("i,i", current, current))
            self.torque_current += float(np.einsum("i,i", current, torque))


def check_session(session: Session, progress: Progress | None = None) -> CheckReport:
    """Read a session's samples once, in pieces, and judge them against the session format.

    Structure has been checked by ``open_session``; this adds time that runs backwards, NaN, a sampling
    rate that the time channel does not keep, gaps, and what the file says of itself.

    Args:
        progress: called with the share done (0 to 1) and what is being read.

    Returns:
        Findings in the order of the runs; errors are those that break the format.

    Raises:
        UserError: the file can no longer be opened at all.
    """
    findings: list[Finding] = []
    runs: list[RunCheck] = []
    for number, run in enumerate(session.runs):
        if progress:
            progress(number / len(session.runs), f"run {run.name}")
        tally = _Tally()
        try:
            for piece, first in _pieces(run):
                tally.add(piece, run.sample_rate_hz, first)
        except UserError as error:
            findings.append(Finding("error", run.name, str(error)))
            runs.append(RunCheck(run.name, tally.gaps, tally.lost, tally.force_nan))
            continue
        findings += _judge(session, run, tally)
        runs.append(RunCheck(run.name, tally.gaps, tally.lost, tally.force_nan))
    return CheckReport(tuple(findings), tuple(runs))


def _pieces(run: Run) -> Iterator[tuple[dict[str, Array], int]]:
    """Pieces of the run's contract channels; each begins with the last sample of the one before."""
    names = [name for name in CHANNEL_UNITS if run.has(name)]
    start = 0
    while start < run.length:
        first = 1 if start else 0
        stop = min(start + PIECE_SAMPLES, run.length)
        yield run.load(names, start - first, stop), first
        start = stop


def _judge(session: Session, run: Run, tally: _Tally) -> list[Finding]:
    where = f"{session.path}: run {run.name}"
    found: list[Finding] = []
    if tally.steps and tally.regular < tally.steps / 2:
        rate = run.sample_rate_hz * tally.steps / tally.step_sum
        text = (
            f"{where} says {run.sample_rate_hz:g} samples a second, but its time channel holds {rate:.4g} "
            "a second; correct sample_rate_hz or time."
        )
        return [Finding("error", run.name, text)]
    if tally.gaps:
        found.append(Finding("warning", run.name, _gap_words(tally)))
    if run.length < 2:
        found.append(Finding("warning", run.name, "only one sample; nothing can be fitted to it."))
    if tally.force_nan:
        found.append(Finding("note", run.name, f"the load cell was not read in {tally.force_nan} samples."))
    if run.phase == "contact" and (tally.force_nan == run.length or not run.has("endpoint_force")):
        found.append(
            Finding(
                "warning", run.name, "a contact run without the fingertip's force; prediction has no measure."
            )
        )
    found += _judge_torque(session.rig, run, tally)
    found += _judge_attributes(run)
    return found


def _gap_words(tally: _Tally) -> str:
    """What is wrong with the times of a run: samples that are missing, or that come early and late."""
    if 2 * round(tally.step_sum - tally.steps) < tally.lost:
        uneven = tally.steps - tally.regular
        return (
            f"uneven sampling, {uneven} of {tally.steps} steps of time are off by more than half of the "
            "usual one; a diagnosis takes the samples at their times."
        )
    return (
        f"{tally.gaps} gap{'s' * (tally.gaps != 1)} in time, {tally.lost} "
        f"sample{'s' * (tally.lost != 1)} lost."
    )


def _judge_torque(rig: Rig, run: Run, tally: _Tally) -> list[Finding]:
    """motor_torque is kt * N * motor_current by definition; a slope that differs is a wrong constant."""
    if tally.current_current == 0.0:
        return []
    slope = tally.torque_current / tally.current_current
    wanted = rig.ampere
    if not wanted or abs(slope / wanted - 1.0) <= TORQUE_TOLERANCE:
        return []
    text = (
        f"the motor's torque is {slope:.4g} N m/A times its current, but the rig's torque constant and gear "
        f"ratio make it {wanted:.4g} N m/A."
    )
    return [Finding("warning", run.name, text)]


def _judge_attributes(run: Run) -> list[Finding]:
    found: list[Finding] = []
    for key, words in (
        ("dropped_samples", "samples were dropped"),
        ("late_cycles", "control cycles came late"),
    ):
        if run.counted(key):
            found.append(Finding("warning", run.name, f"{run.counted(key):g} {words} while recording."))
    try:
        change = intervention_of(run.attributes, run.name)
    except UserError as error:
        found.append(Finding("warning", run.name, str(error)))
    else:
        if change is not None and change.to_json():
            found.append(Finding("note", run.name, f"taken {change.words()}."))
    if not run.complete:
        found.append(Finding("warning", run.name, "recording stopped before the trajectory was complete."))
    return found


MOST_SAMPLES_A_BYTE, FREE_SAMPLES = 8, 1 << 24
"""Real recordings, packed as tightly as HDF5 can, have up to one; small sessions are not asked."""


def open_session(path: str | Path) -> Session:
    """Open a session without reading its samples, so that ten hours cost no more than ten seconds.

    Structure is checked here: format and version, attributes, channels, their units and lengths.
    The file is closed again on return; channels open it anew when they are asked for. A recording that was
    cut is repaired first; its attribute ``ended`` says how it ended.

    Raises:
        UserError: the file is missing, damaged, or breaks the session format; the sentence says where.
    """
    path = _whole(Path(path))
    with open_hdf5(path) as file:
        root = attributes_of(file)
        _check_root(root, file, path)
        rig = Rig.from_json(root["rig"], f"{path}, attribute 'rig'")
        names = sorted(file["runs"], key=_order)
        if len(names) > MOST_RUNS:
            raise UserError(f"{path} holds {len(names)} runs; a session has at most {MOST_RUNS}.")
        runs = tuple(_read_run(file["runs"][name], name, path) for name in names)
    if not runs:
        raise UserError(f"{path} holds no runs; a session has at least one group such as /runs/001.")
    for run in runs:
        if run.phase in FINGER_PHASES and rig.finger is None:
            raise UserError(
                f"{path}: run {run.name} is '{run.phase}' but the rig text has no 'finger'; "
                "it should hold the finger's masses, lengths, inertias and stiffnesses."
            )
    samples = sum(run.length * len(run.units) for run in runs)
    if samples > max(FREE_SAMPLES, MOST_SAMPLES_A_BYTE * path.stat().st_size):
        raise UserError(f"{path} is too small for the {samples} samples that it says it holds; record again.")
    title, created = str(root.pop("title")), str(root.pop("created"))
    return Session(path, title, created, rig, runs, root)


def _whole(path: Path) -> Path:
    from fingerlab.sessions.repair import repaired  # it writes sessions, which needs what is above

    return repaired(path)


def _order(name: str) -> tuple[int, str]:
    """Runs in the order taken: by number, so that 1000 comes after 999."""
    return (int(name) if name.isdecimal() else 10**9, name)


def _check_root(root: Mapping[str, Any], file: h5py.File, path: Path) -> None:
    if root.get("format") != FORMAT_NAME:
        raise UserError(
            f"{path} is HDF5 but not a session; its attribute 'format' should be \"{FORMAT_NAME}\"."
        )
    version = str(root.get("format_version", ""))
    major = version.split(".")[0]
    if not major.isdecimal():
        raise UserError(f'{path} has format_version {version!r}; it should be a number such as "1".')
    if int(major) > FORMAT_MAJOR:
        raise UserError(
            f"{path} is of the newer format version {version}, and this program reads up to version "
            f"{FORMAT_MAJOR}; update FingerLab to read it."
        )
    for name in REQUIRED_ROOT_ATTRIBUTES:
        if name not in root:
            raise UserError(f"{path} lacks the attribute '{name}'; every session file has it at its root.")
    if not isinstance(file.get("runs"), h5py.Group):
        raise UserError(f"{path} has no group /runs; a session has at least one group such as /runs/001.")


def _read_run(group: h5py.Group, name: str, path: Path) -> Run:
    where = f"{path}: run {name}"
    if not isinstance(group, h5py.Group):
        raise UserError(f"{where} is not a group; it should be one, with a dataset for each channel.")
    attributes = attributes_of(group)
    for key in REQUIRED_RUN_ATTRIBUTES:
        if key not in attributes:
            raise UserError(f"{where} lacks the attribute '{key}'; every run has it.")
    phase = _one_of(attributes.pop("phase"), PHASES, f"{where} has the phase")
    cable = _one_of(attributes.pop("cable"), CABLES, f"{where} has the cable")
    rate = _rate(attributes.pop("sample_rate_hz"), where)
    text = attributes.pop("trajectory")
    advice = 'it should read like {"kind": "sine", "amplitude_deg": 15, "frequency_hz": 1}'
    trajectory = read_object(text, f"{where} has a trajectory that", advice)
    units, length = _channels(group, phase, where)
    return Run(name, phase, cable, rate, trajectory, length, units, FileReader(path, name), attributes)


def _one_of(value: Any, allowed: tuple[str, ...], where: str) -> str:
    if value not in allowed:
        raise UserError(f"{where} {value!r}; it should be one of {', '.join(allowed)}.")
    return str(value)


def _rate(value: Any, where: str) -> float:
    try:
        rate = float(value)
    except (TypeError, ValueError):
        rate = math.nan
    if not LEAST_RATE <= rate <= MOST_RATE:
        said = "a positive number" if not rate > 0 else f"{LEAST_RATE:g} to {MOST_RATE:g}"
        raise UserError(f"{where} has sample_rate_hz {value!r}; it should be {said}.")
    return rate


def _channels(group: h5py.Group, phase: str, where: str) -> tuple[dict[str, str], int]:
    """Units by channel name, the contract's channels first, and the run's length."""
    datasets = datasets_of(group)
    for name in REQUIRED_CHANNELS[phase]:
        if name not in datasets:
            raise UserError(
                f"{where} lacks the channel '{name}'; a run of phase '{phase}' has "
                f"{', '.join(REQUIRED_CHANNELS[phase])}."
            )
    length = _samples(datasets["time"], "time", where)
    units = {}
    for name, unit in CHANNEL_UNITS.items():
        if name not in datasets:
            continue
        samples = _samples(datasets[name], name, where)
        if samples != length:
            raise UserError(
                f"{where} has {samples} samples of '{name}' but {length} of time; "
                "all channels of a run should be of one length."
            )
        found = datasets[name].unit
        if found is None:
            raise UserError(f"{where}, channel '{name}' has no attribute 'units'; it should be '{unit}'.")
        if not same_unit(found, unit):
            raise UserError(
                f"{where}, channel '{name}' is in '{found}'; it should be in '{unit}' (convert it before)."
            )
        units[name] = unit
    if length == 0:
        raise UserError(f"{where} is empty (no samples); remove it or record it again.")
    return units | _extra_channels(group, datasets, length), length


def _samples(dataset: DatasetFacts, name: str, where: str) -> int:
    if len(dataset.shape) != 1 or not dataset.numeric:
        kind = "numbers" if dataset.numeric else "something else than numbers"
        raise UserError(
            f"{where}, channel '{name}' is of shape {dataset.shape} and holds {kind}; "
            "a channel should be one-dimensional and of numbers."
        )
    return dataset.shape[0]


def _extra_channels(group: h5py.Group, datasets: Mapping[str, DatasetFacts], length: int) -> dict[str, str]:
    """Channels that the contract does not name but that share the run's time axis, ``raw/...`` included."""
    extras = {key: facts for key, facts in datasets.items() if key not in CHANNEL_UNITS}
    raw = group.get("raw")
    if isinstance(raw, h5py.Group):
        extras |= {f"raw/{key}": facts for key, facts in datasets_of(raw).items()}
    return {
        key: facts.unit or ""
        for key, facts in extras.items()
        if facts.shape == (length,) and facts.numeric and key != "raw/time"
    }
