"""A third bench for blind trials: the finger's equations written out anew, stepped in numba, stored by h5py.

It shares no line with the simulated bench or with the second engine. Every friction is a LuGre bristle with
Stribeck's excess (Canudas de Wit et al. 1995), the amplifier has a bandwidth, the tip meets a spring with a
friction cone and damping that grows with depth (Hunt and Crossley 1975), noise of the load cell is coloured
and drifts, angles are read in steps that little noise smooths. The rig text is right within its tolerances.

    python -m tests.hidden.third_plant FOLDER [EFFECT ...] --seed 1

records a session for each effect (all of them, and six plain benches, if none is named), diagnoses each file
and prints what was said. With ``--textbook`` every friction is a hyperbolic tangent of the speed, as in many
simulators: nothing sticks.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numba import njit

Array = np.ndarray[Any, np.dtype[np.float64]]
RATE, STEP, SUBSTEPS = 1000.0, 1e-4, 10
SECONDS = 18.0

RIG: dict[str, dict[str, float]] = {
    "finger": {
        "proximal_mass": 0.0155, "distal_mass": 0.0128,
        "proximal_half_length": 0.0240, "distal_half_length": 0.0225,
        "proximal_inertia": 3.1e-6, "distal_inertia": 2.3e-6,
        "mcp_stiffness": 0.102, "pip_stiffness": 0.071,
        "wrist_angle": math.radians(15.0), "gravity": 9.81,
    },
    "motor": {"torque_constant": 0.0302, "gear_ratio": 4.3, "pulley_radius": 0.014, "inertia": 3.2e-4},
    "tolerance": {
        "proximal_mass": 0.05, "distal_mass": 0.05, "proximal_inertia": 0.1, "distal_inertia": 0.1,
        "mcp_stiffness": 0.07, "pip_stiffness": 0.07, "inertia": 0.15,
    },
}  # fmt: skip
"""The rig text, SI; assumed: another print of the thesis' finger."""

_TOLD = """m1 m2 l1 l2 i1 i2 k1 k2 alpha g kt ratio r j a b loose kc dc sign cubic1 cubic2 couple
creep1 creep2 lag stop stop_k stop_d tilt extra place spin bend f1 f2 visc1 visc2 pre1 pre2 pre_way fm viscm
bias share motor_pre motor_way spring ripple order phase excess slow wound gap kn mu lean axis cell_x cell_d
touch way1 waym band"""
NAMES = tuple(_TOLD.split())
(
    M1, M2, L1, L2, I1, I2, K1, K2, ALPHA, G, KT, RATIO, R, J, A, B, LOOSE, KC, DC, SIGN, CUBIC1,
    CUBIC2, COUPLE, CREEP1, CREEP2, LAG, STOP, STOP_K, STOP_D, TILT, EXTRA, PLACE, SPIN, BEND, F1, F2,
    VISC1, VISC2, PRE1, PRE2, PRE_WAY, FM, VISCM, BIAS, SHARE, MOTOR_PRE, MOTOR_WAY, SPRING, RIPPLE,
    ORDER, PHASE, EXCESS, SLOW, WOUND, GAP, KN, MU, LEAN, AXIS, CELL_X, CELL_D, TOUCH, WAY1, WAYM, BAND,
) = range(len(NAMES))  # fmt: skip
STATES = (
    17  # angles (3), speeds (3), current, bristles of MCP, PIP, motor, sheath, tip, 2 relaxing, 3 presliding
)
BRISTLE_TIME = 1e-3  # s, damping over stiffness of every bristle
TIP_WAY, SHEATH_WAY = 4e-5, 1.5e-4  # m over which tip and sheath give before they slide
COUNT = 2.0 * math.pi / (4 * 512 * 4.3)  # rad of the pulley: 512 lines


TEXTBOOK = False
"""Whether friction goes by the speed; numba takes it as it stands when it compiles."""
TIP_SPEED, SHEATH_SPEED, JOINT_SPEED, MOTOR_SPEED = 1e-3, 5e-4, 0.02, 0.05
"""m/s and rad/s over which such friction turns round; assumed."""


