"""Verdicts on clean and on spoiled recordings: ``python -m tests.hidden.dirt`` makes docs/dirty-benches.md.

Every recording is spoiled in each of the ways in which real benches spoil theirs (``sweep/disguise.py``), and
diagnosed as if nobody knew. Recordings of others may be named beside the simulated ones.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import click
import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.sessions import Session, open_session
from fingerlab.sessions.model import Array
from tests.hidden.sweep.disguise import KINDS, Channels, decimated, dirty, with_channels

PAGE = Path(__file__).resolve().parents[2] / "docs" / "dirty-benches.md"
SIMULATED = ("coulomb_friction", None, "joint_coupling")
"""What the simulated benches lack, one each; None: nothing."""
SEED = 11
CELL_CUTOFF_HZ = 10.0
CELL_ZERO_N = 0.3
CELL_MOVES_N = 0.1
ANGLES_CUTOFF_HZ = CURRENT_CUTOFF_HZ = 20.0
POSITION_LATE_S = 0.005
PIP_SCALE = 0.95
SCALE = 0.8
CELL, ANGLES, MONITOR = ("endpoint_force",), ("mcp_angle", "pip_angle"), ("motor_current", "motor_torque")


def _with(names: Sequence[str], session: Session, change: Callable[[Array], Array]) -> Session:
    """The session with these channels of every run changed."""

    def changed(channels: Channels) -> Channels:
        return channels | {name: change(channels[name]) for name in names if name in channels}

    return with_channels(session, changed)


def _scaled(scale: float, session: Session) -> Session:
    """The amplifier's monitor reads another share of the current."""
    return _with(MONITOR, session, lambda values: scale * values)


def _filtered(names: Sequence[str], cutoff_hz: float, session: Session) -> Session:
    """Channels behind a low-pass of first order."""
    numbers = butter(1, 2.0 * cutoff_hz / session.runs[0].sample_rate_hz)
    at_rest = lfilter_zi(*numbers)
    return _with(names, session, lambda values: lfilter(*numbers, values, zi=at_rest * values[0])[0])


def _late(names: Sequence[str], seconds: float, session: Session) -> Session:
    """Channels that are read later, by whole samples."""
    back = round(seconds * session.runs[0].sample_rate_hz)
    return _with(names, session, lambda values: np.r_[np.full(back, values[0]), values[:-back]])


def _not_at_zero(session: Session) -> Session:
    """Nobody set the load cell to zero."""
    return _with(CELL, session, lambda force: force + CELL_ZERO_N)


def _cell_moves(session: Session) -> Session:
    """The load cell's zero is another one in each run."""
    rng = np.random.default_rng(SEED)
    return _with(CELL, session, lambda force: force + rng.normal(0.0, CELL_MOVES_N))


def _quarter(session: Session) -> Session:
    """One of four samples, as a slower converter takes them."""
    return decimated(session, 4)


def _spoilt(kinds: tuple[str, ...], session: Session) -> Session:
    return dirty(session, kinds, np.random.default_rng(SEED))


def _askew(session: Session) -> Session:
    """The PIP angle reads less than there is."""
    return _with(ANGLES[1:], session, lambda angle: PIP_SCALE * angle)


WAYS: Mapping[str, Callable[[Session], Session]] = {
    "clean": lambda session: session,
    **{kind: partial(_spoilt, (kind,)) for kind in KINDS},
    "both": partial(_spoilt, ("zeros", "offset")),
    "gain": partial(_scaled, 1.015),
    "scale": partial(_scaled, SCALE),
    "filter": partial(_filtered, CELL, CELL_CUTOFF_HZ),
    "angles": partial(_filtered, ANGLES, ANGLES_CUTOFF_HZ),
    "mcp": partial(_filtered, ANGLES[:1], ANGLES_CUTOFF_HZ),
    "pip": partial(_filtered, ANGLES[1:], ANGLES_CUTOFF_HZ),
    "position": partial(_late, ("motor_position",), POSITION_LATE_S),
    "angle": _askew,
    "current": partial(_filtered, MONITOR, CURRENT_CUTOFF_HZ),
    "tare": _not_at_zero,
    "cell": _cell_moves,
    "rate": _quarter,
}
WORDS = {
    "clean": "as recorded",
    "zeros": "zeros of both angle sensors move by 0.4 degrees from run to run",
    "offset": "the amplifier's offset is another one in each run, 30 mA",
    "spikes": "one sample in two thousand is a spike",
    "gaps": "a few samples lost every three seconds",
    "hum": "50 mA of hum on the current",
    "skew": "the MCP angle comes 1.5 ms late",
    "both": "the angles' zeros and the amplifier's offset move as above at once",
    "gain": "the current reads 1.5 % too much",
    "scale": "the current reads 0.8 of what it is",
    "filter": "the load cell's amplifier has a low-pass of first order at 10 Hz",
    "angles": "both joint angles come from a low-pass of first order at 20 Hz",
    "mcp": "the MCP angle alone does",
    "pip": "the PIP angle alone does",
    "position": "the motor's position comes 5 ms late",
    "angle": "the PIP angle reads 0.95 of what it is",
    "current": "the current comes from a low-pass of first order at 20 Hz",
    "tare": "the load cell reads 0.3 N with nothing on it",
    "cell": "the load cell's zero moves by 0.1 N from run to run",
    "rate": "a quarter of the samples",
}


