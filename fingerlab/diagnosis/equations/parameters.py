"""Unknowns that every model carries, their plausible ranges, and what ties them together.

The thesis uses the arms found with the extension cable for the flexion cable as they are. Plain fingers do
not bear that out: a palmar cable in its guides pulls on the PIP joint with a smaller arm than a dorsal one
over the knuckle. What is taken for normal is a ratio for each joint and how far fingers scatter about it.
Inside that the flexion cable's arms are as free as those of the extension cable; beyond it they cost so much
that a fit stays at its edge, unless an effect says that the routing is another one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.diagnosis.settings import (
    ARM_RATIO_CURVATURE,
    ARM_RATIO_SPREADS,
    COASTING_S,
    CURRENT_ZERO_A,
    EARLY_LAGS,
    EXACT,
    MOST_CHANGES,
    MOST_STICKING_SHARE,
    ROTOR_SPREAD,
    SLIP_STIFFNESSES,
    STICKING_SHARE,
    USUAL_LAG_S,
    USUAL_LAG_SAMPLES,
    USUAL_RATIOS,
    USUAL_SPEED,
    USUAL_SPREAD,
)
from fingerlab.diagnosis.signals.scales import Scales
from fingerlab.effects.base import Effect
from fingerlab.physics.parameter import Parameter, Role
from fingerlab.rig.file import FITTED_CONSTANTS, Rig
from fingerlab.sessions.model import Array

ARMS, LOSSES = ("arm_mcp", "arm_pip"), ("loss_mcp", "loss_pip")
"""Moment arms, m, and constant losses, N m, of the two joints; a value for each routing."""
SLIPS = tuple(f"lateral_slip_{stiffness:g}" for stiffness in SLIP_STIFFNESSES)
CABLE_OFFSET = "offset"
"""Cable that is wound where the joints are straight, m: the motor's zero, for each routing."""
CHANGED_OFFSET = "offset_of_change_"
"""What the offset is otherwise in runs with a known change, m: the change's number follows."""
RUBS = "lateral_rub"
"""Friction coefficient of a tip that slides."""
SET_DOWN = "lateral_constant"
"""What a tip that sticks was set down with, N."""
TIP_LAWS = {"slides": SLIPS, "sticks": (SET_DOWN,)}
"""What else a tip does, of which a model holds one: slide back and forth, its sideways force following the
normal one until friction gives way; or stick, and keep what it was set down with."""


TORQUE_ZERO = "torque_zero"
"""The unknown that a current's zero adds to the motor's torque, N m."""


TORQUE_LAG, TORQUE_LAG_SQUARE = "bench_lag", "bench_lag_square"
"""By how much the torque of a motor alone is logged later than its position, s: a filter of its current, or
two clocks; below zero of a drive that holds its torque until the next reading of its position. Beside a
finger both are channels of one card."""
BENCH_RANGES = {
    "bench_inertia": Parameter("kg m^2", 0.0, 1e4, 1e-3, open=True),
    "bench_gain": Parameter("1", -100.0, 100.0, 1.0, open=True),
    "bench_offset": Parameter("N m", -10.0, 10.0, 0.1, open=True),
    "bench_trace": Parameter("N m s/rad", 0.0, 2e-4, 5e-5),
}
"""Of a motor alone, whose equation is fitted as it comes."""


OF_CONSTANT = {"torque_constant": "torque_gain", "inertia": "rotor_inertia"}
"""Constants of a rig file whose unknowns go by another name: by what share the torque reads too high, and the
inertia of the motor beyond the rig file's."""
RIG_CONSTANTS = (*FITTED_CONSTANTS, "torque_constant", "inertia")
"""Constants of a rig file that every model leaves open within their tolerances."""
KNOWN_CONSTANTS = frozenset(OF_CONSTANT.get(name, name) for name in (*RIG_CONSTANTS, "force_gain"))
"""Unknowns of which a rig file or a data sheet says how far off they usually are."""
ARM = Parameter("m", 0.002, 0.04, 0.01, source="assumed: from 2 to 40 mm", default=0.01, open=True)
KNOCK_GAIN = "knock_gain"
"""By what share a knock of a tip that lands was harder than the load cell's one or two samples of it say."""
IN_CONTACT = (
    "force_gain",
    KNOCK_GAIN,
    "lateral",
    SET_DOWN,
    "lateral_spring",
    RUBS,
    *SLIPS,
    "tip_tilt",
    "tip_compliance",
)
"""What a finger that touches nothing says nothing of."""


