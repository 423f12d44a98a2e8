"""What is compared, in words: sessions run by run, both models of a force trial, our numbers and the thesis'.

A number of the thesis is met or not: it is outside where it is further from the published value than the
published deviation over runs. Where the thesis prints no deviation, the tolerance below holds in its place;
each says where it comes from.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from fingerlab.core.plain_data import json_ready
from fingerlab.core.progress import SILENT, Watch
from fingerlab.core.text import ScreenUnit, decimals_for, fixed, largest_of, number
from fingerlab.prediction.trial import CAUSES, ModelForce, Trial
from fingerlab.report.line_units import LineUnits, line_units
from fingerlab.report.score_words import PHASE_WORDS
from fingerlab.sessions.model import CHANNEL_UNITS
from fingerlab.sessions.trajectory import trajectory_words
from fingerlab.signals.run_pairs import COMPARED, RunPair, SessionPair
from fingerlab.thesis.analysis import PUBLISHED, Published, PublishedQuantity, thesis_analysis
from fingerlab.thesis.onair import Spread

NOTABLE = 3.0
"""A difference of so many times the scatter of a cycle stands out (assumed)."""


@dataclass(frozen=True)
class PairCell:
    """One channel of a pair: a text, the difference over the scatter (NaN: not told), and all of it."""

    text: str
    times: float
    help: str


def channel_title(name: str, line: LineUnits) -> str:
    """``Motor torque``, ``MCP angle``; ``Force`` of an axis along a line."""
    words = line.called(name)
    return words[:3].upper() + words[3:] if words[:3] in ("mcp", "pip") else words[:1].upper() + words[1:]


def channels_of(found: SessionPair) -> dict[str, ScreenUnit]:
    """The channels that any pair has, each with the unit that its differences are shown in."""
    units, line = {}, line_of(found)
    for name in COMPARED:
        largest = largest_of(
            math.hypot(one.offset, one.rms)
            for pair in found.pairs
            for one in ([pair.channels[name]] if name in pair.channels else [])
        )
        if any(name in pair.channels for pair in found.pairs):
            units[name] = line.channel(name, largest)
    return units


def line_of(found: SessionPair) -> LineUnits:
    """Units of the axis that both sessions are of."""
    return line_units((found.first,))


def pair_title(pair: RunPair, line: LineUnits) -> tuple[str, str]:
    """Runs and motion: ``001 – 003``, ``on air, extension, sine, 15°, 1 Hz``."""
    run = pair.first
    cable = "" if run.cable == "none" else f", {run.cable}"
    told = {k: v for k, v in run.trajectory.items() if k != "offset_deg"}
    words = trajectory_words(told, line.radius)
    return f"{run.name} – {pair.second.name}", f"{PHASE_WORDS.get(run.phase, run.phase)}{cable}, {words}"


def cell(pair: RunPair, name: str, unit: ScreenUnit, line: LineUnits) -> PairCell:
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
        f"{channel_title(name, line)}, second less first, {unit.symbol}: {fixed(offset, digits)} all along, "
        f"{fixed(rest, digits)} about it, most {where}; {scatter}."
    )
    return PairCell(fixed(whole, digits) + times, one.times, said)


def pairs_sentence(found: SessionPair) -> str:
    """How many runs have a partner, and which channel stands out most."""
    first, second = found.first.path.name, found.second.path.name
    count, line = len(found.pairs), line_of(found)
    said = [f"{count} run{'s' * (count != 1)} of the same motion in {first} and {second}"]
    for runs, session in ((found.only_first, found.first), (found.only_second, found.second)):
        if runs:
            said.append(f"{len(runs)} more in {session.path.name} alone")
    notable = [
        (one.times, name, pair)
        for pair in found.pairs
        for name, one in pair.channels.items()
        if one.times > NOTABLE
    ]
    sentence = ", ".join(said) + "."
    if notable:
        times, name, pair = max(notable, key=lambda entry: entry[0])
        return (
            f"{sentence} {channel_title(name, line)} differs most, in {pair_title(pair, line)[0]}: "
            f"{times:.1f} times the scatter of a cycle."
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


@dataclass(frozen=True)
class Tolerance:
    """How far from the published value still counts as the same, in the quantity's unit."""

    value: float
    reason: str


_R2 = Tolerance(0.20, "median of the deviations that the thesis prints for an R2")
_PEAK = "30 % of the value: a single run in the thesis, and force peaks differ by that from run to run"

