"""Runs that contradict the others of their kind, whatever acts in all of them.

A sensor that came off, a cable that was changed, a label that is another run's, a motor that was held: a
single such run makes a diagnosis look for physics that is not there. Here the channels of every run are laid
beside those of the others before anything is modelled. What effects do is in most runs of a kind, and is none
of this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.settings import (
    LEAST_ALIKE,
    ODD_CLIPPED,
    ODD_FOLLOWING,
    ODD_FORCE,
    ODD_GEOMETRY,
    ODD_MOVES,
    ODD_NOISE,
    ODD_SAMPLES,
    ODD_STILL,
    ODD_TIMES,
    WELL_APART,
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
    rate_hz: float

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

    def astray(self) -> float:
        """How far the motor is off its command, as a share of what that moves."""
        commanded = self.channels["motor_command"]
        spread = float(commanded.std())
        return float((commanded - self.channels["motor_position"]).std()) / spread if spread > 0.0 else 0.0

    def is_clipped(self, channel: str) -> bool:
        """Whether a channel stands at its largest or its least number, and is read finely elsewhere.

        A drive that is at its limit is no such channel: its current has noise there, too.
        """
        values = self.channels[channel]
        at_ends = [values == end for end in (values.max(), values.min())]
        return bool(np.ptp(values) > 0.0) and any(
            bool(at_end.mean() > ODD_CLIPPED and np.mean(np.diff(values[~at_end]) == 0.0) < ODD_CLIPPED)
            for at_end in at_ends
        )

    @cached_property
    def products(self) -> Array:
        """Mean products of what the cable's length goes with, each about its mean, the position last, (5, 5).

        Both angles; the pull, for a cable that gives; the speed, for channels that are late.
        """
        width = max(round(SMOOTHED_S * self.rate_hz), 1)
        position = self.channels["motor_position"]
        ends = np.pad(position, (width // 2, width - 1 - width // 2), mode="edge")
        speed = np.gradient(np.convolve(ends, np.full(width, 1.0 / width), mode="valid"))
        columns = (*(self.channels[name] for name in (*ANGLES, "motor_torque")), speed, position)
        return np.cov(np.stack(columns), bias=True)


ANGLES = ("mcp_angle", "pip_angle")
SENSES = {"motor_position": (3, 4), "mcp_angle": (0,), "pip_angle": (1,)}
"""Channels whose sense may be turned in one run, and what of the products it turns; that of the position is
as well the cable's name."""
SMOOTHED_S = 0.01
"""A position is averaged over, s, before its speed is told: an encoder's steps are no motion; assumed."""
Check = Callable[[Sequence[_Look]], Iterator[tuple[RunKey, OddRun]]]


def odd_runs(pairs: Iterable[tuple[Session, Run]]) -> dict[RunKey, OddRun]:
    """Those of a finger's runs, as recorded; of a kind with few runs, or where many are odd, none."""
    looks = [look for session, run in pairs if (look := _look(session, run)) is not None]
    checks: tuple[Check, ...] = (_clipped, _still, _noisy, _unpressed, _pressed, _held, _turned)
    found: dict[RunKey, OddRun] = {}
    for check in checks:
        found |= dict(check([look for look in looks if look.key not in found]))
    return found if len(found) < len(looks) else {}


def _look(session: Session, run: Run) -> _Look | None:
    if run.phase == "motor_bench" or run.cable_sign == 0 or missing_channels(run):
        return None
    first = run.length // 10
    needed = ("motor_position", "motor_torque", *ANGLES)
    there = [name for name in (*needed, "endpoint_force", "motor_command") if run.has(name)]
    try:
        channels = run.load(there, first, min(run.length, first + ODD_SAMPLES))
    except UserError:  # a value that is no number: told where the run is read
        return None
    finite = {name: values for name, values in channels.items() if np.isfinite(values).all()}
    if len(channels["motor_position"]) < 16 or not set(needed) <= finite.keys():
        return None
    if max(float(np.abs(finite[name]).max()) for name in ANGLES) > np.pi:  # degrees: told there, too
        return None
    return _Look((str(session.path), run.name), kind_of(run.phase), run.cable, finite, run.sample_rate_hz)


def _odd(
    looks: Sequence[_Look],
    channel: str,
    why: Why,
    is_odd: Callable[[_Look, Sequence[_Look]], bool],
    of: Callable[[_Look], object] = lambda look: (look.cable, look.phase),
) -> Iterator[tuple[RunKey, OddRun]]:
    """Runs with a channel that are odd among those of their kind, if there are enough to tell who is.

    Args:
        is_odd: by the run and the others of its kind. of: what tells the kind of a run.
    """
    kinds: dict[object, list[_Look]] = {}
    for look in looks:
        if channel in look.channels:
            kinds.setdefault(of(look), []).append(look)
    for every in kinds.values():
        if len(every) < LEAST_ALIKE:
            continue
        odd = [look for look in every if is_odd(look, [one for one in every if one is not look])]
        if len(odd) <= len(every) // LEAST_ALIKE:
            yield from ((look.key, OddRun(look.key[1], why, channel)) for look in odd)


def _usual(others: Sequence[_Look], what: str, *channel: str) -> float:
    """Median of a number of the others, by its name in :class:`_Look`."""
    return float(np.median([getattr(one, what)(*channel) for one in others]))


