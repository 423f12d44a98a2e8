"""Tables on the terminal about a session: its runs and its rig."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import fields

from rich.table import Table
from rich.text import Text

from fingerlab.rig.constants import Finger, Motor, Rig
from fingerlab.rig.file import CONSTANT_UNITS, sources_of
from fingerlab.sessions import CheckReport, Session
from fingerlab.sessions.trajectory import trajectory_words


def runs_table(session: Session, report: CheckReport) -> Table:
    """One row a run; channels are listed where they differ from those of most runs."""
    usual = Counter(tuple(run.units) for run in session.runs).most_common(1)[0][0]
    table = Table(caption=f"channels: {', '.join(usual)}", caption_justify="left")
    for title in ("run", "phase", "cable", "trajectory"):
        table.add_column(title)
    for title in ("seconds", "samples", "per second", "gaps"):
        table.add_column(title, justify="right")
    gaps = {check.run: check.gaps for check in report.runs}
    for run in session.runs:
        words = trajectory_words(run.trajectory)
        if tuple(run.units) != usual:
            words += f"; channels {', '.join(run.units)}"
        table.add_row(
            run.name,
            run.phase,
            run.cable,
            Text(words),
            f"{run.seconds:.3f}",
            str(run.length),
            f"{run.sample_rate_hz:g}",
            str(gaps[run.name]),
        )
    return table


def rig_table(rig: Rig, stored: str) -> Table:
    """The bench's constants with tolerance and source; angles in degrees, the rest in SI.

    Args:
        stored: the rig text as the session holds it, to tell its constants from those of the program.
    """
    given = json.loads(stored)
    table = Table()
    table.add_column("constant")
    table.add_column("value", justify="right")
    for title in ("unit", "tolerance", "source"):
        table.add_column(title)
    sources = sources_of(rig)
    for name, part, kind in (("finger", rig.finger, Finger), ("motor", rig.motor, Motor)):
        for spec in fields(kind) if part is not None else ():
            value, unit = getattr(part, spec.name), CONSTANT_UNITS[spec.name]
            if value is None:
                continue
            if unit == "rad":
                value, unit = math.degrees(value), "°"
            origin = "session" if spec.name in (given.get(name) or {}) else "not in the session: default"
            tolerance = f"± {100 * rig.tolerance_of(spec.name):g} %"
            table.add_row(
                spec.name.replace("_", " "),
                f"{value:.5g}",
                unit,
                tolerance,
                Text(sources.get(spec.name, origin)),
            )
    return table