TOLERANCES: dict[str, Tolerance] = {
    "r2_flexion": _R2,
    "r2_extension": _R2,
    "r2_static_1": _R2,
    "r2_static_2": _R2,
    "peak_measured": Tolerance(0.15, _PEAK),
    "peak_extension": Tolerance(0.05, _PEAK),
    "peak_flexion": Tolerance(0.26, _PEAK),
    "r2_flexion_findsignal_30": Tolerance(0.05, "figure 4.14 shows all but two runs above 0.9"),
    "peak_share": Tolerance(7.0, "a quarter of the value: 'almost four times lower'"),
    "speed_change_mcp": Tolerance(1.0, "one percentage point: printed to 0.1"),
    "speed_change_pip": Tolerance(1.0, "one percentage point: printed to 0.1"),
    "r2_angle_60": Tolerance(0.10, "a single run in the thesis, at angles 15 degrees apart"),
}
"""For quantities that the thesis prints without a deviation."""


@dataclass(frozen=True)
class ComparedQuantity:
    """One quantity, published and ours over the runs.

    ``tolerance`` and ``outside``, whether ours is further off than that, are None where nothing is published.
    """

    published: Published
    ours: Spread
    tolerance: Tolerance | None
    outside: bool | None


def compare(benches: Sequence[Iterable[PublishedQuantity]]) -> tuple[ComparedQuantity, ...]:
    """Every published quantity beside ours, in the thesis' order.

    Args:
        benches: the quantities of one analysis each; runs of several benches are taken together.
    """
    runs: dict[str, tuple[float, ...]] = {}
    for quantities in benches:
        for quantity in quantities:
            runs[quantity.key] = runs.get(quantity.key, ()) + quantity.runs
    return tuple(_compared(published, Spread(runs.get(published.key, ()))) for published in PUBLISHED)


def _compared(published: Published, ours: Spread) -> ComparedQuantity:
    if published.value is None:
        return ComparedQuantity(published, ours, None, None)
    if published.deviation is not None:
        tolerance = Tolerance(published.deviation, "deviation that the thesis prints")
    else:
        tolerance = TOLERANCES[published.key]
    # A number that our analysis could not give does not agree with a published one.
    outside = not math.isfinite(ours.mean) or abs(ours.mean - published.value) > tolerance.value
    return ComparedQuantity(published, ours, tolerance, outside)


def lines_json(lines: Sequence[ComparedQuantity]) -> Any:
    """For ``replicate --json``: numbers in the units of the table, null where there is none."""
    return json_ready(
        {
            "quantities": [
                {
                    "key": line.published.key,
                    "title": line.published.title,
                    "unit": line.published.unit,
                    "published": line.published.value,
                    "tolerance": None if line.tolerance is None else line.tolerance.value,
                    "tolerance_reason": "" if line.tolerance is None else line.tolerance.reason,
                    "ours": line.ours.mean,
                    "deviation": line.ours.deviation,
                    "outside": line.outside,
                }
                for line in lines
            ],
            "outside": [line.published.key for line in lines if line.outside],
            "compared": sum(line.outside is not None for line in lines),
        }
    )


def replicated(preset_name: str, seeds: Sequence[int], watch: Watch = SILENT) -> tuple[ComparedQuantity, ...]:
    """Each bench simulated and analysed as the thesis did, beside what was published.

    Raises:
        UserError: there is no such preset. Cancelled: the user asked for it.
    """
    from fingerlab.twin.protocols import PROTOCOLS, load_preset
    from fingerlab.twin.session import simulated_session

    preset = load_preset(preset_name)
    plans = PROTOCOLS["thesis"](preset.numbers["protocol"]["contact_amplitude_deg"])
    results = []
    for place, seed in enumerate(seeds):

        def part(share: float, what: str, start: float = 0.0, place: int = place) -> None:
            watch.tell((place + start + 0.5 * share) / len(seeds), what)

        session = simulated_session(preset, "thesis", plans, seed, part)
        analysis = thesis_analysis(session, lambda share, what: part(share, f"analysing {what}", 0.5))
        results.append(analysis.quantities)
    return compare(results)


def outcome_sentences(lines: Sequence[ComparedQuantity]) -> tuple[str, str]:
    """How many are within the published spread, and what a spread in brackets is."""
    outside = [line.published.title for line in lines if line.outside]
    compared = sum(line.outside is not None for line in lines)
    within = f"{compared - len(outside)} of {compared} within the published spread"
    marked = f"; outside, marked *: {'; '.join(outside)}." if outside else "."
    return within + marked, (
        "Spread in brackets: the thesis prints none, and a tolerance of ours holds in its place (its reason "
        "is in the JSON)."
    )


