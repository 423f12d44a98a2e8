"""The terms that a law may be drafted of: simple functions of the measured state, in each equation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from fingerlab.diagnosis.draft.terms import TORQUE, DraftTerm, Powers, TermPart
from fingerlab.diagnosis.settings import (
    DRAFT_DELAYS_S,
    DRAFT_ENDS_DEG,
    DRAFT_LATE_S,
    DRAFT_MEMORIES_S,
    DRAFT_STRIBECK,
    DRAFT_TRAVELS_DEG,
    SLACK_TENSION_N,
)


@dataclass(frozen=True)
class _Axis:
    """An angle with its derivatives, as expressions."""

    place: str
    angle: str
    speed: str
    acceleration: str
    what: str  # "joint" or "motor"
    symbol: str
    travel_deg: float

    @property
    def way(self) -> str:
        """Direction of travel, -1 to 1, which runs to the other side over a travel."""
        return state_of(self.angle)


def state_of(angle: str, travel_deg: str = "§", sharpness: str = "¤") -> str:
    """Direction of travel of an angle."""
    return f"friction_state({angle}, np.radians({travel_deg}), {sharpness})"


RAD: Powers = {"rad": 1}
SPEED: Powers = {"rad": 1, "s": -1}
PURE: Powers = {}
NEWTON: Powers = {"N": 1}


Travel = tuple[float, float]
"""Least and largest angle of a joint over the recordings, rad."""


def library(
    joints: Mapping[str, Travel] | None,
    contact: bool,
    bench: bool,
    orders: Sequence[float],
    second: float,
    newton: float,
    radian: float = 1.0,
) -> Iterator[DraftTerm]:
    """All terms, simpler ones first in each place.

    Args:
        joints: travel of ``mcp`` and ``pip``; None: there are no runs of a finger.
        contact, bench: whether there are runs of a finger that presses, of a motor alone.
        orders: periods a turn at which a motor's torque may repeat.
        second, newton, radian: s, N and rad of a motor's angle in the fit's units of them.
    """
    if bench:
        axis = _Axis(
            "bench", "motion.position", "motion.velocity", "motion.acceleration", "motor", r"\theta_m", 0.3
        )
        yield from _of_an_axis(axis, second, radian)
        yield from _of_a_load(axis, "bench", "np.abs(load)", "load", r"|\tau_l|", TORQUE)
        yield from _ripple("bench", orders, radian)
    if joints is None:
        return
    motor = _Axis(
        "motor", "motion.position", "motion.velocity", "motion.acceleration", "motor", r"\theta_m", 0.3
    )
    yield from _of_an_axis(motor, second)
    yield from _of_a_load(motor, "motor", "tension * motion.radius", "tension", r"rT", TORQUE)
    yield from _ripple("motor", orders)
    each: list[list[DraftTerm]] = []
    for joint, other, number in (("mcp", "pip", 1), ("pip", "mcp", 2)):
        angle = f"q.{joint}"
        axis = _Axis(
            joint, angle, f"{angle}_velocity", f"{angle}_acceleration", "joint", rf"\theta_{number}", 0.17
        )
        mine = [
            *_of_an_axis(axis, second),
            *_of_an_end(axis, joints[joint]),
            *_of_a_load(axis, joint, "tension", "tension", "T", NEWTON),
        ]
        if contact:
            mine += _of_a_load(axis, joint, "force", "force", "F", NEWTON)
        each.append([*mine, *_beside_another(axis, f"q.{other}", rf"\theta_{3 - number}")])
    yield from _in_either("joints", *each)
    yield from _of_the_cable(second, newton, contact)
    sensors = (_of_a_sensor(joint, number, second) for joint, number in (("mcp", 1), ("pip", 2)))
    yield from _in_either("sensors", *sensors)
    if contact:
        yield from _of_the_tip(second)


def _in_either(together: str, mcp: Iterable[DraftTerm], pip: Iterable[DraftTerm]) -> Iterator[DraftTerm]:
    """Functions of one joint, of the other, and of either in its own with coefficients of their own."""
    for pair in zip(mcp, pip, strict=True):
        yield from pair
        parts = tuple(replace(part, place=term.place) for term in pair for part in term.parts)
        yield replace(pair[0], place=together, parts=parts)


def _one(
    place: str,
    name: str,
    code: str,
    words: str,
    latex: str,
    unit: Powers,
    variables: Sequence[str],
    coordinate: str,
    *,
    friction: bool = False,
    number: float = 0.0,
    size: float = 1.0,
) -> DraftTerm:
    """A term of one function; ``number`` stands for the § in its code and words, in ``size`` units."""
    part = TermPart(code, words, latex, unit)
    return DraftTerm(place, name, (part,), tuple(variables), coordinate, friction, number, 0.0, size)


# One term a line or two: a table, which the formatter would pull apart.
# fmt: off
def _of_an_axis(axis: _Axis, second: float, radian: float = 1.0) -> Iterator[DraftTerm]:
    """Functions of an axis' own motion, its past and the time."""
    one, by_travel = partial(_one, axis.place), partial(_one, axis.place, friction=True, size=radian)
    a, v, w, z, what, s = axis.angle, axis.speed, axis.acceleration, axis.way, axis.what, axis.symbol
    travel = axis.travel_deg
    speed, angle, acceleration = f"{what} speed", f"{what} angle", f"{what} acceleration"
    way = f"direction of the {what}'s travel"

    yield one("speed", v, speed, rf"\dot{s}", SPEED, (speed,), speed)
    yield by_travel("direction", z, way, rf"z({s})", PURE, ("direction",), speed, number=travel)
    yield one("angle", a, angle, s, RAD, (angle,), angle)
    yield one("acceleration", w, acceleration, rf"\ddot{s}",
              {"rad": 1, "s": -2}, (acceleration,), acceleration)
    yield one("speed_squared", f"{v} * np.abs({v})", f"square of {speed}, against it",
              rf"\dot{s}|\dot{s}|", {"rad": 2, "s": -2}, (speed,), speed)
    yield one("speed_root", f"np.sign({v}) * np.sqrt(np.abs({v}) / {second / radian:g})",
              f"root of {speed} in rad/s, against it", rf"\sqrt{{|\dot{s}|}}\,\mathrm{{sgn}}\,\dot{s}",
              PURE, (speed,), speed, friction=True)
    for slow in DRAFT_STRIBECK:
        yield one(f"slow_{_plain(slow)}", f"{state_of(a, f'{travel:g}', '0')} * np.exp(-(({v}) / §) ** 2)",
                  f"{way}, while slower than § rad/s", rf"z({s})\,e^{{-(\dot{s}/{slow:g})^2}}",
                  PURE, ("direction", speed), speed, friction=True, number=slow, size=radian / second)
    for over in DRAFT_TRAVELS_DEG:
        yield by_travel(f"way_{_plain(over)}", z, f"way of the {what} since reversal, over §°",
                         rf"z({s};\delta)", PURE, ("way since reversal",), speed, number=over)
    yield by_travel("dahl", f"dahl_states({a}, [np.radians(§)])[0]",
                     f"friction of the {what} that builds up over §° (Dahl)", rf"d({s};\delta)",
                     PURE, ("way since reversal",), speed, number=DRAFT_TRAVELS_DEG[1])
    yield by_travel("one_way", f"np.maximum({z}, 0.0)", f"{way}, forward only", rf"\max(z({s}),0)",
                     PURE, ("direction",), speed, number=travel)
    yield one("speed_one_way", f"np.maximum({v}, 0.0)", f"{speed}, forward only", rf"\max(\dot{s},0)",
              SPEED, (speed, "direction"), speed)
    yield one("angle_squared", f"{a} ** 2", f"square of {angle}", f"{s}^2", {"rad": 2}, (angle,), angle)
    yield one("angle_cubed", f"{a} ** 3", f"cube of {angle}", f"{s}^3", {"rad": 3}, (angle,), angle)
    yield one("angle_speed", f"{a} * {v}", f"{angle} times speed", rf"{s}\dot{s}",
              {"rad": 2, "s": -1}, (angle, speed), angle)
    yield by_travel("angle_way", f"{a} * {z}", f"{angle} times direction", rf"{s}\,z({s})",
                     RAD, (angle, "direction"), angle, number=travel)
    for past in DRAFT_MEMORIES_S:
        yield one(f"past_{_plain(past)}", f"{a} - first_order_lags({a}, [§], motion.sample_rate_hz)[0]",
                  f"{angle} less its past over § s", rf"{s}-\frac{{{s}}}{{1+\tau p}}",
                  RAD, (angle, "past"), "time", number=past, size=second)
    yield one("time", "motion.time", "time", "t", {"s": 1}, ("time",), "time")


