"""What an effect is: one object that fit, ranking, plots and report work from; its example and its grid.

An effect adds *terms* to the equations. Every equation is written as measured minus modelled, and a
term is a column of the modelled side times an unknown gain:

* ``MCP`` and ``PIP``: cable tension (N) that the motor channel gives, minus the tension that the joint's
  torque balance implies. A term with ``scale="joint"`` is a torque at the joint (N m); the fit divides it
  by the signed moment arm. A term with ``scale="direct"`` is a tension (N).
* ``CABLE``: cable wound on the pulley (m) minus the length that the joints call for. A term with
  ``scale="direct"`` is a length (m), one with ``scale="arm_mcp"`` or ``"arm_pip"`` an angle (rad) that the
  signed moment arm turns into a length.
  One with ``scale="compliance"`` is a tension (N) that the motor gives and the cable never sees; the cable's
  compliance turns it into a length.
* ``BENCH``: motor torque (N m) of a motor-bench run minus its nominal equation.
* ``TIP``: depth of the pressing fingertip (m) from the joint angles minus that of the load cell's face.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import InitVar, dataclass, field, fields, replace
from enum import IntEnum
from typing import Final, Literal

import numpy as np

from fingerlab.physics.motion import Motion
from fingerlab.physics.nominal import JointMotion
from fingerlab.physics.parameter import Parameter, Role
from fingerlab.rig.file import Finger, Motor
from fingerlab.sessions.model import Array

FINGER = Finger(0.01, 0.01, 0.02, 0.02, 1e-6, 2e-6, 0.1, 0.05, wrist_angle=0.0, gravity=10.0)
MOTOR = Motor(pulley_radius=0.01, inertia=1e-4)
JOINTS = tuple(field.name for field in fields(JointMotion))

Signal = float | Sequence[float] | Array


@dataclass(frozen=True)
class Example:
    """What an effect's columns are at one point of its shapes.

    Attributes:
        shape: point of the grid, or between.
        signals: of the motion, SI, by their names in ``Motion`` and ``JointMotion``; a number holds all the
            time, and what is not named is zero.
        expected: column by "EQUATION gain", as ``"PIP viscous_pip"``; empty where the effect has no column.
        on_bench: whether the motor is alone, without the finger.
        sample_rate_hz: of the signals.
    """

    shape: Mapping[str, float]
    signals: Mapping[str, Signal]
    expected: Mapping[str, Signal]
    on_bench: bool = False
    sample_rate_hz: float = 1000.0

    def motion(self) -> Motion:
        """The motion of the example: round constants (``FINGER``, ``MOTOR``) and the extension cable."""
        length = max((np.size(signal) for signal in self.signals.values()), default=1)

        def signal(name: str) -> Array:
            return np.broadcast_to(np.asarray(self.signals.get(name, 0.0), float), length).copy()

        force = signal("force") if "force" in self.signals else None
        return Motion(
            phase="motor_bench" if self.on_bench else "on_air" if force is None else "contact",
            cable_sign=0 if self.on_bench else -1,
            sample_rate_hz=self.sample_rate_hz,
            time=signal("time"),
            position=signal("position"),
            velocity=signal("velocity"),
            acceleration=signal("acceleration"),
            torque=signal("torque"),
            motor=MOTOR,
            finger=None if self.on_bench else FINGER,
            joints=None if self.on_bench else JointMotion(*map(signal, JOINTS)),
            force=force,
            load=signal("load") if self.on_bench else None,
        )


class Row(IntEnum):
    """The equation that a term stands in."""

    MCP = 0
    PIP = 1
    CABLE = 2
    BENCH = 3
    TIP = 4


EQUATION_FAMILIES = ("joint_torque", "cable_kinematics", "motor_torque", "endpoint_force")
BESIDE_A_FINGER: Final = "beside a finger"
BOTH_JOINTS, MOTOR_ALONE = "Both joints miss the same tension", "The motor's equation misses a torque"
"""How the explanation of an effect of the drive begins, and what stands there for a motor without joints."""
COORDINATE_UNITS = {
    "time": "s",
    "joint speed": "rad/s",
    "joint angle": "rad",
    "joint acceleration": "rad/s^2",
    "difference of joint angles": "rad",
    "motor speed": "rad/s",
    "motor angle": "rad",
    "motor acceleration": "rad/s^2",
    "tension": "N",
    "tension times direction of travel": "N",
    "force": "N",
}
"""What a residual can be plotted against to see an effect -> SI unit. A joint's is that of the
joint whose equation is drawn."""
Scale = Literal["joint", "direct", "arm_mcp", "arm_pip", "compliance"]


@dataclass(frozen=True)
class Term:
    """One column of an equation: ``values`` of shape (n,) times (``constant`` + the gain named ``gain``).

    An empty ``gain`` leaves the constant alone.
    """

    row: Row
    gain: str
    values: Array
    scale: Scale = "direct"
    constant: float = 0.0


Gain = Parameter
"""An unknown strength, as files of users name it."""

Shape = Mapping[str, float]
Columns = Callable[[Motion, Shape], list[Term]]
Closer = Callable[[Shape], Sequence[Shape]]


class PortableColumns:
    """Columns of an effect in no catalogue that another process can be handed: the program's own."""


