"""What each effect changes in the simulated bench, given its values (SI; see ``effect_table``)."""

from __future__ import annotations

import math

from fingerlab.twin.bench import Bench
from fingerlab.twin.effects import Values
from fingerlab.twin.layout import MCP, MOTOR, PIP


def _per_joint(bench: Bench, field: str, value: float, ratio: float) -> None:
    bench.plant[field + "_1"] += value
    bench.plant[field + "_2"] += value * ratio


def viscous(bench: Bench, v: Values) -> None:
    _per_joint(bench, "viscous", v["mcp"], v["pip_ratio"])


def _dry(bench: Bench, place: int, level: float, travel: float) -> None:
    law = bench.friction[place]
    law["forward"] += level
    law["backward"] += level
    law["travel"] = travel


def joint_coulomb(bench: Bench, v: Values) -> None:
    _dry(bench, MCP, v["mcp"], v["travel"])
    _dry(bench, PIP, v["mcp"] * v["pip_ratio"], v["travel"])


def _stribeck(bench: Bench, places: dict[int, float], v: Values, level: float) -> None:
    for place, share in places.items():
        _dry(bench, place, level * share, v["travel"])
        bench.friction[place]["breakaway"] += level * share * v["excess"]
        bench.friction[place]["stribeck_speed"] = v["speed"]


def joint_stribeck(bench: Bench, v: Values) -> None:
    _stribeck(bench, {MCP: 1.0, PIP: v["pip_ratio"]}, v, v["mcp"])


def motor_stribeck(bench: Bench, v: Values) -> None:
    _stribeck(bench, {MOTOR: 1.0}, v, v["torque"])


def _spread(bench: Bench, place: int, level: float, travel: float) -> None:
    bench.friction[place]["spread"] += level
    bench.friction[place]["spread_travel"] = travel


def joint_presliding(bench: Bench, v: Values) -> None:
    _spread(bench, MCP, v["mcp"], v["travel"])
    _spread(bench, PIP, v["mcp"] * v["pip_ratio"], v["travel"])


def hardening(bench: Bench, v: Values) -> None:
    _per_joint(bench, "cubic", v["mcp"], v["pip_ratio"])


def stiffness(bench: Bench, v: Values) -> None:
    bench.plant["stiffness_1"] *= 1.0 + v["relative"]
    bench.plant["stiffness_2"] *= 1.0 + v["relative"] * v["pip_ratio"]


def coupling(bench: Bench, v: Values) -> None:
    bench.plant["coupling"] += v["stiffness"]


def creep(bench: Bench, v: Values) -> None:
    for joint in ("1", "2"):
        bench.plant["relaxing_" + joint] = bench.plant["stiffness_" + joint] * v["relative"]
    bench.plant["relaxation_time"] = v["time"]


def stop(bench: Bench, v: Values) -> None:
    bench.plant["stop_stiffness"] = v["stiffness"]
    bench.plant["stop_angle"] = v["angle"]
    bench.plant["stop_damping"] = v["damping"]


def tilt(bench: Bench, v: Values) -> None:
    bench.plant["tilt"] += v["angle"] * bench.truth.sign


def mass(bench: Bench, v: Values) -> None:
    bench.plant["distal_mass"] += v["distal"]
    bench.plant["knuckle_mass"] += v["distal"] * v["knuckle_ratio"]


def rotation(bench: Bench, v: Values) -> None:
    bench.plant["distal_rotation"] = v["share"]


def varying_arm(bench: Bench, v: Values) -> None:
    # An extension cable climbs over the knuckle as the joint extends, a flexion cable bows out.
    bench.plant["arm_slope_1"] += v["slope"] * bench.plant["cable_sign"]
    bench.plant["arm_slope_2"] += v["slope"] * v["pip_ratio"] * bench.plant["cable_sign"]


def capstan(bench: Bench, v: Values) -> None:
    bench.plant["wrap"] += v["wrap"]


def slack(bench: Bench, v: Values) -> None:
    bench.plant["slack"] += v["travel"]


def stretch(bench: Bench, v: Values) -> None:
    plant = bench.plant
    before = float(plant["cable_stiffness"])
    after = 1.0 / (1.0 / before + v["compliance"])
    plant["cable_stiffness"] = after
    # The same material loss at every stiffness, and no less than polymer cable has.
    plant["cable_damping"] = max(plant["cable_damping"] * after / before, v["damping_time"] * after)


def backlash(bench: Bench, v: Values) -> None:
    bench.plant["play"] += v["play"]


def motor_coulomb(bench: Bench, v: Values) -> None:
    _dry(bench, MOTOR, v["torque"], v["travel"])


def motor_viscous(bench: Bench, v: Values) -> None:
    bench.plant["motor_viscous"] += v["coefficient"]


def motor_inertia(bench: Bench, v: Values) -> None:
    bench.plant["inertia"] += v["inertia"]


def motor_presliding(bench: Bench, v: Values) -> None:
    _spread(bench, MOTOR, v["torque"], v["travel"])


def asymmetric(bench: Bench, v: Values) -> None:
    law = bench.friction[MOTOR]
    law["forward"] += v["torque"] * (1.0 + v["asymmetry"])
    law["backward"] += v["torque"] * (1.0 - v["asymmetry"])
    law["travel"] = v["travel"]


def load_dependent(bench: Bench, v: Values) -> None:
    bench.friction[MOTOR]["load_share"] += v["share"]
    bench.friction[MOTOR]["travel"] = v["travel"]


def motor_spring(bench: Bench, v: Values) -> None:
    bench.plant["motor_spring"] += v["stiffness"]


def ripple(bench: Bench, v: Values) -> None:
    bench.plant["ripple"] = v["torque"]
    bench.plant["ripple_order"] = v["order"]
    bench.plant["ripple_phase"] = bench.truth.phase


def delay(bench: Bench, v: Values) -> None:
    bench.sensors.delay += v["delay"]


def bridge(bench: Bench, v: Values) -> None:
    # Half the bridge angle is the shaft angle: an error e of the bridges turns into e / 2 of angle.
    bench.sensors.bridge_offset = 2.0 * v["angle"] * math.cos(bench.truth.phase)
    bench.sensors.bridge_mismatch = 4.0 * v["angle"] * bench.truth.sign


def drift(bench: Bench, v: Values) -> None:
    bench.sensors.drift = v["angle"] * bench.truth.sign


def cell_gain(bench: Bench, v: Values) -> None:
    bench.sensors.force_gain *= 1.0 + v["relative"]


def contact_angle(bench: Bench, v: Values) -> None:
    bench.plant["contact_angle"] += v["angle"]


def contact_compliance(bench: Bench, v: Values) -> None:
    softer = 1.0 / (1.0 / float(bench.plant["contact_stiffness"]) + v["compliance"])
    bench.plant["tip_stiffness"] *= softer / float(bench.plant["contact_stiffness"])
    bench.plant["contact_stiffness"] = softer


def routing(bench: Bench, v: Values) -> None:
    if bench.cable == "flexion":
        bench.plant["arm_1"] *= 1.0 - v["relative"]
        bench.plant["arm_2"] *= 1.0 + v["relative"]
