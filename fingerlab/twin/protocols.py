"""What a simulated session is ordered by: the preset of a bench, and the protocol of its runs.

A table of one's own is text. Its first row names the columns: ``phase``, ``cable``, ``runs`` (how often, 1),
``load_torque`` (N m, of a motor bench), and any key of a trajectory, such as ``kind``, ``amplitude_deg`` or
``file``. What is left empty has its usual value. A number may be a scan, with a run for each of its values,
one scan within the other where a row has several:

=====================  ====================================
``0.5 1 2``            these values
``0.5 to 3 in 6``      six values, equally far apart
``0.5 to 8 in 5 log``  five values, each by as many times more
=====================  ====================================
"""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import is_number, read_object
from fingerlab.rig.file import Rig, read_intervention
from fingerlab.sessions.model import CABLES
from fingerlab.twin.effects import check_effects

PRACTICE = "practice"
AS_BUILT = "as-built"

SECTIONS: dict[str, dict[str, int]] = {
    "arms": {"extension": 2, "flexion": 2, "spread": 1},
    "cable": {
        "stiffness": 1,
        "damping_time": 1,
        "slack": 1,
        "pretravel": 1,
        "scatter": 1,
        "sheath_stiffness": 1,
        "wrap": 2,
    },
    "joints": {"viscous": 2, "wander": 1},
    "motor": {"inertia": 1, "viscous": 1, "current_lag": 1},
    "contact": {
        "posture": 2,
        "posture_spread": 1,
        "stiffness": 1,
        "damping": 1,
        "friction": 1,
        "tip_stiffness": 1,
        "tip_damping": 1,
    },
    "control": {
        "proportional": 1,
        "integral": 1,
        "derivative": 1,
        "derivative_cutoff_hz": 1,
        "current_limit": 1,
        "counts": 1,
    },
    "sensors": {
        "angle_step_deg": 1,
        "angle_noise_deg": 1,
        "force_step": 1,
        "force_noise": 1,
        "current_step": 1,
        "current_noise": 1,
    },
    "protocol": {"contact_amplitude_deg": 1, "contact_force": 1},
}
"""Sections of a preset, their entries, and how many numbers each entry holds."""


@dataclass(frozen=True)
class Preset:
    """A simulated bench before its tolerances are drawn. Units as in ``practice.toml``.

    Attributes:
        rig: what the bench knows of itself.
        numbers: ``numbers[section][entry]`` is a float, or a tuple of two (MCP, PIP).
        effects: effects built into the bench: id -> parameter -> value, SI.
        known: what is no chance in this bench: true over nominal value by rig constant, the load cell's gain
            (``force_gain``), ``sign`` and ``phase`` of effects.
    """

    name: str
    title: str
    rig: Rig
    numbers: Mapping[str, Mapping[str, Any]]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    known: Mapping[str, float] = field(default_factory=dict)


def load_preset(source: str | Path = PRACTICE) -> Preset:
    """A preset by name (``practice``, ``as-built``) or from a TOML file.

    Raises:
        UserError: no such preset, not TOML, or a section or number missing, unknown or impossible.
    """
    if isinstance(source, str) and source in (PRACTICE, AS_BUILT):
        name = source
        text = (files("fingerlab.resources") / "rigs" / f"{source}.toml").read_text(encoding="utf-8")
    else:
        name = Path(source).stem
        text = read_text(Path(source), "a preset: 'practice', 'as-built' or a TOML file")
    return parse_preset(text, name)


def parse_preset(text: str, name: str) -> Preset:
    """A preset from TOML text.

    Raises:
        UserError: as for ``load_preset``.
    """
    data = read_object(text, f"The preset {name}", "see that of the practice rig for an example", toml=True)
    unknown = set(data) - set(SECTIONS) - {"title", "rig", "effects"}
    if unknown:
        raise UserError(
            f"The preset {name} has the unknown section {sorted(unknown)[0]!r}; "
            f"known are {', '.join(SECTIONS)}."
        )
    numbers = {section: _section(data.get(section, {}), section, name) for section in SECTIONS}
    rig = Rig.from_json(json.dumps(data.get("rig", {})), f"The preset {name}, 'rig'")
    if rig.finger is None or rig.motor.pulley_radius is None:
        raise UserError(f"The preset {name} needs 'rig.finger' and 'rig.motor.pulley_radius'.")
    effects = check_effects(data.get("effects", {}), f"The preset {name}")
    return Preset(name, str(data.get("title", name)), rig, numbers, effects)


