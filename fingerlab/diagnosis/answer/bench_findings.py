"""What a diagnosis says of the bench itself: channels lost, zeros that move, times and samples gone wrong."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from fingerlab.core.text import amount, fixed, listed, screen_unit
from fingerlab.diagnosis.answer.results import BenchFinding
from fingerlab.diagnosis.answer.runs_left_aside import named_runs, runs_left_aside
from fingerlab.diagnosis.equations.coefficients import DELAY
from fingerlab.diagnosis.equations.features import Layout
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.equations.parameters import KNOCK_GAIN, OF_CONSTANT, RIG_CONSTANTS, TORQUE_LAG
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.gram.run_constants import SOURCES, Offsets
from fingerlab.diagnosis.score.fitted_model import FittedModel, at_bound, at_found_shapes
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import lacks_fit
from fingerlab.diagnosis.settings import (
    AT_BOUND,
    BEYOND_TOLERANCE,
    CLEARLY_OFF,
    FULL_ITERATIONS,
    LEAST_MOVED,
    LEAST_SPIKES,
    LEFT_BEYOND_TOLERANCE,
    LONGEST_STRETCH_S,
    NEARLY_RIGHT,
    REPORTED_KNOCK,
    REPORTED_OFFSET,
    REPORTED_ONE_SIDED,
    REPORTED_SHARE,
    REPORTED_SKEW_S,
    REPORTED_ZERO_DEG,
)
from fingerlab.diagnosis.signals.channel_checks import torque_of_an_ampere
from fingerlab.diagnosis.signals.filters import (
    BRIDGED,
    CUT_OUT,
    REPEATED,
    SPIKE,
    TURNED,
    UNEVEN,
    Repair,
    without_spikes,
)
from fingerlab.diagnosis.signals.reading_errors import (
    CHANNELS,
    FORCE,
    JOINTS,
    MCP,
    MOTOR,
    NO_ERROR,
    PIP,
    TORQUE,
)
from fingerlab.diagnosis.signals.scales import as_recorded
from fingerlab.sessions.model import CHANNEL_UNITS

BENCH_INERTIA, BENCH_OFFSET, COULOMB = "bench_inertia", "bench_offset", "coulomb"
"""Unknowns of a motor alone: all that turns with it, a constant torque, and the friction of an effect."""
SENSORS = {"mcp_angle": "MCP sensor", "pip_angle": "PIP sensor", "motor_position": "motor's encoder"}


def bench_findings(
    reduction: Reduction, last: FittedModel, offsets: Sequence[Offsets]
) -> tuple[BenchFinding, ...]:
    """All of it, what weighs most first.

    Args:
        last: model of the path. offsets: the constants that the runs have of their own beside it.
    """
    return (
        *runs_left_aside(reduction),
        *_turned(reduction),
        *_shown(reduction),
        *_moved(reduction, offsets),
        *_skew(reduction, last),
        *_readings(reduction, last),
        *_knocks(last),
        *_rig_constants(reduction, last),
        *_inertia_alone(reduction, last),
        *_constant_torque(reduction, last),
        *_spikes(reduction),
        *_lost(reduction),
        *_repeated(reduction),
    )


def _turned(reduction: Reduction) -> list[BenchFinding]:
    """Torques of a motor alone that helped its friction, or told a negative inertia, as they were logged."""
    names = _put_right(reduction, (TURNED, "motor_torque"))[1]
    if not names:
        return []
    said = f"Channel 'motor_torque' counts against the position in {named_runs(names)}; its sign is turned"
    advice = "write what drives the axis towards larger positions as positive"
    return [BenchFinding("turned", "motor_torque", float(len(names)), "runs", names, said, advice)]


def _skew(reduction: Reduction, last: FittedModel) -> list[BenchFinding]:
    """Joint angles, or the torque of a motor alone, that were read later than the motor's position."""
    found, seconds = [], reduction.scales.of("s")
    held = (
        "a drive that holds it until the next reading logs it so, or a filtered position; correct its times"
    )
    filtered = "log the current before it is filtered, or correct its times"
    at_once = "read all channels at one instant, or correct their times"
    joints = "The joint angles come", "the motor's channels"
    drive = "The motor's torque comes", "its position"
    # Of angles that were found late themselves the rest is told with that, or is none of a sensor's.
    told = any(reduction.reading_errors.get(name, NO_ERROR).late for name in (JOINTS, MCP, PIP))
    # A torque's is in the model only where it explains much: however small, it is told.
    for key, channel, least, (what, than), if_early, if_late in (
        (DELAY, "mcp_angle", REPORTED_SKEW_S, joints, at_once, at_once),
        (TORQUE_LAG, "motor_torque", 0.0, drive, held, filtered),
    ):
        place = last.model.index.get(key)
        if place is None or last.model.delayed or (key == DELAY and told):
            continue
        late, unsure = float(last.fit.values[place]), float(last.fit.deviations[place])
        if abs(late) < max(least, REPORTED_OFFSET * unsure):
            continue
        bound = last.model.high[place] if late > 0 else last.model.low[place]
        at_least = "at least " if abs(late) >= AT_BOUND * abs(bound) else ""
        after, advice = ("after", if_late) if late > 0 else ("before", if_early)
        said = f"{what} {at_least}{_number(abs(late) * seconds * 1e3)} ms {after} {than}"
        found.append(BenchFinding("skew", channel, late * seconds, "s", (), said, advice))
    return found