@njit(cache=False)
def _rub(z: float, rate: float, v: float, width: float, excess: float, slow: float) -> float:
    """Friction for a level of one: of a bristle, or by the speed."""
    if TEXTBOOK:
        return math.tanh(v / width) * (1.0 + excess * math.exp(-((v / slow) ** 2)))
    return z + BRISTLE_TIME * rate


@njit(cache=False)
def _bristle(z: float, v: float, way: float, excess: float, slow: float) -> float:
    level = 1.0 + excess * math.exp(-((v / slow) ** 2))
    return (v - abs(v) * z / level) / way


@njit(cache=False)
def _rates(y: Array, p: Array, wanted: float, pulley: float, out: Array) -> tuple[float, float, float]:
    """Time derivatives of the states into ``out``; tension at the pulley (N) and what the cell feels (N)."""
    q1, q2, qm, v1, v2, vm, amps = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    lower, way = p[PLACE] * 2 * p[L2], 2 * p[L1]
    c2, s2 = math.cos(q2), math.sin(q2)
    d1, d2 = q1 - p[ALPHA], q1 + q2 - p[ALPHA]
    cross = 2 * p[M2] * p[L1] * p[L2] + p[EXTRA] * way * lower
    far = p[M2] * p[L2] ** 2 + p[EXTRA] * lower**2
    m11 = (
        p[I1] + (p[M1] + 4 * p[M2]) * p[L1] ** 2 + p[EXTRA] * way**2 + far + 2 * cross * c2 + p[SPIN] * p[I2]
    )
    m12 = far + cross * c2 + p[SPIN] * p[I2]
    m22 = far + p[I2]
    t1 = cross * s2 * (2 * v1 * v2 + v2 * v2)
    t2 = -cross * s2 * v1 * v1
    heavy2 = p[G] * (p[M2] * p[L2] + p[EXTRA] * lower) * math.cos(d2 - p[TILT])
    heavy1 = p[G] * (p[M1] * p[L1] + (p[M2] + p[EXTRA]) * way) * math.cos(d1 - p[TILT])
    t1 += heavy1 + heavy2 - p[K1] * q1 - p[CUBIC1] * q1**3 - p[COUPLE] * (q1 - q2)
    t2 += heavy2 - p[K2] * q2 - p[CUBIC2] * q2**3 + p[COUPLE] * (q1 - q2)
    # What relaxes: a spring behind a dashpot.
    out[12], out[13] = (q1 - y[12]) / p[LAG], (q2 - y[13]) / p[LAG]
    t1 -= p[CREEP1] * (q1 - y[12])
    t2 -= p[CREEP2] * (q2 - y[13])
    if q2 < -p[STOP]:
        t2 += max(-p[STOP_K] * (q2 + p[STOP]) - p[STOP_D] * v2 * min(-(q2 + p[STOP]) / 0.01, 1.0), 0.0)
    out[7] = _bristle(y[7], v1, p[WAY1], p[EXCESS], p[SLOW])
    out[8] = _bristle(y[8], v2, p[WAY1], p[EXCESS], p[SLOW])
    out[14] = _bristle(y[14], v1, p[PRE_WAY], 0.0, 1.0)
    out[15] = _bristle(y[15], v2, p[PRE_WAY], 0.0, 1.0)
    t1 -= p[F1] * _rub(y[7], out[7], v1, JOINT_SPEED, p[EXCESS], p[SLOW]) + p[PRE1] * y[14] + p[VISC1] * v1
    t2 -= p[F2] * _rub(y[8], out[8], v2, JOINT_SPEED, p[EXCESS], p[SLOW]) + p[PRE2] * y[15] + p[VISC2] * v2
    # Cable: what it is wound on the pulley less what the joints give, and Euler's sheath between.
    arm1, arm2 = p[A] * (1 + p[BEND] * q1), p[B] * (1 + p[BEND] * q2)
    length = p[SIGN] * (p[A] * (q1 + p[BEND] * q1 * q1 / 2) + p[B] * (q2 + p[BEND] * q2 * q2 / 2))
    pays = p[SIGN] * (arm1 * v1 + arm2 * v2)
    taut = p[R] * pulley - length - p[LOOSE]
    tension = 0.0
    if taut > 0.0:
        tension = max(p[KC] * taut + p[DC] * (p[R] * vm - pays), 0.0)
    out[10] = _bristle(y[10], pays, SHEATH_WAY, 0.0, 1.0)
    pull = tension * math.exp(-p[WOUND] * _rub(y[10], 0.0, pays, SHEATH_SPEED, 0.0, 1.0))
    t1 += p[SIGN] * arm1 * pull
    t2 += p[SIGN] * arm2 * pull
    # Tip on the cell, in the frame of the base: x out, d down.
    felt = 0.0
    out[11] = 0.0
    if p[TOUCH] > 0:
        n = p[LEAN] + p[AXIS]
        x1, x2 = -way * math.sin(d1) - 2 * p[L2] * math.sin(d2), -2 * p[L2] * math.sin(d2)
        u1, u2 = way * math.cos(d1) + 2 * p[L2] * math.cos(d2), 2 * p[L2] * math.cos(d2)
        x, down = u1, -x1
        into = (down - p[CELL_D]) * math.cos(n) - (x - p[CELL_X]) * math.sin(n)
        if into > 0.0:
            vx, vd = x1 * v1 + x2 * v2, u1 * v1 + u2 * v2
            fast = vd * math.cos(n) - vx * math.sin(n)
            along = vx * math.cos(n) + vd * math.sin(n)
            normal = max(p[KN] * into * (1 + 3.0 * fast), 0.0)
            out[11] = _bristle(y[11], along, TIP_WAY, 0.15, 0.01)
            rub = -p[MU] * normal * _rub(y[11], out[11], along, TIP_SPEED, 0.0, 1.0)
            fx = normal * math.sin(n) + rub * math.cos(n)
            fd = -normal * math.cos(n) + rub * math.sin(n)
            t1 += fx * x1 + fd * u1
            t2 += fx * x2 + fd * u2
            felt = fx * math.sin(p[AXIS]) - fd * math.cos(p[AXIS])
        else:
            out[11] = -y[11] / 0.01
    det = m11 * m22 - m12 * m12
    out[0], out[1], out[2] = v1, v2, vm
    out[3], out[4] = (m22 * t1 - m12 * t2) / det, (m11 * t2 - m12 * t1) / det
    # Motor: the amplifier follows what it is told, the gears rub.
    out[6] = (wanted - amps) * p[BAND]
    out[9] = _bristle(y[9], vm, p[WAYM], p[EXCESS], p[SLOW])
    out[16] = _bristle(y[16], vm, p[MOTOR_WAY], 0.0, 1.0)
    lost = (p[FM] + p[SHARE] * tension * p[R]) * _rub(y[9], out[9], vm, MOTOR_SPEED, p[EXCESS], p[SLOW]) + p[
        MOTOR_PRE
    ] * y[16]
    lost += p[VISCM] * vm + p[BIAS] + p[SPRING] * qm + p[RIPPLE] * math.sin(p[ORDER] * qm + p[PHASE])
    out[5] = (p[KT] * p[RATIO] * amps - lost - p[R] * tension) / p[J]
    return tension, felt, pull


