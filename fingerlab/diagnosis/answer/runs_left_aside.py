"""Runs that an answer leaves aside, and why: a channel was lost, gaps, or they contradict the others."""

from __future__ import annotations

from collections.abc import Sequence

from fingerlab.core.text import listed
from fingerlab.diagnosis.answer.results import BenchFinding
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.signals.odd_runs import Why


def runs_left_aside(reduction: Reduction) -> list[BenchFinding]:
    """All of it, what was lost first."""
    return [*_channels(reduction), *_odd(reduction), *_fragmented(reduction)]


def _channels(reduction: Reduction) -> list[BenchFinding]:
    """Runs that are left aside because a channel was lost."""
    lost = reduction.excluded_runs
    result = []
    for channel in sorted({name for _, names in lost for name in names}):
        runs = tuple(run for run, names in lost if channel in names)
        them = "it is" if len(runs) == 1 else "they are"
        said = f"Channel '{channel}' was lost in {named_runs(runs)}; {them} left aside"
        advice = "look at its cable, and record again"
        result.append(BenchFinding("missing_channel", channel, float(len(runs)), "runs", runs, said, advice))
    return result


_ODD_WORDS: dict[tuple[Why, str], tuple[str, str, str]] = {
    ("clipped", ""): (
        "odd_run",
        "Channel '{channel}' is cut off at one number in {runs}",
        "choose a larger range of its input, or ask less of the motor",
    ),
    ("still", "endpoint_force"): (
        "missing_channel",
        "The load cell shows no force in {runs} in contact, though the motor pulls as in the others",
        "look at its plug, or call what touches nothing on air",
    ),
    ("still", ""): (
        "missing_channel",
        "Channel '{channel}' stands still in {runs}, without the noise that it has in the others",
        "look at its plug, and record again",
    ),
    ("noise", ""): (
        "missing_channel",
        "Channel '{channel}' is noise alone in {runs}, other than in the others",
        "look at its plug, and record again",
    ),
    ("force", ""): (
        "odd_run",
        "The load cell is pressed in {runs} on air",
        "call it contact, or keep the tip clear of the load cell",
    ),
    ("held", ""): (
        "odd_run",
        "The motor does not follow its command in {runs}, as it does in the others",
        "look for what held it, and record again",
    ),
    ("turned", "motor_position"): (
        "turned",
        "Both joints turn against the cable in {runs}, other than in the others",
        "name the other cable, or turn the sign of motor_position",
    ),
    ("turned", ""): (
        "turned",
        "Channel '{channel}' is turned round in {runs}, other than in the others",
        "turn its sign",
    ),
}
"""Kind of the finding, what is said and what to do, by why a run is odd and its channel; "" for any other."""


def _odd(reduction: Reduction) -> list[BenchFinding]:
    """Runs that are left aside because they contradict the others of their kind."""
    found = list(reduction.odd_runs.values())
    result = []
    for why, channel in dict.fromkeys((one.why, one.channel) for one in found):
        runs = tuple(one.run for one in found if (one.why, one.channel) == (why, channel))
        kind, said, advice = _ODD_WORDS.get((why, channel)) or _ODD_WORDS[why, ""]
        said = said.format(channel=channel, runs=_within(runs))
        said += f"; {'it is' if len(runs) == 1 else 'they are'} left aside"
        result.append(BenchFinding(kind, channel, float(len(runs)), "runs", runs, said, advice))
    runs = tuple(sorted(name for _, name in reduction.disagreeing))
    if runs:
        one = len(runs) == 1
        said = f"{_within(runs)} {'disagrees' if one else 'disagree'} with every model of the others"
        said = f"{said[0].upper()}{said[1:]}; {'it is' if one else 'they are'} left aside"
        advice = "something touched the finger, its set-up was another, or something acts there alone"
        result.append(BenchFinding("odd_run", "", float(len(runs)), "runs", runs, said, advice))
    return result


def _fragmented(reduction: Reduction) -> list[BenchFinding]:
    """Runs that are left aside because of their gaps."""
    runs = tuple(reduction.fragmented_runs)
    if not runs:
        return []
    have, them = ("has", "it is") if len(runs) == 1 else ("have", "they are")
    said = f"{named_runs(runs)} {have} gaps that leave no stretch long enough; {them} left aside"
    advice = "find out what loses samples, and record again"
    return [BenchFinding("lost_samples", "time", float(len(runs)), "runs", runs, said, advice)]


def named_runs(runs: Sequence[str]) -> str:
    """How many runs, and the first of their names."""
    more = ", ..." if len(runs) > 5 else ""
    return f"{len(runs):,} run{'' if len(runs) == 1 else 's'} ({', '.join(runs[:5])}{more})"


def _within(runs: Sequence[str]) -> str:
    """The same within a sentence."""
    return f"run {runs[0]}" if len(runs) == 1 else f"runs {listed(runs)}"