def _section(data: Any, section: str, name: str) -> dict[str, Any]:
    expected = SECTIONS[section]
    if not isinstance(data, dict):
        raise UserError(f"The preset {name}, '{section}' is not a table.")
    for key in data:
        if key not in expected:
            raise UserError(f"The preset {name}, '{section}' has the unknown entry {key!r}.")
    result: dict[str, Any] = {}
    for key, count in expected.items():
        value = data.get(key)
        values: list[Any] = value if isinstance(value, list) else [value]
        if len(values) != count or not all(is_number(v) for v in values):
            raise UserError(
                f"The preset {name}, '{section}.{key}' is {value!r}; it should hold {count} finite number(s)."
            )
        result[key] = tuple(map(float, values)) if count > 1 else float(values[0])
    return result


RATE_HZ = 1000.0
"""Control loop and recording, thesis section 3.2."""

THESIS_RUNS = 10
THESIS_SECONDS = 30.0


@dataclass(frozen=True)
class RunPlan:
    """One run to take.

    Attributes:
        phase, cable: as in the session format.
        trajectory: JSON object; in contact its ``offset_deg`` is found by the operator's approach
            where it is absent.
        load_torque: N m, constant known load in place of the finger (motor bench).
    """

    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    load_torque: float = 0.0
    attributes: Mapping[str, Any] = field(default_factory=dict)


def _wave(kind: str, amplitude: float, frequency: float, offset: float | None, **more: Any) -> dict[str, Any]:
    wave = {"kind": kind, "amplitude_deg": amplitude, "frequency_hz": frequency, **more}
    if offset is not None:
        wave["offset_deg"] = offset
    return wave


def _thesis(contact_amplitude: float) -> list[RunPlan]:
    """Ten on-air runs with the extension cable, ten contact runs with the flexion cable, 30 s each."""
    free = _wave("sine", 15.0, 1.0, 22.0, duration_s=THESIS_SECONDS)
    press = _wave("sine", contact_amplitude, 1.0, None, duration_s=THESIS_SECONDS)
    return [RunPlan("on_air", "extension", free)] * THESIS_RUNS + [
        RunPlan("contact", "flexion", press)
    ] * THESIS_RUNS


def _on_air(contact_amplitude: float) -> list[RunPlan]:
    """Eight runs with the extension cable, two with the flexion cable, 20 s each."""
    extension = (
        _wave("sine", 15.0, 1.0, 22.0),
        _wave("sine", 11.0, 0.4, 22.0),
        _wave("sine", 11.0, 1.9, 22.0),
        _wave("chirp", 11.0, 0.5, 22.0, end_frequency_hz=3.0),
        _wave("chirp", 14.0, 0.4, 22.0, end_frequency_hz=2.2),
        _wave("multisine", 17.0, 1.0, 23.0),
        _wave("multisine", 14.0, 1.0, 25.0, frequencies_hz=[0.4, 0.9, 1.5, 2.3]),
        _wave("steps", 14.0, 0.5, 22.0, seed=1),
    )
    flexion = (_wave("sine", 9.0, 1.0, 15.0), _wave("chirp", 8.0, 0.5, 15.0, end_frequency_hz=3.0))
    return [RunPlan("on_air", "extension", w) for w in extension] + [
        RunPlan("on_air", "flexion", w) for w in flexion
    ]


def _contact(contact_amplitude: float) -> list[RunPlan]:
    """Four contact runs with the flexion cable, 20 s each."""
    return [RunPlan("contact", "flexion", _wave("sine", contact_amplitude, 1.0, None))] * 4