def cells(line: ComparedQuantity) -> tuple[str, str, str, str, str]:
    """Quantity, published and ours with their spread, a star where it is outside, unit."""
    one = line.published
    digits = 3 if one.unit == "1" else 2 if one.unit == "N" else 1
    published = "-"
    if line.tolerance is not None:
        spread = f"± {line.tolerance.value:.{digits}f}"
        published = f"{one.value:.{digits}f} {f'({spread})' if one.key in TOLERANCES else spread}"
    ours = f"{line.ours.mean:.{digits}f}" if math.isfinite(line.ours.mean) else "none"
    if math.isfinite(line.ours.deviation):
        ours += f" ± {line.ours.deviation:.{digits}f}"
    return one.title, published, ours, "*" if line.outside else "", "" if one.unit == "1" else one.unit


MENTIONED = 0.1
"""Share of the squared error from which on a cause is named (assumed)."""
WHOLE = 0.99
"""Share of a found torque from which on it was sent whole, for words."""


def trial_sentence(trial: Trial) -> str:
    """By how much the error fell; of one model alone its error."""
    if trial.nominal is None or trial.found is None:
        one = trial.found or trial.nominal
        assert one is not None
        return (
            f"With the {one.model} model the force missed what was wanted by {_mn(one.rms)} (rms). By how "
            "much a found model lowers it takes runs of both models: record with --ab."
        )
    before, after = _mn(trial.nominal.rms), _mn(trial.found.rms)
    interval = _interval(trial)
    if trial.low > 1.0:
        return f"The force error rose from {before} to {after}{interval}: the nominal model does better here."
    if math.isfinite(trial.high) and trial.high >= 1.0:
        return f"The force error went from {before} to {after}{interval}: no difference can be told."
    return f"The force error fell from {before} to {after}, to {100 * trial.ratio:.0f} %{interval}."


def result_sentences(trial: Trial) -> tuple[str, ...]:
    """All that a trial shows: how far the error fell, what was predicted, and what each model leaves."""
    models = [one for one in (trial.nominal, trial.found) if one is not None]
    sentences = (
        trial_sentence(trial), share_sentence(trial), predicted_sentence(trial), *map(rest_sentence, models)
    )  # fmt: skip
    return tuple(sentence for sentence in sentences if sentence)


def trial_row(model: ModelForce) -> tuple[str, ...]:
    """One model in a table: name, runs, error, predicted, largest, run to run (mN), then each cause (%)."""
    predicted = number(1e3 * model.predicted_rms, 1) if math.isfinite(model.predicted_rms) else "–"
    repeats = number(1e3 * model.repeatability, 1) if len(model.runs) > 1 else "–"
    error, peak = (number(1e3 * value, 1) for value in (model.rms, model.peak))
    causes = (number(100.0 * model.parts[cause], 0) for cause in CAUSES)
    return model.model, str(len(model.runs)), error, predicted, peak, repeats, *causes


def _interval(trial: Trial) -> str:
    if not math.isfinite(trial.low):
        return " (no interval: it takes two pairs of runs or more)"
    return f" (90 % interval {100 * trial.low:.0f} to {100 * trial.high:.0f} %)"


def predicted_sentence(trial: Trial) -> str:
    """What the found model had foretold of it; empty where it foretold nothing."""
    if not math.isfinite(trial.predicted_ratio) or trial.nominal is None or trial.found is None:
        return ""
    return (
        f"The found model had foretold {_mn(trial.nominal.predicted_rms)} with the nominal torque and "
        f"{_mn(trial.found.predicted_rms)} with its own: {100 * trial.predicted_ratio:.0f} %."
    )


def share_sentence(trial: Trial) -> str:
    """How far the found torque was sent; empty where it was sent whole."""
    share = trial.found_share
    if not math.isfinite(share) or share > WHOLE:
        return ""
    if share == 0.0:
        return (
            "In practice the found torque, but for less than a tenth, missed no less than the nominal one, "
            "which was therefore sent for both."
        )
    return f"Practice bore out {100 * share:.0f} % of the way from the nominal torque to the found one."


def rest_sentence(model: ModelForce) -> str:
    """What is left of one model's error, by cause; the largest first."""
    named = sorted(model.parts.items(), key=lambda one: -one[1])
    causes = [f"{100 * share:.0f} % {CAUSES[cause]}" for cause, share in named if share >= MENTIONED]
    return f"Of what the {model.model} model leaves ({_mn(model.rms)}, squared): {', '.join(causes)}."


def _mn(newtons: float) -> str:
    return f"{number(1e3 * newtons, 1)} mN"
