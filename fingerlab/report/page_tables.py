"""Rows of the page's tables: what the template prints, as text with units and no digit too many."""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import fingerlab
from fingerlab.core.plain_data import parsed
from fingerlab.core.text import (
    DEGREES,
    ScreenUnit,
    decimals_for,
    estimate_text,
    fixed,
    largest_of,
    listed,
    number,
    percent,
    printed,
    r2_text,
    score_text,
    screen_unit,
    with_minus,
)
from fingerlab.diagnosis.answer.error_parts import EquationError
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis
from fingerlab.models.file import ParameterEstimate
from fingerlab.report.diagnosis_words import (
    FAMILY_TITLES,
    NOTHING_WORDS,
    PHASE_WORDS,
    UNKNOWN_WORDS,
    shown_best_first,
)
from fingerlab.report.line_units import LineUnits
from fingerlab.report.parameter_words import is_told, parameter_title, parameter_titles
from fingerlab.rig.file import changed_words, sources_of
from fingerlab.sessions import content_hash
from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.trajectory import motion_of_run

if TYPE_CHECKING:
    from fingerlab.prediction.comparing import ComparedModel, ModelComparison
    from fingerlab.prediction.predict import RunPrediction

SHOWN_OUTCOMES = 6
"""Candidates in the short ranking; the whole catalogue stands at the end of the page."""
HIGHEST_BAR = 20.0
"""Error over floor at which a bar is full; the number beside it says the rest."""


@dataclass(frozen=True)
class ErrorRow:
    """Error of a family of equations on runs left out of the fit; ``bar`` is 0 to 1."""

    title: str
    error: str
    floor: str
    unit: str
    times: str
    r2: str
    bar: float


def error_texts(error: EquationError) -> tuple[str, str, str]:
    """Error, floor and unit, with the digits that the floor calls for."""
    unit = screen_unit(error.unit, max(error.rmse, error.floor))
    return *_error_in(unit, error), unit.symbol


def _error_in(unit: ScreenUnit, error: EquationError) -> tuple[str, str]:
    """Error and floor in a unit of the screen."""
    floor = error.floor * unit.factor
    decimals = decimals_for(floor / 3.0) if floor > 0 else 3
    return fixed(error.rmse * unit.factor, decimals), fixed(floor, decimals)


def error_rows(errors: Mapping[str, EquationError]) -> list[ErrorRow]:
    """One row a family of equations."""
    rows = []
    for name, error in errors.items():
        times = error.rmse / error.floor if error.floor > 0 else math.nan
        shown, floor, unit = error_texts(error)
        title = FAMILY_TITLES.get(name, name.replace("_", " "))
        bar = min(times / HIGHEST_BAR, 1.0) if math.isfinite(times) else 0.0
        rows.append(ErrorRow(title, shown, floor, unit, score_text(times), r2_text(error.r2), bar))
    return rows


def errors_beside_each_other(
    models: Mapping[str, Mapping[str, EquationError]],
) -> tuple[list[str], dict[str, list[str]]]:
    """Headings with their unit, one a family of equations, and by model the errors (rms) in those units.

    A column has one unit, that of its largest value: its numbers are there to be held against each other.

    Args:
        models: errors by family of equations, by the name of the model.
    """
    families = list(dict.fromkeys(family for errors in models.values() for family in errors))
    headings: list[str] = []
    rows: dict[str, list[str]] = {name: [] for name in models}
    for family in families:
        found = [errors[family] for errors in models.values() if family in errors]
        unit = screen_unit(found[0].unit, largest_of(v for one in found for v in (one.rmse, one.floor)))
        headings.append(unit.label(FAMILY_TITLES.get(family, family.replace("_", " "))))
        for name, errors in models.items():
            error = errors.get(family)
            rows[name].append("–" if error is None else _error_in(unit, error)[0])
    return headings, rows


@dataclass(frozen=True)
class RankedOutcome:
    """A candidate, or one of the two outcomes that are no effect. ``share`` is its probability, 0 to 1."""

    title: str
    effect: str
    share: float
    chance: str
    score: str
    in_set: bool
    detectable: bool
    explanation: str


def all_effects(diagnosis: Diagnosis) -> list[RankedOutcome]:
    """Every effect tried, best first."""
    return [outcome_of(candidate) for candidate in shown_best_first(diagnosis)]


def short_ranking(diagnosis: Diagnosis) -> list[RankedOutcome]:
    """What is probable, with both outcomes that are no effect, most probable first."""
    best = all_effects(diagnosis)
    chosen = [row for row in best if row.in_set or row.share >= 0.005]
    chosen += [row for row in best if row not in chosen][: max(SHOWN_OUTCOMES - len(chosen), 0)]
    nothing = f"{NOTHING_WORDS}{' any more' if diagnosis.model else ''}"
    for title, share in (
        (nothing, diagnosis.probability_nothing),
        (UNKNOWN_WORDS, diagnosis.probability_unknown),
    ):
        chosen.append(RankedOutcome(title, "", share, percent(share), "", False, True, ""))
    return sorted(chosen, key=lambda row: -row.share)


