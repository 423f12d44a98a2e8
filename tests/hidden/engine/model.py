"""The bench of one run as a MuJoCo model (MJCF text), and where its parts are in MuJoCo's arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from .bench import Bench

TIMESTEP = 2e-4  # s; the fastest mode (load cell's plate) turns at some 1.2e3 rad/s
TIP_RADIUS = 2e-3  # m
TINY = 1e-9  # kg m^2: MuJoCo wants a moment of inertia where the model has none
PLATE_MASS = 0.02  # kg, of the load cell's button
OUT_OF_REACH = 0.5  # m below the finger
STOP_LOSS = 0.2  # damping ratio of the stop: hard rubber; assumed
SLIDER_INERTIA = 4e-7  # kg m^2: a hundredth of the finger's
SPREAD_INERTIA = 1e-8  # kg m^2, of each of the sliders in a row: together well below that of the distal body
BRISTLE_TIME = 3e-3  # s, damping over stiffness of friction that winds up; assumed
SHEATH_STIFFNESS = 5e4  # N/m of the stuck cable in its sheath; assumed, like the next two
SHEATH_DAMPING = 50.0  # N s/m
SHEATH_MASS = 0.01  # kg
TYPICAL_CABLE_TORQUE = 0.07  # N m at the pulley, by which gears wind up
SLIDERS = 8  # spring-sliders in a row make friction that builds up (Iwan); four give way with a jerk each
STICKS = 'solreffriction="0.0005 1" solimpfriction="0.999 0.9999 0.001"'
"""MuJoCo's friction creeps while it sticks; so hard that the creep stays below 1e-5 rad/s."""
HARD = 'solref="0.002 1" solimp="0.95 0.99 0.0001"'
"""Contact of tip and plate; they chatter when it is harder."""


@dataclass(frozen=True)
class BuiltModel:
    """A model and the indices that the loop needs, the same for positions and speeds."""

    model: mujoco.MjModel
    mcp: int
    pip: int
    motor: int
    plate: int
    drive: int  # actuator: torque on the motor, N m
    cable: int  # actuator: the cable, its force is minus the tension
    rubs: dict[str, int]  # degree of freedom whose friction loss is that of mcp, pip, motor or sheath


def build(bench: Bench, cable: str, contact: bool, posture: tuple[float, float], wear: float) -> BuiltModel:
    """The bench with one cable on.

    Args:
        cable: ``extension`` or ``flexion``. contact: whether the load cell is in reach.
        posture: MCP and PIP (rad) at which the fingertip just touches the load cell.
        wear: factor on all friction of this run.
    """
    model = mujoco.MjModel.from_xml_string(_mjcf(bench, cable, contact, posture, wear))

    def joint(name: str) -> int:
        return int(model.joint(name).qposadr[0])

    names = {model.joint(index).name for index in range(model.njnt)}
    rubs = {}
    for place in ("mcp", "pip", "motor", "sheath"):
        name = f"{place}_rub" if f"{place}_rub" in names else place
        if name in names:
            rubs[place] = joint(name)
    return BuiltModel(
        model,
        joint("mcp"),
        joint("pip"),
        joint("motor"),
        joint("plate"),
        model.actuator("drive").id,
        model.actuator("cable").id,
        rubs,
    )


def fingertip(bench: Bench, mcp: float, pip: float) -> tuple[float, float]:
    """Position (x, z) of the fingertip's centre, m."""
    alpha = bench.finger["wrist_angle"]
    first, second = 2 * bench.finger["proximal_half_length"], 2 * bench.finger["distal_half_length"]
    down1, down2 = mcp - alpha, mcp + pip - alpha
    return (
        first * math.cos(down1) + second * math.cos(down2),
        -first * math.sin(down1) - second * math.sin(down2),
    )


