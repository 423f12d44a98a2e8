"""What is wrong with channels as they are read: a zero, a scale, a lag; taken off where runs are read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fingerlab.diagnosis.signals.scales import Scales
from fingerlab.sessions.model import CHANNEL_UNITS, Array, Run, Session

FORCE, JOINTS, TORQUE = "endpoint_force", "joint_angles", "motor_torque"
MCP, PIP, MOTOR = "mcp_angle", "pip_angle", "motor_position"
CHANNELS = {JOINTS: (MCP, PIP), **{name: (name,) for name in (FORCE, MCP, PIP, MOTOR, TORQUE)}}
"""Channels of one sensor, or of two that are alike: what is wrong with one is wrong with the other."""

_ERRORS = "reading_errors"
"""Attribute of a run: the :class:`ReadingError` of each of its channels that has one."""


class ReadingError(NamedTuple):
    """What is there is ``(1 + gain) * (reading - zero) + lag * rate + lag_square * second derivative``.

    ``zero`` in the channel's unit, ``gain`` a share, ``lag`` in s, ``lag_square`` in s^2.
    """

    zero: float = 0.0
    gain: float = 0.0
    lag: float = 0.0
    lag_square: float = 0.0

    @property
    def late(self) -> bool:
        """Whether it is not the same at every moment."""
        return bool(self.lag or self.lag_square)

    def then(self, other: ReadingError) -> ReadingError:
        """What both are together; ``other`` is an error of what is left when this one is taken off."""
        mine, its = 1.0 + self.gain, 1.0 + other.gain
        return ReadingError(
            self.zero + other.zero / mine,
            mine * its - 1.0,
            its * self.lag + mine * other.lag,
            its * self.lag_square + self.lag * other.lag + mine * other.lag_square,
        )


NO_ERROR = ReadingError()
ReadingErrors = Mapping[str, ReadingError]
"""Of some of ``CHANNELS``, those that have one."""

RunZeros = Mapping[tuple[str, str], ReadingErrors]
"""Of single runs, by session and name: the zero that a channel has in that run alone."""


def with_run_zeros(sessions: Sequence[Session], zeros: RunZeros) -> tuple[Session, ...]:
    """The sessions, with the zeros of single runs told to these, on top of what is wrong in all."""
    if not zeros:
        return tuple(sessions)
    return tuple(
        replace(s, runs=tuple(with_errors(run, zeros.get((str(s.path), run.name), {})) for run in s.runs))
        for s in sessions
    )


def with_reading_errors(sessions: Sequence[Session], errors: ReadingErrors) -> tuple[Session, ...]:
    """The sessions, with the errors of their channels told to their runs."""
    if not errors:
        return tuple(sessions)
    return tuple(replace(s, runs=tuple(with_errors(run, errors) for run in s.runs)) for s in sessions)


def with_errors(run: Run, errors: ReadingErrors) -> Run:
    """The run, with the errors of its channels told to it."""
    told: dict[str, ReadingError] = dict(run.attributes.get(_ERRORS, {}))
    for of, error in errors.items():
        for name in CHANNELS[of] if error != NO_ERROR else ():
            told[name] = told.get(name, NO_ERROR).then(error)
    return replace(run, attributes={**run.attributes, _ERRORS: told})


def in_si(errors: ReadingErrors, scales: Scales) -> ReadingErrors:
    """Errors in reduced units, in SI."""
    return {name: _times(error, name, scales.of) for name, error in errors.items()}


def in_reduced_units(errors: ReadingErrors, scales: Scales) -> ReadingErrors:
    """Errors in SI, in reduced units."""
    return {name: _times(error, name, lambda unit: 1.0 / scales.of(unit)) for name, error in errors.items()}


def _times(error: ReadingError, name: str, size: Callable[[str], float]) -> ReadingError:
    unit, second = CHANNEL_UNITS[CHANNELS[name][0]], size("s")
    return ReadingError(error.zero * size(unit), error.gain, error.lag * second, error.lag_square * second**2)


def corrected(run: Run, name: str, values: Array) -> Array:
    """Samples of a channel, (n,), without what was told to be wrong with its reading."""
    error: ReadingError = run.attributes.get(_ERRORS, {}).get(name, NO_ERROR)
    if error == NO_ERROR:
        return values
    found = (1.0 + error.gain) * (values - error.zero)
    if error.late:
        rate = np.gradient(values, 1.0 / run.sample_rate_hz)
        found += error.lag * rate + error.lag_square * np.gradient(rate, 1.0 / run.sample_rate_hz)
    return np.asarray(found)
