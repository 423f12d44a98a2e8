"""What can be wrong with the bench: catalogue ids, plausible strengths, and what each does to the bench.

Strengths are in the unit of the table. They are chosen for a bench whose joints carry some 0.04 N m,
whose cable carries some 5 N and whose motor gives some 0.07 N m on air.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .bench import Bench

Change = Callable[[Bench, float, np.random.Generator], None]
PIP_SHARE = (0.45, 0.8)  # of the MCP's value: a smaller hinge


@dataclass(frozen=True)
class EngineEffect:
    """One effect: strength from ``low`` to ``high`` in ``unit``, of either sign where ``signed``."""

    unit: str
    low: float
    high: float
    change: Change
    signed: bool = False

    def draw(self, rng: np.random.Generator) -> float:
        """A strength from the range, logarithmically even, of either sign where that is possible."""
        size = self.low * (self.high / self.low) ** rng.random()
        return float(size * (rng.choice([-1.0, 1.0]) if self.signed else 1.0))


def _pair(value: float, rng: np.random.Generator) -> list[float]:
    return [value, value * rng.uniform(*PIP_SHARE)]


def _viscous(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.viscous = [old + new for old, new in zip(bench.viscous, _pair(value, rng), strict=True)]


def _coulomb(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.dry = _pair(value, rng)


def _stribeck(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.dry = _pair(value, rng)
    law = (rng.uniform(0.8, 1.6), rng.uniform(0.15, 0.5))
    bench.stribeck.update(mcp=law, pip=law)


def _presliding(bench: Bench, value: float, rng: np.random.Generator) -> None:
    mcp, pip = _pair(value, rng)
    bench.spread = (mcp, pip, rng.uniform(0.07, 0.2))


def _hardening(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.cubic = _pair(value, rng)


def _stiffness(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.finger["mcp_stiffness"] *= 1.0 + value
    bench.finger["pip_stiffness"] *= 1.0 + value * rng.uniform(0.5, 1.2)


def _coupling(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.coupling = value


def _creep(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.relaxing = (
        value * bench.finger["mcp_stiffness"],
        value * bench.finger["pip_stiffness"],
        rng.uniform(0.4, 1.6),
    )


def _stop(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.stop = (value, rng.uniform(0.006, 0.012))


def _tilt(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.tilt = value


def _screws(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.screws = value


def _absolute_spin(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.absolute_spin = value


def _sheath(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.sheath = value


def _slack(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.pretravel = {cable: loose + value for cable, loose in bench.pretravel.items()}


def _stretch(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.cable_stiffness = 1.0 / (1.0 / bench.cable_stiffness + value)
    bench.cable_damping = max(bench.cable_stiffness * rng.uniform(2e-3, 6e-3), 5.0)


def _motor_coulomb(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.motor_dry = value


def _motor_viscous(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.motor_viscous += value


def _motor_inertia(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.motor["inertia"] += value


def _motor_stribeck(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.motor_dry = value
    bench.stribeck["motor"] = (rng.uniform(0.8, 1.6), rng.uniform(0.15, 0.5))


def _asymmetric(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.motor_dry = value
    bench.motor_bias = value * rng.uniform(0.3, 0.7) * rng.choice([-1.0, 1.0])


def _load_dependent(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.motor_load_share = value


def _motor_spring(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.motor_spring = value


def _ripple(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.ripple = (value, float(rng.integers(12, 36)), rng.uniform(0.0, 2.0 * math.pi))


def _delay(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.delay = value


def _bridge(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.sensor_harmonic = (value, rng.uniform(0.0, 2.0 * math.pi))


def _drift(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.drift = value


def _cell_gain(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.force_gain = 1.0 + value


def _lean(bench: Bench, value: float, rng: np.random.Generator) -> None:
    bench.lean = value


def _soft_tip(bench: Bench, value: float, rng: np.random.Generator) -> None:
    softer = 1.0 / (1.0 + value * bench.cell_stiffness)
    bench.cell_stiffness *= softer
    bench.cell_damping *= softer


E = EngineEffect
EFFECTS: dict[str, EngineEffect] = {
    "viscous_friction": E("N m s/rad at MCP", 1.5e-3, 4e-3, _viscous),
    "coulomb_friction": E("N m at MCP", 1.5e-3, 4e-3, _coulomb),
    "stribeck_friction": E("N m at MCP", 1.2e-3, 3.2e-3, _stribeck),
    "presliding_hysteresis": E("N m at MCP", 1.8e-3, 4.8e-3, _presliding),
    "spring_hardening": E("N m/rad^3 at MCP", 0.2, 0.55, _hardening),
    "stiffness_error": E("relative", 0.2, 0.4, _stiffness, signed=True),
    "joint_coupling": E("N m/rad", 0.015, 0.04, _coupling),
    "viscoelastic_creep": E("relative", 0.18, 0.5, _creep),
    "joint_stop": E("rad of PIP, extended", 0.24, 0.36, _stop),
    "gravity_tilt": E("rad", 0.15, 0.4, _tilt, signed=True),
    "added_mass": E("kg", 4e-3, 1e-2, _screws),
    "distal_rotation": E("share", 1.0, 1.0, _absolute_spin),
    "capstan_friction": E("share of tension", 0.1, 0.28, _sheath),
    "cable_slack": E("m", 2e-3, 5.5e-3, _slack),
    "cable_stretch": E("m/N", 2e-4, 6e-4, _stretch),
    "motor_coulomb_friction": E("N m", 4e-3, 1e-2, _motor_coulomb),
    "motor_viscous_friction": E("N m s/rad", 2.4e-3, 6.5e-3, _motor_viscous),
    "motor_inertia": E("kg m^2", 2.5e-4, 6.5e-4, _motor_inertia),
    "motor_stribeck_friction": E("N m", 2.7e-3, 7e-3, _motor_stribeck),
    "asymmetric_friction": E("N m", 4e-3, 1e-2, _asymmetric),
    "load_dependent_friction": E("share of torque", 0.08, 0.2, _load_dependent),
    "motor_spring": E("N m/rad", 0.02, 0.05, _motor_spring),
    "torque_ripple": E("N m", 2.5e-3, 6.5e-3, _ripple),
    "transport_delay": E("s", 0.02, 0.07, _delay),
    "angle_sensor_nonlinearity": E("rad", 0.018, 0.05, _bridge),
    "sensor_drift": E("rad over a run", 0.018, 0.05, _drift, signed=True),
    "load_cell_gain": E("relative", 0.1, 0.25, _cell_gain, signed=True),
    "contact_angle": E("rad", 0.27, 0.7, _lean, signed=True),
    "contact_compliance": E("m/N", 6e-4, 1.6e-3, _soft_tip),
}
"""Effects that this bench can have, by catalogue id."""
