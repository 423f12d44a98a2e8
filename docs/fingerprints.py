"""The course of an effect over its own coordinate, drawn from the effect object as a small inline SVG.

The run is made up: a motor that turns by two sines, joints that follow it, a load like a spring. Nothing of
it is a measurement; it shows what shape to look for. The first unknown of an equation has its typical
strength, further ones have half of it, so that two of a kind neither cancel nor look like one.
"""

from __future__ import annotations

import html

import numpy as np

from fingerlab.effects import Effect, Motion, Row, Term
from fingerlab.physics.nominal import JointMotion
from fingerlab.rig.file import default_rig
from fingerlab.sessions.model import Array

RATE_HZ, SECONDS = 250.0, 10.0
SINES = ((14.0, 1.0), (7.0, 0.3))
"""Amplitude (degrees) and frequency (Hz) of the motor's two sines, about 22 degrees."""
ARM_M = 0.01
"""Moment arm, m, by which an angle becomes a length, negative with the extension cable; assumed."""
COMPLIANCE = 1e-4
"""m/N, by which a tension that the cable never sees becomes a length; assumed."""
DEGREE = 180.0 / np.pi
SETTLING = round(2.0 * RATE_HZ)
"""Samples that are left out at the start, where what has a memory begins at zero."""
JUMP = 0.1
"""A step of this share of the width, from one sample to the next, is not drawn: the coordinate has leapt."""
WIDTH, HEIGHT, LEFT, BOTTOM, TOP, RIGHT = 560, 280, 78, 46, 12, 12


def picture(effect: Effect) -> str:
    """The drawing as an ``<svg>`` element; empty for an effect whose course is not known here."""
    motion = _motion("contact" if effect.phases == ("contact",) else "on_air")
    x, x_label = _coordinate(effect, motion)
    outside = next((OUTSIDE[name] for name in (effect.special, *effect.relaxes) if name in OUTSIDE), None)
    if outside is not None:
        y, y_label = outside(effect, motion)
    else:
        terms = _shown(effect, motion)
        if not terms:
            return ""
        y, y_label = _missing(effect, terms)
    return _svg(x[SETTLING:], y[SETTLING:], x_label, y_label, f"{effect.title}: {y_label} against {x_label}")


def _shown(effect: Effect, motion: Motion) -> list[Term]:
    """Terms of the shape nearest to the middle that shows in this run; a stop beyond its travel does not."""
    middle = len(effect.shapes) // 2
    terms: list[Term] = []
    for index in sorted(range(len(effect.shapes)), key=lambda i: abs(i - middle)):
        terms = [t for t in effect.columns(motion, effect.shapes[index]) if t.row == effect.equation]
        if any(np.ptp(t.values[SETTLING:]) > 0 for t in terms):
            break
    return terms


def _motion(phase: str) -> Motion:
    rig = default_rig()
    time = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    wide = np.array([[amplitude / DEGREE] for amplitude, _ in SINES])
    rate = np.array([[2.0 * np.pi * frequency] for _, frequency in SINES])
    swing = np.sum(wide * np.sin(rate * time), axis=0)
    speed = np.sum(wide * rate * np.cos(rate * time), axis=0)
    bend = np.sum(-wide * rate**2 * np.sin(rate * time), axis=0)
    mcp, pip = -0.6, -0.9  # with arms of 10 mm and a pulley of 15 mm the joints take what the pulley winds
    joints = JointMotion(
        *(0.17 + mcp * swing, 0.26 + pip * swing), *(mcp * speed, pip * speed), *(mcp * bend, pip * bend)
    )
    return Motion(
        phase=phase, cable_sign=-1, sample_rate_hz=RATE_HZ, time=time,
        position=22.0 / DEGREE + swing, velocity=speed, acceleration=bend, torque=0.05 + 0.06 * swing,
        motor=rig.motor, finger=rig.finger, joints=joints,
        force=0.8 + 1.5 * swing if phase == "contact" else None,
    )  # fmt: skip


def _missing(effect: Effect, terms: list[Term]) -> tuple[Array, str]:
    """What the terms add to their equation, on screen units, and its name."""
    factor = {"joint": 1e3, "direct": 1.0, "arm_mcp": -ARM_M, "arm_pip": -ARM_M, "compliance": COMPLIANCE}
    gains = effect.unknowns
    total = np.zeros_like(terms[0].values)
    for term in terms:
        share = 1.0 if term.gain == terms[0].gain else 0.5
        strength = term.constant + (share * gains[term.gain].typical if term.gain else 0.0)
        total = total + strength * factor[term.scale] * term.values
    if effect.equation == Row.CABLE:
        return 1e3 * total, "missing length, mm"
    if terms[0].scale == "joint":
        return total, f"missing torque at the {effect.equation.name}, mN m"
    return total, "missing tension, N"


def _stretch(effect: Effect, motion: Motion) -> tuple[Array, str]:
    """Length that the tension draws out of the cable; its rate draws the line open."""
    rate = np.gradient(motion.tension, 1.0 / RATE_HZ)
    gains = effect.relaxes
    length = gains["cable_compliance"].typical * motion.tension + gains["cable_damping"].typical * rate
    return 1e3 * length, "missing length, mm"


