"""Motor commands from the JSON text of a run's ``trajectory``; the rig and the simulated rig use the same.

Every trajectory is ``envelope(t) * (offset + amplitude * wave(t))``: the envelope leads from rest to
the motion in ``ramp_s`` seconds, ``wave`` stays within -1 to 1.

====================  ======================================================================
key                   meaning (default)
====================  ======================================================================
``kind``              ``sine``, ``chirp``, ``multisine``, ``steps``, ``ramp_hold``, ``blocked`` (the motor
                      holds ``offset_deg``), ``file``, or ``torque`` (the motor's torque, not its angle)
``amplitude_deg``     half of the range at the pulley, degrees
``offset_deg``        middle of the range, degrees (0)
``frequency_hz``      sine; start of the chirp; base of the multisine; steps or ramps a second (1)
``end_frequency_hz``  end of the chirp, reached at the end of the run (4 times the start)
``frequencies_hz``    lines of the multisine (0.3, 0.7, 1.1, 1.9 and 2.7 times the base)
``phase_deg``         phase of a sine at the start (0)
``seed``              which sequence of step levels (0)
``rise_s``            time from one step level to the next (0.15)
``duration_s``        length of the run (20)
``until_stopped``     true in place of a length: it goes on until it is brought to rest; a chirp goes up
                      and down and steps come again, each of the length ``pattern_s`` (60)
``ramp_s``            time of the envelope (1.5)
``file``              text table of time (s) and angle (degrees), rows in the order of time; gives
                      amplitude, offset and, where none is given, duration
``time_s``            the same as two lists in place of a file, with ``angle_deg``
``torque_n_m``        in place of ``angle_deg`` for the kind ``torque``: N m at the gearbox output
``most_force_n``      of a ``torque``: the run ends as a fault where the load cell shows more, N
``most_position_deg`` the same for the motor's position, degrees at the pulley
====================  ======================================================================

A ``torque`` is given as a file or as lists. There ``amplitude`` and ``offset`` are N m, not rad: the loop
sends the current that makes the torque, and holds no position.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import is_number, read_object
from fingerlab.sessions.model import Array
from fingerlab.sessions.text_table import inspect_table, read_blocks

MOST_FORCE, MOST_POSITION = "most_force_n", "most_position_deg"
MOST_LINES = 100
"""Of a multisine: a run of 20 s tells lines 0.05 Hz apart, which are 100 up to 5 Hz; assumed."""
MOST_LOOKED_AT = 200_000
"""Moments at which a multisine's peak is looked for, at most; 20 s with lines up to 5 Hz take 5,000."""
MOST_S = 86_400.0
"""Of a run."""
INLINE_POINTS = 400
"""Longer lists are not kept in a run's attributes, which HDF5 limits to 64 kB; the channel has it all."""


@dataclass(frozen=True)
class Points:
    """What the points are: key of their list, ending of amplitude and offset, and words for errors."""

    key: str
    ending: str
    words: str
    words_of_table: str


POSITION = Points("angle_deg", "deg", "angles", "angle in degrees")
TORQUE = Points("torque_n_m", "n_m", "torques", "torque in N m")
FORCE = Points("force_n", "n", "forces", "force in N")