@njit(cache=False)
def _run(p: Array, command: Array, start: Array) -> Array:
    """Truth at 1 kHz, (7, n): motor as counted, current, MCP, PIP, force, tension, motor."""
    y = start.copy()
    k1, k2, k3, k4 = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    truth = np.zeros((7, len(command)))
    integral = speed = before = 0.0
    pulley = y[2]
    for n in range(len(command)):
        seen = math.floor(y[2] / COUNT + 0.5) * COUNT
        speed += 0.25 * ((seen - before) * RATE - speed)
        before = seen
        error = command[n] - seen
        integral = min(max(integral + 55.0 * error / RATE, -4.0), 4.0)
        wanted = min(max(12.0 * error + integral - 0.2 * speed, -5.0), 5.0)
        truth[0, n], truth[1, n], truth[2, n], truth[3, n], truth[6, n] = seen, y[6], y[0], y[1], y[2]
        truth[5, n], truth[4, n], _ = _rates(y, p, wanted, pulley, k1)
        for _ in range(SUBSTEPS):
            pulley = min(max(pulley, y[2] - p[GAP] / 2), y[2] + p[GAP] / 2) if p[GAP] > 0 else y[2]
            ride = 0.0 if p[GAP] > 0 else 1.0
            _rates(y, p, wanted, pulley, k1)
            _rates(y + 0.5 * STEP * k1, p, wanted, pulley + ride * 0.5 * STEP * k1[2], k2)
            _rates(y + 0.5 * STEP * k2, p, wanted, pulley + ride * 0.5 * STEP * k2[2], k3)
            _rates(y + STEP * k3, p, wanted, pulley + ride * STEP * k3[2], k4)
            y += STEP / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)
    return truth


