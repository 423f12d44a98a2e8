"""What was found of the bench itself, beside all physics: each with its size, and what to do about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fingerlab.core.text import fixed
from fingerlab.diagnosis.answer.results import BenchFinding
from fingerlab.diagnosis.equations.coefficients import DELAY
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import SOURCES, Offsets
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.settings import LEAST_SPIKES, TOLD_OFFSET, TOLD_SHARE, TOLD_SKEW_S
from fingerlab.diagnosis.signals.repairs import BRIDGED
from fingerlab.rig.constants import Rig
from fingerlab.sessions.model import Array

SENSORS = {"mcp_angle": "MCP sensor", "pip_angle": "PIP sensor", "motor_position": "motor's encoder"}


def bench_findings(
    reduction: Reduction, last: FittedModel, offsets: Sequence[Offsets]
) -> tuple[BenchFinding, ...]:
    """All of it, what weighs most first.

    Args:
        last: model of the path. offsets: the constants that the runs have of their own beside it.
    """
    return (
        *_channels(reduction),
        *_moved(reduction, offsets, reduction.rig),
        *_skew(reduction, last),
        *_spikes(reduction),
        *_lost(reduction),
    )


def _channels(reduction: Reduction) -> list[BenchFinding]:
    """Runs that are left aside because a channel was lost."""
    lost = reduction.left_aside
    result = []
    for channel in sorted({name for _, names in lost for name in names}):
        runs = tuple(run for run, names in lost if channel in names)
        them = "it is" if len(runs) == 1 else "they are"
        text = (
            f"Channel '{channel}' was lost in {_count(len(runs), 'run')} ({', '.join(runs[:5])}"
            f"{', ...' if len(runs) > 5 else ''}); {them} left aside: look at its cable, and record again."
        )
        result.append(BenchFinding("missing_channel", channel, float(len(runs)), "runs", runs, text))
    return result


def _skew(reduction: Reduction, last: FittedModel) -> list[BenchFinding]:
    """Joint angles that were not read at the instant of the motor's channels."""
    place = last.model.index.get(DELAY)
    if place is None or last.model.delayed:
        return []
    seconds = reduction.scales.of("s")
    late, unsure = float(last.fit.values[place]), float(last.fit.deviations[place])
    if abs(late) < max(TOLD_SKEW_S, TOLD_OFFSET * unsure):
        return []
    at_least = "at least " if abs(late) >= last.model.high[place] * 0.99 else ""
    text = (
        f"The joint angles come {at_least}{_number(abs(late) * seconds * 1e3)} ms "
        f"{'after' if late > 0 else 'before'} the motor's channels: "
        "read all channels at one instant, or correct their times."
    )
    return [BenchFinding("skew", "mcp_angle", late * seconds, "s", (), text)]


def _moved(reduction: Reduction, offsets: Sequence[Offsets], rig: Rig) -> list[BenchFinding]:
    """Zeros that are other ones in every run, by runs that were told the same motion.

    In runs of other motions, what a law lacks is no constant of the run's but looks like one.
    """
    numbers = [n for one in offsets for n in one.numbers]
    repeats = [
        [k for k, n in enumerate(numbers) if reduction.motions[n] == motion]
        for motion in sorted({m for m in reduction.motions if m is not None})
    ]
    repeats = [mine for mine in repeats if len(mine) > 1]
    if not repeats:
        return []
    result = []
    for source, channel in enumerate(SOURCES):
        unit = "N m" if channel == "motor_torque" else "rad"
        scale = reduction.scales.of(unit)
        told = scale * np.concatenate([one.sources[:, source] for one in offsets])
        unsure = scale * np.concatenate([one.spreads[:, source] for one in offsets])
        away = np.concatenate([told[mine] - told[mine].mean() for mine in repeats])
        every = [k for mine in repeats for k in mine]
        spread = float(np.sqrt(np.sum(away**2) / (len(away) - len(repeats))))
        if not spread > TOLD_OFFSET * float(np.sqrt(np.mean(unsure[every] ** 2))):
            continue
        worst = int(np.argmax(np.abs(away)))
        run = reduction.runs[numbers[every[worst]]][1]
        text = _moved_words(channel, spread, float(np.abs(away[worst])), run, rig)
        result.append(BenchFinding("moving_zero", channel, spread, unit, (run,), text))
    # One joint's zero is told from the other's by springs and arms that are not known to the last.
    most = max((one.size for one in result if one.unit == "rad"), default=0.0)
    return [one for one in result if one.unit != "rad" or one.size > TOLD_SHARE * most]


def _moved_words(channel: str, spread: float, most: float, run: str, rig: Rig) -> str:
    if channel == "motor_torque":
        gain = rig.motor.torque_constant * rig.motor.gear_ratio
        current = f" ({_number(spread / gain * 1e3)} mA of its current)" if gain > 0 else ""
        return (
            f"The zero of the motor's torque moves from run to run by {_number(spread * 1e3)} mN m{current}, "
            f"at most by {_number(most * 1e3)} mN m in run {run}: let the amplifier warm up, or set its zero "
            "at rest before each run."
        )
    degrees = np.degrees(1.0)
    return (
        f"The zero of the {SENSORS[channel]} moves from run to run by {_number(spread * degrees)} degrees, "
        f"at most by {_number(most * degrees)} in run {run}: clamp it, or calibrate before each run."
    )


def _spikes(reduction: Reduction) -> list[BenchFinding]:
    """Single samples that are no measurements."""
    result = []
    channels = sorted({name for found in reduction.repairs.values() for name in found} - {BRIDGED})
    for channel in channels:
        runs = _with(reduction, channel)
        count = sum(reduction.repairs[n][channel] for n in runs)
        if count < LEAST_SPIKES:
            continue
        every = round(sum(reduction.samples[n] for n in runs) / count)
        names = tuple(reduction.runs[n][1] for n in runs)
        text = (
            f"Channel '{channel}' has {_count(count, 'single spike')} in {_count(len(runs), 'run')}, one in "
            f"{every:,} samples; they are left aside: look at its plug and its shield."
        )
        result.append(BenchFinding("spikes", channel, float(count), "samples", names, text))
    return result


def _lost(reduction: Reduction) -> list[BenchFinding]:
    """Samples that were lost, a few at a time."""
    runs = _with(reduction, BRIDGED)
    count = sum(reduction.repairs[n][BRIDGED] for n in runs)
    if not count:
        return []
    were = "was" if count == 1 else "were"
    text = (
        f"{_count(count, 'sample')} of {_count(len(runs), 'run')} {were} lost, a few at a time; the gaps are "
        "bridged: close other programs while you record, or lower the rate."
    )
    names = tuple(reduction.runs[n][1] for n in runs)
    return [BenchFinding("lost_samples", "time", float(count), "samples", names, text)]


def _with(reduction: Reduction, channel: str) -> list[int]:
    found: Mapping[int, Mapping[str, int]] = reduction.repairs
    return [n for n in sorted(found) if found[n].get(channel)]


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _number(value: float) -> str:
    """Two figures, and no more decimals than these take."""
    decimals = max(0, 1 - int(np.floor(np.log10(max(abs(value), 1e-9)))))
    return fixed(value, min(decimals, 4))


def residual_offsets(
    offsets: Sequence[Offsets], runs: Sequence[tuple[str, str]]
) -> dict[tuple[str, str], Array]:
    """What the runs' constants add to the residuals, (5,) over ``Row``, by session and run."""
    return {runs[n]: row for one in offsets for n, row in zip(one.numbers, one.rows, strict=True)}