def _of_an_end(axis: _Axis, travel: Travel) -> Iterator[DraftTerm]:
    """What acts near either end of a joint's travel only."""
    one = partial(_one, axis.place)
    low, high = travel
    for name, depth, end in (
        ("high_end", f"{axis.angle} - {high:.4g} + np.radians(§)", "largest"),
        ("low_end", f"{low:.4g} + np.radians(§) - {axis.angle}", "least"),
    ):
        inside = f"np.maximum({depth}, 0.0)"
        words = f"joint angle in the last §° before its {end}"
        latex = rf"\max(\delta-|{axis.symbol}-{axis.symbol}^{{e}}|,0)"
        for last in DRAFT_ENDS_DEG:
            yield one(f"{name}_{_plain(last)}", inside, words, latex,
                      RAD, ("joint angle", "end of travel"), "joint angle", number=last)
            # Two round faces that meet (Hertz 1882), in units of 1 rad.
            yield one(f"round_{name}_{_plain(last)}", f"{inside} ** 1.5", f"{words}, to the power of 1.5",
                      f"{latex}^{{1.5}}", RAD, ("joint angle", "end of travel"), "joint angle", number=last)
        # It takes energy as it is pressed (Hunt and Crossley 1975).
        yield one(f"damped_{name}", f"{inside} * {axis.speed}", f"{words}, times speed",
                  rf"{latex}\,\dot{axis.symbol}", {"rad": 2, "s": -1},
                  ("joint angle", "end of travel", "joint speed"), "joint angle", number=DRAFT_ENDS_DEG[1])