_READ = {
    FORCE: (
        "The load cell's reading comes",
        "the motor and the joints",
        "set its amplifier's cut-off higher",
    ),
    JOINTS: ("The joint angles come", "the motor and the load cell", "set their filters' cut-off higher"),
    MCP: ("The MCP angle comes", "the other channels", "set its filter's cut-off higher"),
    PIP: ("The PIP angle comes", "the other channels", "set its filter's cut-off higher"),
    MOTOR: ("The motor's position comes", "the other channels", "read all channels at one instant"),
    TORQUE: ("The motor's torque comes", "the joints and the load cell", "log its current unfiltered"),
}
"""How it is told that a channel is late, later than what, and what to do."""


def _readings(reduction: Reduction, last: FittedModel) -> list[BenchFinding]:
    """Channels that were found to read something where there is nothing, at another scale, or late."""
    newton, second, found = reduction.scales.of("N"), reduction.scales.of("s"), []
    for name, error in reduction.reading_errors.items():
        late = error.lag + (last.values.get(DELAY, 0.0) if name == JOINTS else 0.0)  # taken off, and beyond
        if error.zero and name == FORCE:
            found.append(_force_zero(error.zero * newton, in_the_air=bool(reduction.zero_in_the_air)))
        elif error.zero:
            found.append(_angle_zero(name, error.zero))
        if error.gain:  # of the torque, beside what the rig file's tolerance takes of it
            known = last.values.get("torque_gain", 0.0) if name == TORQUE else 0.0
            found.append(_scale_read(name, (1.0 + error.gain) * (1.0 - known)))
        if late:
            found.append(_late_read(name, late * second))
    return found


def _force_zero(zero: float, in_the_air: bool) -> BenchFinding:
    """A load cell that reads ``zero`` N with nothing on it."""
    told_by = "in free motion" if in_the_air else "as the joints tell in contact"
    said = f"The load cell reads {_number(zero)} N with nothing on it, {told_by}; that is taken off"
    advice = "set its zero before the runs, with the finger clear of it"
    return BenchFinding("zero", FORCE, zero, "N", (), said, advice)


def _angle_zero(name: str, zero: float) -> BenchFinding:
    """A joint's sensor that reads ``zero`` rad where the joint is straight."""
    joint = name.removesuffix("_angle").upper()
    said = f"The {joint} angle reads {_number(np.degrees(zero))} degrees with the joint straight, "
    said += "as weights and the force's levers tell; that is taken off"
    return BenchFinding(
        "zero", name, zero, "rad", (), said, "set its zero before the runs, on a straight joint"
    )


_CALIBRATED = "the cable's way and the force's levers", "calibrate it anew, at two angles or more"
_SCALED = {
    TORQUE: (
        "motor's torque",
        "springs, weights and the load cell",
        "check the amplifier's monitor, and the gear ratio and torque constant in the rig file",
    ),
    MCP: ("MCP angle", *_CALIBRATED),
    PIP: ("PIP angle", *_CALIBRATED),
}
"""What is read at another scale, by what that is told, and what to do."""


def _scale_read(name: str, scale: float) -> BenchFinding:
    """One of ``CHANNELS`` that is ``scale`` times what its channel reads."""
    what, tellers, advice = _SCALED[name]
    said = f"The {what} is {fixed(scale, 3)} times what its channel reads, as {tellers} tell"
    return BenchFinding("scale", name, scale, "1", (), f"{said}; it is corrected for that", advice)