def _slack(effect: Effect, motion: Motion) -> tuple[Array, str]:
    """Cable that hangs loose where the joints would have to push it."""
    return 1e3 * SLACK_M_PER_N * np.minimum(motion.tension - SLACK_FROM_N, 0.0), "missing length, mm"


def _delay(effect: Effect, motion: Motion) -> tuple[Array, str]:
    """Cable that is wound while the angles are on their way."""
    late = round(effect.gains["delay"].typical * RATE_HZ)
    wound = motion.radius * (motion.position - np.roll(motion.position, late))
    return 1e3 * wound, "missing length, mm"


def _sinking(effect: Effect, motion: Motion) -> tuple[Array, str]:
    """How far tip and load cell give way."""
    assert motion.force is not None
    return 1e3 * effect.relaxes["tip_compliance"].typical * motion.force, "missing depth, mm"


def _other_arm(effect: Effect, motion: Motion) -> tuple[Array, str]:
    """Torque of the tension on what is missing of the moment arm."""
    return 1e3 * effect.relaxes["arm_pip@flexion"].typical * motion.tension, "missing torque at the PIP, mN m"


OUTSIDE = {
    "slack": _slack,
    "delay": _delay,
    "cable_compliance": _stretch,
    "tip_compliance": _sinking,
    "arm_pip@flexion": _other_arm,
}
"""What effects do that are no column of their own in a fit, or that set free what every model has."""
SLACK_FROM_N, SLACK_M_PER_N = 2.5, 1e-3
"""Tension below which the made-up cable is loose, and how much it then pays out; assumed."""


def _coordinate(effect: Effect, motion: Motion) -> tuple[Array, str]:
    """The effect's coordinate on screen units, and its name."""
    assert motion.joints is not None
    joints, mcp = motion.joints, effect.equation == Row.MCP
    tension = motion.tension
    known: dict[str, tuple[Array, str]] = {
        "time": (motion.time, "s"),
        "joint speed": (DEGREE * (joints.mcp_velocity if mcp else joints.pip_velocity), "°/s"),
        "joint angle": (DEGREE * (joints.mcp if mcp else joints.pip), "°"),
        "joint acceleration": (joints.mcp_acceleration if mcp else joints.pip_acceleration, "rad/s²"),
        "difference of joint angles": (DEGREE * (joints.mcp - joints.pip), "°"),
        "motor speed": (DEGREE * motion.velocity, "°/s"),
        "motor angle": (DEGREE * motion.position, "°"),
        "motor acceleration": (motion.acceleration, "rad/s²"),
        "tension": (np.maximum(tension - SLACK_FROM_N, 0.0) if effect.special == "slack" else tension, "N"),
        "tension times direction of travel": (tension * np.sign(motion.velocity), "N"),
        "force": (np.zeros_like(tension) if motion.force is None else motion.force, "N"),
    }
    values, unit = known[effect.coordinate]
    return values, f"{effect.coordinate}, {unit}"


def _svg(x: Array, y: Array, x_label: str, y_label: str, description: str) -> str:
    """A line with axes through its extremes; colours follow the page."""
    (low_x, high_x), (low_y, high_y) = _span(x), _span(y)
    across = LEFT + (x - low_x) / (high_x - low_x) * (WIDTH - LEFT - RIGHT)
    down = HEIGHT - BOTTOM - (y - low_y) / (high_y - low_y) * (HEIGHT - BOTTOM - TOP)
    leaps = np.abs(np.diff(across, prepend=across[0])) > JUMP * WIDTH
    leaps[0] = True
    course = " ".join(
        f"{'M' if m else 'L'}{a:.1f},{d:.1f}" for a, d, m in zip(across, down, leaps, strict=True)
    )
    floor, middle = HEIGHT - BOTTOM, TOP + (HEIGHT - BOTTOM - TOP) / 2
    texts = [
        _text(LEFT, floor + 16, "start", _number(low_x, high_x - low_x)),
        _text(WIDTH - RIGHT, floor + 16, "end", _number(high_x, high_x - low_x)),
        _text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, "middle", x_label),
        _text(LEFT - 6, floor, "end", _number(low_y, high_y - low_y)),
        _text(LEFT - 6, TOP + 10, "end", _number(high_y, high_y - low_y)),
        _text(16, middle, "middle", y_label, f' transform="rotate(-90 16 {middle:g})"'),
    ]
    frame = f'<path d="M{LEFT} {TOP}V{floor}H{WIDTH - RIGHT}" fill="none" stroke="currentColor"/>'
    if low_y < 0.0 < high_y:
        zero = floor + low_y / (high_y - low_y) * (floor - TOP)
        frame += f'<path d="M{LEFT} {zero:.1f}H{WIDTH - RIGHT}" stroke="currentColor" stroke-opacity="0.3"/>'
    drawn = f'<path class="course" d="{course}" fill="none" stroke="#009E73" stroke-width="1.5"/>'
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" style="max-width:{WIDTH}px" role="img" '
        f'aria-label="{html.escape(description, quote=True)}">{frame}{drawn}{"".join(texts)}</svg>'
    )


def _span(values: Array) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - 1.0, high + 1.0)


def _number(value: float, span: float) -> str:
    return f"{value if abs(value) > 1e-4 * span else 0.0:.3g}"


def _text(x: float, y: float, anchor: str, words: str, more: str = "") -> str:
    shown = html.escape(words)
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-size="12" fill="currentColor"{more}>'
        f"{shown}</text>"
    )
