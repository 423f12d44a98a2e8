"""A stiff end of travel, flat or round."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fingerlab.effects.base import Effect, Example, Formula, Row, Shape, Term, either, every, plus
from fingerlab.effects.joints import ANGLES, both, joint_terms
from fingerlab.physics.motion import Motion, nothing
from fingerlab.physics.parameter import Parameter
from fingerlab.sessions.model import Array

END_DEPTHS_DEG = (1.0, 2.5, 5.0, 10.0)
"""So far before the furthest that a joint went its stop is looked for, degrees; assumed: a stiff end is
entered by degrees, and a grid of 5 degrees passes over one that is entered by one."""


def ends_seen(motions: Sequence[Motion]) -> list[Shape]:
    """Edges of a stop by how far the joints went in these motions, flat and round; none without joints."""
    edges = set()
    for joint in ANGLES:
        angles = [getattr(m.joints, joint)[m.lead :] for m in motions if m.joints is not None]
        angles = [angle for angle in angles if len(angle)]
        if not angles:
            return []
        lowest, highest = (math.degrees(end([end(a) for a in angles])) for end in (np.min, np.max))
        # In extension a stop has a negative edge, in flexion a positive one.
        edges |= {e for depth in END_DEPTHS_DEG if (e := round(lowest + depth, 1)) < 0.0}
        edges |= {e for depth in END_DEPTHS_DEG if (e := round(highest - depth, 1)) > 0.0}
    return [{"edge_deg": edge, "hertz": hertz} for hertz in (0.0, 1.0) for edge in sorted(edges)]


def columns(motion: Motion, shape: Shape) -> list[Term]:
    """A stop whose torque grows with the depth or, as of two round faces (Hertz), with its power 1.5.

    The depth counts in units of 1 rad, so that the stiffness is N m/rad under either law. Damped in
    proportion to its torque (Hunt and Crossley 1975).
    """
    _, joints = motion.finger_and_joints
    edge, hertz = float(np.radians(shape["edge_deg"])), bool(shape["hertz"])
    mcp = _pressed(motion, "mcp", edge, hertz, joints.mcp_velocity)
    pip = _pressed(motion, "pip", edge, hertz, joints.pip_velocity)
    names = "stop", "shift", "damp"
    return [t for name, *pair in zip(names, mcp, pip, strict=True) for t in joint_terms(name, *pair)]


def _pressed(motion: Motion, joint: str, edge: float, hertz: bool, velocity: Array) -> list[Array]:
    """Torque of a joint's stop, its change with the edge and its damping, each for a gain of 1; (n,)."""
    side = 1.0 if edge > 0 else -1.0
    angle: Array = getattr(motion.finger_and_joints[1], joint)
    lowest, highest = motion.remember(("reach", joint), lambda: np.array((angle.min(), angle.max())))
    if lowest >= edge if side < 0 else highest <= edge:
        return [nothing(len(angle)) for _ in range(3)]  # three signals, although all are zero here
    depth = motion.remember(("depth", joint, edge), lambda: np.maximum(side * (angle - edge), 0.0))
    slope = np.sqrt(depth) if hertz else (depth > 0).astype(float)
    torque = depth * slope
    # The change is, to first order, what the edge does that lies between two points of the grid.
    return [side * torque, side * slope, torque * velocity]


def _edge_slopes(shape: Shape, gains: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """What a degree by which the edge lies elsewhere adds to the torque of a shifted edge, N m."""
    power, side = 1.5 if shape["hertz"] else 1.0, math.copysign(1.0, shape["edge_deg"])
    per_degree = -side * power * math.radians(1.0)
    return {"edge_deg": {f"shift_{j}": per_degree * gains[f"stop_{j}"] for j in ANGLES}}


EFFECT = Effect(
    id="joint_stop",
    title="Stiff end of travel",
    family="Springs of the joints",
    acts_on=("joint_torque",),
    gains=both("stop", Parameter("N m/rad", 0.0, 5.0, 0.2, title="stop stiffness"))
    | both("shift", Parameter("N m", -0.05, 0.05, 0.002, title="stop stiffness times shift of the edge"))
    | both("damp", Parameter("N m s/rad^2", 0.0, 5.0, 0.1, title="damping of the stop")),
    columns=columns,
    coordinate="joint angle",
    equation=Row.PIP,
    explanation="Beyond a certain angle the joint is suddenly much stiffer.",
    reveal="a slow sine of larger amplitude",
    mend="Keep the motion away from the end of travel, by a smaller amplitude or another offset.",
    shapes=tuple(
        {"edge_deg": 5.0 * k, "hertz": hertz} for hertz in (0.0, 1.0) for k in (*range(-8, 0), *range(2, 10))
    ),
    shape_units={"edge_deg": "deg"},
    shapes_seen=ends_seen,
    closer=every(plus("edge_deg", tuple(0.5 * k for k in range(-8, 9))), either("hertz", (0.0, 1.0))),
    slopes=_edge_slopes,
    formula=Formula(
        equation=(
            r"\tau_j = \sigma u_j^p\left(K_s + d\,\sigma\dot\theta_j\right) + \sigma "
            r"k\,u_j^{p-1},\qquad u_j = \max(\sigma(\theta_j - \theta_e),\,0)"
        ),
        symbols=(
            "θ_e: edge of the travel. σ: sign of θ_e. p: 1 for a flat stop, 1.5 for round faces "
            "(Hertz 1882); both are tried. K_s: stiffness beyond the edge, with u in units of 1 rad. "
            "d: damping as it presses (Hunt and Crossley 1975). k: p times the stiffness times a "
            "shift of the edge between two points of the grid."
        ),
        source="Hertz 1882; Hunt and Crossley 1975.",
        values={
            "stop_mcp": "K_{s1}",
            "stop_pip": "K_{s2}",
            "shift_mcp": "k_1",
            "shift_pip": "k_2",
            "damp_mcp": "d_1",
            "damp_pip": "d_2",
            "edge_deg": r"\theta_e",
        },
        alike=("spring_hardening",),
    ),
    example=Example(
        {"edge_deg": 10.0, "hertz": 1.0},
        {"mcp": math.radians(10.0) + 0.04, "mcp_velocity": 5.0},
        {"MCP stop_mcp": 0.008, "MCP shift_mcp": 0.2, "MCP damp_mcp": 0.04, "PIP stop_pip": 0.0},
    ),
)