def outcome_of(candidate: Candidate) -> RankedOutcome:
    return RankedOutcome(
        candidate.title,
        candidate.effect,
        candidate.probability,
        percent(candidate.probability),
        score_text(candidate.score),
        candidate.in_set,
        candidate.detectable,
        printed(candidate.explanation),
    )


def parameter_rows(candidate: Candidate, radius: float = 0.0) -> list[tuple[str, str]]:
    """Title and value with interval of each parameter of an effect.

    Args:
        radius: of the arc as which a linear axis is told, m; 0: it turns.
    """
    line, titles = LineUnits(radius), parameter_titles(candidate.effect, list(candidate.parameters))
    return [
        (line.title(titles[name]), estimate_text(line.estimate(value)))
        for name, value in candidate.parameters.items()
    ]


_MODEL_ROWS = (
    "arm_mcp", "arm_pip", "loss_mcp", "loss_pip", "bench_inertia", "bench_gain", "bench_offset",
)  # fmt: skip


def model_rows(parameters: Mapping[str, ParameterEstimate], radius: float = 0.0) -> list[tuple[str, str]]:
    """What the fit found out about the bench itself: moment arms and losses, or the motor bench's constants.

    Left out are nuisances that only let a constant move within its tolerance, and what no run can show.

    Args:
        radius: of the arc as which a linear axis is told, m; 0: it turns.
    """
    rows, line = [], LineUnits(radius)
    for key in _MODEL_ROWS:
        for name, estimate in parameters.items():
            if name.partition("@")[0] == key and is_told(name, estimate):
                title = line.title(parameter_title(name, ()))
                rows.append((title, estimate_text(line.estimate(estimate))))
    return rows


@dataclass(frozen=True)
class RunRow:
    """Consecutive runs that were taken alike."""

    runs: str
    count: int
    phase: str
    cable: str
    trajectory: str
    seconds: str
    rate: str


def run_rows(session: Session) -> list[RunRow]:
    """The session's runs, those that follow each other and are alike in one row."""
    blocks: list[list[Run]] = []
    for run in session.runs:
        if blocks and _alike(blocks[-1][-1], run):
            blocks[-1].append(run)
        else:
            blocks.append([run])
    return [_run_row(block, session.rig.line_radius) for block in blocks]


def _alike(one: Run, other: Run) -> bool:
    mine, theirs = (
        (run.phase, run.cable, run.sample_rate_hz, dict(run.trajectory), changed_words(run.attributes))
        for run in (one, other)
    )
    return mine == theirs and abs(one.seconds - other.seconds) < 0.05 * max(one.seconds, 1.0)


def _run_row(block: Sequence[Run], radius: float) -> RunRow:
    first, last = block[0], block[-1]
    names = first.name if len(block) == 1 else f"{first.name} to {last.name}"
    seconds = f"{len(block)} × {first.seconds:.1f}" if len(block) > 1 else f"{first.seconds:.1f}"
    cable = "–" if first.cable == "none" else first.cable
    phase = PHASE_WORDS.get(first.phase, first.phase)
    words = motion_of_run(first, radius)
    return RunRow(names, len(block), phase, cable, words, seconds, f"{first.sample_rate_hz:g}")


@dataclass(frozen=True)
class RigRow:
    """A constant of the bench with its tolerance and where it comes from."""

    name: str
    value: str
    tolerance: str
    source: str


def rig_rows(session: Session) -> list[RigRow]:
    """The bench's constants; one that the file does not give is marked as a default."""
    rig, rows = session.rig, []
    sources, given = sources_of(rig), _given(session)
    for one in LineUnits(rig.line_radius).constants(rig):
        unit = screen_unit(one.unit, abs(one.value))
        shown = unit.after(f"{one.value * unit.factor:.4g}".replace("-", "−"))
        name = "rotor, gearbox and pulley inertia" if one.name == "inertia" else one.name
        name = {"mcp": "MCP", "pip": "PIP"}.get(name[:3], name[:3].capitalize()) + name[3:]
        origin = "the session file" if one.key in given.get(one.part, {}) else "not in the file: default"
        rows.append(RigRow(name, shown, rig.tolerance_words(one.key), sources.get(one.key, origin)))
    return rows


def _given(session: Session) -> dict[str, dict[str, float]]:
    """The constants that the file itself holds, by part of the rig."""
    try:
        stored = json.loads(str(session.attributes.get("rig", session.rig.to_json())))
    except ValueError:
        return {}
    return {part: stored.get(part) or {} for part in ("finger", "motor")}


@dataclass(frozen=True)
class FileRow:
    """A session file, so that a reader can tell that it is the same one."""

    name: str
    title: str
    created: str
    sha256: str


