"""Torque that repeats with the motor angle."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.transmission import drive_terms, pull_terms
from fingerlab.physics.motion import LEAST_PERIODS, Motion, strongest_orders
from fingerlab.physics.parameter import Parameter

RIPPLE_ORDERS = (*range(4, 41, 2), *range(44, 61, 4))
"""Periods a turn of the pulley that are tried; between two of them a travel of 30 degrees shifts the phase by
a quarter of a radian at most. 4.3:1 gearing puts the motor's 13 commutator segments at 56."""

RIPPLE = Parameter("N m", -0.05, 0.05, 0.003, title="ripple amplitude")

DOUBLE = Parameter("N m", -0.02, 0.02, 0.001, title="ripple amplitude at twice the order")

TRIPLE = Parameter("N m", -0.02, 0.02, 0.001, title="ripple amplitude at three times the order", cable="none")
"""Of a motor alone: behind a finger's cable nobody would tell it from the joints' own friction."""


HARMONICS: dict[str, Parameter] = {"": RIPPLE, "double_": DOUBLE, "triple_": TRIPLE}


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A torque with the period of the order, and its double: no mesh or commutator makes a pure sine.

    Of a motor alone, with the third harmonic, too: cogging is as sharp as its teeth.
    """
    order = shape["order"]

    def column(gain: str, of: float, part: str) -> list[Term]:
        pull = motion.remember(
            ("ripple", of, part), lambda: getattr(_turning(motion, of), part) / motion.radius
        )
        return drive_terms(motion, gain, pull) if motion.finger is None else pull_terms(gain, pull)

    return [
        term
        for times, name in enumerate(list(HARMONICS)[: 3 if motion.finger is None else 2], 1)
        for part, of in (("sine", "imag"), ("cosine", "real"))
        for term in column(f"{name}{part}", times * order, of)
    ]


def orders_seen(motions: Sequence[Motion]) -> tuple[Shape, ...]:
    """The strongest lines of the torque over the angle of a motor alone.

    A motor that turns by less than once cannot tell neighbouring lines apart: usual orders are tried, too, of
    which some periods lie within the travel. What does not come again there is as well a spring.
    """
    turns = float(np.median([np.ptp(one.position) for one in motions])) / (2.0 * math.pi)
    usual = [float(n) for n in RIPPLE_ORDERS if n * turns >= LEAST_PERIODS] if turns < 1.0 else []
    return tuple({"order": order} for order in sorted({*usual, *strongest_orders(motions)}))


def orders_closer(shape: Shape) -> Sequence[Shape]:
    """About the one found, and the grid once more.

    The lines of a spectrum have no slope between them that leads from one to another, and what is lacking
    beside a ripple on the grid may have hidden which line it is.
    """
    near = [shape["order"] + k / 2 for k in range(-6, 7)]
    return [{"order": order} for order in sorted({*near, *map(float, RIPPLE_ORDERS)})]


def _turning(motion: Motion, order: float) -> Any:
    """exp(i order position), complex (n,); from the order two below, which costs a tenth of a sine."""
    if order <= RIPPLE_ORDERS[0] or order % 2:
        return motion.remember(("turning", order), lambda: np.exp(1j * order * motion.position))
    step = motion.remember(("turning", 2), lambda: np.exp(2j * motion.position))
    return motion.remember(("turning", order), lambda: _turning(motion, order - 2) * step)


EFFECT = Effect(
    id="torque_ripple",
    title="Torque ripple",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={
        f"{order}{part}": replace(ripple, title=f"{ripple.title}, {part}")
        for order, ripple in HARMONICS.items()
        for part in ("sine", "cosine")
    },
    columns=columns,
    coordinate="motor angle",
    equation=Row.PIP,
    explanation="Both joints miss the same tension, which repeats with the motor angle.",
    reveal="a slow sine of large amplitude on the motor bench",
    mend="Use a motor with more commutator segments, or compensate its torque by its angle.",
    shapes=tuple({"order": float(n)} for n in RIPPLE_ORDERS),
    shape_units={"order": "1/turn"},
    shapes_seen=orders_seen,
    closer=orders_closer,
    bench=True,
    formula=Formula(
        equation=r"\tau_m = \sum_{k=1}^{3} A_k\sin kn\theta_m + B_k\cos kn\theta_m",
        symbols=(
            "A, B: amplitudes at the order and its multiples, the third of a motor alone only. n: periods a "
            "turn of the pulley."
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