def _of_a_sensor(joint: str, number: int, second: float) -> Iterator[DraftTerm]:
    """By how much the reading of a joint's angle is false."""
    one = partial(_one, f"sensor_{joint}")
    a, s = f"q.{joint}", rf"\theta_{number}"
    for times in (2, 4, 8):
        waves = _waves(str(times), a, "joint angle", s)
        yield DraftTerm(f"sensor_{joint}", f"wave_{times}", waves, ("joint angle",), "joint angle")
    yield one("way", state_of(a), "way of the joint since reversal, over §°", rf"z({s};\delta)",
              PURE, ("way since reversal",), "joint speed", number=DRAFT_TRAVELS_DEG[0])
    yield one("time", "motion.time", "time", "t", {"s": 1}, ("time",), "time")
    for late in DRAFT_DELAYS_S:
        yield one(f"late_{_plain(late)}", f"{a} - np.interp(motion.time + §, motion.time, {a})",
                  "change of the angle over § s", rf"{s}(t)-{s}(t+d)",
                  RAD, ("lateness",), "motor speed", number=late, size=second)


def _of_a_load(
    axis: _Axis, place: str, load: str, name: str, symbol: str, unit: Powers
) -> Iterator[DraftTerm]:
    """What grows with what an axis carries."""
    a, v, z, what, s = axis.angle, axis.speed, axis.way, axis.what, axis.symbol
    drawn = "force" if name == "force" else "tension times direction of travel"

    def one(ending: str, code: str, words: str, latex: str, more: Powers, of: str) -> DraftTerm:
        powers = {key: unit.get(key, 0) + more.get(key, 0) for key in {**unit, **more}}
        number = axis.travel_deg if "§" in code else 0.0
        return _one(place, f"{name}_{ending}", code, words, latex, powers, (name, of), drawn,
                    friction=of == "direction", number=number)

    yield one("way", f"{load} * {z}", f"{name} times direction", rf"{symbol}\,z({s})", PURE, "direction")
    yield one("one_way", f"{load} * np.maximum({z}, 0.0)", f"{name} times direction, forward only",
              rf"{symbol}\,\max(z({s}),0)", PURE, "direction")
    # What sticks is not let go when the load rises, and slides at a share of it (load_dependent_friction).
    held = f"rubbing_forces({a}, np.abs({load}), [np.mean(np.abs({load})) / np.radians(§)])[0]"
    yield one("held", held, f"friction that grows with {name}", rf"f({s};|{symbol}|)", PURE, "direction")
    yield one("speed", f"{load} * {v}", f"{name} times {what} speed", rf"{symbol}\dot{s}",
              SPEED, f"{what} speed")
    yield one("angle", f"{load} * {a}", f"{name} times {what} angle", rf"{symbol}{s}", RAD, f"{what} angle")
    if name != "load":
        doubled = {key: 2 * power for key, power in unit.items()}
        yield _one(place, f"{name}_squared", f"{load} ** 2", f"square of {name}", f"{symbol}^2",
                   doubled, (name,), name)


