"""Runs that contradict the others of their kind, whatever acts in all of them.

A sensor that came off, a cable that was changed, a label that is another run's, a motor that was held: a
single such run makes a diagnosis look for physics that is not there. Here the channels of every run are laid
beside those of the others before anything is modelled. What effects do is in most runs of a kind, and is none
of this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import Literal

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.settings import (
    LEAST_ALIKE,
    ODD_CLIPPED,
    ODD_FOLLOWING,
    ODD_FORCE,
    ODD_GEOMETRY,
    ODD_NOISE,
    ODD_STILL,
    PACE_SAMPLES,
)
from fingerlab.diagnosis.signals.conditions import kind_of, missing_channels
from fingerlab.sessions.model import Array, Run, Session

Why = Literal["clipped", "still", "noise", "force", "held", "turned"]
RunKey = tuple[str, str]
"""Session's path and the run's name."""


@dataclass(frozen=True)
class OddRun:
    """A run that is left aside, and by what it contradicts the others.

    ``channel`` is the one to look at first.
    """

    run: str
    why: Why
    channel: str


@dataclass(frozen=True)
class _Look:
    """What is seen of a run behind its ramp from rest, in SI: its channels, (n,) each."""

    key: RunKey
    phase: str
    cable: str
    channels: Mapping[str, Array]

    def spread(self, channel: str) -> float:
        return float(self.channels[channel].std())

    def noise(self, channel: str) -> float:
        """Standard deviation of what changes from sample to sample, as far as it is white."""
        return float(np.diff(self.channels[channel], 2).std()) / np.sqrt(6.0)

    def remembers(self, channel: str) -> float:
        """Correlation of neighbouring samples."""
        values = self.channels[channel] - self.channels[channel].mean()
        power = float(values @ values)
        return float(values[1:] @ values[:-1]) / power if power > 0.0 else 1.0


def odd_runs(pairs: Iterable[tuple[Session, Run]]) -> dict[RunKey, OddRun]:
    """Those of a finger's runs, as recorded; of a kind with few runs, or where many are odd, none."""
    looks = [look for session, run in pairs if (look := _look(session, run)) is not None]
    found: dict[RunKey, OddRun] = {}
    clipped = dict(_clipped(looks))
    if len(clipped) < len(looks):
        found |= clipped
    for check in (_still, _noisy, _pressing, _held, _turned):
        left = [look for look in looks if look.key not in found]
        found |= dict(check(left))
    return found


def _look(session: Session, run: Run) -> _Look | None:
    if run.phase == "motor_bench" or run.cable_sign == 0 or missing_channels(run):
        return None
    first = run.length // 10
    names = ("motor_position", "motor_torque", "mcp_angle", "pip_angle", "endpoint_force", "motor_command")
    there = [name for name in names if run.has(name)]
    try:
        channels = run.load(there, first, min(run.length, first + PACE_SAMPLES))
    except UserError:  # a value that is no number: told where the run is read
        return None
    finite = {name: values for name, values in channels.items() if np.isfinite(values).all()}
    if len(channels["motor_position"]) < 16 or not set(names[:4]) <= finite.keys():
        return None
    if max(float(np.abs(finite[name]).max()) for name in names[2:4]) > np.pi:  # degrees: told there, too
        return None
    finite["motor_speed"] = np.gradient(_smooth(finite["motor_position"], run.sample_rate_hz))
    return _Look((str(session.path), run.name), kind_of(run.phase), run.cable, finite)


def _smooth(values: Array, rate: float) -> Array:
    """A channel averaged over ``SMOOTHED_S``, (n,)."""
    width = max(round(SMOOTHED_S * rate), 1)
    ends = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(ends, np.full(width, 1.0 / width), mode="valid")


SMOOTHED_S = 0.01
"""A position is averaged over, s, before its speed is told: an encoder's steps are no motion; assumed."""
Found = Iterator[tuple[RunKey, OddRun]]


