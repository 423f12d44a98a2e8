"""What a motor alone was seen to do, and motions that ask little more of it.

Of a stranger's machine nobody knows what drive, guides and coupling bear: what the recordings show is all
that a proposal may rest on. A crude law of the torque (acceleration, angle, speed and its direction) says
what a motion would take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.diagnosis.settings import ALIKE_SHARE, MOST_OF_SEEN
from fingerlab.diagnosis.signals.filters import decimate
from fingerlab.diagnosis.signals.segments import is_fragmented, is_too_short, segments_of
from fingerlab.physics.motion import Motion
from fingerlab.sessions.model import Array, Session

_ACCELERATION, _POSITION = 0, 1
"""Places of two columns that are one another's multiple in a single sine."""


@dataclass(frozen=True)
class SeenLimits:
    """The largest magnitudes of the runs of a motor alone, in the narrow band.

    Attributes:
        speed: rad/s. acceleration: rad/s^2.
        laws: coefficients of the torque for the columns of :func:`_columns`, (laws, 5): two where the
            recordings do not tell an inertia from a spring.
        torques: the largest by each law, N m, (laws,): noise is nothing that a drive has to bear.
        travel: lowest and highest position, rad; None where the motor turns on and on.
    """

    speed: float
    acceleration: float
    laws: Array
    torques: Array
    travel: tuple[float, float] | None = None

    def within(self, amplitude_deg: float) -> tuple[float, float | None]:
        """Amplitude and offset, degrees at the pulley, of a motion that stays where the machine has been.

        No offset where it turns on and on.
        """
        if self.travel is None:
            return amplitude_deg, None
        low, high = np.degrees(self.travel)
        return min(amplitude_deg, float(high - low) / 2.0), float(high + low) / 2.0

    def _too_quick(self, motion: Motion) -> bool:
        """Whether a motion is faster, or turns round more sharply, than it may be."""
        _, speed, acceleration = _narrow(motion)
        return bool(
            np.max(np.abs(speed)) > MOST_OF_SEEN * self.speed
            or np.max(np.abs(acceleration)) > MOST_OF_SEEN * self.acceleration
        )

    def allows(self, motion: Motion, load: float) -> bool:
        """Whether a motion against a known load, N m, asks for no more than it may."""
        if self._too_quick(motion):
            return False
        wanted = np.abs(self.laws @ _columns(*_narrow(motion))).max(axis=1) + abs(load)
        return bool(np.all(wanted <= MOST_OF_SEEN * self.torques))


def seen_limits(sessions: Sequence[Session]) -> SeenLimits | None:
    """What the runs of a motor alone show; None where none of them can be read."""
    parts, torques, loads = list[Array](), list[Array](), list[Array]()
    turns = False
    for session in sessions:
        for run in session.runs:
            if run.phase != "motor_bench" or is_too_short(run) or is_fragmented(run):
                continue
            for motion in segments_of(run, session.rig):
                now = _narrow(motion)
                if not now.shape[-1]:
                    continue
                load = np.zeros_like(motion.torque) if motion.load is None else motion.load
                torque, known = decimate(np.stack((motion.torque, load))[:, motion.lead :])
                parts.append(now)
                torques.append(torque)
                loads.append(known)
                turns |= bool(np.ptp(now[0]) > 2.0 * np.pi)
    if not parts:
        return None
    joined, torque, load = np.concatenate(parts, axis=1), np.concatenate(torques), np.concatenate(loads)
    _, speed, acceleration = np.abs(joined).max(axis=1)
    laws, largest = _laws(_columns(*joined), torque, load, turns)
    travel = None if turns else (float(joined[0].min()), float(joined[0].max()))
    return SeenLimits(float(speed), float(acceleration), laws, largest, travel)


def _narrow(motion: Motion) -> Array:
    """Position, speed and acceleration behind the lead, as the diagnosis looks at them, (3, n)."""
    wide = np.stack((motion.position, motion.velocity, motion.acceleration))
    return decimate(wide[:, motion.lead :])


def _columns(position: Array, speed: Array, acceleration: Array) -> Array:
    """What the torque is told by, (5, n): acceleration, angle from the middle, speed, direction, one.

    Where the middle of a motion is, its operator chooses.
    """
    middle = 0.5 * (position.max() + position.min())
    return np.stack((acceleration, position - middle, speed, np.sign(speed), np.ones_like(speed)))


def _laws(columns: Array, torque: Array, load: Array, turns: bool) -> tuple[Array, Array]:
    """Coefficients of the torque for the columns, (laws, 5), and the largest torque by each, (laws,).

    Of a motor that turns on no angle counts.
    """
    every = list(range(len(columns)))
    inert, elastic = ([k for k in every if k != left] for left in (_POSITION, _ACCELERATION))
    together = float(np.sum(columns[_ACCELERATION] * columns[_POSITION]))
    squares = float(np.sum(columns[_ACCELERATION] ** 2) * np.sum(columns[_POSITION] ** 2))
    alike = together**2 > ALIKE_SHARE * squares
    result, largest = [], []
    for mine in [inert] if turns else [inert, elastic] if alike else [every]:
        basis = np.vstack((columns[mine], load))
        sizes = np.maximum(np.sqrt(np.mean(basis**2, axis=1)), np.finfo(float).tiny)
        found = np.linalg.lstsq((basis / sizes[:, None]).T, torque, rcond=1e-6)[0] / sizes
        law = np.zeros(len(columns))
        law[mine] = found[:-1]
        result.append(law)
        largest.append(float(np.abs(found @ basis).max()))
    return np.array(result), np.array(largest)
