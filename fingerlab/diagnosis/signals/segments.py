"""From a run to segments of high-bandwidth motion, each short enough to hold in memory, and their senses.

Channels must have the sense that the session format gives them; a turned one fits no law. A joint follows
its cable, a cable pulls, and no finger joint turns by more than half a turn. What a recording says otherwise
in every free run is a matter of its file, not of physics.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.settings import (
    AT_ONCE_S,
    AT_ONCE_SHARE,
    AT_ONCE_STEP_S,
    CLEARLY_HELPING,
    CONTRADICTED,
    LEAST_RUBBING,
    LONGEST_STRETCH_S,
    MOVED_DEG,
    NARROW_RATE_HZ,
    NO_TORQUE,
    PUSHES_N,
    PUSHING_SHARE,
    SETTLING_S,
    SETTLING_SHARE,
    SHORTEST_STRETCH_S,
    TURNED_CORRELATION,
    USUAL_INERTIA,
    WIDE_RATE_HZ,
)
from fingerlab.diagnosis.signals.conditions import BENCH_CHANNELS, CHANGE, FINGER_CHANNELS
from fingerlab.diagnosis.signals.encoder import between_counts, smallest_step
from fingerlab.diagnosis.signals.filters import (
    REPEATED,
    SPIKE,
    TURNED,
    at_even_times,
    at_wide_rate,
    between_readings,
    bridged,
    derivative_kernels,
    differentiate,
    is_wide_rate,
    knocks_of,
    landing_samples,
    lost,
    readings_of,
    usual_wait,
    without_spikes,
)
from fingerlab.diagnosis.signals.reading_errors import corrected
from fingerlab.diagnosis.signals.scales import LEAST_SECONDS, as_recorded, reduced_change, scales_of
from fingerlab.physics.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import Array, IntArray, Run, whole_pieces


def segments_of(run: Run, rig: Rig) -> Iterator[Motion]:
    """The run's motion after its start-up ramp, in stretches of at most a minute without a gap.

    Raises:
        UserError: a channel is missing, holds NaN, or the run is too short to analyse.
    """
    on_bench = run.phase == "motor_bench"
    needed = BENCH_CHANNELS if on_bench else FINGER_CHANNELS
    for name in needed:
        if not run.has(name):
            raise UserError(
                f"Run {run.name} has no channel '{name}'; a diagnosis of the "
                f"{'motor alone' if on_bench else 'finger'} needs {', '.join(needed)}."
            )
    rate = run.sample_rate_hz
    first = int(settling_s(run) * rate)
    if is_too_short(run):
        lasts = as_recorded(run).seconds
        raise UserError(
            f"Run {run.name} lasts {lasts:.1f} s; a diagnosis needs at least "
            f"{_duration(run, LEAST_SECONDS)}: {_duration(run, LEAST_SECONDS - SHORTEST_STRETCH_S)} in which "
            "the machine settles are left out, and the filters need "
            f"{_duration(run, SHORTEST_STRETCH_S)} of what follows."
        )
    none = True
    for start, stop in _blocks(run):
        for motion in _without_gaps(run, rig, start, stop, on_bench, first):
            none = False
            yield motion
    if none:
        least = _duration(run, settling_s(run) + SHORTEST_STRETCH_S)
        raise UserError(
            f"Run {run.name} has so many gaps that no {least} of it are whole, which a diagnosis needs for "
            "the machine to settle and for its filters; record it again, or leave it out."
        )


def is_read_at_once(run: Run) -> bool:
    """Whether all of a run is read in one block, so that its stretches together are no more than that."""
    return len(_blocks(run)) == 1


def _blocks(run: Run) -> list[tuple[int, int]]:
    """First and last sample (exclusive) of the blocks of at most a minute in which a run is read."""
    rate = run.sample_rate_hz
    first, length = int(settling_s(run) * rate), int(LONGEST_STRETCH_S * rate)
    ends = ((start, min(start + length, run.length)) for start in range(first, run.length, length))
    return [(start, stop) for start, stop in ends if stop - start >= SHORTEST_STRETCH_S * rate]


def is_fragmented(run: Run) -> bool:
    """Whether gaps leave no stretch of a run, in reduced units, that is long enough for its filters."""
    time, rate = run.channel("time"), run.sample_rate_hz
    if is_too_short(run) or len(whole_pieces(time, rate)) == 1:
        return False
    lead = int(settling_s(run) * rate)
    lead -= lead % derivative_kernels(rate)[1]
    blocks = (bridged({"time": time[start - lead : stop]}, rate)[0]["time"] for start, stop in _blocks(run))
    return not any(True for one in blocks for _ in _whole(one, rate, lead))


def is_too_short(run: Run) -> bool:
    """Whether too little is left of a run, in reduced units, once it has settled."""
    return run.length - int(settling_s(run) * run.sample_rate_hz) < SHORTEST_STRETCH_S * run.sample_rate_hz


def settling_s(run: Run) -> float:
    """What is left out at the start of a run, s: a ramp from rest, or what rubs needs to find its state."""
    usual = min(SETTLING_S, SETTLING_SHARE * run.seconds)
    # A finger's runs are a rig's own: they begin at rest.
    at_once = run.phase == "motor_bench" and moves_at_once(run)
    return min(AT_ONCE_S, usual) if at_once else usual


def moves_at_once(run: Run) -> bool:
    """Whether the motor moves from the first sample on as it does later: a log of a motion under way."""
    step = max(round(AT_ONCE_STEP_S * run.sample_rate_hz), 1)
    position = run.channel("motor_position", 0, min(run.length, int(LONGEST_STRETCH_S * run.sample_rate_hz)))
    speeds = np.diff(position[::step])
    first = speeds[: max(math.ceil(AT_ONCE_S * run.sample_rate_hz / step), 1)]
    squares = [
        float(np.mean(known**2)) if len(known := part[np.isfinite(part)]) else 0.0 for part in (first, speeds)
    ]
    return squares[0] > AT_ONCE_SHARE**2 * squares[1]


def _duration(run: Run, seconds: float) -> str:
    return f"{seconds * scales_of(run).time:.3g} s"


def _without_gaps(run: Run, rig: Rig, start: int, stop: int, on_bench: bool, lead: int) -> Iterator[Motion]:
    """Samples ``start:stop`` and the ``lead`` before them, in pieces between gaps of the recording."""
    anew = start == lead
    lead -= lead % derivative_kernels(run.sample_rate_hz)[1]
    names = [*(BENCH_CHANNELS if on_bench else FINGER_CHANNELS)]
    extra = "load_torque" if on_bench else "endpoint_force" if run.phase == "contact" else ""
    names += [extra] if run.has(extra) else []
    samples = run.load(["time", *names], start - lead, stop)  # the file is opened once
    step = smallest_step(samples["motor_position"][lead:])  # of the encoder, not of what is put between
    samples, uneven = at_even_times(samples, run.sample_rate_hz, lead)
    # What is missing before the start was counted with the stretch before this.
    missing = uneven or lost(samples["time"][0 if anew else max(lead - 1, 0) :], run.sample_rate_hz)
    samples = bridged(samples, run.sample_rate_hz)[0]
    for piece, its_lead in _whole(samples["time"], run.sample_rate_hz, lead):
        mine = {name: values[piece] for name, values in samples.items()}
        repairs, missing = missing, {}  # told once
        spiked: set[int] = set()
        for name in names:
            if name != "endpoint_force":
                _check_numbers(run, name, mine[name], start - lead + piece.start)
            around = landing_samples(run.sample_rate_hz) if name == "endpoint_force" else 0
            mine[name], spikes, repeated = _repaired(mine[name], run.sample_rate_hz, its_lead, around)
            if name == "motor_position":
                mine[name] = between_counts(mine[name], step, run.sample_rate_hz)
            repairs |= {(REPEATED, name): repeated} if repeated else {}
            spikes = spikes[spikes >= its_lead]
            repairs |= {(SPIKE, name): len(spikes)} if len(spikes) else {}
            spiked |= set(spikes.tolist())
        motion = _motion(run, rig, start - lead + piece.start, mine, on_bench, its_lead)
        at = (start - lead + piece.start + np.array(sorted(spiked), dtype=float)) / run.sample_rate_hz
        later = float(mine["time"][0] - samples["time"][0]) - piece.start / run.sample_rate_hz
        later = later if piece.start else 0.0
        yield replace(
            motion,
            repairs={**motion.repairs, **repairs},
            time=motion.time + later,
            repaired_at=at + later,
            position_step=step,
        )


def _repaired(values: Array, rate: float, lead: int, around: int) -> tuple[Array, IntArray, int]:
    """A channel without spikes and steps; where spikes were, and how many samples behind the lead repeat.

    ``around``: so many samples of a force are looked at around what may be a tip that lands; 0: no force.
    """
    usual = usual_wait(values, rate / NARROW_RATE_HZ) if np.isfinite(values).all() else 1
    if usual == 1:
        return *without_spikes(values, around), 0
    readings = readings_of(values, usual)
    read, spikes = without_spikes(values[readings], -(-around // usual))
    repeated = len(values) - lead - int(np.count_nonzero(readings >= lead))
    return between_readings(read, readings, len(values)), readings[spikes], repeated


def _whole(time: Array, rate: float, lead: int) -> Iterator[tuple[slice, int]]:
    """Pieces of a block without a gap, and how many samples at the start of each only set its state.

    Behind a gap nobody knows what rubs or creeps: it finds its state as it does at the start of a run.
    """
    step = derivative_kernels(rate)[1]
    settling = int(min(SETTLING_S, SETTLING_SHARE * len(time) / rate) * rate)
    for piece in whole_pieces(time, rate):
        its_lead = lead
        if piece.start:
            its_lead = max(lead - piece.start, settling)
            its_lead -= its_lead % step
        if piece == slice(0, len(time)) or _counts(piece, its_lead, rate):
            yield piece, its_lead


def _counts(piece: slice, lead: int, rate: float) -> bool:
    """Whether enough of a piece is left behind its lead."""
    return bool(piece.stop - piece.start - lead >= SHORTEST_STRETCH_S * rate)


def _motion(
    run: Run, rig: Rig, first: int, samples: Mapping[str, Array], on_bench: bool, lead: int
) -> Motion:
    """What ``samples`` hold, of which ``first`` is the number of the first one in the run.

    What rubs, creeps or has play remembers how it came here: its state is followed through the ``lead``,
    where no equation is counted.
    """
    kernels, step = derivative_kernels(run.sample_rate_hz)
    rate = run.sample_rate_hz / step

    def read(name: str) -> Array:
        return at_wide_rate(differentiate(corrected(run, name, samples[name]), kernels, step), rate)

    wide = rate if is_wide_rate(rate) else WIDE_RATE_HZ
    behind = lead // step if is_wide_rate(rate) else math.ceil(lead / run.sample_rate_hz * wide)
    position, torque = read("motor_position"), read("motor_torque")
    joints = force = knocks = load = None
    turned, told = False, 0
    if on_bench:
        load = read("load_torque")[0] if run.has("load_torque") else np.zeros(position.shape[1])
        told = drive_sign(torque[0][behind:], position[:, behind:])
        turned = run.attributes.get(DRIVE_SIGN, told) < 0
        torque = -torque if turned else torque
    else:
        mcp, pip = read("mcp_angle"), read("pip_angle")
        joints = JointMotion(mcp[0], pip[0], mcp[1], pip[1], mcp[2], pip[2])
        force, knocks = _force(run, samples, lead, kernels, step)
    start = (first + len(kernels) // 2) / run.sample_rate_hz
    return Motion(
        phase=run.phase,
        cable_sign=run.cable_sign,
        sample_rate_hz=wide,
        time=start + np.arange(position.shape[1]) / wide,
        position=position[0],
        velocity=position[1],
        acceleration=position[2],
        torque=torque[0],
        motor=rig.motor,
        finger=None if on_bench else rig.finger,
        joints=joints,
        force=force,
        knocks=knocks,
        load=load,
        revolute=not rig.line_radius and scales_of(run).angle == 1.0,
        lead=behind,
        inertia_spread=_inertia_spread(rig),
        intervention=None if on_bench else reduced_change(run),
        change=run.attributes.get(CHANGE, (0, 0)),
        repairs={(TURNED, "motor_torque"): position.shape[1]} if turned else {},
        drive_sign=told,
    )


def _inertia_spread(rig: Rig) -> float:
    """One standard deviation of the rotor's inertia, kg m^2; where the rig gives none, it may be any."""
    inertia = rig.motor.inertia
    return USUAL_INERTIA if inertia is None else inertia * rig.tolerance_of("inertia")