def draw(rng: np.random.Generator) -> dict[str, float]:
    """A plain bench within the tolerances of the rig text; what is here beside is assumed."""

    def near(value: float, tolerance: float) -> float:
        return value * (1.0 + tolerance * float(np.clip(rng.standard_normal(), -2, 2)))

    p = dict.fromkeys(NAMES, 0.0)
    short = dict(
        zip(RIG["finger"], ("m1", "m2", "l1", "l2", "i1", "i2", "k1", "k2", "alpha", "g"), strict=True)
    )
    short |= {"torque_constant": "kt", "gear_ratio": "ratio", "pulley_radius": "r", "inertia": "j"}
    for name, value in {**RIG["finger"], **RIG["motor"]}.items():
        exact = name in ("wrist_angle", "gravity", "gear_ratio")
        p[short[name]] = value if exact else near(value, RIG["tolerance"].get(name, 0.01))
    p |= {
        "a": near(0.0096, 0.05), "b": near(0.0080, 0.05), "kc": 5e4, "dc": 30.0, "lag": 1.0, "stop": 9.0,
        "f1": 1e-5, "f2": 1e-5, "visc1": 5e-5, "visc2": 4e-5, "pre_way": 0.1, "fm": 1e-5, "viscm": 1e-5,
        "motor_way": 0.1, "order": 1.0, "slow": 0.02, "kn": 3.5e4, "mu": rng.uniform(0.02, 0.12),
        "way1": 8e-4, "waym": 3e-3, "band": 2 * math.pi * 400.0,
    }  # fmt: skip
    p["ratio1"], p["ratio2"] = near(1.10, 0.06), near(0.78, 0.06)
    p["delay"] = p["harmonic"] = p["drift"] = 0.0
    p["gain"] = 1.0
    return p