def file_rows(sessions: Sequence[Session]) -> list[FileRow]:
    """Name, title, date and content hash of each file; a folder would mean nothing elsewhere."""
    return [
        FileRow(
            session.path.name,
            session.title,
            session.created,
            content_hash(session) if session.path.is_file() else "not kept in a file",
        )
        for session in sessions
    ]


def _plain_text(value: object) -> str:
    """An attribute as a person reads it; lists of words are kept as JSON in the file."""
    if not isinstance(value, str):
        return ""
    try:
        entry = parsed(value)
    except ValueError:
        return value.strip()
    return ", ".join(map(str, entry)) if isinstance(entry, list) else value.strip()


def facts(session: Session) -> list[tuple[str, str]]:
    """What the file tells of itself in words: who, when, with what."""
    rows = [("File", session.path.name), ("Recorded", session.created)]
    for key in ("operator", "notes", "software", "tags"):
        text = _plain_text(session.attributes.get(key))
        if text:
            rows.append((key.capitalize(), text))
    phases: dict[str, int] = {}
    for run in session.runs:
        phases[run.phase] = phases.get(run.phase, 0) + 1
    counted = ", ".join(f"{count} {PHASE_WORDS.get(phase, phase)}" for phase, count in phases.items())
    total = sum(run.seconds for run in session.runs)
    rows.append(("Runs", f"{len(session.runs)}: {counted}; {total:.0f} s in all"))
    return rows


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
        held = parsed(str(session.attributes.get("calibration", "{}")))
        return [_calibration_row(name, record) for name, record in held.items()]
    except (ValueError, AttributeError, TypeError, KeyError):
        return []


def _calibration_row(name: str, record: Mapping[str, Any]) -> CalibrationRow:
    from fingerlab.calibration.sensors import SENSORS  # its package loads scipy, which tables do without

    sensor = SENSORS.get(name)
    unit = str(record.get("unit", ""))
    factor, shown = (DEGREES, "°") if unit == "rad" else (1.0, f" {unit}")
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


COMPARED_COLUMNS = (
    ("Model", "File it was saved in."),
    ("Effects", "That it adds to the nominal model."),
    ("Error / floor", "Over all equations, on runs that its values have not seen."),
    ("Force error (mN)", "Root mean square, of the endpoint force in contact."),
    ("R2", "Of that force."),
    ("R2 normalised", "The same with both forces scaled to their span."),
    ("Amplitude (%)", "Of the modelled force, over that of the measured one."),
    ("In interval (%)", "Share of samples that the 90 % interval holds."),
)
"""What models are compared by, and what it means."""


def compared_rows(result: ModelComparison) -> list[tuple[str, ...]]:
    """Cells of :data:`COMPARED_COLUMNS` for every model, the nominal one first."""
    return [
        (one.name, ", ".join(one.effects) or "–", score_text(one.score), *_force_cells(one))
        for one in result.models
    ]


def judged_as_they_stand(result: ModelComparison) -> str:
    """Which models were fitted on other sessions, in a sentence; empty: none."""
    names = ", ".join(one.name for one in result.models if not one.left_out)
    return f"Fitted on other sessions, so judged as it stands: {names}." if names else ""


def worse_force_sentence(
    nominal: Sequence[RunPrediction], others: Mapping[str, Sequence[RunPrediction]]
) -> str:
    """Which models miss the endpoint force by more than the nominal one, by how much; empty: none does.

    Args:
        nominal: contact runs by the nominal model. others: by further models, by their names.
    """
    before, after = _force_error(nominal), {name: _force_error(runs) for name, runs in others.items()}
    worse = [f"{name} by {number(error, 1)} mN" for name, error in after.items() if error > before]
    if not worse:
        return ""
    known = f"The nominal model misses the endpoint force by {number(before, 1)} mN"
    return f"{known}, others by more: {listed(worse)}."


def force_got_worse(result: ModelComparison) -> str:
    """The same of models that were compared; empty where none of them is the nominal one."""
    plain = next((one.forces for one in result.models if not one.effects), ())
    return worse_force_sentence(plain, {one.name: one.forces for one in result.models if one.effects})


def _force_error(runs: Sequence[RunPrediction]) -> float:
    """Mean over contact runs of the force's error (rms), mN, as it is told; NaN: there are none."""
    from fingerlab.prediction.predict import spread_over  # loads scipy

    return round(1e3 * spread_over(runs, "both", "rmse").mean, 1) if runs else math.nan


def _force_cells(model: ComparedModel) -> tuple[str, ...]:
    if not model.forces:
        return ("–",) * 5
    from fingerlab.prediction.predict import interval_over, spread_over  # loads scipy

    coverage = interval_over(model.forces)[1]
    return (
        number(_force_error(model.forces), 1),
        number(spread_over(model.forces, "both", "r2").mean, 4),
        number(spread_over(model.forces, "both", "normalised_r2").mean, 4),
        number(100 * spread_over(model.forces, "both", "share").mean, 1),
        number(100 * coverage, 1) if math.isfinite(coverage) else "–",
    )