def _mjcf(bench: Bench, cable: str, contact: bool, posture: tuple[float, float], wear: float) -> str:
    sign = 1.0 if cable == "flexion" else -1.0
    a, b = bench.arms[cable]
    g, tilt = bench.finger["gravity"], bench.tilt
    hidden = Hidden()
    _relaxing(hidden, bench)
    _spread(hidden, bench, wear)
    _rubbing(hidden, bench, wear)
    if bench.sheath > 0:
        # The cable sticks in its sheath and gives a little before it slides: friction at the finger's end.
        arms = {"mcp": a, "pip": b}
        hidden.add("sheath_rub", arms, SHEATH_STIFFNESS, 1e-9, mass=SHEATH_MASS, damping=SHEATH_DAMPING)
    return f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{TIMESTEP}" integrator="implicitfast" cone="elliptic" impratio="50"
          gravity="{-g * math.sin(tilt)} 0 {-g * math.cos(tilt)}"/>
  <worldbody>
    {_finger(bench, wear)}
    <body name="rotor" pos="-0.1 0 0">
      <inertial pos="0 0 0" mass="0.01" diaginertia="{TINY} {TINY} {TINY}"/>
      <joint name="motor" axis="0 1 0" armature="{bench.motor["inertia"]}" stiffness="{bench.motor_spring}"
             damping="{bench.motor_viscous * wear}" {_hard(bench.motor_dry * wear, bench.stick["motor"])}/>
    </body>
    {_load_cell(bench, contact, posture)}
    {hidden.bodies}
  </worldbody>
  <tendon>
    <fixed name="cable">
      <joint joint="motor" coef="{bench.motor["pulley_radius"]}"/>
      <joint joint="mcp" coef="{-sign * a}"/><joint joint="pip" coef="{-sign * b}"/>
    </fixed>
    <fixed name="coupling" stiffness="{bench.coupling}" springlength="0">
      <joint joint="mcp" coef="1"/><joint joint="pip" coef="-1"/>
    </fixed>
    {hidden.tendons}
  </tendon>
  <actuator>
    <motor name="drive" joint="motor"/>
    <general name="cable" tendon="cable" gainprm="0" biastype="affine" biasprm="0 0 0"
             forcelimited="true" forcerange="-1000 0"/>
  </actuator>
