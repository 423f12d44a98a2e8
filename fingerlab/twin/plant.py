"""The plant of one run and what an effect may change in it; a file an effect is in ``twin/effects``.

Strengths are chosen so that an effect matters on a bench whose joints carry some 0.04 N m, whose cable
carries some 5 N and whose motor sees some 0.07 N m. Ranges are what such an effect could plausibly
have on a printed finger with an RE40 drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fingerlab.physics.parameter import Parameter

ON_AIR, CONTACT, MOTOR_BENCH = "on_air", "contact", "motor_bench"

Values = Mapping[str, float]
"""Parameter -> value, SI."""


@dataclass(frozen=True)
class Truth:
    """What one bench really is, drawn once a session; nothing of it is told to the rig file.

    Attributes:
        factors: true over nominal value, by rig constant.
        arms: (MCP, PIP) moment arms in m, by cable. pretravel: m of cable left loose, by cable.
        posture: (MCP, PIP), rad, where the finger meets the load cell.
        sign: +1 or -1 for effects whose direction is chance. phase: rad, of periodic effects.
    """

    factors: dict[str, float]
    arms: dict[str, tuple[float, float]]
    pretravel: dict[str, float]
    posture: tuple[float, float]
    sign: float
    phase: float


@dataclass
class Sensors:
    """What stands between the plant and the recording; SI units."""

    angle_step: float
    angle_noise: float
    force_step: float
    force_noise: float
    current_step: float
    current_noise: float
    delay: float = 0.0  # s, joint angles and force against the motor's channels
    bridge_offset: float = 0.0  # relative offset of the angle sensors' bridges
    bridge_mismatch: float = 0.0  # relative amplitude mismatch of the two bridges
    drift: float = 0.0  # rad over a run, MCP sensor
    force_gain: float = 1.0


@dataclass
class Plant:
    """The plant of one run, ready to be changed by effects and then simulated."""

    plant: Any  # record of PLANT
    friction: Any  # array (3,) of FRICTION
    control: Any  # record of CONTROL
    sensors: Sensors
    truth: Truth
    cable: str


@dataclass(frozen=True)
class PlantEffect:
    """An effect as a change of the plant, which the first lines of its file say in words.

    Attributes:
        id: fixed name of ``effects.md``.
        parameters: the first is the strength; the others shape it.
        phases: phases of a session in which the effect acts.
        apply: changes the bench of one run in place, before the finger is hung and the load cell placed.
    """

    id: str
    parameters: tuple[Parameter, ...]
    phases: frozenset[str]
    apply: Callable[[Plant, Values], None]

    def defaults(self) -> dict[str, float]:
        """Default value of every parameter, SI."""
        return {p.name: p.default for p in self.parameters}


def constant(
    name: str, unit: str, default: float, low: float, high: float, source: str = "assumed"
) -> Parameter:
    """One number of an effect in the plant; its default is what is put in where nothing else is said."""
    return Parameter(unit, low, high, default, source, name=name, default=default)


FINGER = frozenset({ON_AIR, CONTACT})
DRIVE = frozenset({ON_AIR, CONTACT, MOTOR_BENCH})
TOUCH = frozenset({CONTACT})

RATIO = constant("pip_ratio", "", 0.6, 0.3, 1.0, "assumed: smaller hinge")
WIND_UP = constant("travel", "rad", 1.5e-3, 5e-4, 5e-3, "assumed: elastic wind-up before it slides")
GEAR_WIND_UP = constant("travel", "rad", 4e-3, 1e-3, 1e-2, "assumed: gearbox wind-up before it slides")


def per_joint(bench: Plant, field: str, value: float, ratio: float) -> None:
    """Add a value to a constant of the MCP, and its share to that of the PIP."""
    bench.plant[field + "_1"] += value
    bench.plant[field + "_2"] += value * ratio


def dry(bench: Plant, place: int, level: float, travel: float) -> None:
    """Friction that sticks: a level (N m) either way, over a travel (rad) before it slides."""
    law = bench.friction[place]
    law["forward"] += level
    law["backward"] += level
    law["travel"] = travel


def breaking_away(bench: Plant, places: dict[int, float], v: Values, level: float) -> None:
    """The same at each place by its share of the level (N m), higher by the excess where it breaks away."""
    for place, share in places.items():
        dry(bench, place, level * share, v["travel"])
        bench.friction[place]["breakaway"] += level * share * v["excess"]
        bench.friction[place]["stribeck_speed"] = v["speed"]


def spread(bench: Plant, place: int, level: float, travel: float) -> None:
    """Friction that builds up gradually to a level (N m) over a travel (rad)."""
    bench.friction[place]["spread"] += level
    bench.friction[place]["spread_travel"] = travel