def _waves(times: str, angle: str, of: str, symbol: str, in_si: str = "") -> tuple[TermPart, ...]:
    """Sine and cosine of a multiple of an angle, a wave of any phase; ``in_si``: the multiple as told."""
    told = in_si or times
    return tuple(
        TermPart(f"np.{wave}({times} * {angle})", f"{title} of {told} times {of}",
             rf"\{wave} {told}{symbol}", PURE)
        for wave, title in (("sin", "sine"), ("cos", "cosine"))
    )


def _ripple(place: str, orders: Sequence[float], radian: float = 1.0) -> Iterator[DraftTerm]:
    """Waves over the motor's turn, of any phase."""
    for order in orders:
        waves = _waves(f"{order:g}", "motion.position", "motor angle", r"\theta_m", f"{order / radian:g}")
        yield DraftTerm(place, f"ripple_{_plain(order)}", waves, ("motor phase",), "motor angle")


def _beside_another(axis: _Axis, other: str, symbol: str) -> Iterator[DraftTerm]:
    """What the other joint does to this one, and weight."""
    one = partial(_one, axis.place)
    a, s = axis.angle, axis.symbol
    yield one("other", other, "the other joint's angle", symbol, RAD, ("other joint",), "joint angle")
    yield one("other_speed", f"{other}_velocity", "the other joint's speed", rf"\dot{symbol}",
              SPEED, ("other joint",), "joint speed")
    yield one("other_acceleration", f"{other}_acceleration", "the other joint's acceleration",
              rf"\ddot{symbol}", {"rad": 1, "s": -2}, ("other joint",), "joint acceleration")
    yield one("product", f"{a} * {other}", "product of both angles", f"{s}{symbol}",
              {"rad": 2}, ("joint angle", "other joint"), "joint angle")
    yield one("difference", "q.mcp - q.pip", "difference of the joint angles", r"(\theta_1-\theta_2)",
              RAD, ("joint angle", "other joint"), "difference of joint angles")
    body, latex = ("q.mcp", r"\theta_1") if axis.place == "mcp" else ("q.mcp + q.pip", r"(\theta_1+\theta_2)")
    weight = tuple(
        TermPart(f"np.{wave}({body} - motion.finger.wrist_angle)", f"{title} of the link's angle to the base",
             rf"\{wave} {latex}", PURE)
        for wave, title in (("cos", "cosine"), ("sin", "sine"))
    )
    yield DraftTerm(axis.place, "weight", weight, ("gravity", "joint angle"), "joint angle")