def nuisance_ranges(
    rig: Rig, rate: float = math.inf, speed: float = 0.0, tip_sticks: bool = False
) -> dict[str, Parameter]:
    """Plausible range of every unknown that each model carries; ``typical`` is one standard deviation.

    Constants of the rig move within 2.5 tolerances and no further: a prior alone lets a mass absorb what
    it should not.

    Args:
        rate: samples a second, of the run that has fewest. speed: of a machine of one axis in the run that
            moves fastest, rad/s, root mean square; 0: as the thesis' motor moves.
        tip_sticks: no run shows that the tip slides: it may hold any share of the force within its friction,
            whatever it was set down with. Of one that slides friction turns round, and a share that stays is
            a force that leans.
    """
    lag = max(USUAL_LAG_S, USUAL_LAG_SAMPLES / rate)
    bench = BENCH_RANGES | {
        TORQUE_LAG: Parameter("s", -EARLY_LAGS * lag, 10.0 * lag, lag),
        # Half its square of a pure lag, more of a filter that swings.
        TORQUE_LAG_SQUARE: Parameter("s^2", 0.0, (10.0 * lag) ** 2, 5.0 * lag**2),
    }
    if rig.motor.inertia is not None:
        bench["bench_trace"] = _trace_of(rig.motor.inertia)
    elif speed > USUAL_SPEED:  # a trace is what takes a trace of the torque, however fast the machine turns
        usual, share = bench["bench_trace"], USUAL_SPEED / speed
        bench["bench_trace"] = replace(usual, high=usual.high * share, typical=usual.typical * share)
    if rig.finger is None:
        return bench
    zero = rig.motor.torque_constant * rig.motor.gear_ratio * CURRENT_ZERO_A
    ranges = bench | {
        TORQUE_ZERO: Parameter("N m", -2.5 * zero, 2.5 * zero, zero, source="assumed: the current's zero"),
        "load_gain": Parameter("1", -0.05, 0.05, 0.02, source="assumed: a load known to 2 %"),
    }
    for name in (*FITTED_CONSTANTS, "torque_constant"):
        tolerance = max(rig.tolerance_of(name), EXACT)
        ranges[OF_CONSTANT.get(name, name)] = Parameter(
            "1", -2.5 * tolerance, 2.5 * tolerance, tolerance, source="rig file"
        )
    inertia = rig.motor.inertia
    spread = ROTOR_SPREAD if inertia is None else inertia * rig.tolerance_of("inertia")
    spread = max(spread, EXACT * ROTOR_SPREAD)
    ranges["rotor_inertia"] = Parameter("kg m^2", -2.5 * spread, 2.5 * spread, spread, source="rig file")
    ranges |= {
        "force_gain": Parameter("1", -0.03, 0.03, 0.01, source="FC2231 data sheet: 1 % of span"),
        KNOCK_GAIN: Parameter("1", -1.0, 2.0, 0.5, source="assumed: a knock of one or two samples"),
        "loss_mcp": Parameter("N m", -0.05, 0.05, 1e-3, source="assumed: a degree of a joint's zero"),
        "loss_pip": Parameter("N m", -0.05, 0.05, 1e-3, source="assumed: a degree of a joint's zero"),
        "trace_mcp": Parameter("N m s/rad", 0.0, 4e-4, 1e-4),
        "trace_pip": Parameter("N m s/rad", 0.0, 4e-4, 1e-4),
        CABLE_OFFSET: Parameter("m", -0.05, 0.05, 0.01, open=True),
        **{
            f"{CHANGED_OFFSET}{k}": Parameter("m", -0.05, 0.05, 0.01, open=True)
            for k in range(1, MOST_CHANGES + 1)
        },
        "cable_compliance": Parameter("m/N", 0.0, 6e-5, 2e-5),
        "cable_damping": Parameter("m s/N", -2e-6, 2e-6, 5e-7),
        "lateral": _held_share() if tip_sticks else Parameter("tan", -0.12, 0.12, 0.05),
        SET_DOWN: Parameter("N", -1.5, 1.5, 0.5, source="assumed: friction that the tip was set down with"),
        # A pad can only hold the tip back: with either sign, it would pass for a force that leans.
        "lateral_spring": Parameter("N/m", 0.0, 4000.0, 1300.0, source="assumed: a tip of rubber"),
        RUBS: Parameter("1", 0.0, 0.4, 0.1, source="assumed: friction coefficient of printed parts"),
        **dict.fromkeys(
            SLIPS,
            Parameter(
                "1", -0.25, 0.25, 0.1, source="assumed: friction coefficient of printed parts, either way"
            ),
        ),
        "tip_tilt": Parameter("1", -0.15, 0.15, 0.05, source="assumed: a level face, lengths within 2 %"),
        "tip_compliance": Parameter(
            "m/N", 0.0, 1.5e-4, 5e-5, source="assumed: a printed tip on a steel button"
        ),
        "delay": Parameter("s", -0.001, 0.001, 0.0003),
        **dict.fromkeys(ARMS, ARM),
    }
    pressed = {name: replace(ranges[name], phase="contact") for name in IN_CONTACT}
    return {
        name: replace(pressed.get(name, one), name=name, role=Role.NUISANCE) for name, one in ranges.items()
    }