def _rich(contact_amplitude: float) -> list[RunPlan]:
    """Ten runs on air with either cable and four in contact, 20 s each."""
    return _on_air(contact_amplitude) + _contact(contact_amplitude)


def _motor_bench(contact_amplitude: float) -> list[RunPlan]:
    """The motor alone and against two constant loads, 20 s each."""
    waves = (
        _wave("sine", 60.0, 0.5, 70.0),
        _wave("ramp_hold", 70.0, 0.2, 80.0),
        _wave("chirp", 25.0, 0.3, 40.0, end_frequency_hz=4.0),
    )
    return [RunPlan("motor_bench", "none", wave, load) for load in (0.0, 0.04, 0.09) for wave in waves]


PROTOCOLS: dict[str, Callable[[float], list[RunPlan]]] = {
    "on-air": _on_air,
    "contact": _contact,
    "motor-bench": _motor_bench,
    "thesis": _thesis,
    "rich": _rich,
}
"""Protocols of ``simulate``: name -> plan, given the contact amplitude in degrees at the pulley."""

CABLE_OF_PHASE = {"on_air": "extension", "contact": "flexion", "motor_bench": "none", "free": "extension"}


def setup_of(phase: str, cable: str | None = None) -> tuple[str, str]:
    """Phase and cable of a set-up; the phase's usual cable where none is given.

    Raises:
        UserError: the phase or cable is unknown, or they do not go together.
    """
    if phase not in CABLE_OF_PHASE:
        raise UserError(f"The phase is {phase!r}; it should be one of {', '.join(CABLE_OF_PHASE)}.")
    cable = cable or CABLE_OF_PHASE[phase]
    if cable not in CABLES:
        raise UserError(f"The cable is {cable!r}; it should be one of {', '.join(CABLES)}.")
    if (cable == "none") != (phase == "motor_bench"):
        if cable != "none":
            raise UserError(
                f"The motor alone moves no cable, and the {cable} cable was given; leave the cable out."
            )
        raise UserError("The finger moves by a cable, and none was given; leave it out, or say which.")
    if phase == "contact" and cable != "flexion":
        raise UserError(
            "A contact run presses with the flexion cable; leave the cable out or give 'flexion'."
        )
    return phase, cable


def single_run(
    trajectory: str | Mapping[str, Any],
    phase: str,
    cable: str | None = None,
    intervention: Mapping[str, Any] | None = None,
) -> RunPlan:
    """One proposed run, as in ``next_experiment`` of a diagnosis.

    Args:
        trajectory: JSON text or object; for a motor bench maybe with ``load_torque``, N m.
        intervention: a known change of the machine, as in ``rig.file.Intervention``.

    Raises:
        UserError: the phase or cable is unknown, or they do not go together, or the trajectory or the change
            is bad.
    """
    phase, cable = setup_of(phase, cable)
    change = read_intervention(intervention or {}, "The proposed 'intervention'")
    if change.to_json() and cable == "none":
        raise UserError("A known change is one of the finger's bench; leave it out for the motor alone.")
    settings = dict(read_trajectory(trajectory).settings)
    amplitude = settings.get("amplitude_deg", 1.0)
    if settings["kind"] not in ("blocked", "file", "torque") and not amplitude > 0:
        raise UserError(
            f"The trajectory has 'amplitude_deg' = {amplitude:g}; it should be greater than zero."
        )
    load = settings.get("load_torque", 0.0)
    if not is_number(load):
        raise UserError(f"The trajectory has 'load_torque' = {load!r}; it should be a torque in N m.")
    if load and phase != "motor_bench":
        raise UserError(
            "The trajectory has a known load ('load_torque'), which hangs on the motor alone; leave it out, "
            "or give the phase 'motor_bench'."
        )
    if settings["kind"] in ("file", "torque"):  # the points stay with the plan, however many they are
        settings = dict(json.loads(trajectory) if isinstance(trajectory, str) else trajectory)
    settings.pop("load_torque", None)
    return RunPlan(phase, cable, settings, float(load), change.attributes())