def _kinds(looks: Sequence[_Look], of: Callable[[_Look], object], channel: str) -> Iterator[list[_Look]]:
    """Groups of the runs with a channel that are of one kind, of enough runs to tell who is odd."""
    kinds: dict[object, list[_Look]] = {}
    for look in looks:
        if channel in look.channels:
            kinds.setdefault(of(look), []).append(look)
    return (each for each in kinds.values() if len(each) >= LEAST_ALIKE)


def _few(odd: Sequence[_Look], every: Sequence[_Look]) -> bool:
    """Whether so few of a kind are odd that the others are the rule."""
    return 0 < len(odd) <= len(every) // LEAST_ALIKE


def _others(look: _Look, every: Sequence[_Look], size: Callable[[_Look], float]) -> float:
    return float(np.median([size(one) for one in every if one is not look]))


def _clipped(looks: Sequence[_Look]) -> Found:
    """Runs of which a channel is cut off at its largest or its least number, and is read finely elsewhere.

    A drive that is at its limit is no such run: its current has noise there, too.
    """
    for look in looks:
        for channel in ("motor_torque", "endpoint_force", "mcp_angle", "pip_angle"):
            values = look.channels.get(channel)
            if values is None or not np.ptp(values) > 0.0:
                continue
            for end in (values.max(), values.min()):
                at_end = values == end
                elsewhere = np.diff(values[~at_end])
                share, alike = (
                    float(at_end.mean()),
                    float(np.mean(elsewhere == 0.0)) if len(elsewhere) else 1.0,
                )
                if share > ODD_CLIPPED and alike < ODD_CLIPPED:
                    yield look.key, OddRun(look.key[1], "clipped", channel)


def _still(looks: Sequence[_Look]) -> Found:
    """Angles that stand still, without the noise of their sensor, while the motor moves as in the others."""
    for channel in ("mcp_angle", "pip_angle"):
        for every in _kinds(looks, lambda look: (look.cable, look.phase), channel):
            odd = [
                look for look in every
                if look.spread(channel) < ODD_STILL * _others(look, every, methodcaller("spread", channel))
                and look.noise(channel) < ODD_STILL * _others(look, every, methodcaller("noise", channel))
                and _moves(look, every)
            ]  # fmt: skip
            if _few(odd, every):
                yield from ((look.key, OddRun(look.key[1], "still", channel)) for look in odd)


def _moves(look: _Look, every: Sequence[_Look], channel: str = "motor_position") -> bool:
    """Whether a run's motor moves, or pulls, at least a good part of what it does in the others."""
    return look.spread(channel) > 0.3 * _others(look, every, methodcaller("spread", channel))


def _noisy(looks: Sequence[_Look]) -> Found:
    """Angles that are noise, and nothing else."""
    for channel in ("mcp_angle", "pip_angle"):
        for every in _kinds(looks, lambda look: (look.cable, look.phase), channel):
            odd = [
                look for look in every
                if look.remembers(channel) < ODD_NOISE
                and _others(look, every, methodcaller("remembers", channel)) > 1.0 - ODD_NOISE / 5.0
            ]  # fmt: skip
            if _few(odd, every):
                yield from ((look.key, OddRun(look.key[1], "noise", channel)) for look in odd)


def _pressing(looks: Sequence[_Look]) -> Found:
    """Runs in contact in which the load cell shows no force, and runs in the air in which it shows one."""
    channel = "endpoint_force"
    both = list(_kinds(looks, lambda look: look.phase == "contact", channel))
    contact = next((each for each in both if each[0].phase == "contact"), [])
    air = next((each for each in both if each[0].phase != "contact"), [])
    odd = [
        look for look in contact
        if look.spread(channel) < ODD_FORCE * _others(look, contact, methodcaller("spread", channel))
        and _moves(look, contact, "motor_torque")
    ]  # fmt: skip
    if _few(odd, contact):
        yield from ((look.key, OddRun(look.key[1], "still", channel)) for look in odd)
    touching = [one.spread(channel) for one in looks if one.phase == "contact" and channel in one.channels]
    if not touching:
        return
    least = 2.0 * ODD_FORCE * float(np.median(touching))
    odd = [
        look for look in air
        if look.spread(channel) > max(least, 10.0 * _others(look, air, methodcaller("spread", channel)))
    ]  # fmt: skip
    if _few(odd, air):
        yield from ((look.key, OddRun(look.key[1], "force", channel)) for look in odd)