def _of_the_cable(second: float, newton: float, contact: bool) -> Iterator[DraftTerm]:
    """Lengths of cable."""
    one = partial(_one, "cable")
    lag = "first_order_lags(tension, [§], motion.sample_rate_hz)[0]"
    yield one("tension", "tension", "tension", "T", NEWTON, ("tension",), "tension")
    yield one("tension_late", lag, "tension, late by § s", r"\frac{T}{1+\tau p}",
              NEWTON, ("tension",), "tension", number=DRAFT_LATE_S, size=second)
    yield one("loose", "way_while(motion.position, tension < §)",
              "way of the motor while tension is below § N", r"[\theta_m-\theta_m(t_0)]_{T<T_0}",
              RAD, ("slack", "tension"), "tension", number=SLACK_TENSION_N / newton, size=newton)
    yield one("tension_squared", "tension ** 2", "square of tension", "T^2",
              {"N": 2}, ("tension",), "tension")
    yield one("speed", "motion.velocity", "motor speed", r"\dot\theta_m",
              SPEED, ("motor speed",), "motor speed")
    for travel in (0.3, *DRAFT_TRAVELS_DEG):
        yield one(f"way_{_plain(travel)}", state_of("motion.position"),
                  "way of the motor since reversal, over §°", r"z(\theta_m;\delta)",
                  PURE, ("way since reversal",), "motor speed", number=travel)
    for joint, number in (("mcp", 1), ("pip", 2)):
        a, s, name = f"q.{joint}", rf"\theta_{number}", joint.upper()
        angle = ("joint angle",)
        yield one(f"{joint}_squared", f"{a} ** 2", f"square of {name} angle", f"{s}^2",
                  {"rad": 2}, angle, *angle)
        yield one(f"{joint}_cubed", f"{a} ** 3", f"cube of {name} angle", f"{s}^3",
                  {"rad": 3}, angle, *angle)
        yield one(f"{joint}_speed", f"{a}_velocity", f"{name} speed", rf"\dot{s}",
                  SPEED, ("joint speed",), "joint speed")
        for times in (2, 4):
            waves = _waves(str(times), a, f"{name} angle", s)
            yield DraftTerm("cable", f"{joint}_wave_{times}", waves, angle, *angle)
    yield one("product", "q.mcp * q.pip", "product of both angles", r"\theta_1\theta_2",
              {"rad": 2}, ("joint angle", "other joint"), "joint angle")
    for past in DRAFT_MEMORIES_S:
        yield one(f"past_{_plain(past)}", f"tension - {lag}", "tension less its past over § s",
                  r"T-\frac{T}{1+\tau p}", NEWTON, ("tension", "past"), "time", number=past, size=second)
    yield one("time", "motion.time", "time", "t", {"s": 1}, ("time",), "time")
    if contact:
        yield one("force", "force", "endpoint force", "F", NEWTON, ("force",), "force")


def _of_the_tip(second: float) -> Iterator[DraftTerm]:
    """Forces at the fingertip: across the load cell, and on it beyond its reading."""
    turned = state_of("(q.mcp + q.pip)", "0.17", "0")
    for place in ("tip", "cell"):
        one = partial(_one, place)
        yield one("force", "force", "endpoint force", "F", NEWTON, ("force",), "force")
        if place == "cell":
            yield one("drift", "force * motion.time", "endpoint force times time", "Ft",
                      {"N": 1, "s": 1}, ("force", "time"), "time")
            for late in DRAFT_DELAYS_S:
                yield one(f"late_{_plain(late)}", "force - np.interp(motion.time + §, motion.time, force)",
                          "change of the force over § s", "F(t)-F(t+d)", NEWTON, ("lateness",), "motor speed",
                          number=late, size=second)
        yield one("force_squared", "force ** 2", "square of endpoint force", "F^2",
                  {"N": 2}, ("force",), "force")
        yield one("force_way", f"force * {turned}", "endpoint force times direction",
                  r"F\,z(\theta_1+\theta_2)", NEWTON, ("force", "direction"), "force", friction=True)
# fmt: on


def _plain(number: float) -> str:
    """A number as a part of a name."""
    return f"{number:g}".replace(".", "p").replace("-", "m").replace("+", "")