WORDS = ("phase", "cable", "kind", "file")
"""Columns that hold words."""
COUNTS = ("runs", "seed")
"""Columns that hold whole numbers."""
NUMBERS = (
    *("amplitude_deg", "frequency_hz", "offset_deg", "end_frequency_hz", "phase_deg", "rise_s", "duration_s"),
    *("ramp_s", "load_torque"),
)
KNOWN = (*WORDS, *COUNTS, *NUMBERS)
MOST_RUNS = 1000
"""Of one table (assumed: at 5 s each more than an hour)."""
EXAMPLE = "phase,kind,amplitude_deg,frequency_hz,offset_deg,duration_s,runs"


def read_run_table(path: Path) -> list[RunPlan]:
    """The runs of a table in their order.

    Raises:
        UserError: the file cannot be read, names no columns, or a row is no run.
    """
    text = read_text(path, "a text table of runs").lstrip("\ufeff")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise UserError(
            f"{path} has no rows; it should have a row of names such as {EXAMPLE}, and runs below."
        )
    mark = next((mark for mark in ("\t", ";", ",") if mark in lines[0]), ",")
    names, *rows = csv.reader(io.StringIO("\n".join(lines)), delimiter=mark)
    names = [name.strip() for name in names]
    strange = next((name for name in names if name not in KNOWN), None)
    if strange is not None:
        raise UserError(f"{path} has the column {strange!r}; it may have {', '.join(KNOWN)}.")
    if "kind" not in names or len(set(names)) < len(names):
        raise UserError(f"{path} has the columns {', '.join(names)}; it should have each once, and 'kind'.")
    plans: list[RunPlan] = []
    for number, row in enumerate(rows, start=1):
        plans += _runs(dict(zip(names, row, strict=False)), f"{path}, row {number}", path.parent)
        if len(plans) > MOST_RUNS:
            raise UserError(f"{path} holds more than {MOST_RUNS} runs; make fewer of them, or shorter scans.")
    return plans


def _runs(cells: dict[str, str], where: str, folder: Path) -> list[RunPlan]:
    entries = {name: text.strip() for name, text in cells.items() if text.strip()}
    phase, cable, often = entries.pop("phase", "on_air"), entries.pop("cable", None), entries.pop("runs", "1")
    if not often.isdecimal() or not 1 <= int(often) <= MOST_RUNS:
        raise UserError(f"{where} has 'runs' = {often!r}; it should be a whole number from 1.")
    words = {name: text for name, text in entries.items() if name in WORDS}
    if "file" in words:  # beside the table, unless it says where
        words["file"] = str(folder / words["file"])
    scans = {
        name: scan_values(text, f"{where}, {name}") for name, text in entries.items() if name not in WORDS
    }
    plans = []
    for values in itertools.product(*scans.values()):
        numbers = dict(zip(scans, values, strict=True))
        settings: dict[str, Any] = {
            **words,
            **{name: round(value) if name in COUNTS else value for name, value in numbers.items()},
        }
        try:
            plans += [single_run(settings, phase, cable)] * int(often)
        except UserError as error:
            raise UserError(f"{where}: {error}") from None
    return plans


def scan_values(text: str, where: str) -> list[float]:
    """The values of a cell: one, several, or a scan.

    Raises:
        UserError: it holds none.
    """
    parts = text.lower().split()
    log = parts[-1] == "log"
    parts = parts[:-1] if log else parts
    try:
        if len(parts) == 5 and (parts[1], parts[3]) == ("to", "in"):
            first, last, count = float(parts[0]), float(parts[2]), int(parts[4])
            usable = 2 <= count <= MOST_RUNS and math.isfinite(first + last) and (not log or first * last > 0)
            if usable:
                made = np.geomspace(first, last, count) if log else np.linspace(first, last, count)
                return [float(f"{value:.6g}") for value in made]
        elif not log and parts:
            values = [float(part) for part in parts]
            if all(map(math.isfinite, values)):
                return values
    except ValueError:
        pass
    raise UserError(
        f"{where} is {text!r}; it should be a number, several such as '0.5 1 2', or a scan such as "
        "'0.5 to 3 in 6' (with 'log' behind it: each by as many times more)."
    )