def _held(looks: Sequence[_Look]) -> Found:
    """Runs in which the motor does not follow its command, as it does in the others."""

    def astray(look: _Look) -> float:
        commanded = look.channels["motor_command"]
        spread = float(commanded.std())
        return float((commanded - look.channels["motor_position"]).std()) / spread if spread > 0.0 else 0.0

    for every in _kinds(looks, lambda look: (look.cable, look.phase), "motor_command"):
        odd = [
            look for look in every
            if astray(look) > max(ODD_FOLLOWING, 10.0 * _others(look, every, astray))
        ]  # fmt: skip
        if _few(odd, every):
            yield from ((look.key, OddRun(look.key[1], "held", "motor_position")) for look in odd)


SENSES = ("motor_position", "mcp_angle", "pip_angle")
"""Channels whose sense may be turned in one run; that of the position is as well the cable's name."""


def _turned(looks: Sequence[_Look]) -> Found:
    """Runs in which one channel is turned round, or the name of the cable, by the others' geometry.

    The pull stands beside the angles, for a cable that gives, and the speed for channels that are late. How
    far a run's geometry is off otherwise may be the physics' doing, and is left to the models.
    """
    for every in _kinds(looks, lambda look: look.cable, "motor_position"):
        left, found = list(every), []
        while len(left) > LEAST_ALIKE and (odd := _turned_most(left)) is not None:
            found.append(odd)
            left = [look for look in left if look.key != odd[0]]
        if found and len(found) <= len(every) // LEAST_ALIKE:
            yield from found


def _turned_most(every: Sequence[_Look]) -> tuple[RunKey, OddRun] | None:
    """The run without which the others agree best, if one of its channels is turned round by them."""
    without = {look.key: [one for one in every if one is not look] for look in every}
    each = {key: _geometry(others) for key, others in without.items()}
    worst = {key: max(_left(one, each[key]) for one in others) for key, others in without.items()}
    look = min(every, key=lambda one: worst[one.key])
    left = _left(look, each[look.key])
    if not left > max(ODD_GEOMETRY * look.spread("motor_position"), 5.0 * worst[look.key]):
        return None
    channel = min(SENSES, key=lambda name: _left(look, each[look.key], name))
    if _left(look, each[look.key], channel) > 0.2 * left:
        return None
    return look.key, OddRun(look.key[1], "turned", channel)


def _columns(look: _Look, turned: str | None = None) -> tuple[Array, Array]:
    """What the position goes with, (n, 4), and the position, (n,), each about its mean."""
    signs = {name: -1.0 if name == turned else 1.0 for name in SENSES}
    columns = np.stack(
        [
            signs["mcp_angle"] * look.channels["mcp_angle"],
            signs["pip_angle"] * look.channels["pip_angle"],
            look.channels["motor_torque"],
            signs["motor_position"] * look.channels["motor_speed"],
        ],
        axis=1,
    )
    position = signs["motor_position"] * look.channels["motor_position"]
    return columns - columns.mean(axis=0), position - position.mean()


def _geometry(looks: Sequence[_Look]) -> Array:
    """Least squares of the position over both angles, the pull and the speed, (4,); each run has its zero."""
    each = [_columns(look) for look in looks]
    columns, position = (np.concatenate(parts) for parts in zip(*each, strict=True))
    scale = np.maximum(columns.std(axis=0), 1e-30)
    return np.asarray(np.linalg.lstsq(columns / scale, position, rcond=1e-6)[0] / scale)


def _left(look: _Look, geometry: Array, turned: str | None = None) -> float:
    """What a geometry leaves of a run's position, root mean square, rad."""
    columns, position = _columns(look, turned)
    return float((position - columns @ geometry).std())
