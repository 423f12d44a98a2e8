"""Two sessions run by run, in words: the rows of a table, and what stands out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fingerlab.core.text import ScreenUnit, decimals_for, fixed, largest_of, screen_unit
from fingerlab.report.score_words import PHASE_WORDS
from fingerlab.sessions.format import CHANNEL_UNITS
from fingerlab.sessions.trajectory import trajectory_words
from fingerlab.signals.run_pairs import COMPARED, ChannelPair, RunPair, SessionPair

NOTABLE = 3.0
"""A difference of so many times the scatter of a cycle stands out (assumed)."""


@dataclass(frozen=True)
class PairCell:
    """One channel of a pair: a text, the difference over the scatter (NaN: not told), and all of it."""

    text: str
    times: float
    help: str


def channel_title(name: str) -> str:
    """``Motor torque``, ``MCP angle``."""
    words = name.replace("_", " ")
    return words[:3].upper() + words[3:] if words[:3] in ("mcp", "pip") else words[:1].upper() + words[1:]


def channels_of(found: SessionPair) -> dict[str, ScreenUnit]:
    """The channels that any pair has, each with the unit that its differences are shown in."""
    units = {}
    for name in COMPARED:
        largest = largest_of(
            math.hypot(one.offset, one.rms) for pair in found.pairs for one in _of(pair.channels, name)
        )
        if any(name in pair.channels for pair in found.pairs):
            units[name] = screen_unit(CHANNEL_UNITS[name], largest)
    return units


def _of(channels: Mapping[str, ChannelPair], name: str) -> list[ChannelPair]:
    return [channels[name]] if name in channels else []


def pair_title(pair: RunPair) -> tuple[str, str]:
    """Runs and motion: ``001 – 003``, ``on air, extension, sine, 15°, 1 Hz``."""
    run = pair.first
    cable = "" if run.cable == "none" else f", {run.cable}"
    words = trajectory_words({k: v for k, v in run.trajectory.items() if k != "offset_deg"})
    return f"{run.name} – {pair.second.name}", f"{PHASE_WORDS.get(run.phase, run.phase)}{cable}, {words}"


def cell(pair: RunPair, name: str, unit: ScreenUnit) -> PairCell:
    """Difference (root mean square, its constant part included) and how many times the scatter that is."""
    if name not in pair.channels:
        return PairCell("–", math.nan, "One of the two runs did not read it.")
    one = pair.channels[name]
    whole, offset, rest, usual = (
        value * unit.factor for value in (math.hypot(one.offset, one.rms), one.offset, one.rms, one.usual)
    )
    digits = decimals_for(0.1 * whole)
    times = "" if math.isnan(one.times) else f" ({one.times:.1f} ×)"
    where = f"at phase {one.largest_at:.2f} of the cycle" if pair.periodic else f"at {one.largest_at:.1f} s"
    scatter = "no cycle repeats" if math.isnan(usual) else f"a cycle scatters by {fixed(usual, digits)}"
    said = (
        f"{channel_title(name)}, second less first, {unit.symbol}: {fixed(offset, digits)} all along, "
        f"{fixed(rest, digits)} about it, most {where}; {scatter}."
    )
    return PairCell(fixed(whole, digits) + times, one.times, said)


def pairs_sentence(found: SessionPair) -> str:
    """How many runs have a partner, and which channel stands out most."""
    first, second = found.first.path.name, found.second.path.name
    count = len(found.pairs)
    said = [f"{count} run{'s' * (count != 1)} of the same motion in {first} and {second}"]
    for runs, session in ((found.only_first, found.first), (found.only_second, found.second)):
        if runs:
            said.append(f"{len(runs)} more in {session.path.name} alone")
    told = [
        (one.times, name, pair)
        for pair in found.pairs
        for name, one in pair.channels.items()
        if one.times > NOTABLE
    ]
    sentence = ", ".join(said) + "."
    if told:
        times, name, pair = max(told, key=lambda entry: entry[0])
        return (
            f"{sentence} {channel_title(name)} differs most, in {pair_title(pair)[0]}: {times:.1f} times the "
            "scatter of a cycle."
        )
    if any(not math.isnan(one.times) for pair in found.pairs for one in pair.channels.values()):
        return f"{sentence} No channel differs by more than {NOTABLE:g} times the scatter of a cycle."
    return sentence


def pairs_json(found: SessionPair) -> dict[str, Any]:
    """Plain data, SI; the curves are left out."""
    return {
        "schema": 1,
        "sessions": [str(found.first.path), str(found.second.path)],
        "pairs": [
            {
                "runs": [pair.first.name, pair.second.name],
                "periodic": pair.periodic,
                "cycles": list(pair.cycles),
                "lag": pair.lag,
                "channels": {
                    name: {
                        "unit": CHANNEL_UNITS[name], "offset": one.offset, "rms": one.rms,
                        "scatter": one.usual, "times_scatter": one.times, "largest_at": one.largest_at,
                    }
                    for name, one in pair.channels.items()
                },
            }
            for pair in found.pairs
        ],
        "only_first": [run.name for run in found.only_first],
        "only_second": [run.name for run in found.only_second],
        "refused": list(found.refused),
    }  # fmt: skip