def _clipped(looks: Sequence[_Look]) -> Iterator[tuple[RunKey, OddRun]]:
    """Runs of which a channel is cut off, however many."""
    for look in looks:
        for channel in ("motor_torque", "endpoint_force", *ANGLES):
            if channel in look.channels and look.is_clipped(channel):
                yield look.key, OddRun(look.key[1], "clipped", channel)


def _still(looks: Sequence[_Look]) -> Iterator[tuple[RunKey, OddRun]]:
    """Angles that stand still, without the noise of their sensor, while the motor moves as in the others."""
    for channel in ANGLES:

        def is_still(look: _Look, others: Sequence[_Look], channel: str = channel) -> bool:
            return (
                look.spread(channel) < ODD_STILL * _usual(others, "spread", channel)
                and look.noise(channel) < ODD_STILL * _usual(others, "noise", channel)
                and look.spread("motor_position") > ODD_MOVES * _usual(others, "spread", "motor_position")
            )

        yield from _odd(looks, channel, "still", is_still)


def _noisy(looks: Sequence[_Look]) -> Iterator[tuple[RunKey, OddRun]]:
    """Angles that are noise, and nothing else."""
    for channel in ANGLES:

        def is_noise(look: _Look, others: Sequence[_Look], channel: str = channel) -> bool:
            least, most = ODD_NOISE
            return look.remembers(channel) < least and _usual(others, "remembers", channel) > most

        yield from _odd(looks, channel, "noise", is_noise)


def _unpressed(looks: Sequence[_Look]) -> Iterator[tuple[RunKey, OddRun]]:
    """Runs in contact in which the load cell shows no force, though the motor pulls as in the others."""

    def shows_none(look: _Look, others: Sequence[_Look]) -> bool:
        pulls = look.spread("motor_torque") > ODD_MOVES * _usual(others, "spread", "motor_torque")
        return pulls and look.spread(FORCE) < ODD_FORCE * _usual(others, "spread", FORCE)

    pressed = [look for look in looks if look.phase == "contact"]
    return _odd(pressed, FORCE, "still", shows_none, lambda look: look.phase)


def _pressed(looks: Sequence[_Look]) -> Iterator[tuple[RunKey, OddRun]]:
    """Runs on air in which the load cell shows a force, as it does in contact and not in the others."""
    pressed = [look for look in looks if look.phase == "contact" and FORCE in look.channels]
    if not pressed:
        return iter(())
    least = ODD_FORCE * _usual(pressed, "spread", FORCE)

    def shows_one(look: _Look, others: Sequence[_Look]) -> bool:
        return look.spread(FORCE) > max(least, ODD_TIMES * _usual(others, "spread", FORCE))

    free = [look for look in looks if look.phase != "contact"]
    return _odd(free, FORCE, "force", shows_one, lambda look: look.phase)


FORCE = "endpoint_force"


def _held(looks: Sequence[_Look]) -> Iterator[tuple[RunKey, OddRun]]:
    """Runs in which the motor does not follow its command, as it does in the others."""

    def is_held(look: _Look, others: Sequence[_Look]) -> bool:
        return look.astray() > max(ODD_FOLLOWING, ODD_TIMES * _usual(others, "astray"))

    found = _odd(looks, "motor_command", "held", is_held)
    return ((key, replace(one, channel="motor_position")) for key, one in found)


def _turned(looks: Sequence[_Look]) -> Iterator[tuple[RunKey, OddRun]]:
    """Runs in which one channel is turned round, or the name of the cable, by the others' geometry.

    How far a run's geometry is off otherwise may be the physics' doing, and is left to the models.
    """
    for cable in sorted({look.cable for look in looks}):
        every = [look for look in looks if look.cable == cable]
        left, found = list(every), []
        while len(left) > LEAST_ALIKE and (odd := _turned_most(left)) is not None:
            found.append(odd)
            left = [look for look in left if look.key != odd[0]]
        if len(found) <= len(every) // LEAST_ALIKE:
            yield from found


def _turned_most(every: Sequence[_Look]) -> tuple[RunKey, OddRun] | None:
    """The run without which the others agree best, if one of its channels is turned round by them."""
    whole = sum(look.products for look in every)
    geometries = [_geometry(whole - look.products) for look in every]
    worst = [
        max(_left(one, geometry) for one in every if one is not look)
        for look, geometry in zip(every, geometries, strict=True)
    ]
    place = int(np.argmin(worst))
    look, geometry = every[place], geometries[place]
    left = _left(look, geometry)
    if not left > max(ODD_GEOMETRY * look.spread("motor_position"), WELL_APART * worst[place]):
        return None
    channel = min(SENSES, key=lambda name: _left(look, geometry, name))
    if WELL_APART * _left(look, geometry, channel) > left:
        return None
    return look.key, OddRun(look.key[1], "turned", channel)


def _geometry(products: Array) -> Array:
    """Least squares of the position over the other columns of some products, (4,)."""
    scale = np.sqrt(np.maximum(np.diag(products)[:-1], 1e-60))
    matrix = products[:-1, :-1] / np.outer(scale, scale)
    return np.asarray(np.linalg.lstsq(matrix, products[:-1, -1] / scale, rcond=1e-9)[0] / scale)


def _left(look: _Look, geometry: Array, turned: str | None = None) -> float:
    """What a geometry leaves of a run's position, root mean square, rad; with one channel ``turned``."""
    residual = np.append(-geometry, 1.0)
    if turned is not None:
        residual[list(SENSES[turned])] *= -1.0
    return float(np.sqrt(max(residual @ look.products @ residual, 0.0)))