def effects(p: dict[str, float], rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """What each effect changes of a bench, by catalogue id; strengths vary by two thirds either way."""
    k = float(np.exp(rng.uniform(-0.5, 0.5)))
    sign = float(rng.choice([-1.0, 1.0]))
    excess = {"excess": 0.6 + 0.5 * k, "slow": rng.uniform(0.15, 0.45)}
    return {
        "viscous_friction": {"visc1": p["visc1"] + 2.5e-3 * k, "visc2": p["visc2"] + 1.6e-3 * k},
        "coulomb_friction": {"f1": 2.6e-3 * k, "f2": 1.7e-3 * k},
        "stribeck_friction": {"f1": 2.0e-3 * k, "f2": 1.3e-3 * k, **excess},
        "presliding_hysteresis": {"pre1": 3e-3 * k, "pre2": 2e-3 * k, "pre_way": rng.uniform(0.05, 0.12)},
        "spring_hardening": {"cubic1": 0.3 * k, "cubic2": 0.2 * k},
        "stiffness_error": {"k1": p["k1"] * (1 + sign * 0.28), "k2": p["k2"] * (1 + sign * 0.3)},
        "joint_coupling": {"couple": 0.025 * k},
        "viscoelastic_creep": {
            "creep1": 0.3 * k * p["k1"], "creep2": 0.3 * k * p["k2"], "lag": rng.uniform(0.4, 1.5)
        },
        "joint_stop": {"stop": 0.06 * k, "stop_k": 1.2, "stop_d": 0.01},
        "gravity_tilt": {"tilt": sign * 0.22 * k, "axis": sign * 0.22 * k},
        "added_mass": {"extra": 6e-3 * k, "place": rng.uniform(0.3, 0.9)},
        "distal_rotation": {"spin": 1.0},
        "varying_moment_arm": {"bend": sign * 0.3 * k},
        "capstan_friction": {"wound": 0.2 * k},
        "cable_slack": {"loose": 3e-3 * k},
        "cable_stretch": {"kc": 1 / (1 / p["kc"] + 3.5e-4 * k), "dc": 12.0},
        "backlash": {"gap": math.radians(3.0 * k)},
        "motor_coulomb_friction": {"fm": 6e-3 * k},
        "motor_viscous_friction": {"viscm": p["viscm"] + 4e-3 * k},
        "motor_inertia": {"j": p["j"] + 4e-4 * k},
        "motor_stribeck_friction": {"fm": 4.5e-3 * k, **excess},
        "motor_presliding": {"motor_pre": 7e-3 * k, "motor_way": rng.uniform(0.08, 0.2)},
        "asymmetric_friction": {"fm": 6e-3 * k, "bias": sign * 3e-3 * k},
        "load_dependent_friction": {"share": 0.13 * k},
        "motor_spring": {"spring": 0.03 * k},
        "torque_ripple": {
            "ripple": 4e-3 * k, "order": float(rng.integers(12, 32)), "phase": rng.uniform(0, 6)
        },
        "transport_delay": {"delay": 0.035 * k},
        "angle_sensor_nonlinearity": {"harmonic": 0.03 * k, "turn": rng.uniform(0, 6)},
        "sensor_drift": {"drift": sign * 0.03 * k},
        "load_cell_gain": {"gain": 1 + sign * 0.17 * k},
        "contact_angle": {"lean": sign * 0.4 * k},
        "contact_compliance": {"kn": 1 / (1 / p["kn"] + 9e-4 * k)},
        "routing_change": {
            "ratio1": p["ratio1"] * (1 + 0.5 * sign), "ratio2": p["ratio2"] * (1 - 0.35 * sign)
        },
    }  # fmt: skip


def plans() -> list[tuple[str, str, dict[str, Any]]]:
    """Phase, cable and trajectory of every run."""

    def wave(kind: str, amplitude: float, frequency: float, offset: float, **more: Any) -> dict[str, Any]:
        return {
            "kind": kind,
            "amplitude_deg": amplitude,
            "frequency_hz": frequency,
            "offset_deg": offset,
            **more,
        }

    free = [
        wave("sine", 14.0, 1.0, 24.0), wave("sine", 12.0, 0.5, 24.0), wave("sine", 10.0, 2.0, 24.0),
        wave("chirp", 10.0, 0.5, 24.0, end_frequency_hz=3.0),
        wave("multisine", 15.0, 0.5, 24.0, frequencies_hz=[0.5, 1.0, 1.5, 2.5]),
        wave("steps", 12.0, 0.8, 24.0, seed=5),
    ]  # fmt: skip
    flexion = [wave("sine", 9.0, 1.0, 16.0), wave("chirp", 8.0, 0.5, 16.0, end_frequency_hz=2.8)]
    press = wave("sine", 2.0, 1.0, 0.0)
    return [
        *(("on_air", "extension", one) for one in free),
        *(("on_air", "flexion", one) for one in flexion),
        *(("contact", "flexion", press) for _ in range(3)),
    ]


def command(wave: Mapping[str, Any], seconds: float) -> Array:
    """Motor command, rad, one value a millisecond, from rest within a second and a half."""
    t = np.arange(round(seconds * RATE)) / RATE
    f, kind = float(wave["frequency_hz"]), wave["kind"]
    if kind == "sine":
        shape = np.sin(2 * np.pi * f * t)
    elif kind == "chirp":
        shape = np.sin(2 * np.pi * (f * t + 0.5 * (wave["end_frequency_hz"] - f) * t * t / seconds))
    elif kind == "multisine":
        shape = sum(np.sin(2 * np.pi * g * t + 1.7 * i * i) for i, g in enumerate(wave["frequencies_hz"]))
        shape = shape / np.abs(shape).max()
    else:
        levels = np.random.default_rng(wave["seed"]).uniform(-1, 1, int(seconds * f) + 2)
        shape = np.convolve(levels[(t * f).astype(int)], np.hanning(121) / np.hanning(121).sum(), "same")
    lead = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / 1.5, 0, 1))
    return np.asarray(lead * np.radians(wave["offset_deg"] + wave["amplitude_deg"] * shape))