def of_shape(effect: str, name: str) -> str:
    """Key by which a shape follows a number of another effect's shape."""
    return f"{effect}/{name}"


def as_found(shape: Shape) -> Sequence[Shape]:
    """The shape alone: there is nothing between the points of the grid."""
    return (shape,)


FAMILIES = (
    "Joint friction",
    "Springs of the joints",
    "Mass and gravity",
    "Cable",
    "Motor and gearbox",
    "Sensors",
    "Contact",
    "Others",
)
"""Under which an effect stands in the documents."""


EXAMPLE_TOLERANCE = 1e-6
"""Relative; slopes of angle errors are taken by differences."""


@dataclass(frozen=True)
class Formula:
    r"""What is printed of an effect; symbols as in ``docs/theory.md``, joint j is 1 (MCP) or 2 (PIP).

    Attributes:
        equation: LaTeX that matplotlib's mathtext can draw too.
        symbols: what its symbols mean. source: where the law comes from.
        values: LaTeX symbol of each unknown (gain, nuisance that is set free, or shape), by its name.
        alike: ids of effects whose equations have nearly the same course in ordinary recordings.
    """

    equation: str
    symbols: str
    source: str
    values: Mapping[str, str] = field(default_factory=dict)
    alike: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """A physical effect that the nominal model leaves out.

    Attributes:
        id: fixed name, as commands and files have it. title: in an operator's words.
        acts_on: equation families changed: joint_torque, cable_kinematics, motor_torque, endpoint_force.
        gains: the linear unknowns, by name.
        columns: terms from signals and one point of ``shapes``.
        coordinate: what the residual is plotted against to see this effect (a ``Motion`` quantity).
        equation: the row in which that fingerprint is drawn.
        explanation: one sentence for a person, without numbers.
        of_an_axis: the same of a motor or an axis alone, at a point of ``shapes``; None: as ``explanation``.
        title_of_an_axis: what it is called of one, at a point of ``shapes``; None: ``title``.
        reveal: the experiment that shows the effect where these data could not.
        reveal_of_an_axis: the same of a motor or an axis alone, of whatever size; empty: as ``reveal``.
        mend: what on the bench makes it smaller, a sentence.
        shapes: grid of the nonlinear unknowns; each point is a mapping name -> value.
        shape_units: unit of each nonlinear unknown; what ``shapes`` holds beyond these are switches, 0 or 1.
        shapes_seen: what recordings suggest in place of ``shapes``, from their motions: those of the motor
            alone or, for what shows beside a finger only, of a finger; these may name unknowns that
            ``shapes`` does not.
        switches_seen: switches that they may hold beyond ``shapes``.
        closer: shapes around one that was found, finer than the grid, and of other laws of the same physics
            (what these name beyond the grid's shapes is 0 where it is missing); tried by grid refinement.
        phases: phases of a run in which it can act; empty means all.
        cables: cables that the recording must hold, each, for it to be judged.
        bench: whether it can be told from runs of the motor alone, which it then has columns for; "beside a
            finger": it has them, but alone it is what the bench's own equation fits.
        special: how the fit treats it where it is not a column: "delay" or "slack".
        relaxes: nuisances that this effect sets free (the same terms without the tight prior).
        follows: numbers of a shape that are the sum of other unknowns of the model, and those unknowns' keys,
            or a number of another effect's shape (:func:`of_shape`); grid refinement takes them from the
            model, on the coarse grid they are missing.
        slopes: at a shape, from the gains found there by name: for a number of the shape, by how much each
            gain that stands for a small change of it changes with the number; grid refinement moves the
            number until these gains are nothing.
        turns: by how much (rad) the load cell's face is turned against the finger at a point of ``shapes``;
            what the tip does along the face turns with it.
        arms: how many times as long as usual the joints' moment arms are in a motion at a point of
            ``shapes``, (n,) by equation; what a joint calls for is divided by its arm, whatever brings it.
            Empty where the shape tells nothing of it.
        family: one of ``FAMILIES``. formula: what is printed of it.
        example: a motion and what the columns are in it.
        followed: unknowns whose value is followed over sessions, the effect found missing or not, and what a
            table calls them.
        like_late_torque: at one pace, it takes what a motor's inertia leaves whose torque is logged late.
        widened: names of unknowns whose range was made ten times as wide, once for each time.
        wanders, sticks: as an argument, says of all gains that they differ from run to run, or hold at rest.
    """

    id: str
    title: str
    acts_on: tuple[str, ...]
    gains: Mapping[str, Parameter]
    columns: Columns
    coordinate: str
    equation: Row
    explanation: str
    reveal: str
    mend: str = ""
    reveal_of_an_axis: str = ""
    of_an_axis: Callable[[Shape], str] | None = None
    title_of_an_axis: Callable[[Shape], str] | None = None
    shapes: Sequence[Shape] = ({},)
    shape_units: Mapping[str, str] = field(default_factory=dict)
    shapes_seen: Callable[[Sequence[Motion]], Sequence[Shape]] | None = None
    switches_seen: tuple[str, ...] = ()
    closer: Closer = as_found
    phases: tuple[str, ...] = ()
    cables: tuple[str, ...] = ()
    bench: bool | Literal["beside a finger"] = False
    special: Literal["", "delay", "slack"] = ""
    relaxes: Mapping[str, Parameter] = field(default_factory=dict)
    follows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    slopes: Callable[[Shape, Mapping[str, float]], Mapping[str, Mapping[str, float]]] | None = None
    turns: Callable[[Shape], float] | None = None
    arms: Callable[[Motion, Shape], Mapping[Row, Array]] | None = None
    family: str = FAMILIES[-1]
    formula: Formula | None = None
    example: Example | None = None
    followed: Mapping[str, str] = field(default_factory=dict)
    like_late_torque: bool = False
    widened: tuple[str, ...] = ()
    wanders: InitVar[bool] = False
    sticks: InitVar[bool] = False

    def __post_init__(self, wanders: bool, sticks: bool) -> None:
        if wanders or sticks:
            flagged = {
                name: replace(
                    gain,
                    varies_between_runs=gain.varies_between_runs or wanders,
                    holds_at_rest=gain.holds_at_rest or sticks,
                )
                for name, gain in self.gains.items()
            }
            object.__setattr__(self, "gains", flagged)

    @property
    def explanation_alone(self) -> str:
        """The explanation where there is a motor alone, if none is given of an axis."""
        return self.explanation.replace(BOTH_JOINTS, MOTOR_ALONE)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All of its unknowns, each with its name, role and symbol: gains, nuisances set free, shapes."""
        symbols = {} if self.formula is None else self.formula.values
        linear = [
            replace(one, name=name, symbol=symbols.get(name, "")) for name, one in self.unknowns.items()
        ]
        return (*linear, *(self._shape(name, symbols.get(name, "")) for name in self.shape_units))

    @property
    def unknowns(self) -> dict[str, Parameter]:
        """What a fit finds: the gains, then the nuisances that are set free; by name."""
        free = {name: replace(one, role=Role.NUISANCE) for name, one in self.relaxes.items()}
        return {**self.gains, **free}

    def _shape(self, name: str, symbol: str) -> Parameter:
        values = [float(shape[name]) for shape in self.shapes if name in shape]
        values = values or [0.0, math.inf]  # only recordings suggest some
        low, high, middle = min(values), max(values), values[len(values) // 2]
        unit = self.shape_units[name]
        return Parameter(unit, low, high, middle, "tried", "", name, middle, Role.SHAPE, symbol)

    def law_at(self, shape: int) -> frozenset[str]:
        """Nonlinear unknowns of a point of ``shapes``, by its number; what has others is another law."""
        return frozenset(self.shape_units.keys() & self.shapes[shape].keys() if len(self.shapes) else ())

    def wider(self, names: Sequence[str]) -> Effect:
        """The effect with ten times the range of some of its unknowns, and ten times their usual size."""

        def tenfold(one: Parameter) -> Parameter:
            return replace(one, low=10.0 * one.low, high=10.0 * one.high, typical=10.0 * one.typical)

        def ranges(known: Mapping[str, Parameter]) -> dict[str, Parameter]:
            return {name: tenfold(one) if name in names else one for name, one in known.items()}

        return replace(
            self, gains=ranges(self.gains), relaxes=ranges(self.relaxes), widened=(*self.widened, *names)
        )

    @property
    def excess(self) -> dict[str, str]:
        """Gains that come on top of another one, and that one's name."""
        return {name: gain.excess_of for name, gain in self.gains.items() if gain.excess_of}

    @property
    def offsets(self) -> tuple[str, ...]:
        """Gains of a constant that the joints' losses could be as well."""
        return tuple(name for name, gain in self.gains.items() if gain.degenerate_with)

    def gains_at(self, shape: int) -> dict[str, Parameter]:
        """The gains with the limits that they have at one point of ``shapes``."""
        return {name: gain.at(self.shapes[shape]) for name, gain in self.gains.items()}

    def example_problem(self) -> str:
        """In which column the example expects something else than there is, in words; empty: in none."""
        if self.example is None:
            return ""
        motion, found = self.example.motion(), dict[str, Array]()
        for term in self.columns(motion, self.example.shape):
            key = f"{Row(term.row).name} {term.gain}"
            found[key] = found.get(key, np.zeros(len(motion.time))) + term.values
        for key, values in self.example.expected.items():
            if key not in found:
                return f"expects a column {key!r}, and there are {', '.join(found) or 'none'}"
            expected = np.broadcast_to(np.asarray(values, float), len(motion.time))
            off = ~np.isclose(found[key], expected, rtol=EXAMPLE_TOLERANCE, atol=1e-12)
            if off.any():
                at = int(np.flatnonzero(off)[0])
                return f"expects {expected[at]:g} for {key!r} at sample {at}, and it is {found[key][at]:g}"
        extra = found and not self.example.expected
        return f"expects no column, and there are {', '.join(found)}" if extra else ""