@dataclass(frozen=True)
class Row:
    """What one diagnosis said."""

    recording: str
    way: str
    answer: str
    alike: int
    before: float
    after: float
    findings: str


def row_of(recording: str, way: str, found: Diagnosis) -> Row:
    """A line of the table."""
    title = {"nothing_missing": "nothing missing", "not_in_catalogue": "not in the catalogue"}
    best = found.candidates[0].title.lower() if found.verdict == "missing_effect" else ""
    told = [f"{one.kind.replace('_', ' ')} ({one.channel})" for one in found.bench]
    return Row(
        recording, way, title.get(found.verdict, best), len(found.set), found.path[0].score,
        found.path[-1].score, ", ".join(told),
    )  # fmt: skip


def recorded(name: str, folder: Path) -> Path:
    """A session with the effect of that name, or with none; simulated once."""
    place = folder / f"{name}.h5"
    if not place.exists():
        effect = [] if name == "nothing" else ["--effect", name]
        asked = ["simulate", "--protocol", "rich", *effect, "--seed", str(SEED), "--out", str(place)]
        subprocess.run([sys.executable, "-m", "fingerlab", *asked], check=True, capture_output=True)
    return place


def judged(place: Path, recording: str, way: str) -> Row:
    """A recording, spoilt in a way, and what is said of it."""
    return row_of(recording, way, diagnose([WAYS[way](open_session(place))], with_curves=False))


def page(rows: Sequence[Row]) -> str:
    """The table as a page."""
    clean = {one.recording: one for one in rows if one.way == "clean"}
    same = [one for one in rows if one.way != "clean"]
    kept = sum(one.answer == clean[one.recording].answer for one in same)
    close = sum(one.after <= 1.3 for one in same)
    lines = [
        "# Dirty benches",
        "",
        "Made by `python -m tests.hidden.dirt`.",
        "",
        f"The same recordings, clean and spoiled as real benches do it. {kept} of {len(same)} spoiled ones "
        f"have the answer of the clean one; in {close} the end of the path is within 1.3 floors.",
        "",
        "| way | what is done |",
        "|---|---|",
        *(f"| {way} | {WORDS[way]} |" for way in WAYS),
        "",
        "Errors are in multiples of the floor: of the nominal model, and at the end of the path.",
        "",
        "| recording | way | answer | cannot be ruled out | error before | at the end | told of the bench |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r.recording} | {r.way} | {r.answer} | {r.alike} | {r.before:.2f} | {r.after:.2f} "
        f"| {r.findings or '-'} |"
        for r in rows
    ]
    return "\n".join(lines) + "\n"


@click.command()
@click.argument("recordings", nargs=-1, type=click.Path(exists=True, path_type=Path))
@click.option(
    "--folder", type=click.Path(path_type=Path), default="dirt", help="Where simulated sessions are kept."
)
@click.option("--way", "ways", multiple=True, type=click.Choice(list(WAYS)), help="Only these, and clean.")
@click.option("--processes", default=2, show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=PAGE, help="The page.")
def main(
    recordings: tuple[Path, ...], folder: Path, ways: tuple[str, ...], processes: int, out: Path
) -> None:
    """Spoil recordings in every way and write what is said of them."""
    folder.mkdir(exist_ok=True)
    places = {name or "nothing": recorded(name or "nothing", folder) for name in SIMULATED}
    places |= {place.stem: place for place in recordings}
    asked = [(n, w) for n in places for w in WAYS if not ways or w in (*ways, "clean")]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(judged, places[name], name, way) for name, way in asked]
        rows = []
        for future in futures:
            rows.append(future.result())
            click.echo(rows[-1])
            out.write_text(page(rows), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