def _late_read(name: str, late: float) -> BenchFinding:
    """One of ``CHANNELS`` that comes ``late`` s after the others."""
    what, than, advice = _READ[name]
    said = f"{what} {_number(abs(late) * 1e3)} ms {'after' if late > 0 else 'before'} {than}"
    if late > 0:
        said += f", as behind a first-order filter of {_number(1.0 / (2.0 * np.pi * late))} Hz"
    said, advice = f"{said}; it is corrected for that", f"{advice}, or correct its times"
    return BenchFinding("skew", CHANNELS[name][0], late, "s", (), said, advice)


def _knocks(last: FittedModel) -> list[BenchFinding]:
    """Knocks of a tip that lands which were not as hard as the load cell's few samples of them say."""
    place = last.model.index.get(KNOCK_GAIN)
    if place is None:
        return []
    harder, unsure = float(last.fit.values[place]), float(last.fit.deviations[place])
    if abs(harder) < max(REPORTED_KNOCK, REPORTED_OFFSET * unsure):
        return []
    said = (
        "Where the tip lands, it knocks on the load cell for a sample or two, "
        f"{fixed(1.0 + harder, 2)} times as hard as these say, as the joints tell; that is taken into account"
    )
    advice = "sample the force faster, filter it before it is sampled, or let the tip land more slowly"
    return [BenchFinding("knock", FORCE, 1.0 + harder, "1", (), said, advice)]


def _rig_constants(reduction: Reduction, last: FittedModel) -> list[BenchFinding]:
    """Constants that the runs put where the rig file's tolerances end, of those that lie clearly beyond.

    A law that is nearly right puts constants there as well, but hardly gains by letting them go further.
    """
    rig, model, at_end = reduction.rig, last.model, dict[str, str]()
    told = [name for name in RIG_CONSTANTS if name != "inertia" or rig.motor.inertia]
    for name in told if rig.finger is not None else ():
        place = model.index.get(OF_CONSTANT.get(name, name))
        if place is None or model.unknowns[place].key in reduction.fixed:
            continue
        share = float(last.fit.values[place])
        if not at_bound(share, float(model.low[place]), float(model.high[place])):
            continue
        if name == "torque_constant":
            share = -share  # the unknown is by what the torque reads too high
        if name == "inertia":
            share *= reduction.scales.of("kg m^2") / (rig.motor.inertia or 1.0)
        what = "motor's inertia" if name == "inertia" else name.replace("_", " ")
        what = what.replace("mcp", "MCP").replace("pip", "PIP")
        at_end[model.unknowns[place].key] = (
            f"the {what} (at least {_number(100.0 * abs(share))} % {'higher' if share > 0 else 'lower'})"
        )
    off = [at_end[key] for key in _beyond(reduction, last, list(at_end))]
    if not off:
        return []
    are, advice = "is", "measure it again, or write down the tolerance that it has"
    if len(off) > 1:
        are, advice = (
            "are",
            "measure them again, for one may stand for another, or write down their tolerances",
        )
    said = f"By these runs {listed(off)} {are} not what the rig file says, within its tolerance"
    return [BenchFinding("rig_constant", "rig", float(len(off)), "constants", (), said, advice)]


def _inertia_alone(reduction: Reduction, last: FittedModel) -> list[BenchFinding]:
    """The inertia of a motor alone, which any fit is free to find, where it is not that of the rig file.

    Only of a model that leaves little: what one lacks may look like an inertia.
    """
    rig, place = reduction.rig, last.model.index.get(BENCH_INERTIA)
    if not rig.motor.inertia or place is None or lacks_fit(last, NEARLY_RIGHT):
        return []
    size = reduction.scales.of("kg m^2")
    found = size * float(last.fit.values[place])
    known_to = size * float(np.sqrt(max(last.fit.covariance[place, place], 0.0)))
    tolerance = rig.tolerance_of("inertia") * rig.motor.inertia
    if not abs(found - rig.motor.inertia) > CLEARLY_OFF * float(np.hypot(tolerance, known_to)):
        return []
    said = (
        f"By these runs the inertia is {amount(found, 'kg m^2')}, and "
        f"{amount(rig.motor.inertia, 'kg m^2')} ± {_number(100.0 * rig.tolerance_of('inertia'))} % by "
        "the rig file"
    )
    advice = (
        "correct it there, or look for what turns with the motor that should not, or does not that should"
    )
    return [BenchFinding("rig_constant", "rig", found, "kg m^2", (), said, advice)]