def simulate(p: Mapping[str, float], phase: str, cable: str, told: Array, wear: float = 1.0) -> Array:
    """One run of a bench from rest, its cable loose at zero; all friction ``wear`` times as large."""
    own = dict(p)
    own["sign"] = 1.0 if cable == "flexion" else -1.0
    if cable == "flexion":
        own["a"], own["b"] = p["a"] * p["ratio1"], p["b"] * p["ratio2"]
    for name in ("f1", "f2", "fm", "pre1", "pre2", "motor_pre", "wound", "share", "mu"):
        own[name] *= wear
    mcp, pip = 0.42, 0.38  # posture in which the tip meets the cell, rad; assumed
    first, second = mcp - own["alpha"], mcp + pip - own["alpha"]
    own["cell_x"] = 2 * own["l1"] * math.cos(first) + 2 * own["l2"] * math.cos(second)
    own["cell_d"] = 2 * own["l1"] * math.sin(first) + 2 * own["l2"] * math.sin(second)
    own["touch"] = float(phase == "contact")
    y = np.zeros(STATES)
    for _ in range(60):  # the finger hangs on its springs
        one, two = y[0] - own["alpha"] - own["tilt"], y[0] + y[1] - own["alpha"] - own["tilt"]
        lower = (
            own["g"] * (own["m2"] * own["l2"] + own["extra"] * own["place"] * 2 * own["l2"]) * math.cos(two)
        )
        near = own["m1"] * own["l1"] + (own["m2"] + own["extra"]) * 2 * own["l1"]
        upper = own["g"] * near * math.cos(one) + lower
        stretch = own["couple"] * (y[0] - y[1])
        y[0] += 0.5 * ((upper - stretch - own["cubic1"] * y[0] ** 3) / own["k1"] - y[0])
        y[1] += 0.5 * ((lower + stretch - own["cubic2"] * y[1] ** 3) / own["k2"] - y[1])
    y[12], y[13] = y[0], y[1]
    a1 = own["a"] * (y[0] + own["bend"] * y[0] ** 2 / 2)
    hang = own["sign"] * (a1 + own["b"] * (y[1] + own["bend"] * y[1] ** 2 / 2))
    own["loose"] += 2e-4 - hang  # as wound as the hanging finger is, it is just loose
    return _run(np.array([own[name] for name in NAMES]), told, y)


def read(p: Mapping[str, float], truth: Array, told: Array, rng: np.random.Generator) -> dict[str, Array]:
    """The channels that a recording holds, SI."""
    t = np.arange(len(told)) / RATE
    late = [np.interp(t - p["delay"], t, truth[i]) for i in (2, 3, 4)]
    angles = [a + p["harmonic"] * np.sin(2 * a + p.get("turn", 0.0)) for a in late[:2]]
    angles[0] = angles[0] + p["drift"] * (t / t[-1]) ** 0.7
    step = math.radians(0.04)
    angles = [np.round((a + 0.4 * step * rng.standard_normal(len(t))) / step) * step for a in angles]
    slow = np.zeros(len(t))
    white = rng.standard_normal(len(t))
    for i in range(1, len(t)):
        slow[i] = 0.95 * slow[i - 1] + 0.31 * white[i]
    force = p["gain"] * late[2] + 0.006 * slow + 0.004 * rng.standard_normal(len(t)) + 0.004 * t / t[-1]
    hum = 0.003 * np.sin(2 * np.pi * 50.0 * t + rng.uniform(0, 6))
    amps = truth[1] + hum + 0.015 * rng.standard_normal(len(t))
    amps = np.round(amps / 0.0024) * 0.0024
    motor = RIG["motor"]
    return {
        "motor_command": told, "motor_position": truth[0], "motor_current": amps,
        "motor_torque": motor["torque_constant"] * motor["gear_ratio"] * amps,
        "mcp_angle": angles[0], "pip_angle": angles[1], "endpoint_force": np.round(force / 0.004) * 0.004,
    }  # fmt: skip