</mujoco>"""


def _finger(bench: Bench, wear: float) -> str:
    """Two rods. The part of the distal inertia that turns with the relative rate sits in the joint, as in
    the thesis' energy; the rest is the body's, as in nature."""
    f = bench.finger
    l1, l2 = f["proximal_half_length"], f["distal_half_length"]
    spin = f["distal_inertia"] * bench.absolute_spin
    i1, i2 = f["proximal_inertia"], max(spin, TINY)
    stop = ""
    if bench.stop is not None:
        edge, swing = bench.stop
        stop = f'limited="true" range="{-edge} 3" solreflimit="{swing / STOP_LOSS} {STOP_LOSS}"'
    screws = ""
    if bench.screws > 0:
        screws = (
            f'<body pos="{l2} 0 0"><inertial pos="0 0 0" mass="{bench.screws}" '
            f'diaginertia="{TINY} {TINY} {TINY}"/></body>'
        )
    return f"""
    <body name="proximal" euler="0 {-f["wrist_angle"]} 0">
      <inertial pos="{l1} 0 0" mass="{f["proximal_mass"]}" diaginertia="{i1} {i1} {i1}"/>
      <joint name="mcp" axis="0 1 0" stiffness="{f["mcp_stiffness"]} 0 {bench.cubic[0]}"
             damping="{bench.viscous[0] * wear}" {_hard(bench.dry[0] * wear, bench.stick["joint"])}/>
      <body name="distal" pos="{2 * l1} 0 0">
        <inertial pos="{l2} 0 0" mass="{f["distal_mass"]}" diaginertia="{i2} {i2} {i2}"/>
        <joint name="pip" axis="0 1 0" stiffness="{f["pip_stiffness"]} 0 {bench.cubic[1]}" {stop}
               armature="{f["distal_inertia"] - spin}"
               damping="{bench.viscous[1] * wear}" {_hard(bench.dry[1] * wear, bench.stick["joint"])}/>
        <geom name="tip" type="sphere" size="{TIP_RADIUS}" pos="{2 * l2} 0 0" mass="0"
              friction="{bench.tip_friction} 0 0" {HARD}/>
        {screws}
      </body>
    </body>"""


def _load_cell(bench: Bench, contact: bool, posture: tuple[float, float]) -> str:
    """A plate on stiff springs; its deflection along z is what the cell reads. The face may lean."""
    x, z = fingertip(bench, *posture)
    x, z = x - TIP_RADIUS * math.sin(bench.lean), z - TIP_RADIUS * math.cos(bench.lean)
    z -= 0.0 if contact else OUT_OF_REACH
    depth = 0.005
    return f"""
    <body name="cell" pos="{x} 0 {z}" gravcomp="1">
      <inertial pos="0 0 0" mass="{PLATE_MASS}" diaginertia="1e-6 1e-6 1e-6"/>
      <joint name="plate" type="slide" axis="0 0 1" stiffness="{bench.cell_stiffness}"
             damping="{bench.cell_damping}"/>
      <joint name="aside" type="slide" axis="1 0 0" stiffness="{bench.cell_sideways}"
             damping="{bench.cell_damping}"/>
      <geom name="face" type="box" size="0.05 0.05 {depth}" euler="0 {bench.lean} 0" mass="0"
            pos="{-depth * math.sin(bench.lean)} 0 {-depth * math.cos(bench.lean)}"
            friction="{bench.tip_friction} 0 0" {HARD}/>
    </body>"""


def _hard(torque: float, travel: float) -> str:
    """Friction of a joint that sticks hard; where it winds up first, a hidden slider carries it instead."""
    return f'frictionloss="{torque if travel == 0 else 0.0}" {STICKS}'


class Hidden:
    """Hidden degrees of freedom, each behind a spring: sliders that rub and dashpots that relax."""

    def __init__(self) -> None:
        self.bodies = ""
        self.tendons = ""

    def add(
        self,
        name: str,
        coefficients: dict[str, float],
        stiffness: float,
        friction: float,
        dashpot: float = 0.0,
        mass: float = SLIDER_INERTIA,
        damping: float = 0.0,
    ) -> None:
        """One degree of freedom that a spring pulls to the sum of the named joints times coefficients.

        Args:
            friction: of the degree of freedom against the ground, N m or N. dashpot: the same, by speed.
            mass: its inertia. damping: beside the spring.
        """
        self.bodies += (
            f'<body pos="0 0.1 0"><inertial pos="0 0 0" mass="0.001" diaginertia="{TINY} {TINY} {TINY}"/>'
            f'<joint name="{name}" axis="0 1 0" armature="{mass}" damping="{dashpot}" '
            f'frictionloss="{friction}" {STICKS}/></body>'
        )
        joints = "".join(f'<joint joint="{k}" coef="{v}"/>' for k, v in coefficients.items())
        self.tendons += (
            f'<fixed name="{name}_spring" stiffness="{stiffness}" damping="{damping}" springlength="0">'
            f'{joints}<joint joint="{name}" coef="-1"/></fixed>'
        )


def _relaxing(hidden: Hidden, bench: Bench) -> None:
    """A spring in series with a dashpot beside each joint spring (standard linear solid)."""
    for joint, stiffness in zip(("mcp", "pip"), bench.relaxing[:2], strict=True):
        if stiffness > 0:
            dashpot = stiffness * bench.relaxing[2]
            hidden.add(f"{joint}_relaxing", {joint: 1.0}, stiffness, 0.0, dashpot, mass=1e-6)


def _spread(hidden: Hidden, bench: Bench, wear: float) -> None:
    """Equal sliders that give way one after the other, evenly up to twice the mean travel (Iwan)."""
    for joint, torque in zip(("mcp", "pip"), bench.spread[:2], strict=True):
        for index in range(SLIDERS) if torque > 0 else ():
            share = torque * wear / SLIDERS
            travel = bench.spread[2] * 2 * (index + 0.5) / SLIDERS
            hidden.add(f"{joint}_slider{index}", {joint: 1.0}, share / travel, share, mass=SPREAD_INERTIA)


def _rubbing(hidden: Hidden, bench: Bench, wear: float) -> None:
    """Dry friction that winds up elastically before it slides."""
    load = bench.motor_load_share * TYPICAL_CABLE_TORQUE
    motor = max(bench.motor_dry * wear, load)
    for place, torque, travel in (
        ("mcp", bench.dry[0] * wear, bench.stick["joint"]),
        ("pip", bench.dry[1] * wear, bench.stick["joint"]),
        ("motor", motor, bench.stick["motor"]),
    ):
        if torque > 0 and travel > 0:
            stiffness = torque / travel
            hidden.add(f"{place}_rub", {place: 1.0}, stiffness, torque, damping=BRISTLE_TIME * stiffness)


def settle(built: BuiltModel, seconds: float = 0.5) -> mujoco.MjData:
    """Let the finger hang without cable and without rubbing; what comes back is at rest there.

    The hidden degrees of freedom follow their joints: a branch that relaxes has had time to.
    """
    model = built.model
    data = mujoco.MjData(model)
    saved = [getattr(model, name).copy() for name in ("dof_damping", "dof_frictionloss")]
    model.dof_damping[:] = 0.0
    model.dof_damping[[built.mcp, built.pip]] = 2e-3
    hidden = [index for index in range(model.nv) if index not in (built.mcp, built.pip, built.motor)]
    model.dof_damping[hidden] = np.maximum(1e-4, saved[0][hidden])
    model.dof_frictionloss[:] = 0.0
    mujoco.mj_step(model, data, nstep=round(seconds / TIMESTEP))
    model.dof_damping[:], model.dof_frictionloss[:] = saved
    data.qvel[:] = 0.0
    data.time = 0.0
    return data