def _constant_torque(reduction: Reduction, last: FittedModel) -> list[BenchFinding]:
    """A constant torque of a motor alone that rubs: of friction in either direction the mean is told."""
    place, dry = last.model.index.get(BENCH_OFFSET), _dry_friction(last)
    if place is None or not dry:
        return []
    constant, friction = float(last.fit.values[place]), max(abs(last.values[key]) for key in dry)
    known_to = float(np.sqrt(max(last.fit.covariance[place, place], 0.0)))
    if not abs(constant) > max(REPORTED_ONE_SIDED * friction, REPORTED_OFFSET * known_to):
        return []
    size = constant * reduction.scales.of("N m")
    said = (
        f"Beside the friction stands a constant torque of {_torque(size)}: the amplifier's zero, a weight, "
        "or friction that is larger in one direction, which a motor alone does not tell apart"
    )
    advice = "read the current at rest with nothing coupled to the motor"
    return [BenchFinding("zero", "motor_torque", size, "N m", (), said, advice)]


def _dry_friction(last: FittedModel) -> list[str]:
    """Keys of the unknowns of a model that are Coulomb friction of its motor."""
    keys = (f"{choice.effect.id}.{COULOMB}" for choice in last.choices)
    return [key for key in keys if key in last.model.index]


def _beyond(reduction: Reduction, last: FittedModel, keys: Sequence[str]) -> list[str]:
    """Those of some constants that leave clearly less of runs left out, let go beyond their tolerance."""
    if not keys:
        return []
    effects = at_found_shapes(last)
    reduced, choices = reduction.refined(effects), [Choice(one) for one in effects]

    def left_by(layout: Layout) -> float:
        scorer = Scorer(replace(reduced, layout=layout))
        return scorer.score_held_out(scorer.fit(choices, last, FULL_ITERATIONS, last.weights)).misfit

    def freed(key: str) -> Layout:
        one = reduced.layout.nuisances[key]
        low, high, typical = (BEYOND_TOLERANCE * value for value in (one.low, one.high, one.typical))
        free = replace(one, low=low, high=high, typical=typical)
        return replace(reduced.layout, nuisances={**reduced.layout.nuisances, key: free})

    within = left_by(reduced.layout)
    return [key for key in keys if within - left_by(freed(key)) > LEFT_BEYOND_TOLERANCE * within]


def _shown(reduction: Reduction) -> list[BenchFinding]:
    """Zeros of the load cell in single runs, which it shows while the tip is clear of it."""
    known = reduction.reading_errors.get(FORCE, NO_ERROR)
    shown = {
        run: known.then(errors[FORCE]).zero * reduction.scales.of("N")
        for (_, run), errors in reduction.seen_zeros.items()
    }
    if not shown:
        return []
    zeros = np.array(list(shown.values()))
    mean, spread = float(zeros.mean()), float(np.std(zeros, ddof=1)) if len(zeros) > 1 else 0.0
    runs = tuple(shown)
    if not spread > LEAST_MOVED * abs(mean):
        said = f"The load cell reads {_number(mean)} N with nothing on it, while the tip is clear of it"
        advice = "set its zero before the runs, with the finger clear of it"
        return [BenchFinding("zero", FORCE, mean, "N", runs, f"{said}; that is taken off", advice)]
    away = np.abs(zeros - mean)
    worst = runs[int(np.argmax(away))]
    said, advice = _moved_words(FORCE, spread, float(away.max()), worst, 0.0)
    said += ", as it reads while the tip is clear of it; that is taken off"
    return [BenchFinding("moving_zero", FORCE, spread, "N", (worst,), said, advice)]


