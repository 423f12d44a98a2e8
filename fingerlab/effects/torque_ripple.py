"""Torque that repeats with the motor angle."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fingerlab.effects.base import BOTH_JOINTS, Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.transmission import RIPPLE_ORDERS, drive_terms, pull_terms, turning_with
from fingerlab.physics.motion import LEAST_PERIODS, Motion, strongest_orders
from fingerlab.physics.parameter import Limits, Parameter

RIPPLE = Parameter("N m", -0.05, 0.05, 0.003, title="ripple amplitude")

DOUBLE = Parameter("N m", -0.02, 0.02, 0.001, title="ripple amplitude at twice the order")

TRIPLE = Parameter("N m", -0.02, 0.02, 0.001, title="ripple amplitude at three times the order", cable="none")
"""Of a motor alone: behind a finger's cable nobody would tell it from the joints' own friction."""


HARMONICS: dict[str, Parameter] = {"": RIPPLE, "double_": DOUBLE, "triple_": TRIPLE}

WEIGHT = "weight"
"""Switch of a shape: the torque goes with sine and cosine of the angle, as the weight of a link does."""
WEIGHS = {"order": 1.0, WEIGHT: 1.0}
MOST_WEIGHT = 1.0
"""Of a link's weight, N m; assumed: it may move the axis more than all else does."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A torque with the period of the order, and its double: no mesh or commutator makes a pure sine.

    Of a motor alone, with the third harmonic, too: cogging is as sharp as its teeth.
    """
    order = shape["order"]
    harmonics = 1 if shape.get(WEIGHT) else 3 if motion.finger is None else 2

    def column(gain: str, of: float, part: str) -> list[Term]:
        pull = motion.remember(
            ("ripple", of, part), lambda: getattr(turning_with(motion, of), part) / motion.radius
        )
        return drive_terms(motion, gain, pull) if motion.finger is None else pull_terms(gain, pull)

    return [
        term
        for times, name in enumerate(list(HARMONICS)[:harmonics], 1)
        for part, of in (("sine", "imag"), ("cosine", "real"))
        for term in column(f"{name}{part}", times * order, of)
    ]


def orders_seen(motions: Sequence[Motion]) -> tuple[Shape, ...]:
    """The strongest lines of the torque over the angle of a motor alone.

    A motor that turns by less than once cannot tell neighbouring lines apart: usual orders are tried, too, of
    which some periods lie within the travel. What does not come again there is as well a spring; but a joint
    carries a link, whose weight goes with sine and cosine of its angle.
    """
    turns = float(np.median([np.ptp(one.position) for one in motions])) / (2.0 * math.pi)
    usual = [float(n) for n in RIPPLE_ORDERS if n * turns >= LEAST_PERIODS] if turns < 1.0 else []
    shapes = tuple({"order": order} for order in sorted({*usual, *strongest_orders(motions)}))
    swings = turns < LEAST_PERIODS and all(one.revolute for one in motions)
    return (WEIGHS, *shapes) if swings else shapes


def _closer(shape: Shape) -> Sequence[Shape]:
    """About the order found, and about its double as far as usual orders go.

    On a grid what a line leaves beside it may pass for the double of another one: then that is the order, and
    no way downhill leads from one line of a spectrum to the next.
    """
    if shape.get(WEIGHT):
        return (shape,)
    near = [shape["order"] + k / 2 for k in range(-6, 7)]
    doubles = [2.0 * order for order in near if 2.0 * order <= RIPPLE_ORDERS[-1]]
    return [{"order": order} for order in sorted({*near, *doubles})]


def _limits(shape: Shape) -> Limits | None:
    return (-MOST_WEIGHT, MOST_WEIGHT) if shape.get(WEIGHT) else None


def _of_an_axis(shape: Shape) -> str:
    if shape.get(WEIGHT):
        return (
            "The motor's equation misses a torque that goes with the sine of its angle, once a turn: that of "
            "the weight of a link, or of whatever is out of balance."
        )
    return "The motor's equation misses a torque, which repeats with the motor angle."


EFFECT = Effect(
    id="torque_ripple",
    title="Torque ripple",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        f"{order}{part}": replace(ripple, title=f"{ripple.title}, {part}", limits=_limits)
        for order, ripple in HARMONICS.items()
        for part in ("sine", "cosine")
    },
    columns=columns,
    coordinate="motor angle",
    equation=Row.PIP,
    explanation=f"{BOTH_JOINTS}, which repeats with the motor angle.",
    of_an_axis=_of_an_axis,
    reveal="a slow sine of large amplitude on the motor bench",
    mend="Use a motor with more commutator segments, or compensate its torque by its angle.",
    shapes=tuple({"order": float(n)} for n in RIPPLE_ORDERS),
    shape_units={"order": "1/turn"},
    shapes_seen=orders_seen,
    closer=_closer,
    bench=True,
    formula=Formula(
        equation=r"\tau_m = \sum_{k=1}^{3} A_k\sin kn\theta_m + B_k\cos kn\theta_m",
        symbols=(
            "A, B: amplitudes at the order and its multiples, the third of a motor alone only. n: periods a "
            "turn of the pulley. Of a joint that turns by less than two turns k = n = 1 is tried, too: the "
            "weight of a link."
        ),
        source="Ours: the first terms of a Fourier series over a turn, assumed.",
        values={
            "sine": "A_1",
            "cosine": "B_1",
            "double_sine": "A_2",
            "double_cosine": "B_2",
            "triple_sine": "A_3",
            "triple_cosine": "B_3",
            "order": "n",
        },
    ),
    example=Example(
        {"order": 8.0},
        {"position": math.pi / 16.0},
        {
            "BENCH sine": 1.0,
            "BENCH cosine": 0.0,
            "BENCH double_sine": 0.0,
            "BENCH double_cosine": -1.0,
            "BENCH triple_sine": -1.0,
            "BENCH triple_cosine": 0.0,
        },
        on_bench=True,
    ),
)