def _check_numbers(run: Run, name: str, values: Array, first: int) -> None:
    """``values`` from the sample ``first`` on.

    Raises:
        UserError: one of them is not a number.
    """
    if not np.all(np.isfinite(values)):
        bad = first + int(np.flatnonzero(~np.isfinite(values))[0])
        raise UserError(
            f"Run {run.name}, channel '{name}' holds a value that is not a number at sample {bad}; "
            "only endpoint_force may, where no load cell was read."
        )


DRIVE_SIGN = "drive_sign"
"""Attribute of a run of a motor alone: -1 where the torque is turned, told of the whole session."""


def with_drive_sign(runs: Sequence[Run], motions: Sequence[Motion]) -> list[Run]:
    """The runs of a motor alone with the sense of its torque told to each: a session has one wiring.

    Unless a quarter of the runs that tell it clearly or more contradict the others: then each has its own.

    Args:
        motions: of some of the runs; where there are none each has its own as well.
    """
    clear = [motion.drive_sign for motion in motions if motion.drive_sign]
    turned = clear.count(-1) / max(len(clear), 1)
    if not motions or CONTRADICTED <= turned <= 1.0 - CONTRADICTED:
        return list(runs)
    sign = -1 if turned > 0.5 else 1
    return [replace(run, attributes={**run.attributes, DRIVE_SIGN: sign}) for run in runs]