def with_points(settings: Mapping[str, Any], where: str, what: Points = POSITION) -> dict[str, Any]:
    """Settings with ``time_s``, the list of points, and the amplitude and offset that follow.

    Raises:
        UserError: the table cannot be read, holds fewer than two rows, or its time does not increase.
    """
    if "time_s" in settings or what.key in settings:
        time, points = _listed(settings, where, what)
        found = dict(settings)
    else:
        time, points, found = *_table(settings, where, what), dict(settings)
        path = Path(str(settings["file"]))
        found |= {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    if len(time) < 2 or len(time) != len(points):
        raise UserError(
            f"{where} has {len(time)} times and {len(points)} {what.words}; it should have two rows or more."
        )
    if not (np.isfinite(time).all() and np.isfinite(points).all() and (np.diff(time) > 0).all()):
        raise UserError(f"{where} has a time that does not increase or a value that is not a number.")
    low, high = float(points.min()), float(points.max())
    found.setdefault("pattern_s" if found.get("until_stopped") else "duration_s", float(time[-1]))
    return found | {
        "time_s": time.tolist(),
        what.key: points.tolist(),
        f"amplitude_{what.ending}": (high - low) / 2,
        f"offset_{what.ending}": (high + low) / 2,
    }


def unit_shape(settings: Mapping[str, Any], what: Points = POSITION) -> tuple[Array, Array]:
    """Times (s) and the shape of the motion within -1 to 1, each of shape (n,)."""
    points = np.asarray(settings[what.key], dtype=np.float64)
    half = float(settings[f"amplitude_{what.ending}"])
    middle = float(settings[f"offset_{what.ending}"])
    shape = (points - middle) / half if half else np.zeros_like(points)
    return np.asarray(settings["time_s"], dtype=np.float64), shape


def without_long_lists(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as they are stored with a run."""
    if len(settings.get("time_s", ())) <= INLINE_POINTS:
        return dict(settings)
    return {key: value for key, value in settings.items() if key not in ("time_s", POSITION.key, TORQUE.key)}


def _listed(settings: Mapping[str, Any], where: str, what: Points) -> tuple[Array, Array]:
    try:
        time = np.asarray(settings["time_s"], dtype=np.float64).reshape(-1)
        points = np.asarray(settings[what.key], dtype=np.float64).reshape(-1)
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{where} should have two lists of numbers, 'time_s' and '{what.key}'.") from None
    return time, points


def _table(settings: Mapping[str, Any], where: str, what: Points) -> tuple[Array, Array]:
    if not isinstance(settings.get("file"), str):
        raise UserError(
            f"{where} is of kind '{settings.get('kind')}'; it should name in 'file' a text table of time "
            f"in s and {what.words_of_table}, or hold the lists 'time_s' and '{what.key}'."
        )
    table = inspect_table(settings["file"])
    if table.columns < 2:
        raise UserError(
            f"{table.path} has one column; it should have two, time in s and {what.words_of_table}."
        )
    rows = np.concatenate(list(read_blocks(table)))
    return rows[:, 0], rows[:, 1]


MULTISINE_RATIOS = (0.3, 0.7, 1.1, 1.9, 2.7)
"""Lines of a multisine that names none: no line is a harmonic of another, so that harmonics show."""

DEFAULT_DURATION_S = 20.0
DEFAULT_PATTERN_S = 60.0
"""Of a motion without an end: so long a chirp goes up, and steps take to come again (assumed)."""
REPEATED = ("chirp", "steps")
"""Kinds whose motion depends on the length of its pattern."""
DEFAULT_RAMP_S = 1.5

KIND_TITLES = {
    "sine": "Sine",
    "chirp": "Chirp",
    "multisine": "Multisine",
    "steps": "Steps",
    "ramp_hold": "Ramp and hold",
    "blocked": "Blocked",
    "file": "From a file",
    "torque": "Torque from a file",
}
BY_POINTS = ("file", "torque")
"""Kinds that are given point by point: of the angle, or of the torque itself."""
_MOVES = ("sine", "chirp", "multisine", "steps", "ramp_hold")


@dataclass(frozen=True)
class TrajectoryParameter:
    """A number of a trajectory, from which a form makes its field.

    Attributes:
        name: as in the JSON text; ``lines`` stands for the first lines of ``frequencies_hz``.
        title, unit, letter: of its label, and the letter that is its key there, if any.
        kinds: that have it. help: its name, and what it is.
        start, low, high, decimals, step: of the field, in ``unit``.
        unsaid: whether the settings leave it out where it is ``start``, which is what they mean without it.
    """

    name: str
    title: str
    unit: str
    letter: str
    kinds: tuple[str, ...]
    help: str
    start: float
    low: float
    high: float
    decimals: int
    step: float
    unsaid: bool = False


_ALL = len(MULTISINE_RATIOS)
_RATIOS = ", ".join(f"{ratio:g}" for ratio in MULTISINE_RATIOS)
PARAMETERS = {
    one.name: one
    for one in (
        TrajectoryParameter(
            "amplitude_deg", "Amplitude", "°", "m", _MOVES, "Amplitude: half of the range, at the pulley.",
            15.0, 0.0, 120.0, 1, 1.0,
        ),
        TrajectoryParameter(
            "frequency_hz", "Frequency", "Hz", "r", _MOVES, "Frequency: of the motion.",
            1.0, 0.01, 10.0, 2, 0.1,
        ),
        TrajectoryParameter(
            "end_frequency_hz", "To", "Hz", "T", ("chirp",), "End frequency of the chirp.",
            3.0, 0.01, 10.0, 2, 0.1,
        ),
        TrajectoryParameter(
            "rise_s", "Rise", "s", "i", ("steps",), "Rise: time from one step to the next.",
            0.15, 0.01, 2.0, 2, 0.05,
        ),
        TrajectoryParameter(
            "seed", "Sequence", "", "q", ("steps",),
            "Sequence: seed of the steps' heights; the same gives the same.",
            0.0, 0.0, 99_999.0, 0, 1.0, unsaid=True,
        ),
        TrajectoryParameter(
            "lines", "Lines", "", "n", ("multisine",), f"Lines: the first of {_RATIOS} times the frequency.",
            _ALL, 1.0, _ALL, 0, 1.0,
        ),
        TrajectoryParameter(
            "offset_deg", "Offset", "°", "O", (*_MOVES, "blocked"),
            "Offset: middle of the range, at the pulley.",
            22.0, -180.0, 180.0, 1, 1.0,
        ),
        TrajectoryParameter(
            "ramp_s", "Ramp", "s", "", tuple(KIND_TITLES), "Ramp: time from rest to the whole motion.",
            DEFAULT_RAMP_S, 0.0, 60.0, 2, 0.5, unsaid=True,
        ),
    )
}  # fmt: skip
"""In the order in which a form has them; limits are those of a bench of this size (assumed)."""


@dataclass(frozen=True)
class Trajectory:
    """A motor command as a function of time.

    Attributes:
        kind: as in the JSON text. duration: s. ramp: s. amplitude, offset: rad at the pulley; N m at the
            gearbox output for the kind ``torque``.
        wave: takes times (s, shape (n,)), returns shape (n,) within -1 to 1.
        settings: the JSON object it was made from, as stored in a session.
    """

    kind: str
    duration: float
    ramp: float
    amplitude: float
    offset: float
    wave: Callable[[Array], Array]
    settings: Mapping[str, Any]

    @property
    def is_torque(self) -> bool:
        """Whether it commands the motor's torque instead of its position."""
        return self.kind == "torque"

    def command(self, time: Array) -> Array:
        """Motor command at the pulley, rad (or N m), shape (n,), at times in s; rest before zero."""
        if self.ramp > 0:
            share = np.clip(time / self.ramp, 0.0, 1.0)
            envelope = 0.5 - 0.5 * np.cos(np.pi * share)
        else:
            envelope = np.where(time >= 0, 1.0, 0.0)
        return np.asarray(envelope * (self.offset + self.amplitude * self.wave(time)))


def read_trajectory(source: str | Mapping[str, Any], where: str = "the trajectory") -> Trajectory:
    """A trajectory from JSON text or the object it holds.

    Raises:
        UserError: the text is not JSON, or the kind is unknown, or a number is missing or impossible.
    """
    settings = _object(source, where)
    kind = settings.get("kind")
    if str(kind) not in WAVES:
        raise UserError(f"{where} has the kind {kind!r}; it should be one of {', '.join(WAVES)}.")
    if kind in ("file", "torque"):
        settings = with_points(settings, where, TORQUE if kind == "torque" else POSITION)
    endless = settings.get("until_stopped", False)
    if not isinstance(endless, bool):
        raise UserError(f"{where} has 'until_stopped' = {endless!r}; it should be true or false.")
    name, usual = ("pattern_s", DEFAULT_PATTERN_S) if endless else ("duration_s", DEFAULT_DURATION_S)
    duration = _number(settings, name, usual, where, positive=True)
    if duration > MOST_S:
        raise UserError(f"{where} has '{name}' = {duration:g}; a run lasts at most a day, {MOST_S:g} s.")
    ramp = _number(settings, "ramp_s", DEFAULT_RAMP_S, where)
    if ramp < 0:
        raise UserError(f"{where} has 'ramp_s' = {ramp:g}; it should be zero or more seconds.")
    if kind == "torque":
        for bound in (MOST_FORCE, MOST_POSITION):
            if bound in settings:
                _number(settings, bound, None, where)
        amplitude, offset = (
            _number(settings, f"{name}_n_m", None, where) for name in ("amplitude", "offset")
        )
    else:
        needed = 0.0 if kind == "blocked" else None
        amplitude = math.radians(_number(settings, "amplitude_deg", needed, where))
        offset = math.radians(_number(settings, "offset_deg", 0.0, where))
    return Trajectory(
        kind=str(kind),
        duration=duration,
        ramp=ramp,
        amplitude=amplitude,
        offset=offset,
        wave=WAVES[str(kind)](settings, duration, where),
        settings=without_long_lists(settings),
    )


def _sine(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    frequency = _number(settings, "frequency_hz", 1.0, where, positive=True)
    phase = math.radians(_number(settings, "phase_deg", 0.0, where))
    return lambda time: np.sin(2 * np.pi * frequency * time + phase)


def _chirp(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    start = _number(settings, "frequency_hz", 1.0, where, positive=True)
    end = _number(settings, "end_frequency_hz", 4.0 * start, where, positive=True)
    rate = (end - start) / duration

    def wave(time: Array) -> Array:
        if not settings.get("until_stopped"):
            t = np.clip(time, 0.0, duration)
            return np.sin(2 * np.pi * (start * t + 0.5 * rate * t * t))
        # Up and down again: frequency and angle then have no jump where it begins anew.
        whole, t = np.divmod(np.maximum(time, 0.0), 2.0 * duration)
        back = np.maximum(t - duration, 0.0)
        both = start * t + 0.5 * rate * t * t - rate * back * back
        return np.sin(2 * np.pi * (both + whole * (start + end) * duration))

    return wave


def _multisine(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    base = _number(settings, "frequency_hz", 1.0, where, positive=True)
    lines = settings.get("frequencies_hz", [ratio * base for ratio in MULTISINE_RATIOS])
    if not isinstance(lines, list | tuple) or not lines or not all(_is_positive(f) for f in lines):
        raise UserError(f"{where} has 'frequencies_hz' = {lines!r}; it should be a list of positive numbers.")
    if len(lines) > MOST_LINES:
        raise UserError(
            f"{where} has {len(lines)} numbers in 'frequencies_hz'; it should have {MOST_LINES} at most."
        )
    frequency = np.asarray(lines, dtype=np.float64)
    order = np.arange(len(frequency))
    phase = -np.pi * order * (order + 1) / len(frequency)  # Schroeder 1970: a low crest

    def raw(time: Array) -> Array:
        return np.asarray(np.sin(2 * np.pi * np.outer(time, frequency) + phase).sum(axis=1))

    step = max(0.02 / float(frequency.max()), duration / MOST_LOOKED_AT)
    peak = float(np.max(np.abs(raw(np.arange(0.0, duration, step)))))
    return lambda time: raw(time) / peak


def _steps(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    hold = 1.0 / _number(settings, "frequency_hz", 1.0, where, positive=True)
    rise = _number(settings, "rise_s", 0.15, where, positive=True)
    if rise > hold:
        raise UserError(f"{where} has 'rise_s' = {rise:g}; it should not exceed the {hold:g} s of a step.")
    seed = int(_number(settings, "seed", 0.0, where))
    rng = np.random.default_rng(abs(seed))
    endless, count = bool(settings.get("until_stopped")), math.ceil(duration / hold) + 2
    # One level from each fifth of the range in random order, again and again: even coverage.
    fifths = np.concatenate([rng.permutation(5) for _ in range(math.ceil(count / 5))])[:count]
    level = (fifths + rng.random(count)) / 2.5 - 1.0

    def wave(time: Array) -> Array:
        position = (np.maximum(time, 0.0) if endless else np.clip(time, 0.0, duration)) / hold
        index = position.astype(np.int64)
        share = np.clip((position - index) * hold / rise, 0.0, 1.0)
        blend = 0.5 - 0.5 * np.cos(np.pi * share)
        before = level[np.maximum(index - 1, 0) % count]
        return np.asarray(before + blend * (level[index % count] - before))

    return wave


def _ramp_hold(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    frequency = _number(settings, "frequency_hz", 1.0, where, positive=True)
    corners = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # up, hold, down, hold
    return lambda time: np.interp((time * frequency) % 1.0, corners, np.array([-1.0, 1.0, 1.0, -1.0, -1.0]))


def _blocked(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    if settings.get("amplitude_deg", 0) != 0:
        raise UserError(
            f"{where} is 'blocked' and has 'amplitude_deg' = {settings['amplitude_deg']!r}; a blocked motor "
            "only has 'offset_deg'."
        )
    return lambda time: np.zeros_like(time, dtype=np.float64)


def _file(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    moments, shape = unit_shape(settings, POSITION)
    return lambda time: np.interp(time, moments, shape)


def _torque(settings: Mapping[str, Any], duration: float, where: str) -> Callable[[Array], Array]:
    moments, shape = unit_shape(settings, TORQUE)
    return lambda time: np.interp(time, moments, shape)


WAVES: dict[str, Callable[[Mapping[str, Any], float, str], Callable[[Array], Array]]] = {
    "sine": _sine,
    "chirp": _chirp,
    "multisine": _multisine,
    "steps": _steps,
    "ramp_hold": _ramp_hold,
    "blocked": _blocked,
    "file": _file,
    "torque": _torque,
}
"""Kinds of trajectory."""


def _object(source: str | Mapping[str, Any], where: str) -> Mapping[str, Any]:
    if isinstance(source, str):
        return read_object(
            source,
            where,
            'it should look like {"kind": "sine", "amplitude_deg": 15, "frequency_hz": 1, "offset_deg": 22}',
        )
    if not isinstance(source, Mapping):
        raise UserError(f"{where} is not a JSON object with 'kind', 'amplitude_deg' and the like.")
    return source


def _is_positive(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, int | float) and 0 < value < math.inf


def _number(
    settings: Mapping[str, Any], name: str, default: float | None, where: str, positive: bool = False
) -> float:
    value = settings.get(name, default)
    if value is None:
        raise UserError(f"{where} lacks {name!r}, a number.")
    if not is_number(value):
        raise UserError(f"{where} has {name!r} = {value!r}; it should be a finite number.")
    if positive and value <= 0:
        raise UserError(f"{where} has {name!r} = {value:g}; it should be greater than zero.")
    return float(value)