def _moved(reduction: Reduction, offsets: Sequence[Offsets]) -> list[BenchFinding]:
    """Zeros that are other ones in every run, by runs that were told the same motion.

    In runs of other motions, what a law lacks is no constant of the run's but looks like one. Only where
    constants of the runs explained nearly all that the best model missed are they told by all runs.
    """
    numbers = [n for one in offsets for n in one.numbers]
    by_all = reduction.constants is not None and reduction.constants.by_averages
    motion_of = {
        n: (k if by_all else reduction.motions[n]) for k, one in enumerate(offsets) for n in one.numbers
    }
    repeats = [
        [k for k, n in enumerate(numbers) if motion_of[n] == motion]
        for motion in sorted({m for m in motion_of.values() if m is not None})
    ]
    repeats = [mine for mine in repeats if len(mine) > 1]
    if not repeats:
        return []
    result = []
    for source, channel in enumerate(SOURCES):
        unit = CHANNEL_UNITS[channel]
        scale = reduction.scales.of(unit)
        zeros = np.concatenate([one.sources[:, source] for one in offsets])
        taken_off = [reduction.run_zeros.get(reduction.runs[n], {}).get(channel, NO_ERROR) for n in numbers]
        zeros = scale * (zeros + np.array([error.zero for error in taken_off]))
        unsure = scale * np.concatenate([one.spreads[:, source] for one in offsets])
        away = np.concatenate([zeros[mine] - zeros[mine].mean() for mine in repeats])
        every = [k for mine in repeats for k in mine]
        spread = float(np.sqrt(np.sum(away**2) / (len(away) - len(repeats))))
        least = np.radians(REPORTED_ZERO_DEG) if unit == "rad" else 0.0
        if not spread > max(REPORTED_OFFSET * float(np.sqrt(np.mean(unsure[every] ** 2))), least):
            continue
        if channel == FORCE and reduction.seen_zeros:
            continue
        worst = int(np.argmax(np.abs(away)))
        at = numbers[every[worst]]
        run = reduction.runs[at][1]
        ampere = torque_of_an_ampere(as_recorded(reduction.analysed[at]), reduction.rig)
        words = _moved_words(channel, spread, float(np.abs(away[worst])), run, ampere)
        result.append(BenchFinding("moving_zero", channel, spread, unit, (run,), *words))
    # One joint's zero is told from the other's by springs and arms that are not known to the last.
    most = max((one.size for one in result if one.unit == "rad"), default=0.0)
    return [one for one in result if one.unit != "rad" or one.size > REPORTED_SHARE * most]


def _moved_words(channel: str, spread: float, most: float, run: str, ampere: float) -> tuple[str, str]:
    """What is said, and advised; ``ampere``: torque of one, N m/A, 0 where nobody knows it."""
    if channel == "motor_torque":
        current = f" ({_number(spread / ampere * 1e3)} mA of its current)" if ampere > 0 else ""
        return (
            f"The zero of the motor's torque moves from run to run by {_torque(spread)}{current}, "
            f"at most by {_torque(most)} in run {run}",
            "let the amplifier warm up, or set its zero at rest before each run",
        )
    if channel == "endpoint_force":
        return (
            f"The load cell's zero moves from run to run by {_number(spread)} N, "
            f"at most by {_number(most)} N in run {run}",
            "set it to zero before each run, with the finger clear of it",
        )
    degrees = np.degrees(1.0)
    return (
        f"The zero of the {SENSORS[channel]} moves from run to run by {_number(spread * degrees)} degrees, "
        f"at most by {_number(most * degrees)} degrees in run {run}",
        "clamp it, or calibrate before each run",
    )


def _spikes(reduction: Reduction) -> list[BenchFinding]:
    """Single samples that are no measurements."""
    result = []
    for channel in _channels_with(reduction, SPIKE):
        runs, names, count = _put_right(reduction, (SPIKE, channel))
        if count < LEAST_SPIKES:
            continue
        every = round(sum(reduction.samples[n] for n in runs) / count)
        where = f"in {_count(len(runs), 'run')}, one in {every:,} samples"
        said = (
            f"Channel '{channel}' has {_count(count, 'single spike')} {where}, put on the line between their "
            "neighbours"
        )
        advice = "look at its plug and its shield"
        if _die_away(reduction, channel, runs):
            said = (
                f"Channel '{channel}' jumps and dies away again over the next samples; "
                f"{_count(count, 'sample')} {where}, are put on a line"
            )
            advice = "that is how a drive answers a step of its reference, or of a coarse encoder"
        result.append(BenchFinding("spikes", channel, float(count), "samples", names, said, advice))
    return result