OCTAVE = tuple(2.0 ** (k / 4) for k in range(-4, 5))
"""Factors from one half to two."""
HALF_OCTAVE = OCTAVE[2:-2]
FINE_OCTAVE = tuple(2.0 ** (k / 8) for k in range(-6, 7))
"""Factors for a travel of degrees, on which much of every cycle depends."""
FINEST_OCTAVE = tuple(2.0 ** (k / 16) for k in range(-11, 12))
"""Factors for a speed at which friction turns round: a law that is a tenth off leaves several floors."""
SPEED_FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)
SHARPNESSES = (0.0, 0.5, 1.0)
"""Virgin curves of a friction that builds up (:func:`friction_states.friction_state`): many contacts, parts
that let go evenly, one contact."""
STEEP = 0.7
"""Exponent with which a virgin curve begins that is steep at first: with it parts that let go evenly are
within 1 per cent (rms) of contacts as strong as each other whose travels are spread evenly."""


def times(name: str, factors: Sequence[float] = OCTAVE, least: float = 0.0) -> Closer:
    """The shape with one number multiplied, as far as it does not come below ``least``."""

    def multiplied(shape: Shape) -> list[Shape]:
        found = ({**shape, name: shape[name] * factor} for factor in factors)
        return [one for one in found if one[name] >= least or one[name] == shape[name]]

    return multiplied


