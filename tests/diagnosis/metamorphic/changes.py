"""What is done to a session without a change of what it says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.diagnosis.signals.scales import Scales, as_recorded, reduced_sessions
from fingerlab.sessions.model import Array, ChannelReader, Run, Session


def resized(session: Session, mass: float = 1.0, length: float = 1.0, time: float = 1.0) -> Session:
    """Every quantity of a session as of a machine so many times as heavy, long and slow.

    Torques grow as mass times length squared over time squared, rates and frequencies fall with time, gravity
    is length over time squared; angles and currents stay.
    """
    torque = mass * length**2 / time**2
    other = reduced_sessions([session], Scales(1.0 / torque, 1.0 / length, 1.0 / time))[0]
    return replace(other, runs=tuple(_plain(run) for run in other.runs))


def _plain(run: Run) -> Run:
    """Without the memory of what it was made from."""
    if as_recorded(run) is run:
        return run
    return Run(
        run.name, run.phase, run.cable, run.sample_rate_hz, run.trajectory, run.length, run.units, run.reader,
        run.attributes,
    )  # fmt: skip


def shuffled(session: Session, seed: int = 5) -> Session:
    """The runs in another order, under other names."""
    order = np.random.default_rng(seed).permutation(len(session.runs))
    runs = tuple(replace(session.runs[old], name=f"{k + 1:03d}") for k, old in enumerate(order))
    return replace(session, runs=runs)


@dataclass(frozen=True)
class EverySecond:
    """Every second sample of a run."""

    reader: ChannelReader

    def load(self, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
        """Samples ``start:stop`` of those that are left."""
        found = self.reader.load(names, 2 * start, max(2 * stop - 1, 2 * start))
        return {name: values[::2] for name, values in found.items()}


def at_half_the_rate(session: Session) -> Session:
    """Every second sample."""
    runs = tuple(
        replace(
            run, sample_rate_hz=0.5 * run.sample_rate_hz, length=(run.length + 1) // 2,
            reader=EverySecond(run.reader),
        )
        for run in session.runs
    )  # fmt: skip
    return replace(session, runs=runs)


CHANGES: Mapping[str, Callable[[Session], Session]] = {
    "as recorded": lambda session: session,
    "mass × 0.01": lambda session: resized(session, mass=0.01),
    "mass × 0.1": lambda session: resized(session, mass=0.1),
    "mass × 10": lambda session: resized(session, mass=10.0),
    "mass × 100": lambda session: resized(session, mass=100.0),
    "length × 0.3": lambda session: resized(session, length=0.3),
    "length × 3": lambda session: resized(session, length=3.0),
    "time × 0.5": lambda session: resized(session, time=0.5),
    "time × 2": lambda session: resized(session, time=2.0),
    "other order": shuffled,
    "half the rate": at_half_the_rate,
}
