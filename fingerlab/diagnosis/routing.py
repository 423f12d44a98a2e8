"""What the nominal model says of the two cables' moment arms: they go together, within a tolerance.

The thesis uses the arms found with the extension cable for the flexion cable as they are. Plain fingers do
not bear that out: a palmar cable in its guides pulls on the PIP joint with a smaller arm than a dorsal one
over the knuckle. What is taken for normal is a ratio for each joint and how far fingers scatter about it.
Inside that the flexion cable's arms are as free as those of the extension cable; beyond it they cost so much
that a fit stays at its edge, unless an effect says that the routing is another one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fingerlab.rig.constants import Rig
from fingerlab.sessions.model import Array

USUAL_RATIOS = (1.10, 0.76)
"""Flexion over extension arm at MCP and PIP; assumed. In thirteen recordings of finger benches that the
project did not make it is 0.97 to 1.32 and 0.61 to 0.78."""
USUAL_SPREAD = 0.12
"""One standard deviation of the ratio's logarithm between fingers of one design, each joint; assumed."""
TOLERANCES = 2.75
"""How many of them the two joints together may be away: one finger in forty is."""
STIFFNESS = 1e7
"""Curvature of the cost beyond the edge, for a ratio's logarithm: ten times what a session tells of it."""


@dataclass(frozen=True)
class Tie:
    """Holds the arms of the two cables together.

    ``places`` are the indices of the arms among the unknowns, (2, 2): flexion and extension, MCP and PIP.
    ``reach`` is how far the ratios' logarithms together may be from the usual ones.
    """

    places: Array
    reach: float

    def cost(self, values: Array) -> float:
        """What it adds to minus twice the log posterior."""
        return STIFFNESS * max(float(np.linalg.norm(self._distance(values))) - self.reach, 0.0) ** 2

    def expansion(self, values: Array) -> tuple[Array, Array]:
        """Half the gradient of the cost, (p,), and half its curvature, (p, p)."""
        gradient, curvature = np.zeros(len(values)), np.zeros((len(values), len(values)))
        away = self._distance(values)
        distance = float(np.linalg.norm(away))
        if distance <= self.reach:
            return gradient, curvature
        outwards, beyond = away / distance, distance - self.reach
        bend = (beyond / distance) * np.eye(2) + (self.reach / distance) * np.outer(outwards, outwards)
        slopes = np.zeros((2, len(values)))
        for cable, sign in ((0, 1.0), (1, -1.0)):
            slopes[(0, 1), self.places[cable]] = sign / values[self.places[cable]]
        return STIFFNESS * beyond * (outwards @ slopes), STIFFNESS * slopes.T @ bend @ slopes

    def _distance(self, values: Array) -> Array:
        """The logarithms of both ratios less the usual ones, (2,)."""
        flexion, extension = values[self.places[0]], values[self.places[1]]
        return np.asarray(np.log(flexion / extension) - np.log(USUAL_RATIOS))


def tie(index: Mapping[str, int], spread: float) -> Tie | None:
    """The tie between the arms among the unknowns; None where there is only one cable."""
    keys = [[f"arm_{joint}@{cable}" for joint in ("mcp", "pip")] for cable in ("flexion", "extension")]
    if not all(key in index for pair in keys for key in pair):
        return None
    return Tie(np.array([[index[key] for key in pair] for pair in keys]), TOLERANCES * spread)


def spread_of(rig: Rig) -> float:
    """Spread of the ratios' logarithms: the rig file's tolerance ``moment_arm``, or the usual one."""
    return float(rig.tolerance.get("moment_arm", USUAL_SPREAD))