UNITS = {
    "motor_command": "rad", "motor_position": "rad", "motor_current": "A", "motor_torque": "N m",
    "mcp_angle": "rad", "pip_angle": "rad", "endpoint_force": "N",
}  # fmt: skip


def record(path: Path, names: tuple[str, ...], seed: int) -> dict[str, dict[str, float]]:
    """A session with the named effects, by the contract of the session file; what each of them changed."""
    rng = np.random.default_rng([seed, 303])
    p, changed = draw(rng), {}
    for name in names:
        own = np.random.default_rng([seed, *name.encode()])
        changed[name] = effects(p, own)[name]
        p |= changed[name]
    approach = np.radians(np.minimum(np.arange(0.0, 60.0, 12.0 / RATE), 60.0))
    slow = simulate(p, "contact", "flexion", approach)
    pressed = np.flatnonzero(slow[4] * p["gain"] > 1.1)
    if not len(pressed):
        raise RuntimeError("the finger does not press on the cell")
    with h5py.File(path, "w") as file:
        file.attrs.update(
            {"format": "fingerlab-session", "format_version": "1", "created": "2026-11-20T10:00:00+00:00"}
        )
        file.attrs["title"], file.attrs["rig"] = "third plant", json.dumps(RIG)
        for number, (phase, cable, wave) in enumerate(plans(), 1):
            if phase == "contact":
                wave = {**wave, "offset_deg": math.degrees(slow[6][pressed[0]])}
            told = command(wave, SECONDS)
            wear = 1.0 + 0.03 * float(np.clip(rng.standard_normal(), -2, 2))
            channels = read(p, simulate(p, phase, cable, told, wear), told, rng)
            run = file.create_group(f"runs/{number:03d}")
            run.attrs.update({"phase": phase, "cable": cable, "sample_rate_hz": RATE})
            run.attrs["trajectory"] = json.dumps(wave)
            run["time"] = np.arange(len(told)) / RATE
            run["time"].attrs["units"] = "s"
            run["time"].make_scale("time")
            for name, values in channels.items():
                run[name] = values.astype(np.float32)
                run[name].attrs["units"] = UNITS[name]
                run[name].dims[0].attach_scale(run["time"])
    return changed


def main() -> None:
    """Record and diagnose, one line each."""
    from fingerlab.diagnosis import diagnose
    from fingerlab.sessions import open_session

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("effects", nargs="*")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--textbook", action="store_true", help="Friction by the speed.")
    asked = parser.parse_args()
    globals()["TEXTBOOK"] = asked.textbook
    every = list(effects(draw(np.random.default_rng(0)), np.random.default_rng(0)))
    trials = [(name, asked.seed) for name in asked.effects or every]
    trials += [] if asked.effects else [("plain", asked.seed + k) for k in range(6)]
    asked.folder.mkdir(parents=True, exist_ok=True)
    for name, seed in trials:
        path = asked.folder / f"{name}-{seed}.h5"
        if not path.exists():
            record(path, () if name == "plain" else tuple(name.split("+")), seed)
        said = diagnose([open_session(path)], with_curves=False)
        best = said.candidates[0]
        steps = " -> ".join(f"{step.added or 'as given'} {step.score:.2f}" for step in said.path)
        print(f"{name:26} {seed:3d} {said.verdict:16} {best.effect:26} {best.probability:4.0%} {steps} | "
              f"{' '.join(said.set)}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
