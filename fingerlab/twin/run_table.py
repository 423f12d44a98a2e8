"""A protocol of one's own: a text table with a row for each kind of run, which any editor makes.

The first row names the columns: ``phase``, ``cable``, ``runs`` (how often, 1), ``load_torque`` (N m, of a
motor bench), and any key of a trajectory, such as ``kind``, ``amplitude_deg`` or ``file``. What is left empty
has its usual value. A number may be a scan, with a run for each of its values, one scan within the other
where a row has several:

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
import math
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.twin.protocols import RunPlan, single_run

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
    told = {name: text.strip() for name, text in cells.items() if text.strip()}
    phase, cable, often = told.pop("phase", "on_air"), told.pop("cable", None), told.pop("runs", "1")
    if not often.isdecimal() or not 1 <= int(often) <= MOST_RUNS:
        raise UserError(f"{where} has 'runs' = {often!r}; it should be a whole number from 1.")
    words = {name: text for name, text in told.items() if name in WORDS}
    if "file" in words:  # beside the table, unless it says where
        words["file"] = str(folder / words["file"])
    scans = {name: scan_values(text, f"{where}, {name}") for name, text in told.items() if name not in WORDS}
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