def plus(name: str, steps: Sequence[float]) -> Closer:
    """The shape with something added to one number."""
    return lambda shape: [{**shape, name: shape[name] + step} for step in steps]


def either(name: str, values: Sequence[float]) -> Closer:
    """The shape with one number, or switch, set to each of some values."""
    return lambda shape: [{**shape, name: value} for value in values]


REVERSAL_SPEED = "reversal_speed"
"""Number of a shape, rad/s: friction goes by the speed, as its hyperbolic tangent over this, and nothing
sticks. So does the friction of many simulators, and of a film of grease. On the grid of a motor alone, and
between the points of a finger's."""
REVERSAL_SPEEDS = (0.01, 0.025, 0.06, 0.15, 0.4)
FINGER_SPEEDS = (0.012, 0.03, 0.08)
"""The same beside a finger, each looked at to 1.6 times as much: from above the noise of a joint's speed (of
0.05 degrees below 8 Hz) to a tenth of the thesis' motions; assumed."""
FINGER_TRAVELS_DEG = (0.12, 0.3)
"""Where friction found by the speed is looked for by the travel again; usual for joints and motor."""
ALONE = "alone"
"""Switch of a shape: friction of a motor alone, whose grid holds laws of the travel and of the speed."""
ALONE_TRAVELS_DEG = tuple(0.05 * 2.0 ** (k / 2) for k in range(9))
"""Of a motor that winds up no cable: from rigid to the wind-up of a gearbox; assumed."""
STICK_DAMPING = "stick_damping"
"""Number of a shape, s: damping of what sticks, over its stiffness (LuGre's sigma_1 over sigma_0)."""
STICK_DAMPINGS_S = (0.001, 0.002, 0.004, 0.008)
"""Where it is looked for first: 3 ms in the LuGre model's first paper (Canudas de Wit et al. 1995), half of
what is critical for a mass of 1 kg; assumed within a factor of three."""
CLOSING_IN = tuple(2.0 ** (k / 16) for k in (-8, -4, -2, -1, 0, 1, 2, 4, 8))
"""Factors about a travel, and squared about a damping: far and near, for one goes with the other so closely
that a tenth of the one leaves several floors."""
LONGER_TRAVELS = tuple(2.0 ** (k / 8) for k in (0, 1, 2, 3, 4, 6, 8))
"""Factors by which the travel of what sticks may be longer than it seems to be without damping; assumed."""


