"""Torque that repeats with the motor angle."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fingerlab.effects.base import BOTH_JOINTS, Effect, Example, Formula, Row, Shape, Term
from fingerlab.effects.transmission import RIPPLE_ORDERS, drive_terms, pull_terms, turning_with
from fingerlab.physics.motion import LEAST_PERIODS, Motion, strongest_lines
from fingerlab.physics.parameter import Limits, Parameter

MOST_RIPPLE = 0.2
"""Amplitude, N m; assumed: five times the spread of the torque of a motor alone as it is read, for cogging
may be most of what moves one."""
RIPPLE = Parameter("N m", -MOST_RIPPLE, MOST_RIPPLE, 0.003, title="amplitude")

DOUBLE = Parameter("N m", -MOST_RIPPLE, MOST_RIPPLE, 0.001, title="amplitude at the second order")

TRIPLE = Parameter(
    "N m", -MOST_RIPPLE, MOST_RIPPLE, 0.001, title="amplitude at the third order", cable="none"
)
"""Of a motor alone: behind a finger's cable nobody would tell it from the joints' own friction."""


HARMONICS: dict[str, Parameter] = {"": RIPPLE, "double_": DOUBLE, "triple_": TRIPLE}

LINES = ("order", "second_order", "third_order")
"""Of a motor alone three lines of its spectrum: the order and its multiples, where no others are strong.
Teeth, poles and an amplifier's offset repeat at orders that have nothing to do with each other."""
ANOTHER_LINE = 0.05
"""Share of the strongest line's power from which on one that is no multiple of it is another one; assumed."""
CLOSEST_STEPS = tuple(sign * 2.0**k for k in (-3, -5, -7) for sign in (-1.0, 1.0))
"""Steps of an order, per turn, about a peak that tells it to a hundredth of its line's width; assumed."""
WEIGHT = "weight"
"""Switch of a shape: the torque goes with sine and cosine of the angle, as the weight of a link does."""
WEIGHS = {"order": 1.0, WEIGHT: 1.0}
MOST_WEIGHT = 1.0
"""Of a link's weight, N m; assumed: it may move the axis more than all else does."""


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A torque with the period of the order, and its double: no mesh or commutator makes a pure sine.

    Of a motor alone, with the third harmonic, too: cogging is as sharp as its teeth.
    """
    lines = _lines(shape)
    harmonics = 1 if shape.get(WEIGHT) else 3 if motion.finger is None else 2

    def column(gain: str, of: float, part: str) -> list[Term]:
        pull = motion.remember(
            ("ripple", of, part), lambda: getattr(turning_with(motion, of), part) / motion.radius
        )
        return drive_terms(motion, gain, pull) if motion.finger is None else pull_terms(gain, pull)

    return [
        term
        for order, name in zip(lines[:harmonics], HARMONICS, strict=False)
        for part, of in (("sine", "imag"), ("cosine", "real"))
        for term in column(f"{name}{part}", order, of)
    ]


def _lines(shape: Shape) -> list[float]:
    """Orders of the three lines."""
    return [shape.get(name, times * shape["order"]) for times, name in enumerate(LINES, 1)]


def orders_seen(motions: Sequence[Motion]) -> tuple[Shape, ...]:
    """The strongest lines of the torque over the angle of a motor alone.

    A motor that turns by less than once cannot tell neighbouring lines apart: usual orders are tried, too, of
    which some periods lie within the travel. What does not come again there is as well a spring; but a joint
    carries a link, whose weight goes with sine and cosine of its angle.
    """
    turns = float(np.median([np.ptp(one.position) for one in motions])) / (2.0 * math.pi)
    found = strongest_lines(motions)
    usual = [float(n) for n in RIPPLE_ORDERS if n * turns >= LEAST_PERIODS] if turns < 1.0 else []
    shapes = (*({"order": order} for order in sorted({*usual, *found})), *_of_unrelated(found))
    swings = turns < LEAST_PERIODS and all(one.revolute for one in motions)
    return (WEIGHS, *shapes) if swings else shapes


def _of_unrelated(found: dict[float, float]) -> Sequence[Shape]:
    """Shapes of two and of three strong lines that are no multiples of each other, if there are such."""
    apart: list[float] = []
    for order, power in found.items():
        if power >= ANOTHER_LINE and not any(_is_multiple(order, other) for other in apart):
            apart.append(order)
    return [dict(zip(LINES, apart[:count], strict=False)) for count in (2, 3) if len(apart) >= count]


def _is_multiple(one: float, other: float) -> bool:
    """Whether one order is about a small multiple of the other: both are told in quarters."""
    low, high = sorted((one, other))
    times = round(high / low)
    return times <= len(LINES) and abs(high - times * low) <= (times + 1) / 8


def _closer(shape: Shape) -> Sequence[Shape]:
    """About the order found, and about its double as far as usual orders go.

    On a grid what a line leaves beside it may pass for the double of another one: then that is the order, and
    no way downhill leads from one line of a spectrum to the next.
    """
    if shape.get(WEIGHT):
        return (shape,)
    if LINES[1] in shape:
        moved = [
            {**shape, name: shape[name] + step}
            for name in LINES
            if name in shape
            for step in (-0.5, -0.25, 0.25, 0.5, *_closest(shape[name]))
        ]
        return [shape, *moved]
    # Below the usual orders a finger's motor turns by less than a period: what does not come again is a
    # spring.
    least = RIPPLE_ORDERS[0] if shape["order"] >= RIPPLE_ORDERS[0] else shape["order"] / 2.0
    steps = (*(k / 2 for k in range(-6, 7)), *_closest(shape["order"]))
    near = [order for step in steps if (order := shape["order"] + step) >= least]
    doubles = [2.0 * order for order in near if 2.0 * order <= RIPPLE_ORDERS[-1]]
    return [{"order": order} for order in sorted({*near, *doubles})]


def _closest(order: float) -> Sequence[float]:
    """Small steps from the order of a line that is at no quarter: its peak tells it about."""
    return () if 4.0 * order == round(4.0 * order) else CLOSEST_STEPS


def _limits(shape: Shape) -> Limits | None:
    return (-MOST_WEIGHT, MOST_WEIGHT) if shape.get(WEIGHT) or _is_once_a_turn(shape) else None


def _is_once_a_turn(shape: Shape) -> bool:
    """Whether it may be a weight that turns over, which is as large as the motor can carry, and no ripple."""
    return shape.get("order") == 1.0


TITLE = "Torque ripple"


def _title_of_an_axis(shape: Shape) -> str:
    """What goes once a turn is told by its cause: nobody calls the weight of a link a ripple."""
    if shape.get(WEIGHT):
        return "Weight of a link out of balance"
    return f"{TITLE} once a turn" if _is_once_a_turn(shape) else TITLE


def _of_an_axis(shape: Shape) -> str:
    if shape.get(WEIGHT):
        return (
            "The motor's equation misses a torque that goes with the sine of its angle, once a turn: that of "
            "the weight of a link, or of whatever is out of balance."
        )
    if _is_once_a_turn(shape):
        return (
            "The motor's equation misses a torque that repeats once a turn, as that of a weight out of "
            "balance or of a part out of true."
        )
    return "The motor's equation misses a torque, which repeats with the motor angle."


EFFECT = Effect(
    id="torque_ripple",
    title=TITLE,
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
    title_of_an_axis=_title_of_an_axis,
    reveal="a slow sine of large amplitude on the motor bench",
    reveal_of_an_axis="slow motion over a large travel",
    mend="Use a motor with more commutator segments, balance what it carries, or compensate its torque by "
    "its angle.",
    shapes=tuple({"order": float(n)} for n in RIPPLE_ORDERS),
    shape_units=dict.fromkeys(LINES, "1/turn"),
    shapes_seen=orders_seen,
    switches_seen=(WEIGHT,),
    closer=_closer,
    bench=True,
    formula=Formula(
        equation=r"\tau_m = \sum_{k=1}^{3} A_k\sin n_k\theta_m + B_k\cos n_k\theta_m",
        symbols=(
            "A, B: amplitudes, the third of a motor alone only. n: periods a turn of the output, the second "
            "and third of them multiples of the first, but where a motor alone shows another strong line. Of "
            "an axis that turns by less than two turns a single n = 1 is tried, too: the weight of a link."
        ),
        source="Ours: the first terms of a Fourier series over a turn, assumed.",
        values={
            "sine": "A_1",
            "cosine": "B_1",
            "double_sine": "A_2",
            "double_cosine": "B_2",
            "triple_sine": "A_3",
            "triple_cosine": "B_3",
            "order": "n_1",
            "second_order": "n_2",
            "third_order": "n_3",
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