def drive_sign(torque: Array, motion: Array) -> int:
    """-1 where a bench's torque clearly helps the motion of a passive machine, 1 where it opposes it, else 0.

    What is left of the torque beside a constant, a spring and inertia must oppose the motion, since
    a machine that only rubs cannot give work back. Where it clearly helps instead, the recording shows the
    reaction, and its sign is turned. Not so where inertia alone tells more than all that is left, or where
    what helps is a small share of the torque: one that is logged before its position seems to help, too, by
    the sine of its lead, and on a single sine inertia and spring are not told apart. No inertia is negative:
    one that tells more than is left beside friction of either kind turns the sign as well.

    Args:
        torque: N m, shape (n,). motion: position, velocity and acceleration, shape (3, n).
    """
    position, velocity, acceleration = motion
    base = np.stack((np.ones_like(torque), position, acceleration), axis=1)
    fitted = np.linalg.lstsq(base, torque, rcond=None)[0]
    rest = torque - base @ fitted
    if float(fitted[2]) * float(_beside(base[:, :2], acceleration).std()) > float(rest.std()):
        return 1
    friction = np.stack((*base[:, :2].T, velocity, np.sign(velocity)), axis=1)
    moved, pulled = _beside(friction, acceleration), _beside(friction, torque)
    inertial = float(pulled @ moved) / max(float(moved @ moved), 1e-300) * moved
    if float(pulled @ moved) < 0.0 and float(inertial.std()) > float((pulled - inertial).std()):
        return -1
    alike = float(rest @ velocity) / max(float(np.linalg.norm(rest) * np.linalg.norm(velocity)), 1e-300)
    rubs = abs(alike) * float(rest.std()) > LEAST_RUBBING * float(torque.std())
    return int(np.sign(alike)) if rubs and abs(alike) > CLEARLY_HELPING else 0