def rubbing(
    factors: Sequence[float] = HALF_OCTAVE,
    sharpnesses: Sequence[float] = SHARPNESSES,
    speed_factors: Sequence[float] = FINEST_OCTAVE,
    by_speed: bool = False,
    least_speed: float = 0.0,
    afar: bool = True,
) -> Closer:
    """Friction that builds up over other travels and along other virgin curves.

    A sharper curve, 1 - (1 - x / (p d))^p with its p nearer to 1, lacks less work behind every reversal:
    d p / (1 + p). At the same lack it is softer at first, by 1 + 1/p. What goes by the speed is tried over
    other speeds.

    Args:
        by_speed: whether friction beside a finger is tried by the speed, too. least_speed: at which it turns
            round, rad/s. afar: whether a motor alone is tried at travels and speeds far from those found.
    """

    def around(shape: Shape) -> Sequence[Shape]:
        if REVERSAL_SPEED in shape:
            faster = times(REVERSAL_SPEED, speed_factors)(shape)
            near = [one for one in faster if one[REVERSAL_SPEED] >= min(least_speed, shape[REVERSAL_SPEED])]
            return [*near, *(_other_travels(shape, sharpnesses) if afar or not shape.get(ALONE) else [])]
        even = shape["travel_deg"] / (1.0 + shape.get("sharpness", 0.0))
        near = [
            {**shape, "travel_deg": even * (1.0 + sharpness) * factor, "sharpness": sharpness}
            for sharpness in sharpnesses
            for factor in factors
        ]
        if shape.get(ALONE) and not afar:
            return near
        travels = [one["travel_deg"] for one in near]
        far = [
            one for one in _other_travels(shape, sharpnesses)
            if not min(travels) <= one["travel_deg"] <= max(travels)
        ]  # fmt: skip
        beside = FINGER_SPEEDS if by_speed else ()
        return [*near, *far, *_other_speeds(shape, REVERSAL_SPEEDS if shape.get(ALONE) else beside)]

    return around