def _die_away(reduction: Reduction, channel: str, runs: Sequence[int]) -> bool:
    """Whether most of what was taken for spikes goes back by and by: after a spike the next sample is right.

    Of the first stretch of each run.
    """
    shares: list[float] = []
    for n in runs:
        run = as_recorded(reduction.analysed[n])
        values = run.channel(channel, 0, min(run.length, int(LONGEST_STRETCH_S * run.sample_rate_hz)))
        _, found = without_spikes(values)
        for at in found[(found >= BEFORE_A_JUMP) & (found < len(values) - 1)]:
            before = float(np.median(values[at - BEFORE_A_JUMP : at]))
            if values[at] != before:
                shares.append(float((values[at + 1] - before) / (values[at] - before)))
    return bool(shares) and float(np.median(shares)) > STILL_THERE


BEFORE_A_JUMP, STILL_THERE = 3, 0.25
"""Samples before a jump that tell where it begins, and what of it the next sample still has where it dies
away; assumed: noise is a twelfth of a spike at most."""


def _lost(reduction: Reduction) -> list[BenchFinding]:
    """Samples that were lost, a few at a time or many, or came early or late."""
    result = _uneven(reduction)
    # Of a run that was sampled unevenly, what its times lack is told with that.
    uneven = set(_put_right(reduction, UNEVEN)[0])
    for how, said in (
        (BRIDGED, "lost, a few at a time; the gaps are bridged"),
        (CUT_OUT, "lost, many at a time; what lies between the gaps is analysed"),
    ):
        runs, names, count = _put_right(reduction, how, uneven if how == BRIDGED else ())
        if count:
            were = "was" if count == 1 else "were"
            sentence = f"{_count(count, 'sample')} of {_count(len(runs), 'run')} {were} {said}"
            finding = BenchFinding("lost_samples", "time", float(count), "samples", names, sentence, STEADIER)
            result.append(finding)
    return result


STEADIER = "close other programs while you record, or lower the rate"
"""What is advised where samples are lost or late."""


def _uneven(reduction: Reduction) -> list[BenchFinding]:
    """Runs whose samples came early or late, with those that are missing among them."""
    runs, names, count = _put_right(reduction, UNEVEN)
    if not count:
        return []
    missing = sum(reduction.repairs[n].get(BRIDGED, 0) for n in runs)
    lost = f", and {missing:,} {'is' if missing == 1 else 'are'} missing" if missing else ""
    said = (
        f"Uneven sampling: {_count(count, 'sample')} of {_count(len(runs), 'run')} "
        f"{'was' if count == 1 else 'were'} taken early or late{lost}; all are taken at their times"
    )
    return [BenchFinding("uneven_times", "time", float(count), "samples", names, said, STEADIER)]


def _repeated(reduction: Reduction) -> list[BenchFinding]:
    """Channels that are logged more often than they are read."""
    result = []
    for channel in _channels_with(reduction, REPEATED):
        runs, names, count = _put_right(reduction, (REPEATED, channel))
        every = sum(reduction.analysed[n].length for n in runs)
        said = (
            f"Channel '{channel}' is logged more often than it is read: of {every:,} samples in "
            f"{_count(len(runs), 'run')} {count:,} only repeat the one before; it is taken at its readings"
        )
        advice = "read it with each sample, or log no faster than it is read"
        result.append(BenchFinding("held", channel, float(count), "samples", names, said, advice))
    return result


def _channels_with(reduction: Reduction, how: str) -> list[str]:
    """Channels of which samples were put right in this way."""
    return sorted({name for found in reduction.repairs.values() for way, name in found if way == how})


def _put_right(
    reduction: Reduction, what: Repair, but: Collection[int] = ()
) -> tuple[list[int], tuple[str, ...], int]:
    """Numbers and names of the runs, ``but`` some, in which this was put right, and how many samples."""
    runs = [n for n in sorted(reduction.repairs) if reduction.repairs[n].get(what) and n not in but]
    names = tuple(reduction.runs[n][1] for n in runs)
    return runs, names, sum(reduction.repairs[n][what] for n in runs)


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _number(value: float) -> str:
    """Two figures, and no more decimals than these take."""
    decimals = max(0, 1 - int(np.floor(np.log10(max(abs(value), 1e-9)))))
    return fixed(value, min(decimals, 4))


def _torque(value: float) -> str:
    """A torque, N m, to two figures in the unit that its size asks for."""
    unit = screen_unit("N m", value)
    return unit.after(_number(value * unit.factor))