def _beside(columns: Array, values: Array) -> Array:
    """What of some values the columns, (n, k), do not tell, (n,)."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _force(
    run: Run, samples: Mapping[str, Array], lead: int, kernels: Array, step: int
) -> tuple[Array | None, Array | None]:
    """Contact force, and what the knocks of a landing tip add to it, N; None in free motion, or without any.

    In free motion the load cell shows only its noise.
    """
    if run.phase != "contact":
        return None, None
    if not run.has("endpoint_force"):
        raise UserError(
            f"Run {run.name} is a contact run without 'endpoint_force'; it needs the load cell's force in N."
        )
    values = samples["endpoint_force"]
    if not np.all(np.isfinite(values[lead:])):
        raise UserError(
            f"Run {run.name} is a contact run, but 'endpoint_force' holds values that are not numbers; "
            "it needs the load cell's force in N."
        )
    rate = run.sample_rate_hz

    def narrowed(force: Array) -> Array:
        narrow = differentiate(force, kernels[:, :1], step)
        return np.asarray(at_wide_rate(narrow, rate / step)[0])

    values = corrected(run, "endpoint_force", np.nan_to_num(values))
    knocks = knocks_of(values, landing_samples(rate))
    return narrowed(values), narrowed(knocks) if knocks.any() else None


@dataclass(frozen=True)
class ChannelSigns:
    """What a free stretch says: ``follows`` its cable, -1 to 1, for MCP and PIP (NaN: hardly moves).

    ``tension`` is its mean, N, and ``pushes`` the share of the time at which it is negative.
    """

    run: str
    cable: str
    follows: tuple[float, float]
    tension: float
    pushes: float
    newton: float = 1.0  # what a tension is multiplied by to be told


def senses(run: Run, motion: Motion) -> ChannelSigns | None:
    """Of a stretch of a run; None where the finger is not free.

    Raises:
        UserError: a joint turns further than any does, or the torque is one number.
    """
    if motion.joints is None:
        return None
    for name, angle in (("mcp_angle", motion.joints.mcp), ("pip_angle", motion.joints.pip)):
        most = float(np.max(np.abs(angle)))
        if most > np.pi:
            raise UserError(
                f"Run {run.name}, channel '{name}' goes to {most:.3g} rad, more than half a turn; write "
                "it in rad, not in degrees."
            )
    if float(np.ptp(motion.torque)) < NO_TORQUE:
        raise UserError(
            f"Run {run.name}, channel 'motor_torque' never changes; a current that is not connected reads so."
        )
    if motion.force is not None or motion.cable_sign == 0:
        return None
    follows = tuple(_follows(motion, angle) for angle in (motion.joints.mcp, motion.joints.pip))
    pull = motion.tension[motion.lead :]
    newton = scales_of(run).of("N")
    mean, pushes = float(pull.mean()), float(np.mean(pull < 0))
    return ChannelSigns(run.name, run.cable, (follows[0], follows[1]), mean, pushes, newton)


def _follows(motion: Motion, angle: Array) -> float:
    mine, wound = angle[motion.lead :], motion.position[motion.lead :]
    if np.ptp(mine) < np.radians(MOVED_DEG) or not np.ptp(wound) > 0:
        return float("nan")
    return motion.cable_sign * float(np.corrcoef(mine, wound)[0, 1])


def check_senses(seen: Sequence[ChannelSigns]) -> None:
    """Refuse recordings in which every free run says that a channel's sense is turned.

    Raises:
        UserError: with the channel, and what would be right.
    """
    if not seen:
        return
    first = seen[0]
    turned = [_turned([one.follows[k] for one in seen]) for k in (0, 1)]
    cable = f"the {first.cable} cable" if len({one.cable for one in seen}) == 1 else "the cable"
    if all(turned):
        raise UserError(
            f"Both joints turn against {cable} in every free run (run {first.run}, for one); name the other "
            "cable, or turn the sign of motor_position or of both angles."
        )
    if any(turned):
        joint = "MCP" if turned[0] else "PIP"
        raise UserError(
            f"The {joint} angle turns against {cable} in every free run (run {first.run}, for one) while the "
            "other joint follows it; turn its sign, flexion is positive."
        )
    if all(one.tension < PUSHES_N and one.pushes > PUSHING_SHARE for one in seen):
        raise UserError(
            f"The motor's torque would push the cable in every free run (run {first.run}: "
            f"{first.tension * first.newton:.3g} N on average), which no cable can; turn the sign of "
            "motor_torque."
        )


def _turned(follows: Sequence[float]) -> bool:
    """Whether a joint turns against its cable wherever it moves."""
    known = [one for one in follows if np.isfinite(one)]
    return bool(known) and max(known) < TURNED_CORRELATION