def falling(around: Closer) -> Closer:
    """Of Stribeck friction: what goes by the speed turns round before it falls with the speed.

    One that falls while it still turns round is viscous friction in other words, and a larger one at that.
    """

    def slower(shape: Shape) -> Sequence[Shape]:
        return [one for one in around(shape) if one.get(REVERSAL_SPEED, 0.0) <= one["stribeck_speed"]]

    return slower


def with_damping(undamped: Closer) -> Closer:
    """Friction of a motor alone, whose sticking may be damped, too; what it is undamped stays in sight.

    A law with a damping has a longer travel than it seemed to have without: both are looked for together.
    """

    def around(shape: Shape) -> Sequence[Shape]:
        bare = {name: value for name, value in shape.items() if name != STICK_DAMPING}
        if not shape.get(ALONE):
            return undamped(bare)
        rest = {name: value for name, value in bare.items() if name != REVERSAL_SPEED}
        found = shape.get(STICK_DAMPING)
        even = shape.get("travel_deg", FINGER_TRAVELS_DEG[0]) / (1.0 + shape.get("sharpness", 0.0))
        travels = CLOSING_IN[1:-1] if found else LONGER_TRAVELS
        dampings = [found * factor**2 for factor in CLOSING_IN] if found else STICK_DAMPINGS_S
        damped = [
            {**rest, "travel_deg": even * factor, "sharpness": 0.0, STICK_DAMPING: damping}
            for factor in travels
            for damping in dampings
        ]
        return [*undamped(bare), *damped]

    return around


def _other_travels(shape: Shape, sharpnesses: Sequence[float]) -> list[Shape]:
    """Beside other effects another travel may be right for a motor alone, or travel in place of speed."""
    rest = {name: value for name, value in shape.items() if name != REVERSAL_SPEED}
    if not shape.get(ALONE):
        travels = FINGER_TRAVELS_DEG if REVERSAL_SPEED in shape else ()
        return [{**rest, "travel_deg": travel} for travel in travels]
    return [
        {**rest, "travel_deg": travel * (1.0 + sharpness), "sharpness": sharpness}
        for sharpness in sharpnesses
        for travel in ALONE_TRAVELS_DEG
    ]


def _other_speeds(shape: Shape, speeds: Sequence[float]) -> list[Shape]:
    """The same friction by the speed."""
    rest = {name: value for name, value in shape.items() if name not in ("travel_deg", "sharpness")}
    return [{**rest, REVERSAL_SPEED: speed} for speed in speeds]


def every(*closer: Closer) -> Closer:
    """All combinations."""

    def combined(shape: Shape) -> Sequence[Shape]:
        found: list[Shape] = [shape]
        for one in closer:
            found = [new for old in found for new in one(old)]
        return found

    return combined


PRESLIDING_TRAVELS_DEG = (1.0, 2.0, 4.0, 8.0)
"""Travel over which what winds up before it slides lets go, degrees at the joint or the pulley; assumed."""


def dahl_or_masing(shape: Shape) -> list[Shape]:
    """Presliding over other travels: by Dahl's law, or by spring-sliders (Masing) of three virgin curves."""
    masing, evenly = either("masing", (1.0,)), rubbing(FINE_OCTAVE, (0.5,))
    return [
        *times("travel_deg", HALF_OCTAVE)(shape),
        *every(masing, either("start", (1.0,)), rubbing(OCTAVE[1:-1], (0.0,)))(shape),
        *every(masing, either("start", (1.0, STEEP)), evenly)(shape),
    ]