def _held_share() -> Parameter:
    """What share of the force a tip that sticks holds along the face."""
    source = "assumed: friction coefficient of printed parts"
    return Parameter("tan", -MOST_STICKING_SHARE, MOST_STICKING_SHARE, STICKING_SHARE, source=source)


def _trace_of(inertia: float) -> Parameter:
    """What of viscous friction every rotor has: its size goes by the rotor, not by how hard it was driven.

    Args:
        inertia: kg m^2, as the rig file tells it.
    """
    usual, trace = BENCH_RANGES["bench_trace"], inertia / COASTING_S
    return replace(usual, high=usual.high / usual.typical * trace, typical=trace)


_LOG_USUAL_RATIOS = np.log(USUAL_RATIOS)


@dataclass(frozen=True)
class ArmRatioPenalty:
    """Holds the arms of the two cables together.

    ``places`` are the indices of the arms among the unknowns, (2, 2): flexion and extension, MCP and PIP.
    ``reach`` is how far the ratios' logarithms together may be from the usual ones.
    """

    places: Array
    reach: float

    def cost(self, values: Array) -> float:
        """What it adds to minus twice the log posterior."""
        return ARM_RATIO_CURVATURE * max(float(np.linalg.norm(self._distance(values))) - self.reach, 0.0) ** 2

    def expansion(self, values: Array) -> tuple[Array, Array]:
        """Half the gradient of the cost, (p,), and half its curvature, (p, p)."""
        away = self._distance(values)
        distance = float(np.linalg.norm(away))
        if distance <= self.reach:
            return np.zeros(len(values)), np.zeros((len(values), len(values)))
        outwards, beyond = away / distance, distance - self.reach
        bend = (beyond / distance) * np.eye(2) + (self.reach / distance) * np.outer(outwards, outwards)
        slopes = np.zeros((2, len(values)))
        for cable, sign in ((0, 1.0), (1, -1.0)):
            slopes[(0, 1), self.places[cable]] = sign / values[self.places[cable]]
        return ARM_RATIO_CURVATURE * beyond * (
            outwards @ slopes
        ), ARM_RATIO_CURVATURE * slopes.T @ bend @ slopes

    def _distance(self, values: Array) -> Array:
        """The logarithms of both ratios less the usual ones, (2,)."""
        flexion, extension = values[self.places[0]], values[self.places[1]]
        return np.asarray(np.log(flexion / extension) - _LOG_USUAL_RATIOS)


def tie(index: Mapping[str, int], spread: float) -> ArmRatioPenalty | None:
    """The tie between the arms among the unknowns; None where there is only one cable."""
    keys = [[f"arm_{joint}@{cable}" for joint in ("mcp", "pip")] for cable in ("flexion", "extension")]
    if not all(key in index for pair in keys for key in pair):
        return None
    return ArmRatioPenalty(
        np.array([[index[key] for key in pair] for pair in keys]), ARM_RATIO_SPREADS * spread
    )


def is_loss(key: str) -> bool:
    """Whether an unknown is a constant torque of a joint's own, which should be zero."""
    return key.partition("@")[0] in LOSSES


def spread_of(rig: Rig) -> float:
    """Spread of the ratios' logarithms: the rig file's tolerance ``moment_arm``, or the usual one."""
    return float(rig.tolerance.get("moment_arm", USUAL_SPREAD))


def narrowed(effect: Effect, rig: Rig, scales: Scales) -> Effect:
    """The effect with the ranges of the rig file's section ``[ranges]``, such as ``id.gain = [0, 0.02]``, SI.

    They may be narrower than the usual ones, and are known: a value at their end stays there.

    Raises:
        UserError: it is no pair of rising numbers within the usual range.
    """
    given = rig.extra.get("ranges", {})
    own = given.get(effect.id, {}) if isinstance(given, Mapping) else {}
    if not own or not isinstance(own, Mapping):
        return effect
    gains = dict(effect.gains)
    for name, ends in own.items():
        where = f"The rig, [ranges] {effect.id}.{name}"
        if name not in gains:
            raise UserError(f"{where} is unknown; {effect.id} has {', '.join(gains)}.")
        numbers = isinstance(ends, list | tuple) and all(isinstance(e, int | float) for e in ends)
        if not numbers or len(ends) != 2 or not ends[0] < ends[1]:
            raise UserError(f"{where} is {ends!r}; it should be two rising numbers in {gains[name].unit}.")
        low, high = (float(e) / scales.of(gains[name].unit) for e in ends)
        usual = gains[name]
        low, high = max(low, usual.low), min(high, usual.high)
        typical = min(usual.typical, max(abs(low), abs(high)))
        if not low < high:
            raise UserError(f"{where} is {ends!r}; none of it is plausible, leave it out.")
        gains[name] = replace(usual, low=low, high=high, typical=typical, source="rig file")
    return replace(effect, gains=gains)
